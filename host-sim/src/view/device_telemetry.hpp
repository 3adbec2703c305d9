// How the real-time process does, for viewers: what its device states say, gathered by looking on at their ring.
//
// A ring keeps its last eight states, so that a look every 4 ms sees each of up to 2,000 a second; states that came and
// went between two looks are counted as unseen, and nothing is said of them. A period is the time between the encoder
// latches of two states that follow one another, both seen. A missed tick is a deadline that passed without a
// latch: a period of n median periods and a part has n - 1 of them. The age of a frame is the time from its publishing
// to the latch of a tick that rendered it. All of it is about the last 10 s, of the states of one run of rt-core.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/ring_observer.hpp"

namespace haptic::sim::view {

/// When each of the latest frames was published. One thread writes, another reads; neither ever waits.
class PublishTimes {
  public:
    static constexpr std::size_t kFrames = 1024;  // a quarter of a second at 4,000 frames a second

    void add(std::uint64_t sequence, std::int64_t time_ns) noexcept;
    /// Nothing of a frame that is not ours, or too long ago.
    [[nodiscard]] std::optional<std::int64_t> of(std::uint64_t sequence) const noexcept;

  private:
    struct Entry {
        std::atomic<std::uint64_t> sequence{0};  // 0 while it is written
        std::atomic<std::int64_t> time_ns{0};
    };
    std::array<Entry, kFrames> entries_;
};

class DeviceTelemetry {
  public:
    static constexpr std::int64_t kWindowNs = 10'000'000'000;
    static constexpr std::int64_t kSilenceNs = 500'000'000;  // without a state, after which there is no device
    static constexpr std::int64_t kPauseNs = 1'000'000'000;  // between two looks, after which the window begins anew
    static constexpr std::size_t kMostStates = 32768;        // of the window that are kept
    static constexpr std::size_t kBins = 60;

    /// Of the session's ring of device states, which need not be there. Throws RingError::Kind::BadSessionName.
    explicit DeviceTelemetry(const std::string& session);

    /// Takes what has come since the last look. `now_ns` is CLOCK_MONOTONIC, here and below.
    void look(std::int64_t now_ns);
    /// The message "device" of page/PROTOCOL.md, JSON. Flags are those of the ticks since the message before.
    [[nodiscard]] std::string message(std::int64_t now_ns);
    /// From the simulation's thread, beside the others: a frame went to the ring. Wait-free.
    void frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept { published_.add(sequence, time_ns); }

  private:
    struct Seen {
        std::int64_t latch_ns = 0;
        std::uint64_t sequence = 0;
        std::optional<std::int64_t> period_ns;     // from the state before
        std::optional<std::int64_t> frame_age_ns;  // of the frame that it rendered
    };

    void take(const DeviceState& state, std::int64_t now_ns);
    void forget_before(std::int64_t time_ns);
    [[nodiscard]] double rate_hz() const;

    RingObserver<DeviceState> observer_;
    PublishTimes published_;
    std::deque<Seen> seen_;
    std::int64_t looked_ns_ = 0;
    std::uint64_t session_ = 0;  // of rt-core's run
    std::uint32_t safety_state_ = HAPTIC_DISARMED;
    std::uint32_t faults_ = 0;
    std::uint32_t flags_ = 0;
};

}  // namespace haptic::sim::view
