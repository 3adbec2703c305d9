// Device telemetry: timing statistics of the real-time process for viewers, from its ring of device states.
//
// The ring keeps its last eight states, so polling every 4 ms sees each of up to 2,000 states/s. States overwritten
// between two polls are counted as unseen and enter no other statistic. A period is the time between the encoder
// latches of two consecutive states that were both seen. A missed tick is a deadline that passed without a latch: a
// period of n median periods and a fraction has n - 1 of them. The age of a frame is the time from its publication to
// the latch of a tick that rendered it. All statistics cover the last 10 s of one run of rt-core.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "haptic/frames.hpp"
#include "haptic/ring_observer.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

/// Publication times of the latest frames. Wait-free, for one writer and one reader.
class PublishTimes {
  public:
    static constexpr std::size_t kFrames = 1024;  // a quarter of a second at 4,000 frames/s

    void add(std::uint64_t sequence, std::int64_t time_ns) noexcept;
    /// Empty if the frame was published by another process or is too old.
    [[nodiscard]] std::optional<std::int64_t> find(std::uint64_t sequence) const noexcept;

  private:
    struct Entry {
        std::atomic<std::uint64_t> sequence{0};  // 0 while the entry is being written
        std::atomic<std::int64_t> time_ns{0};
    };
    std::array<Entry, kFrames> entries_;
};

class DeviceTelemetry {
  public:
    static constexpr std::int64_t kWindowNs = 10'000'000'000;
    static constexpr std::int64_t kSilenceNs =
        500'000'000;  // without a state for this long, the device counts as absent
    static constexpr std::int64_t kPauseNs = 1'000'000'000;  // a longer pause between polls restarts the window
    static constexpr std::size_t kMaxStates = 32768;         // kept of the window
    static constexpr std::size_t kBins = 60;

    /// Observes the session's ring of device states, which need not exist yet. Throws RingError::Kind::BadSessionName.
    explicit DeviceTelemetry(const std::string& session);

    /// Reads the states that arrived since the last poll. `now_ns` is CLOCK_MONOTONIC, here and below.
    void poll(std::int64_t now_ns);
    /// The message "device" of page/PROTOCOL.md, JSON. Its flags are those of the ticks since the previous message, and
    /// its region is that of the session's rt-core, placed in the scene; none without `device`.
    [[nodiscard]] std::string message(std::int64_t now_ns, const std::optional<DeviceInScene>& device = {});
    /// Records the publication of a frame. Called from the simulation's thread, concurrently with the rest. Wait-free.
    void frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept { published_.add(sequence, time_ns); }

  private:
    struct Tick {
        std::int64_t latch_ns = 0;
        std::uint64_t sequence = 0;
        std::optional<std::int64_t> period_ns;     // since the previous state, if that was seen
        std::optional<std::int64_t> frame_age_ns;  // of the rendered frame, if it is known
        bool unanswered = false;                   // by the board
    };

    [[nodiscard]] nlohmann::json region_in(const std::optional<DeviceInScene>& device) const;
    void add_state(const DeviceState& state, std::int64_t now_ns);
    void drop_before(std::int64_t time_ns);
    [[nodiscard]] double rate_hz() const;

    std::string session_name_;
    RingObserver<DeviceState> observer_;
    PublishTimes published_;
    std::deque<Tick> ticks_;
    std::int64_t polled_ns_ = 0;
    std::uint64_t session_ = 0;  // of rt-core's run
    std::uint32_t safety_state_ = HAPTIC_DISARMED;
    std::uint32_t faults_ = 0;
    std::uint32_t flags_ = 0;
};

}  // namespace haptic::sim::view
