// Live settings: the settings of a scene that may change while it runs, between steps, without making the scene again.
//
// A change must not be felt as a jolt. Stiffnesses, friction, shrink and the step are interpolated linearly to the new
// value within kFade, as the clutch fades: bodies answer another step with another stiffness. The radius changes by a
// bounded factor per step: kRadiusRate per second, and at most kMaxGrowth per step. A surface that the grown sphere
// intersects is then handled like one that has approached: the next step's secure position moves clear of it, on the
// side where it is, so nothing passes through the centre however much the radius grows. Iterations and methods apply
// from the next step.
//
// The result depends only on which settings are requested before which steps, bit for bit.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "haptic/config.hpp"
#include "haptic/sim/contact.hpp"
#include "haptic/sim/scene.hpp"

namespace haptic::sim {

struct LiveSettings {
    double stiffness = 20.0;        // N/m, CouplingSettings
    double torque_stiffness = 0.0;  // N/m, CouplingSettings; 0: as `stiffness`
    double radius = 0.03;           // m, of the proxy; no effect on a tool with spheres of its own
    double shrink = 0.999;
    int iterations = 5;  // of the bodies' constraints
    double step = 0.01;  // s
    CcdMethod method = CcdMethod::Complete;
    PopOutMethod pop_out = PopOutMethod::OrderFree;
    double static_friction = 0.0;   // of the proxy
    double dynamic_friction = 0.0;  // 0 .. static_friction

    bool operator==(const LiveSettings&) const = default;
};

/// One live setting: its key, its value as a number (an enumeration as the index of its choice), and its copies between
/// scene and LiveSettings. scene_reference() has its unit, choices and label.
struct LiveSetting {
    std::string_view key;  // of the scene file: "coupling.stiffness"
    Range range{};         // of its value
    double (*get)(const LiveSettings& settings);
    void (*set)(LiveSettings& settings, double value);
    std::function<void(const Scene& scene, LiveSettings& settings)> read;
    std::function<void(const LiveSettings& settings, Scene& scene)> write;
};
[[nodiscard]] const std::vector<LiveSetting>& live_setting_list();

[[nodiscard]] LiveSettings live_settings_of(const Scene& scene);
/// Writes the settings into the scene, as if its file contained them.
void apply(const LiveSettings& settings, Scene& scene);
/// Throws std::invalid_argument that names the first setting out of its range, and the range.
void check(const LiveSettings& settings);

/// Transition from the present settings to the requested ones.
class SettingsFade {
  public:
    static constexpr double kFade = 0.1;        // s
    static constexpr double kRadiusRate = 7.0;  // 1/s: twice the radius in 0.1 s
    static constexpr double kMaxGrowth = 0.02;  // of the radius, per step

    explicit SettingsFade(const LiveSettings& start) : from_(start), now_(start), asked_(start) {}

    /// Requests settings; the transition starts at the present ones and replaces an earlier request.
    void go_to(const LiveSettings& asked) noexcept;
    /// Advances by a step of step_s, s. Returns the settings of the step that starts. No allocation.
    const LiveSettings& advance(double step_s) noexcept;
    [[nodiscard]] bool moving() const noexcept { return now_ != asked_; }
    [[nodiscard]] const LiveSettings& asked() const noexcept { return asked_; }

  private:
    LiveSettings from_;
    LiveSettings now_;
    LiveSettings asked_;
    double age_s_ = 0.0;  // s, since the request
};

}  // namespace haptic::sim
