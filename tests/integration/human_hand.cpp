#include "human_hand.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "haptic/config.hpp"

namespace haptic::test {
namespace {

constexpr double kStroke = 0.3;     // s, from one point to the next
constexpr double kReach = 0.003;    // m at the device, deviation of a stroke's end from the script
constexpr double kTremor = 0.0003;  // m, at 9 to 11 Hz

/// Pseudo-random number in -1..1, the same on every machine (integer hash).
class Wander {
  public:
    double next() {
        state_ = state_ * 6364136223846793005u + 1442695040888963407u;
        return static_cast<double>(state_ >> 33) / 1073741824.0 - 1.0;
    }
    Vec3 random_point() {
        const double x = next();
        const double y = next();
        return kReach * Vec3(x, y, next());
    }

  private:
    std::uint64_t state_ = 4;
};

double minimum_jerk(double x) {  // Flash and Hogan 1985
    return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const HandTrace& trace) {
    return out << trace.scene;
}

sim::Scene scene_of(const HandTrace& trace) {
    Config config = sim::open_scene(trace.scene);
    for (const std::string& assignment : trace.settings) {
        config.set(assignment);
    }
    return sim::read_scene(config, trace.scene);
}

PoseTrack human_hand(const sim::Scene& scene, const HandTrace& trace) {
    const sim::Workspace workspace(scene.workspace);
    Wander wander;
    std::vector<double> times;
    std::vector<Pose> poses;
    const auto script_at = [&](double script_s) { return workspace.to_device(scene.hand.at(nanoseconds(script_s))); };
    const Pose begin = script_at(trace.from_s);
    Vec3 from(0.0);
    Vec3 to = wander.random_point();
    int stroke = 0;
    for (int ms = 0; ms <= static_cast<int>(trace.duration_s * 1000.0) + kHandRampMs; ++ms) {
        const double t = 1e-3 * ms;
        if (t >= (stroke + 1) * kStroke) {
            ++stroke;
            from = to;
            to = wander.random_point();
        }
        const double ramp = minimum_jerk(std::min(1.0, static_cast<double>(ms) / kHandRampMs));
        const Pose script = ms < kHandRampMs ? interpolate(Pose{}, begin, ramp)
                                             : script_at(trace.from_s + 1e-3 * std::max(0, ms - kHandRampMs));
        const Vec3 aside = from + minimum_jerk((t - stroke * kStroke) / kStroke) * (to - from);
        const double w = 2.0 * std::numbers::pi * t;
        const Vec3 tremor = kTremor * Vec3(std::sin(9.0 * w), std::sin(10.0 * w + 1.0), std::sin(11.0 * w + 2.0));
        const Vec3 exact = script.position + aside + tremor;
        const auto cut = [&](double x) {
            return trace.quantum > 0.0 ? trace.quantum * std::round(x / trace.quantum) : x;
        };
        times.push_back(t);
        poses.push_back({{cut(exact.x), cut(exact.y), cut(exact.z)}, script.orientation});
    }
    return {std::move(times), std::move(poses)};
}

}  // namespace haptic::test
