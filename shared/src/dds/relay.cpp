#include "dds/relay.hpp"

#include <cstdint>
#include <limits>

#include "haptic/clock.hpp"

namespace haptic {
namespace {

// The first exchanges come quickly, so that the bounds are narrow when the first planes are converted.
constexpr std::uint64_t kQuickQueries = 20;
constexpr std::int64_t kQuickPeriodNs = 5'000'000;
constexpr std::int64_t kPeriodNs = 100'000'000;

/// A time on another clock; where no number can be it, the nearest one.
std::int64_t shifted(std::int64_t time_ns, std::int64_t offset_ns) noexcept {
    using Limits = std::numeric_limits<std::int64_t>;
    std::int64_t there_ns = 0;
    if (__builtin_add_overflow(time_ns, offset_ns, &there_ns)) {
        return offset_ns < 0 ? Limits::min() : Limits::max();
    }
    return there_ns;
}

}  // namespace

DeviceRelay::DeviceRelay(const LinkSettings& settings)
    : session_(settings.session), link_(settings), states_(settings.session) {}

bool DeviceRelay::run_once(std::int64_t timeout_ns) {
    link_.wait(timeout_ns);
    answer_queries();
    pass_frame(monotonic_now_ns());
    pass_state(monotonic_now_ns());
    return frames_.has_value();
}

void DeviceRelay::answer_queries() {
    ClockQueryMessage query;
    for (Taken taken = link_.take(query); taken != Taken::Nothing; taken = link_.take(query)) {
        if (taken == Taken::Message) {
            const std::int64_t received_ns = monotonic_now_ns();
            link_.send({.asker = query.asker,
                        .sent_ns = query.sent_ns,
                        .received_ns = received_ns,
                        .replied_ns = monotonic_now_ns()});
        }
    }
}

void DeviceRelay::pass_frame(std::int64_t now_ns) {
    const Taken taken = link_.take(frame_);
    counts_.refused += taken == Taken::Refused ? 1u : 0u;
    if (taken != Taken::Message) {
        // Detach from a simulation that is gone: the loop then fades its force at once.
        if ((frames_ || !problem_.empty()) && (now_ns - heard_ns_ > kSilenceNs || !link_.matched())) {
            leave();
        }
        return;
    }
    heard_ns_ = now_ns;
    std::int64_t age_ns = 0;
    if (__builtin_sub_overflow(now_ns, frame_.plane_time_ns, &age_ns) || age_ns > kMaxAgeNs || age_ns < -kMaxAgeNs) {
        ++counts_.late;
        return;
    }
    join(now_ns);
    if (!frames_) {
        ++counts_.displaced;
        return;
    }
    const std::uint64_t number = frame_.sequence;
    frame_.publish_time_ns = now_ns;
    frame_numbers_.add(frames_->publish(frame_, now_ns), number);
    ++counts_.frames;
}

/// Takes the simulator's place in the session, unless another has it.
void DeviceRelay::join(std::int64_t now_ns) {
    if (frames_ || now_ns < join_at_ns_) {
        return;
    }
    try {
        frames_.emplace(session_);
    } catch (const RingError& error) {
        if (error.kind() != RingError::Kind::RoleTaken) {
            throw;
        }
        problem_ = error.what();
        join_at_ns_ = now_ns + kRejoinNs;
        return;
    }
    problem_.clear();
    ++counts_.connections;
}

void DeviceRelay::leave() {
    frames_.reset();
    problem_.clear();
    join_at_ns_ = 0;
}

void DeviceRelay::pass_state(std::int64_t now_ns) {
    states_.attend(now_ns);
    bool found = false;
    while (states_.next(next_state_)) {
        state_ = next_state_;
        found = true;
    }
    if (!found) {
        return;
    }
    // Which of the simulation's frames this tick rendered.
    state_.frame_sequence = frame_numbers_.there(state_.frame_sequence);
    link_.send(state_);
    ++counts_.states;
}

SimulationRelay::SimulationRelay(const LinkSettings& settings, std::uint64_t asker)
    : link_(settings), states_(ring_session(settings)), frames_(ring_session(settings)), asker_(asker) {}

void SimulationRelay::run_once(std::int64_t timeout_ns) {
    link_.wait(timeout_ns);
    const std::int64_t now_ns = monotonic_now_ns();
    take_replies();
    pass_state();
    pass_frame(now_ns);
    ask(now_ns);
}

void SimulationRelay::ask(std::int64_t now_ns) {
    const bool matched = link_.matched();
    if (matched && !matched_) {
        ++counts_.connections;
        asked_ = 0;
    }
    matched_ = matched;
    if (!matched || now_ns < ask_at_ns_) {
        return;
    }
    link_.send({.asker = asker_, .sent_ns = monotonic_now_ns()});
    ask_at_ns_ = now_ns + (asked_ < kQuickQueries ? kQuickPeriodNs : kPeriodNs);
    ++asked_;
}

void SimulationRelay::take_replies() {
    ClockReplyMessage reply;
    for (Taken taken = link_.take(reply); taken != Taken::Nothing; taken = link_.take(reply)) {
        if (taken == Taken::Message && reply.asker == asker_) {
            (void)clock_.add({.sent_ns = reply.sent_ns,
                              .received_ns = reply.received_ns,
                              .replied_ns = reply.replied_ns,
                              .returned_ns = monotonic_now_ns()});
        }
    }
}

void SimulationRelay::pass_state() {
    const Taken taken = link_.take(state_);
    counts_.refused += taken == Taken::Refused ? 1u : 0u;
    const std::int64_t now_ns = monotonic_now_ns();
    const std::optional<ClockOffset> clock = clock_.at(now_ns);
    if (taken != Taken::Message || !clock) {
        return;
    }
    const std::uint64_t number = state_.sequence;
    state_.latch_time_ns = shifted(state_.latch_time_ns, -clock->offset_ns);
    state_numbers_.add(states_.publish(state_, now_ns), number);
    ++counts_.states;
}

void SimulationRelay::pass_frame(std::int64_t now_ns) {
    const std::optional<ClockOffset> clock = clock_.at(now_ns);
    if (!clock || !frames_.read_newest(frame_)) {
        return;
    }
    frame_.state_sequence = state_numbers_.there(frame_.state_sequence);
    frame_.state_time_ns = shifted(frame_.state_time_ns, clock->offset_ns);
    frame_.plane_time_ns = shifted(frame_.plane_time_ns, clock->offset_ns);
    link_.send(frame_, clock->uncertainty_ns);
    ++counts_.frames;
}

}  // namespace haptic
