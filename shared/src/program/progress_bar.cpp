#include "program/progress_bar.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/types.hpp"

namespace haptic {
namespace {

constexpr std::chrono::seconds kPatience{1};  // without a bar at the beginning
constexpr std::chrono::milliseconds kBetweenDrawings{100};
constexpr double kMinShare = 0.01;  // below, the rest of the time is not estimated
constexpr std::size_t kCells = 30;

/// "45 s", "12 min" or "3.5 h".
std::string duration_text(double duration_s) {
    const bool minutes = duration_s >= 120.0;
    const bool hours = duration_s >= 7200.0;
    const double value =
        hours ? std::round(duration_s / 360.0) / 10.0 : std::round(minutes ? duration_s / 60.0 : duration_s);
    std::string text = std::to_string(value);
    text.resize(text.find('.') + (hours ? 2 : 0));
    return text + (hours ? " h" : minutes ? " min" : " s");
}

/// Writes to the terminal, unless it takes no output now: the end of the work must not wait for that.
void draw(const std::string& text) {
    pollfd watched{STDERR_FILENO, POLLOUT, 0};
    if (poll(&watched, 1, 0) == 1 && (watched.revents & POLLOUT) != 0) {
        (void)std::fputs(text.c_str(), stderr);
        (void)std::fflush(stderr);
    }
}

}  // namespace

bool stderr_shows_progress() {
    const char* const terminal = std::getenv("TERM");
    return isatty(STDERR_FILENO) != 0 && terminal != nullptr && std::string_view(terminal) != "dumb";
}

std::string progress_line(std::string_view work, double share, std::int64_t elapsed_ns) {
    const double done = std::clamp(share, 0.0, 1.0);
    const auto filled = static_cast<std::size_t>(done * static_cast<double>(kCells));
    const std::string percent = std::to_string(static_cast<int>(done * 100.0));
    std::string line(work);
    line += " [" + std::string(filled, '#') + std::string(kCells - filled, '-') + "] ";
    line += std::string(3 - std::min<std::size_t>(3, percent.size()), ' ') + percent + " %";
    if (done >= kMinShare) {
        line += ", " + duration_text(seconds(elapsed_ns) * (1.0 - done) / done) + " left";
    }
    return line;
}

ProgressBar::ProgressBar(std::string work) : work_(std::move(work)) {
    if (!stderr_shows_progress()) {
        return;
    }
    // Signals are for the thread that works.
    sigset_t all;
    sigset_t before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    drawer_ = std::jthread([this](const std::stop_token& ended) { keep_drawing(ended); });
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

ProgressBar::~ProgressBar() = default;

void ProgressBar::keep_drawing(const std::stop_token& ended) const {
    const std::int64_t begin_ns = monotonic_now_ns();
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any pause;
    const auto is_to_end = [&ended] { return ended.stop_requested(); };
    if (pause.wait_for(lock, ended, kPatience, is_to_end)) {
        return;
    }
    do {
        // The cursor stays at the beginning of the line, so that whatever is printed next begins there.
        const std::string line =
            progress_line(work_, share_.load(std::memory_order_relaxed), monotonic_now_ns() - begin_ns);
        draw(line + std::string(kEraseLine) + "\r");
    } while (!pause.wait_for(lock, ended, kBetweenDrawings, is_to_end));
    draw("\r" + std::string(kEraseLine));
}

}  // namespace haptic
