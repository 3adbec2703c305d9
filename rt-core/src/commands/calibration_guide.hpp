// Calibration guide: instructs the person at the device while the loop runs, and checks that the grip is held and moved
// as required.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "commands/run_command.hpp"
#include "haptic/device/device_geometry.hpp"
#include "tick/tick_record.hpp"

namespace haptic::rt {

class CalibrationGuide final : public RunObserver {
  public:
    struct Settings {
        device::DeviceGeometry geometry;
        double hold_s = 1.0;
        double wiggle_s = 30.0;
        double movement = 0.5e-3;  // m, largest movement of a string while the grip is held
        double residual = 1e-3;    // m, largest residual of the string lengths meanwhile
        bool live = false;         // standard output is a terminal: show progress on one line that is overwritten
    };
    explicit CalibrationGuide(const Settings& settings) : settings_(settings) {}

    void on_tick(const TickRecord& tick) override;
    [[nodiscard]] bool done() const override { return phase_ == Phase::Done || phase_ == Phase::Failed; }

    /// True if the grip was held still and then moved for the whole time.
    [[nodiscard]] bool complete() const noexcept { return phase_ == Phase::Done; }
    /// Reason of a failure; empty otherwise.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  private:
    enum class Phase : std::uint8_t { Waiting, Holding, Wiggling, Done, Failed };
    /// Range of the values seen; starts at 0.
    struct Extent {
        double min = 0.0;
        double max = 0.0;
        void add(double value) {
            min = std::min(min, value);
            max = std::max(max, value);
        }
        [[nodiscard]] double width() const { return max - min; }
    };

    void accumulate_counts(const TickRecord& tick);
    void wait(const TickRecord& tick);
    void hold(const TickRecord& tick);
    void wiggle(const TickRecord& tick);
    void enter(Phase phase, const TickRecord& tick);
    void judge_hold();
    /// m, largest movement of a string in this phase.
    [[nodiscard]] double largest_movement() const;
    /// "x 12 y 30 z 9 mm, rotation x 20 y 25 z 31 degrees": extents of the motion in this phase.
    [[nodiscard]] std::string extents_text() const;
    void show(const TickRecord& tick, const std::string& line);

    Settings settings_;
    std::atomic<Phase> phase_{Phase::Waiting};  // done() is another thread's question
    std::string problem_;
    std::array<std::uint32_t, kStrings> last_{};   // counters of the previous tick
    std::array<std::int64_t, kStrings> counts_{};  // since the phase began, without wrap-around
    std::array<Extent, kStrings> strings_;         // counts
    std::array<Extent, 6> axes_;                   // m, rad
    double worst_residual_ = 0.0;                  // m
    std::int64_t begin_ns_ = 0;
    std::int64_t shown_ns_ = 0;
    bool counted_ = false;
};

}  // namespace haptic::rt
