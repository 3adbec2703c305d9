#include "commands/calibration_guide.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "device/velocity.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kShowNs = 250'000'000;
constexpr double kDegrees = 57.29577951308232;
constexpr double kMillimetres = 1e3;

std::string text(const char* format, auto... values) {
    char line[200];
    std::snprintf(line, sizeof line, format, values...);
    return line;
}

}  // namespace

void CalibrationGuide::saw(const TickRecord& tick) {
    if (done()) {
        return;
    }
    count(tick);
    const bool running = tick.safety_state == HAPTIC_RUNNING;
    switch (phase_) {
        case Phase::Waiting:
            if (running) {
                begin(Phase::Holding, tick);
                std::printf("\nThe grip is taken as centred and level. Hold it there.\n");
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
    if (!done() && phase_ != Phase::Waiting && !running) {
        phase_ = Phase::Failed;
        problem_ = "the loop stopped before the grip was moved about for long enough";
    }
}

void CalibrationGuide::count(const TickRecord& tick) {
    const unsigned unused = 32U - static_cast<unsigned>(device::counter_bits(settings_.variant.board));
    for (std::size_t i = 0; i < kStrings && counted_; ++i) {
        counts_[i] += static_cast<std::int32_t>((tick.counters[i] - last_[i]) << unused) >> unused;
        strings_[i].take(static_cast<double>(counts_[i]));
    }
    last_ = tick.counters;
    counted_ = true;
}

void CalibrationGuide::begin(Phase phase, const TickRecord& tick) {
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
        largest = std::max(largest, strings_[i].width() * std::fabs(settings_.variant.strings[i].metres_per_count));
    }
    return largest;
}

void CalibrationGuide::show(const TickRecord& tick, const std::string& line) {
    if (tick.now_ns - shown_ns_ < kShowNs) {
        return;
    }
    shown_ns_ = tick.now_ns;
    if (settings_.live) {
        std::printf("\r\033[K%s", line.c_str());
        std::fflush(stdout);
    }
}

void CalibrationGuide::wait(const TickRecord& tick) {
    if (tick.now_ns - shown_ns_ >= kShowNs) {
        show(tick, text("hold still: the strings moved by %.2f mm at most in the last quarter second",
                        kMillimetres * largest_movement()));
        counts_ = {};
        strings_ = {};
    }
}

void CalibrationGuide::hold(const TickRecord& tick) {
    worst_residual_ = std::max(worst_residual_, tick.residual);
    show(tick, text("held: the strings moved by %.3f mm at most, lengths contradict by %.1f um",
                    kMillimetres * largest_movement(), 1e6 * worst_residual_));
    if (seconds(tick.now_ns - begin_ns_) < settings_.hold_s) {
        return;
    }
    end_hold();
    if (phase_ == Phase::Holding) {
        begin(Phase::Wiggling, tick);
    }
}

void CalibrationGuide::end_hold() {
    const double movement = largest_movement();
    std::printf("\nheld for %.1f s: the strings moved by %.3f mm at most, lengths contradict by %.1f um at most\n",
                settings_.hold_s, kMillimetres * movement, 1e6 * worst_residual_);
    for (std::size_t i = 0; i < kStrings; ++i) {
        std::printf("  string %zu: %+lld counts, over %.0f\n", i, static_cast<long long>(counts_[i]),
                    strings_[i].width());
    }
    if (movement > settings_.movement) {
        phase_ = Phase::Failed;
        problem_ = text("the grip was not held still: a string moved by %.2f mm, %.2f mm are allowed",
                        kMillimetres * movement, kMillimetres * settings_.movement);
    } else if (worst_residual_ > settings_.residual) {
        phase_ = Phase::Failed;
        problem_ = text("the lengths contradict each other by %.2f mm although the grip was held: is a string slack?",
                        kMillimetres * worst_residual_);
    } else {
        std::printf(
            "Now move the grip for %.0f s, slowly and without letting a string go slack: 2 cm to each side, up and\n"
            "down, to and fro, and turn it about every axis by 20 degrees and more, also while it is off the centre.\n",
            settings_.wiggle_s);
    }
}

void CalibrationGuide::wiggle(const TickRecord& tick) {
    const Vec3 turn = rotation_between(Quat(1.0, 0.0, 0.0, 0.0), tick.pose.orientation);
    for (int i = 0; i < 3; ++i) {
        axes_[static_cast<std::size_t>(i)].take(tick.pose.position[i]);
        axes_[static_cast<std::size_t>(i) + 3].take(turn[i]);
    }
    const double left_s = settings_.wiggle_s - seconds(tick.now_ns - begin_ns_);
    show(tick, text("%3.0f s left; moved x %.0f y %.0f z %.0f mm, turned x %.0f y %.0f z %.0f degrees", left_s,
                    kMillimetres * axes_[0].width(), kMillimetres * axes_[1].width(), kMillimetres * axes_[2].width(),
                    kDegrees * axes_[3].width(), kDegrees * axes_[4].width(), kDegrees * axes_[5].width()));
    if (left_s > 0.0) {
        return;
    }
    phase_ = Phase::Done;
    std::printf("\nmoved x %.0f y %.0f z %.0f mm, turned x %.0f y %.0f z %.0f degrees\n",
                kMillimetres * axes_[0].width(), kMillimetres * axes_[1].width(), kMillimetres * axes_[2].width(),
                kDegrees * axes_[3].width(), kDegrees * axes_[4].width(), kDegrees * axes_[5].width());
}

}  // namespace haptic::rt
