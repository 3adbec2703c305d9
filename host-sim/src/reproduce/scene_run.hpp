// A built-in scene run by its own script, and what a haptic loop would make of its frames.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "reproduce/povray.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"

namespace haptic::sim::reproduce {

/// One millisecond of haptic rendering, in the scene.
struct HapticSample {
    double time_s = 0.0;
    Vec3 hip{0.0};    // m
    Vec3 proxy{0.0};  // m
    Vec3 force{0.0};  // N, on the hand
};

class SceneRun {
  public:
    /// A built-in scene with some keys set as by --set. The clock times the stages; null: none.
    SceneRun(const std::string& scene, const std::vector<std::string>& assignments, std::int64_t (*clock)());

    /// The scene has run for as long as it says.
    [[nodiscard]] bool over() const noexcept;

    /// One step of the script, verified by the independent check. The vertices as the step found them are kept.
    const StepResult& step();

    /// Renders the last frame at 1 kHz until the next step is due: at each millisecond the proxy is the point nearest
    /// to the hip within the frame's half-spaces, which move on with their velocities, and the force is that of the
    /// coupling's spring. So does rt-core (with limits, smoothing and damping on top).
    void render(std::vector<HapticSample>& samples) const;

    /// The scene as the last step found it and with what it made of the proxy. The picture points into this object.
    [[nodiscard]] PictureScene picture(const std::string& title) const;

    [[nodiscard]] const Simulation& simulation() const noexcept { return simulation_; }
    [[nodiscard]] const StepResult& result() const noexcept { return result_; }
    /// Where the vertices were when the last step began.
    [[nodiscard]] const std::vector<Vec3>& vertices() const noexcept { return vertices_; }
    /// s, of the beginning of the last step.
    [[nodiscard]] double time_s() const noexcept { return time_s_; }
    [[nodiscard]] std::uint64_t escapes() const noexcept { return escapes_; }

  private:
    Simulation simulation_;
    StepResult result_;
    std::vector<Vec3> vertices_;
    double time_s_ = 0.0;
    std::uint64_t escapes_ = 0;
};

/// The value that this part (0 .. less than 1) of the others is below; 0 if there are none.
[[nodiscard]] double quantile(std::vector<double> values, double part);

/// "1.23" with so many digits behind the point.
[[nodiscard]] std::string shown(double value, int digits);

}  // namespace haptic::sim::reproduce
