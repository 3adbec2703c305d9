#include "view/viewer.hpp"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "haptic/types.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::int64_t kSamplesPeriodNs = kNanosecondsPerSecond / 30;
constexpr std::size_t kMaxSamples = 1024;        // per message
constexpr std::uint64_t kInitialHistory = 1024;  // earlier samples that a new subscriber gets

void assign_text(Outgoing& message, std::string_view text) {
    message.text = true;
    const auto bytes = std::as_bytes(std::span(text));
    message.bytes.assign(bytes.begin(), bytes.end());
}

/// Appends the parts that are newer than the viewer's copy and records their versions; returns their number.
std::uint32_t append_newer(Bytes& message, const std::vector<EncodedPart>& parts, std::vector<std::uint64_t>& had) {
    std::uint32_t appended = 0;
    had.resize(parts.size(), 0);
    for (std::size_t k = 0; k < parts.size(); ++k) {
        if (had[k] != parts[k].version) {
            message.insert(message.end(), parts[k].bytes.begin(), parts[k].bytes.end());
            had[k] = parts[k].version;
            ++appended;
        }
    }
    return appended;
}

}  // namespace

/// Token bucket: kMaxRequests tokens, refilled at kMaxRequests per second. Returns false if it is empty.
bool Viewer::take_allowance(std::int64_t now_ns) noexcept {
    allowance_ = std::min(kMaxRequests, allowance_ + kMaxRequests * seconds(now_ns - last_message_ns_));
    last_message_ns_ = now_ns;
    if (allowance_ < 1.0) {
        return false;
    }
    allowance_ -= 1.0;
    return true;
}

Viewer::Outcome Viewer::on_message(std::string_view text, const SceneDescription& description, std::int64_t now_ns) {
    if (!take_allowance(now_ns)) {
        return Closing{kPolicyViolation, "more than 200 messages a second"};
    }
    Request request = parse_request(text, description);
    if (const auto* malformed = std::get_if<Malformed>(&request)) {
        return Closing{kPolicyViolation, malformed->why};
    }
    // A renewed subscription to samples starts with the recent history again.
    if (const auto* watch = std::get_if<Watch>(&request)) {
        samples_begun_ = samples_begun_ && watch->samples && watch_.samples;
        watch_ = *watch;
    } else if (const auto* refusal = std::get_if<Refusal>(&request)) {
        refuse(*refusal);
    } else if (!control_) {
        refuse({type_of(std::get<Command>(request)),
                "this view is read-only: host-sim was started without --view-control"});
    } else {
        return std::get<Command>(std::move(request));
    }
    return std::monostate{};
}

void Viewer::refuse(const Refusal& refusal) {
    if (refusals_.size() < kMaxRefusals) {
        refusals_.push_back(refused_message(refusal));
    }
}

bool Viewer::compose(const ViewState& state, std::int64_t now_ns, Outgoing& message) {
    wants_snapshot_ = false;
    if (bye_sent_) {
        return false;
    }
    // Notices first, then samples, then the newest snapshot.
    if (compose_notice(state, message) || compose_samples(state, now_ns, message)) {
        return true;
    }
    if (geometry_ == 0) {
        return false;
    }
    if (snapshots_ == state.snapshots) {
        wants_snapshot_ = true;
        return false;
    }
    compose_frame(state, message);
    return true;
}

bool Viewer::compose_notice(const ViewState& state, Outgoing& message) {
    if (state.ending) {
        bye_sent_ = true;
        assign_text(message, R"({"type":"bye"})");
    } else if (scene_ != state.scene) {
        scene_ = state.scene;
        assign_text(message, state.scene_text);
    } else if (geometry_ != state.scene) {
        geometry_ = state.scene;
        snapshots_ = 0;
        surfaces_.clear();
        particles_.clear();
        samples_begun_ = false;
        message.text = false;
        message.bytes = state.geometry;
    } else if (!refusals_.empty()) {
        assign_text(message, refusals_.front());
        refusals_.pop_front();
    } else if (records_ != state.records) {
        records_ = state.records;
        assign_text(message, state.record);
    } else if (devices_ != state.devices) {
        devices_ = state.devices;
        assign_text(message, state.device);
    } else {
        return false;
    }
    return true;
}

bool Viewer::compose_samples(const ViewState& state, std::int64_t now_ns, Outgoing& message) {
    if (!watch_.samples || geometry_ == 0 || now_ns - samples_ns_ < kSamplesPeriodNs) {
        return false;
    }
    if (!samples_begun_) {
        // A new subscriber starts some samples before the newest.
        samples_ = std::max(state.samples.end(), kInitialHistory) - kInitialHistory;
    }
    const SampleHistory::Run run = state.samples.from(samples_, kMaxSamples);
    if (run.samples.empty()) {
        return false;
    }
    message.text = false;
    const std::uint64_t dropped = samples_begun_ ? run.number - samples_ : 0;
    message.bytes = samples_message(run.samples, state.scene, static_cast<std::uint32_t>(dropped));
    samples_begun_ = true;
    samples_ = run.number + run.samples.size();
    // A viewer that is behind catches up without waiting for the period.
    samples_ns_ = samples_ == state.samples.end() ? now_ns : 0;
    return true;
}

void Viewer::compose_frame(const ViewState& state, Outgoing& message) {
    const EncodedSnapshot& snapshot = *state.snapshot;
    message.text = false;
    message.bytes.clear();
    append_frame_header(message.bytes, snapshot, state.scene, 0);
    const std::size_t count_at = message.bytes.size() - sizeof(std::uint32_t);
    // Only the parts that changed since this viewer's last frame, and only the subscribed kinds.
    std::uint32_t parts = append_newer(message.bytes, snapshot.surfaces, surfaces_);
    if (watch_.particles) {
        parts += append_newer(message.bytes, snapshot.particles, particles_);
    }
    if (watch_.planes) {
        message.bytes.insert(message.bytes.end(), snapshot.planes.begin(), snapshot.planes.end());
        ++parts;
    }
    message.bytes.insert(message.bytes.end(), snapshot.remaining.begin(), snapshot.remaining.end());
    parts += kRemainingParts;
    std::memcpy(message.bytes.data() + count_at, &parts, sizeof(parts));
    snapshots_ = state.snapshots;
}

}  // namespace haptic::sim::view
