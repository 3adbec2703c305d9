// Progress bar: how far a long piece of work has come, in one line on a terminal.
#pragma once

#include <atomic>
#include <cstdint>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

namespace haptic {

/// Control sequence that erases a terminal's line from the cursor on (ECMA-48, EL).
inline constexpr std::string_view kEraseLine = "\x1b[K";

/// Whether bars are drawn: stderr is a terminal, and not one without control sequences (TERM=dumb).
[[nodiscard]] bool stderr_shows_progress();

/// The line of a bar: "running fish [########------------]  40 %, 12 s left". `share` of the work, 0 to 1, took
/// `elapsed_ns`.
[[nodiscard]] std::string progress_line(std::string_view work, double share, std::int64_t elapsed_ns);

/// Draws itself from time to time, so that a user sees that work goes on.
class ProgressBar {
  public:
    /// Work that begins now; it is named as what the program is doing, such as "running fish". Work of less than a
    /// second draws no bar.
    explicit ProgressBar(std::string work);
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;
    /// Erases the bar.
    ~ProgressBar();

    /// Takes note of the share of the work that is done, 0 to 1.
    void show(double share) noexcept { share_.store(share, std::memory_order_relaxed); }

  private:
    void keep_drawing(const std::stop_token& ended) const;

    std::string work_;
    std::atomic<double> share_{0.0};
    std::jthread drawer_;  // none where bars are not drawn
};

/// Does work under a bar: calls `act` with a function that shows the share of it that is done, and returns its result.
template <class Act>
auto with_progress_bar(std::string work, const Act& act) {
    ProgressBar bar(std::move(work));
    return act([&bar](double share) { bar.show(share); });
}

}  // namespace haptic
