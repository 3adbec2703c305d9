#include "haptic/pose_track.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <stdexcept>
#include <string>
#include <utility>

#include "haptic/csv.hpp"
#include "haptic/numeric.hpp"

namespace haptic {
namespace {

constexpr const char* kQuaternionColumns[] = {"qw", "qx", "qy", "qz"};

/// Index of the first time that is not later than its predecessor; the size if there is none.
std::size_t first_not_increasing(const std::vector<double>& times_s) {
    const auto found = std::adjacent_find(times_s.begin(), times_s.end(), [](double a, double b) { return !(a < b); });
    return found == times_s.end() ? times_s.size() : static_cast<std::size_t>(found - times_s.begin()) + 1;
}

}  // namespace

Pose interpolate(const Pose& from, const Pose& to, double fraction) HAPTIC_RT {
    return {glm::mix(from.position, to.position, fraction),
            glm::normalize(glm::slerp(from.orientation, to.orientation, fraction))};
}

PoseTrack::PoseTrack(const Pose& still) : times_s_{0.0}, poses_{still} {}

PoseTrack::PoseTrack(std::vector<double> times_s, std::vector<Pose> poses)
    : times_s_(std::move(times_s)), poses_(std::move(poses)) {
    if (times_s_.empty() || times_s_.size() != poses_.size()) {
        throw std::invalid_argument("a track needs at least one pose and as many times as poses");
    }
    if (const std::size_t row = first_not_increasing(times_s_); row != times_s_.size()) {
        throw std::invalid_argument("time " + std::to_string(row) + " of the track is not later than its predecessor");
    }
}

PoseTrack PoseTrack::load(const std::filesystem::path& file) {
    const CsvTable table = CsvTable::load(file);
    // Line number of a row, assuming no blank lines or notes between rows.
    const auto fail = [&](std::size_t row, const std::string& problem) {
        throw CsvError(table.name() + ":" + std::to_string(table.header_line() + 1 + row) + ": " + problem);
    };
    const auto time = table.column("time_s");
    const auto x = table.column("x_m");
    const auto y = table.column("y_m");
    const auto z = table.column("z_m");
    const bool oriented = std::any_of(std::begin(kQuaternionColumns), std::end(kQuaternionColumns),
                                      [&](const char* name) { return table.find(name).has_value(); });
    if (table.rows() == 0) {
        fail(0, "there is no pose");
    }
    // Times and positions, then the optional orientations.
    std::vector<double> times_s(time.begin(), time.end());
    if (const std::size_t row = first_not_increasing(times_s); row != times_s.size()) {
        fail(row, "time_s is not later than in the previous row");
    }
    std::vector<Pose> poses(table.rows());
    for (std::size_t row = 0; row < table.rows(); ++row) {
        poses[row].position = {x[row], y[row], z[row]};
    }
    if (oriented) {
        const auto qw = table.column("qw");
        const auto qx = table.column("qx");
        const auto qy = table.column("qy");
        const auto qz = table.column("qz");
        for (std::size_t row = 0; row < table.rows(); ++row) {
            const Quat orientation(qw[row], qx[row], qy[row], qz[row]);
            if (std::abs(glm::length(orientation) - 1.0) > kUnitTolerance) {
                fail(row, "qw,qx,qy,qz is not of unit length but " + std::to_string(glm::length(orientation)));
            }
            poses[row].orientation = glm::normalize(orientation);
        }
    }
    return {std::move(times_s), std::move(poses)};
}

Pose PoseTrack::at(std::int64_t time_ns) const HAPTIC_RT {
    const double time_s = seconds(time_ns);
    // Rows on either side of the time.
    const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), time_s);
    if (after == times_s_.begin()) {
        return poses_.front();
    }
    if (after == times_s_.end()) {
        return poses_.back();
    }
    const auto next = static_cast<std::size_t>(after - times_s_.begin());
    const double fraction = (time_s - times_s_[next - 1]) / (times_s_[next] - times_s_[next - 1]);
    return interpolate(poses_[next - 1], poses_[next], fraction);
}

double PoseTrack::duration_s() const noexcept {
    return times_s_.back();
}

}  // namespace haptic
