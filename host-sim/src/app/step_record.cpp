#include "app/step_record.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <stdexcept>

#include "haptic/csv.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {
namespace {

constexpr std::string_view kFirstLine = "host-sim record 2";
constexpr std::string_view kFormerFirstLine = "host-sim record 1";

constexpr std::string_view kHeader =
    "time_s,x_m,y_m,z_m,qw,qx,qy,qz,proxy_x_m,proxy_y_m,proxy_z_m,hip_x_m,hip_y_m,hip_z_m,fx_n,fy_n,fz_n,in_contact,"
    "step_us,tx_nm,ty_nm,tz_nm,curl,buttons,rendered_n_m,rendered_scale,felt_x_n_s,felt_y_n_s,felt_z_n_s";

/// Notes are single lines; in TOML a space may replace a line break here.
std::string on_one_line(std::string text) {
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
}

std::uint64_t number_of(std::string_view text, const std::string& line) {
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size()) {
        throw std::invalid_argument("the note \"" + line + "\" has no valid number");
    }
    return number;
}

std::string list_of(std::initializer_list<double> numbers) {
    std::string text;
    for (const double number : numbers) {
        text += (text.empty() ? "[" : ", ") + text_of(number);
    }
    return text + "]";
}

std::string line_of(const LiveChange& change) {
    return "change " + std::to_string(change.step) + " " + on_one_line(change.what);
}

}  // namespace

std::vector<std::string> lines_of(const RecordNotes& notes) {
    std::vector<std::string> lines{std::string(kFirstLine), "scene " + on_one_line(notes.scene)};
    for (const std::string& assignment : notes.assignments) {
        lines.push_back("set " + on_one_line(assignment));
    }
    lines.push_back("first-step " + std::to_string(notes.first_step));
    for (const LiveChange& change : notes.changes) {
        lines.push_back(line_of(change));
    }
    return lines;
}

std::optional<RecordNotes> read_notes(std::span<const std::string> lines) {
    if (lines.empty() || (lines.front() != kFirstLine && lines.front() != kFormerFirstLine)) {
        return std::nullopt;
    }
    RecordNotes notes;
    for (const std::string& line : lines.subspan(1)) {
        const std::size_t blank = std::min(line.find(' '), line.size());
        const std::string_view word = std::string_view(line).substr(0, blank);
        const std::string_view rest = std::string_view(line).substr(std::min(blank + 1, line.size()));
        if (word == "scene") {
            notes.scene = rest;
        } else if (word == "set") {
            notes.assignments.emplace_back(rest);
        } else if (word == "first-step") {
            notes.first_step = number_of(rest, line);
        } else if (word == "time-zero-ns") {
            (void)number_of(rest, line);  // for those who read other recordings beside it
        } else if (word == "change") {
            const std::size_t next = std::min(rest.find(' '), rest.size());
            notes.changes.push_back(
                {number_of(rest.substr(0, next), line), std::string(rest.substr(std::min(next + 1, rest.size())))});
        } else {
            throw std::invalid_argument("the note \"" + line + "\" is unknown to this version");
        }
    }
    return notes;
}

std::vector<std::string> assignments_of(const WorkspaceSettings& workspace) {
    const Vec3& offset = workspace.offset;
    const Quat& rotation = workspace.rotation;
    return {"workspace.scale=" + text_of(workspace.scale),
            "workspace.offset=" + list_of({offset.x, offset.y, offset.z}),
            "workspace.rotation=" + list_of({rotation.w, rotation.x, rotation.y, rotation.z}),
            "workspace.force_scale=" + text_of(workspace.force_scale),
            "workspace.clutch_button=" + std::to_string(workspace.clutch_button),
            "workspace.clutch_fade=" + text_of(workspace.clutch_fade)};
}

StepRecord::StepRecord(const RecordNotes& origin, bool clocked) : clocked_(clocked) {
    for (const std::string& line : lines_of(origin)) {
        text_ += "# " + line + '\n';
    }
    text_ += kHeader;
    text_ += '\n';
}

void StepRecord::add(const LiveChange& change) {
    text_ += "# " + line_of(change) + '\n';
}

void StepRecord::add(const StepInput& input, const StepResult& result) {
    if (rows_ == 0) {
        first_ns_ = input.time_ns;
        text_ += clocked_ ? "# time-zero-ns " + std::to_string(first_ns_) + '\n' : "";
    }
    ++rows_;
    const Vec3& x = input.device.position;
    const Quat& q = input.device.orientation;
    const Vec3& proxy = result.proxy;
    const Vec3& hip = result.hip;
    const Vec3& force = result.hand_force;
    const Vec3& torque = result.hand_torque;
    // A negative stiffness: no device.
    const DeviceFeedback felt = input.feedback.value_or(DeviceFeedback{.stiffness = -1.0});
    // In the order of kHeader.
    append_row(text_, std::array{static_cast<double>(input.time_ns - first_ns_) / 1e9,
                                 x.x,
                                 x.y,
                                 x.z,
                                 q.w,
                                 q.x,
                                 q.y,
                                 q.z,
                                 proxy.x,
                                 proxy.y,
                                 proxy.z,
                                 hip.x,
                                 hip.y,
                                 hip.z,
                                 force.x,
                                 force.y,
                                 force.z,
                                 result.in_contact ? 1.0 : 0.0,
                                 static_cast<double>(result.times.total_ns) * 1e-3,
                                 torque.x,
                                 torque.y,
                                 torque.z,
                                 result.curl,
                                 static_cast<double>(input.buttons),
                                 felt.stiffness,
                                 felt.scale,
                                 felt.impulse.x,
                                 felt.impulse.y,
                                 felt.impulse.z});
}

}  // namespace haptic::sim
