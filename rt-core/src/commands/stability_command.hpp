// `rt-core stability`: maps the stiffnesses and delays for which a virtual wall is stable, with and without the
// passivity controller; or, with a scene, those for which its bodies are (scene_stability.hpp).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

inline constexpr double kMillimetre = 1e-3;  // m

struct StabilityOptions {
    std::filesystem::path out;  // output folder, created if missing
    std::optional<std::filesystem::path> config;
    std::vector<std::string> assignments;  // --set
    int rows = 12;                         // stiffnesses, 10 to 2000 N/m in equal ratios
    int columns = 11;                      // delays, 0 to 20 ms in equal steps, rounded to whole ticks
    std::optional<double> duration_s;      // of each trial; 2.5, of a scene 4
    std::optional<double> hand_stiffness;  // N/m; 100, of a scene 400
    std::optional<double> hand_damping;    // N s/m; 0, of a scene 4

    // Of a scene of host-sim instead of the wall.
    std::string scene;                                               // empty: the wall
    std::filesystem::path host_sim;                                  // program; empty: searched in PATH
    std::vector<std::string> scene_assignments;                      // --scene-set
    std::optional<double> hold_s;                                    // s of its script, then the hand is still
    std::vector<double> rates_hz = {30.0, 60.0, 100.0, 200.0};       // steps of the scene per second
    std::vector<double> stiffnesses = {50.0, 200.0, 600.0, 2000.0};  // N/m, requested at the hand
    std::vector<double> delays_ms = {0.0, 10.0, 30.0, 50.0};         // of each frame
};

/// Runs all trials and writes stability.csv and stability.html, the map. Returns 0 if no vibration grew with the
/// controller, else kExitFaulted. Throws ConfigError, RingError, std::invalid_argument, and std::runtime_error for a
/// file that cannot be written.
int stability_command(const StabilityOptions& options);

}  // namespace haptic::rt
