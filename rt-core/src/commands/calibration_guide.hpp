// What a person at the device is told while the loop runs, and whether the grip was held and moved as it has to be.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include <haptic/device/variant.hpp>
#include "tick/tick_record.hpp"
#include "commands/run_command.hpp"

namespace haptic::rt {

class CalibrationGuide final : public RunObserver {
  public:
    struct Settings {
        device::Variant variant;
        double hold_s = 1.0;
        double wiggle_s = 30.0;
        double movement = 0.5e-3;  // m, that a string may move while the grip is held
        double residual = 1e-3;    // m, that the lengths may contradict each other meanwhile
        bool live = false;         // standard output is a terminal: one line that is written over
    };
    explicit CalibrationGuide(const Settings& settings) : settings_(settings) {}

    void saw(const TickRecord& tick) override;
    [[nodiscard]] bool done() const override { return phase_ == Phase::Done || phase_ == Phase::Failed; }

    /// The grip was held, and the time for moving it is over.
    [[nodiscard]] bool complete() const noexcept { return phase_ == Phase::Done; }
    /// Why not.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  private:
    enum class Phase : std::uint8_t { Waiting, Holding, Wiggling, Done, Failed };
    struct Extent {
        double least = 0.0;
        double most = 0.0;
        void take(double value) {
            least = value < least ? value : least;
            most = value > most ? value : most;
        }
        [[nodiscard]] double width() const { return most - least; }
    };

    void count(const TickRecord& tick);
    void wait(const TickRecord& tick);
    void hold(const TickRecord& tick);
    void wiggle(const TickRecord& tick);
    void begin(Phase phase, const TickRecord& tick);
    void end_hold();
    [[nodiscard]] double largest_movement() const;
    void show(const TickRecord& tick, const std::string& line);

    Settings settings_;
    Phase phase_ = Phase::Waiting;
    std::string problem_;
    std::array<std::uint32_t, kStrings> last_{};
    std::array<std::int64_t, kStrings> counts_{};  // since the phase began
    std::array<Extent, kStrings> strings_;         // counts
    std::array<Extent, 6> axes_;                   // m, rad
    double worst_residual_ = 0.0;                  // m
    std::int64_t begin_ns_ = 0;
    std::int64_t shown_ns_ = 0;
    bool counted_ = false;
};

}  // namespace haptic::rt
