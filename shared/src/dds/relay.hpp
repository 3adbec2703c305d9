// Relays: between the rings of a session and its other end on another machine. rt-core and the simulator use their
// rings as if the other were beside them.
//
//     rt-core <-- rings "NAME" --> DeviceRelay <-- DDS --> SimulationRelay <-- rings "NAME-link" --> simulator
//
// On the network all times are those of rt-core's clock: the simulation's relay, which measures the offset of the
// clocks, converts in both directions. Sequences of frames and states are each those of the ring that they come from.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "dds/clock_bounds.hpp"
#include "dds/link.hpp"
#include "haptic/ring.hpp"
#include "haptic/ring_observer.hpp"

namespace haptic {

/// Numbers of the last messages in two rings.
class SequencePairs {
  public:
    void add(std::uint64_t here, std::uint64_t there) noexcept { pairs_[here % kKept] = {here, there}; }
    /// 0 for a number that was not added, or long ago.
    [[nodiscard]] std::uint64_t there(std::uint64_t here) const noexcept {
        const Pair& pair = pairs_[here % kKept];
        return pair.here == here ? pair.there : 0;
    }

  private:
    static constexpr std::size_t kKept = 1024;
    struct Pair {
        std::uint64_t here = 0;
        std::uint64_t there = 0;
    };
    std::array<Pair, kKept> pairs_{};
};

/// How long a relay waits for messages before it looks at its rings: a quarter of a tick, by which a state may be late.
inline constexpr std::int64_t kRelayPollNs = 250'000;

/// What passed since the relay began.
struct RelayCounts {
    std::uint64_t states = 0;
    std::uint64_t frames = 0;
    std::uint64_t refused = 0;      // messages that were invalid, or of another version
    std::uint64_t late = 0;         // frames whose planes held longer than kMaxAgeNs ago, or hold later than now
    std::uint64_t displaced = 0;    // frames of a simulation whose place in the session another one has
    std::uint64_t connections = 0;  // times that the other end came
};

/// Beside rt-core. Observes its states, and joins the session's rings as a simulator does while a simulation is
/// connected; so a simulator on rt-core's own machine may have that place while none is. A simulation that finds the
/// place taken is refused until it is free.
class DeviceRelay {
  public:
    static constexpr std::int64_t kMaxAgeNs = 1'000'000'000;
    static constexpr std::int64_t kSilenceNs = 500'000'000;  // after which the simulation is taken to be gone
    static constexpr std::int64_t kRejoinNs = 100'000'000;   // between two attempts to take a place that is taken

    /// Throws RingError, and std::runtime_error of the link.
    explicit DeviceRelay(const LinkSettings& settings);

    /// Waits for a message, at most as long, and passes on what came. Returns whether a simulation is connected.
    bool run_once(std::int64_t timeout_ns);
    [[nodiscard]] const RelayCounts& counts() const noexcept { return counts_; }
    /// Why the simulation that sends frames is refused; empty if it is not, or none sends.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  private:
    void answer_queries();
    void pass_frame(std::int64_t now_ns);
    void join(std::int64_t now_ns);
    void leave();
    void pass_state(std::int64_t now_ns);

    std::string session_;
    DeviceLink link_;
    RingObserver<DeviceState> states_;
    std::optional<RingWriter<ContactFrame>> frames_;  // while a simulation is connected
    SequencePairs frame_numbers_;                     // of rt-core's ring, of the simulation's
    std::string problem_;
    std::int64_t heard_ns_ = 0;
    std::int64_t join_at_ns_ = 0;
    RelayCounts counts_;
    ContactFrame frame_{};
    DeviceState state_{};
    DeviceState next_state_{};  // not valid until it was read whole
};

/// Beside the simulator, for which it has the role of rt-core in a session of its own.
class SimulationRelay {
  public:
    /// Session of the rings that the simulator opens.
    [[nodiscard]] static std::string ring_session(const LinkSettings& settings) { return settings.session + "-link"; }

    /// `asker` tells this start from others. Throws RingError, and std::runtime_error of the link.
    SimulationRelay(const LinkSettings& settings, std::uint64_t asker);

    /// Waits for a message, at most as long, and passes on what came.
    void run_once(std::int64_t timeout_ns);
    [[nodiscard]] const RelayCounts& counts() const noexcept { return counts_; }
    [[nodiscard]] const ClockBounds& clock() const noexcept { return clock_; }

  private:
    void ask(std::int64_t now_ns);
    void take_replies();
    void pass_state();
    void pass_frame(std::int64_t now_ns);

    SimulationLink link_;
    RingWriter<DeviceState> states_;
    RingReader<ContactFrame> frames_;
    SequencePairs state_numbers_;  // of the simulator's ring, of rt-core's
    ClockBounds clock_;
    std::uint64_t asker_;
    std::uint64_t asked_ = 0;
    std::int64_t ask_at_ns_ = 0;
    bool matched_ = false;
    RelayCounts counts_;
    ContactFrame frame_{};
    DeviceState state_{};
};

}  // namespace haptic
