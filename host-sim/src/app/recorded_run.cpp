#include "app/recorded_run.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>

#include "haptic/csv.hpp"
#include "haptic/pose_track.hpp"
#include "haptic/sim/curl_track.hpp"

namespace haptic::sim {
namespace {

// s, tolerance in comparing a time in nanoseconds with one in seconds.
constexpr double kSameTime = 5e-10;

std::vector<double> column_of(const CsvTable& table, const char* name) {
    const auto column = table.find(name);
    return column ? std::vector<double>(column->begin(), column->end()) : std::vector<double>{};
}

std::vector<Pose> poses_of(const CsvTable& table) {
    const auto x = table.column("x_m");
    const auto y = table.column("y_m");
    const auto z = table.column("z_m");
    const auto w = table.find("qw");
    std::vector<Pose> poses(table.rows());
    for (std::size_t k = 0; k < poses.size(); ++k) {
        poses[k].position = {x[k], y[k], z[k]};
        if (w) {
            poses[k].orientation = Quat((*w)[k], table.column("qx")[k], table.column("qy")[k], table.column("qz")[k]);
        }
    }
    return poses;
}

/// What the device rendered, per row; empty if the file does not say.
std::vector<std::optional<DeviceFeedback>> feedback_of(const CsvTable& table) {
    const auto stiffness = table.find("rendered_n_m");
    if (!stiffness) {
        return {};
    }
    const auto scale = table.column("rendered_scale");
    const auto x = table.column("felt_x_n_s");
    const auto y = table.column("felt_y_n_s");
    const auto z = table.column("felt_z_n_s");
    std::vector<std::optional<DeviceFeedback>> feedback(table.rows());
    for (std::size_t k = 0; k < feedback.size(); ++k) {
        // A negative stiffness: no device.
        if ((*stiffness)[k] >= 0.0) {
            feedback[k] =
                DeviceFeedback{.stiffness = (*stiffness)[k], .scale = scale[k], .impulse = {x[k], y[k], z[k]}};
        }
    }
    return feedback;
}

}  // namespace

RecordedRun RecordedRun::load(const std::filesystem::path& file) {
    // Validation: increasing times, unit quaternions, curls in 0..1.
    (void)PoseTrack::load(file);
    (void)CurlTrack::load(file);
    const CsvTable table = CsvTable::load(file);
    RecordedRun run;
    try {
        run.notes_ = read_notes(table.notes());
    } catch (const std::invalid_argument& wrong) {
        throw CsvError(table.name() + ": " + wrong.what());
    }
    run.time_s_ = column_of(table, "time_s");
    run.device_ = poses_of(table);
    run.curl_ = column_of(table, "curl");
    run.buttons_ = column_of(table, "buttons");
    for (const double buttons : run.buttons_) {
        if (!(buttons >= 0.0 && buttons <= 4294967295.0)) {
            throw CsvError(table.name() + ": buttons must be a 32-bit number, found " + std::to_string(buttons));
        }
    }
    run.feedback_ = feedback_of(table);
    const std::vector<double> x = column_of(table, "proxy_x_m");
    const std::vector<double> y = column_of(table, "proxy_y_m");
    const std::vector<double> z = column_of(table, "proxy_z_m");
    for (std::size_t k = 0; k < std::min({x.size(), y.size(), z.size()}); ++k) {
        run.proxy_.emplace_back(x[k], y[k], z[k]);
    }
    return run;
}

double RecordedRun::length() const noexcept {
    const std::size_t n = time_s_.size();
    const double last_step = n > 1 ? time_s_[n - 1] - time_s_[n - 2] : 0.0;
    return time_s_[n - 1] + last_step - time_s_[0];
}

StepInput RecordedRun::row(std::size_t row) const {
    StepInput input;
    input.time_ns = nanoseconds(time_s_[row]);
    input.device = device_[row];
    if (!buttons_.empty()) {
        input.buttons = static_cast<std::uint32_t>(buttons_[row]);
    }
    if (!curl_.empty()) {
        input.curl = curl_[row];
    }
    if (row < feedback_.size()) {
        input.feedback = feedback_[row];
    }
    return input;
}

StepInput RecordedRun::at(double time_s) const {
    const double since = time_s_[0] + time_s;
    const auto after = std::upper_bound(time_s_.begin(), time_s_.end(), since + kSameTime);
    const auto next = static_cast<std::size_t>(std::distance(time_s_.begin(), after));
    const std::size_t before = next == 0 ? 0 : next - 1;
    StepInput input = row(before);
    if (next > 0 && next < time_s_.size()) {
        const double part = (since - time_s_[before]) / (time_s_[next] - time_s_[before]);
        const bool between = since - time_s_[before] > kSameTime;
        if (between) {
            input.device = interpolate(device_[before], device_[next], part);
        }
        if (between && input.curl) {
            input.curl = curl_[before] + part * (curl_[next] - curl_[before]);
        }
    }
    input.time_ns = nanoseconds(time_s);
    input.feedback.reset();  // it belongs to the recorded steps
    return input;
}

std::optional<Vec3> RecordedRun::proxy(std::size_t row) const {
    return row < proxy_.size() ? std::optional(proxy_[row]) : std::nullopt;
}

}  // namespace haptic::sim
