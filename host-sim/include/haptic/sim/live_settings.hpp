// What of a scene may change while it runs, between steps, without the scene being made anew; and how it gets there.
//
// What the hand would feel as a knock does not change at once. Stiffnesses, friction and shrink go straight to the new
// value within kFade, as the clutch fades. The radius grows and shrinks by a part of itself a step, kRadiusRate a
// second and kMostGrowth a step at most: what clips the larger sphere is a surface that has come nearer, which the
// next step's secure position rides clear of, on the side on which it is. So nothing passes through the centre,
// however much the radius grows. Step, iterations and methods make no force of their own, and count from the next step.
//
// The result depends only on which settings are asked for before which steps, bit for bit.
#pragma once

#include "haptic/config.hpp"
#include <haptic/sim/contact.hpp>
#include "haptic/sim/scene.hpp"

namespace haptic::sim {

/// What scene files and live changes may set these to.
namespace ranges {
inline constexpr Range kStiffness{0.0, 1e5};  // N/m
inline constexpr Range kRadius{1e-6, 10.0};   // m
inline constexpr Range kShrink{0.9, 0.99999};
inline constexpr Range kIterations{0.0, 1000.0};
inline constexpr Range kStep{1e-4, 0.1};  // s
inline constexpr Range kFriction{0.0, 10.0};
}  // namespace ranges

struct LiveSettings {
    double stiffness = 20.0;        // N/m, CouplingSettings
    double torque_stiffness = 0.0;  // N/m, likewise; 0: as `stiffness`
    double radius = 0.03;           // m, of the proxy; of a tool with spheres of its own it changes nothing
    double shrink = 0.999;
    int iterations = 5;       // of the bodies' constraints
    int tool_iterations = 0;  // of the tool's
    double step = 0.01;       // s
    CcdMethod method = CcdMethod::Complete;
    PopOutMethod pop_out = PopOutMethod::OrderFree;
    double static_friction = 0.0;   // of the proxy
    double dynamic_friction = 0.0;  // 0 .. static_friction

    bool operator==(const LiveSettings&) const = default;
};

[[nodiscard]] LiveSettings live_settings_of(const Scene& scene);
/// The scene with these in place of its own, as if its file said so.
void apply(const LiveSettings& settings, Scene& scene);
/// Throws std::invalid_argument that names the first setting out of its range, and the range.
void check(const LiveSettings& settings);

/// Settings on their way from what they were to what was asked for.
class SettingsFade {
  public:
    static constexpr double kFade = 0.1;         // s
    static constexpr double kRadiusRate = 7.0;   // 1/s: twice the radius in 0.1 s
    static constexpr double kMostGrowth = 0.02;  // of the radius, a step

    explicit SettingsFade(const LiveSettings& start) : from_(start), now_(start), asked_(start) {}

    /// The last ones asked for count; they begin at those of now.
    void go_to(const LiveSettings& asked) noexcept;
    /// Goes on by a step of step_s, s. Returns the settings of the step that begins. No allocation.
    const LiveSettings& advance(double step_s) noexcept;
    [[nodiscard]] bool moving() const noexcept { return now_ != asked_; }
    [[nodiscard]] const LiveSettings& asked() const noexcept { return asked_; }

  private:
    LiveSettings from_;
    LiveSettings now_;
    LiveSettings asked_;
    double age_s_ = 0.0;  // since `asked_` was asked for
};

}  // namespace haptic::sim
