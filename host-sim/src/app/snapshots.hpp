// Snapshots: moments of a run, kept in memory while it runs and written as POV-Ray scenes afterwards.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "haptic/sim/simulation.hpp"
#include "reproduce/tool_picture.hpp"

namespace haptic::sim {

/// Keeps the step of the first contact, those 0.25 s and 1 s later, and the step with the largest force at the hand.
class Snapshots {
  public:
    /// `simulation` must outlive this object.
    explicit Snapshots(const Simulation& simulation);

    /// To be called before each step: keeps the surfaces at its beginning.
    void before_step();
    void after_step(const StepResult& result);

    /// Writes a .pov file for each moment that occurred: the bodies and the actual tool, all seen from the direction in
    /// which tool and contacts are hidden least. Creates the folder. Returns the files.
    [[nodiscard]] std::vector<std::filesystem::path> write(const std::filesystem::path& folder) const;

  private:
    struct Moment {
        std::string name;
        double time_s = 0.0;
        std::vector<Vec3> vertices;  // m, scene: surfaces at the beginning of the step
        reproduce::ToolMoment tool;  // after the step
        Vec3 hip{0.0};               // m, scene
    };
    void keep(const char* name, const Moment& moment);

    const Simulation* simulation_;
    Moment present_;  // current step
    Moment peak_;     // step with the largest force; no name: none yet
    std::vector<Moment> kept_;
    double peak_force_ = 0.0;        // N, at the hand
    double first_contact_s_ = -1.0;  // -1: none yet
    std::size_t later_ = 0;          // moments after the first contact that are kept
};

}  // namespace haptic::sim
