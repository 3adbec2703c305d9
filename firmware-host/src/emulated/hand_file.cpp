#include "haptic/device/hand_file.hpp"

#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"

namespace haptic::device {
namespace {

constexpr double kApproachS = 0.5;
// m, rad; tolerance of the centre, well below an encoder count (17 um).
constexpr double kAtCentre = 1e-6;

bool at_centre(const Pose& pose) {
    const Quat& q = pose.orientation;
    return glm::length(pose.position) < kAtCentre && 2.0 * glm::length(Vec3(q.x, q.y, q.z)) < kAtCentre;
}

}  // namespace

PoseTrack hand_from_centre(const std::filesystem::path& file) {
    PoseTrack track = PoseTrack::load(file);
    const CsvTable table = CsvTable::load(file);
    const auto rows = table.column("time_s");
    if (rows.empty() || at_centre(track.at(nanoseconds(rows.front())))) {
        return track;
    }
    // Prepend the centre, kApproachS before the first row.
    std::vector<double> times_s{0.0};
    std::vector<Pose> poses{Pose{}};
    for (const double time_s : rows) {
        times_s.push_back(kApproachS + time_s - rows.front());
        poses.push_back(track.at(nanoseconds(time_s)));
    }
    return {std::move(times_s), std::move(poses)};
}

}  // namespace haptic::device
