#include "view/viewer.hpp"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "haptic/types.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::int64_t kSamplesPeriod = kNanosecondsPerSecond / 30;
constexpr std::size_t kMostSamples = 1024;  // in one message
constexpr std::uint64_t kBefore = 1024;     // samples that one gets from before it came, if there are any

void assign_text(Outgoing& message, std::string_view text) {
    message.text = true;
    const auto bytes = std::as_bytes(std::span(text));
    message.bytes.assign(bytes.begin(), bytes.end());
}

/// Appends the parts that are newer than the viewer's, which then has them.
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

bool Viewer::within_rate(std::int64_t now_ns) noexcept {
    allowance_ = std::min(kMostRequests, allowance_ + kMostRequests * seconds(now_ns - heard_ns_));
    heard_ns_ = now_ns;
    if (allowance_ < 1.0) {
        return false;
    }
    allowance_ -= 1.0;
    return true;
}

Viewer::Heard Viewer::hear(std::string_view text, const SceneDescription& description, std::int64_t now_ns) {
    if (!within_rate(now_ns)) {
        return Closing{kPolicyViolation, "more than 200 messages a second"};
    }
    Request request = parse_request(text, description);
    if (const auto* malformed = std::get_if<Malformed>(&request)) {
        return Closing{kPolicyViolation, malformed->why};
    }
    if (const auto* watch = std::get_if<Watch>(&request)) {
        samples_begun_ = samples_begun_ && watch->samples && watch_.samples;
        watch_ = *watch;
    } else if (const auto* refusal = std::get_if<Refusal>(&request)) {
        refuse(*refusal);
    } else if (!control_) {
        refuse({type_of(std::get<Command>(request)),
                "this view is for looking only: host-sim was started without --view-control"});
    } else {
        return std::get<Command>(std::move(request));
    }
    return std::monostate{};
}

void Viewer::refuse(const Refusal& refusal) {
    if (refusals_.size() < kMostRefusals) {
        refusals_.push_back(refused_message(refusal));
    }
}

bool Viewer::compose(const Shown& shown, std::int64_t now_ns, Outgoing& message) {
    waits_ = false;
    if (told_bye_) {
        return false;
    }
    if (compose_notice(shown, message) || compose_samples(shown, now_ns, message)) {
        return true;
    }
    if (geometry_ == 0) {
        return false;  // there is no scene yet
    }
    if (moments_ == shown.moments) {
        waits_ = true;
        return false;
    }
    compose_frame(shown, message);
    return true;
}

bool Viewer::compose_notice(const Shown& shown, Outgoing& message) {
    if (shown.ending) {
        told_bye_ = true;
        assign_text(message, R"({"type":"bye"})");
    } else if (scene_ != shown.scene) {
        scene_ = shown.scene;
        assign_text(message, shown.scene_text);
    } else if (geometry_ != shown.scene) {
        geometry_ = shown.scene;
        moments_ = 0;
        surfaces_.clear();
        particles_.clear();
        samples_begun_ = false;
        message.text = false;
        message.bytes = shown.geometry;
    } else if (!refusals_.empty()) {
        assign_text(message, refusals_.front());
        refusals_.pop_front();
    } else if (records_ != shown.records) {
        records_ = shown.records;
        assign_text(message, shown.record);
    } else if (devices_ != shown.devices) {
        devices_ = shown.devices;
        assign_text(message, shown.device);
    } else {
        return false;
    }
    return true;
}

bool Viewer::compose_samples(const Shown& shown, std::int64_t now_ns, Outgoing& message) {
    if (!watch_.samples || geometry_ == 0 || now_ns - samples_ns_ < kSamplesPeriod) {
        return false;
    }
    if (!samples_begun_) {
        samples_ = std::max(shown.samples.end(), kBefore) - kBefore;
    }
    const SampleHistory::Run run = shown.samples.from(samples_, kMostSamples);
    if (run.samples.empty()) {
        return false;
    }
    message.text = false;
    const std::uint64_t dropped = samples_begun_ ? run.number - samples_ : 0;
    message.bytes = samples_message(run.samples, shown.scene, static_cast<std::uint32_t>(dropped));
    samples_begun_ = true;
    samples_ = run.number + run.samples.size();
    // One that is behind catches up without a pause.
    samples_ns_ = samples_ == shown.samples.end() ? now_ns : 0;
    return true;
}

void Viewer::compose_frame(const Shown& shown, Outgoing& message) {
    const EncodedMoment& moment = *shown.moment;
    message.text = false;
    message.bytes.clear();
    // The number of parts is known when they are there.
    append_frame_header(message.bytes, moment, shown.scene, 0);
    const std::size_t count_at = message.bytes.size() - sizeof(std::uint32_t);
    std::uint32_t parts = append_newer(message.bytes, moment.surfaces, surfaces_);
    if (watch_.particles) {
        parts += append_newer(message.bytes, moment.particles, particles_);
    }
    if (watch_.planes) {
        message.bytes.insert(message.bytes.end(), moment.planes.begin(), moment.planes.end());
        ++parts;
    }
    message.bytes.insert(message.bytes.end(), moment.rest.begin(), moment.rest.end());
    parts += kRestParts;
    std::memcpy(message.bytes.data() + count_at, &parts, sizeof(parts));
    moments_ = shown.moments;
}

}  // namespace haptic::sim::view
