#include "haptic/device/hand_file.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <string>
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

/// The recording begins away from the centre: kApproachS come before it.
bool needs_approach(const PoseTrack& track, double first_s) {
    return !at_centre(track.at(nanoseconds(first_s)));
}

}  // namespace

PoseTrack hand_from_centre(const std::filesystem::path& file) {
    PoseTrack track = PoseTrack::load(file);
    const CsvTable table = CsvTable::load(file);
    const auto rows = table.column("time_s");
    if (rows.empty() || !needs_approach(track, rows.front())) {
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

ButtonTrack buttons_of_hand(const std::filesystem::path& file) {
    const CsvTable table = CsvTable::load(file);
    const auto rows = table.column("time_s");
    const auto held = table.find("buttons");
    if (rows.empty() || !held) {
        return {};
    }
    const bool approaches = needs_approach(PoseTrack::load(file), rows.front());
    const double delay_s = approaches ? kApproachS - rows.front() : 0.0;
    std::vector<double> times_s;
    std::vector<std::uint8_t> buttons;
    for (std::size_t row = 0; row < rows.size(); ++row) {
        const double value = (*held)[row];
        if (!(value >= 0.0 && value <= 255.0 && value == std::floor(value))) {
            throw CsvError(table.name() + ":" + std::to_string(table.header_line() + 1 + row) +
                           ": buttons is not a whole number of 0 to 255");
        }
        times_s.push_back(rows[row] + delay_s);
        buttons.push_back(static_cast<std::uint8_t>(value));
    }
    return {std::move(times_s), std::move(buttons)};
}

}  // namespace haptic::device
