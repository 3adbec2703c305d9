#include "commands/calibration_guide.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "device/velocity.hpp"
#include "formatted.hpp"

namespace haptic::rt {
namespace {

using haptic::detail::formatted;

constexpr std::int64_t kUpdateNs = 250'000'000;  // between two updates of the progress line
constexpr double kDegrees = 57.29577951308232;
constexpr double kMillimetres = 1e3;

}  // namespace

void CalibrationGuide::on_tick(const TickRecord& tick) {
    if (done()) {
        return;
    }
    accumulate_counts(tick);
    // Advance the phase that this tick belongs to.
    const bool running = tick.safety_state == HAPTIC_RUNNING;
    switch (phase_.load()) {
        case Phase::Waiting:
            if (running) {
                enter(Phase::Holding, tick);
                std::printf("\nThis pose is taken as centred and level. Hold the grip there.\n");
            } else {
                wait(tick);
            }
            break;
        case Phase::Holding:
            hold(tick);
            break;
        case Phase::Wiggling:
            wiggle(tick);
            break;
        case Phase::Done:
        case Phase::Failed:
            break;
    }
    // A stop or a fault before the end is a failure.
    if (!done() && phase_ != Phase::Waiting && !running) {
        phase_ = Phase::Failed;
        problem_ = "the loop stopped before the grip had been moved for the whole time";
    }
}

void CalibrationGuide::accumulate_counts(const TickRecord& tick) {
    // Sign-extends the difference of two counters of 16, 24 or 32 bits, so that it survives a wrap-around.
    const unsigned unused = 32U - static_cast<unsigned>(device::counter_bits(settings_.geometry.board));
    for (std::size_t i = 0; i < kStrings && counted_; ++i) {
        counts_[i] += static_cast<std::int32_t>((tick.counters[i] - last_[i]) << unused) >> unused;
        strings_[i].add(static_cast<double>(counts_[i]));
    }
    last_ = tick.counters;
    counted_ = true;
}

void CalibrationGuide::enter(Phase phase, const TickRecord& tick) {
    phase_ = phase;
    begin_ns_ = tick.now_ns;
    counts_ = {};
    strings_ = {};
    axes_ = {};
    worst_residual_ = 0.0;
}

double CalibrationGuide::largest_movement() const {
    double largest = 0.0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        largest = std::max(largest, strings_[i].width() * std::fabs(settings_.geometry.strings[i].metres_per_count));
    }
    return largest;
}

void CalibrationGuide::show(const TickRecord& tick, const std::string& line) {
    if (tick.now_ns - shown_ns_ < kUpdateNs) {
        return;
    }
    shown_ns_ = tick.now_ns;
    if (settings_.live) {
        std::printf("\r\033[K%s", line.c_str());
        std::fflush(stdout);
    }
}

void CalibrationGuide::wait(const TickRecord& tick) {
    if (tick.now_ns - shown_ns_ >= kUpdateNs) {
        show(tick, formatted("hold still: largest movement of a string in the last quarter second %.2f mm",
                             kMillimetres * largest_movement()));
        counts_ = {};
        strings_ = {};
    }
}

void CalibrationGuide::hold(const TickRecord& tick) {
    worst_residual_ = std::max(worst_residual_, tick.residual);
    show(tick, formatted("held: largest movement of a string %.3f mm, residual of the lengths %.1f um",
                         kMillimetres * largest_movement(), 1e6 * worst_residual_));
    if (seconds(tick.now_ns - begin_ns_) < settings_.hold_s) {
        return;
    }
    judge_hold();
    if (phase_ == Phase::Holding) {
        enter(Phase::Wiggling, tick);
    }
}

void CalibrationGuide::judge_hold() {
    // Print the result of the hold.
    const double movement = largest_movement();
    std::printf("\nheld for %.1f s: largest movement of a string %.3f mm, largest residual of the lengths %.1f um\n",
                settings_.hold_s, kMillimetres * movement, 1e6 * worst_residual_);
    for (std::size_t i = 0; i < kStrings; ++i) {
        std::printf("  string %zu: %+lld counts, range %.0f\n", i, static_cast<long long>(counts_[i]),
                    strings_[i].width());
    }
    // Fail if a string moved, or if the lengths are inconsistent; else go on to the wiggle.
    if (movement > settings_.movement) {
        phase_ = Phase::Failed;
        problem_ = formatted("the grip was not held still: a string moved by %.2f mm, the limit is %.2f mm",
                             kMillimetres * movement, kMillimetres * settings_.movement);
    } else if (worst_residual_ > settings_.residual) {
        phase_ = Phase::Failed;
        problem_ =
            formatted("the residual of the string lengths is %.2f mm although the grip was held: is a string slack?",
                      kMillimetres * worst_residual_);
    } else {
        std::printf(
            "Now move the grip for %.0f s, slowly and with all strings taut: 2 cm to each side, up and down, back and\n"
            "forth, and rotate it about every axis by at least 20 degrees, away from the centre too.\n",
            settings_.wiggle_s);
    }
}

std::string CalibrationGuide::extents_text() const {
    return formatted("x %.0f y %.0f z %.0f mm, rotation x %.0f y %.0f z %.0f degrees", kMillimetres * axes_[0].width(),
                     kMillimetres * axes_[1].width(), kMillimetres * axes_[2].width(), kDegrees * axes_[3].width(),
                     kDegrees * axes_[4].width(), kDegrees * axes_[5].width());
}

void CalibrationGuide::wiggle(const TickRecord& tick) {
    // Rotation vector (rad) from the level orientation.
    const Vec3 rotation = rotation_between(Quat(1.0, 0.0, 0.0, 0.0), tick.pose.orientation);
    for (int i = 0; i < 3; ++i) {
        axes_[static_cast<std::size_t>(i)].add(tick.pose.position[i]);
        axes_[static_cast<std::size_t>(i) + 3].add(rotation[i]);
    }
    const double left_s = settings_.wiggle_s - seconds(tick.now_ns - begin_ns_);
    show(tick, formatted("%3.0f s left; range ", left_s) + extents_text());
    if (left_s > 0.0) {
        return;
    }
    phase_ = Phase::Done;
    std::printf("\nrange %s\n", extents_text().c_str());
}

}  // namespace haptic::rt
