// Fake GPIO lines: an output that records its levels, may refuse them, and passes its edges over a wire to a capture.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <system_error>
#include <thread>

#include "haptic/gpio.hpp"

namespace haptic::test {

/// An output line and its edges, with simulated times. Neither allocates nor locks.
class FakeWire {
  public:
    static constexpr std::size_t kRoom = 1 << 16;

    /// Time of the edge of the next call; advances by `step_ns`.
    std::int64_t time_ns = 0;
    std::int64_t step_ns = 1000;
    int error = 0;                    // errno of all further calls; 0: success
    std::uint64_t calls = 0;          // of the line
    std::atomic<bool> broken{false};  // reading edges fails

    int set(bool up) noexcept {
        ++calls;
        time_ns += step_ns;
        if (error != 0) {
            return error;
        }
        const std::size_t count = count_.load(std::memory_order_relaxed);
        if (up != up_ && count < kRoom) {
            edges_[count] = {time_ns, up};
            count_.store(count + 1, std::memory_order_release);
        }
        up_ = up;
        return 0;
    }
    [[nodiscard]] bool is_up() const noexcept { return up_; }
    [[nodiscard]] std::span<const Edge> edges() const noexcept {
        return {edges_.data(), count_.load(std::memory_order_acquire)};
    }

  private:
    std::array<Edge, kRoom> edges_{};
    std::atomic<std::size_t> count_{0};
    bool up_ = false;
};

/// Output end of the wire, which must outlive it.
class FakeOutput final : public OutputLine {
  public:
    explicit FakeOutput(FakeWire& wire) : wire_(&wire) {}
    int set(bool up) HAPTIC_RT override {
        int error = 0;
        HAPTIC_RT_EXCEPTION_BEGIN("in a test, where it stores one value")
        error = wire_->set(up);
        HAPTIC_RT_EXCEPTION_END
        return error;
    }

  private:
    FakeWire* wire_;
};

/// Input end.
class FakeEdges final : public EdgeSource {
  public:
    explicit FakeEdges(FakeWire& wire) : wire_(&wire) {}
    [[nodiscard]] std::size_t read(std::span<Edge> edges, std::int64_t at_most_ns) override {
        if (wire_->broken) {
            throw std::system_error(ENODEV, std::system_category(), "reading a wire");
        }
        if (wire_->edges().size() == taken_) {
            std::this_thread::sleep_for(std::chrono::nanoseconds(at_most_ns / 20));
        }
        const std::span<const Edge> there = wire_->edges().subspan(taken_);
        const std::size_t count = there.size() < edges.size() ? there.size() : edges.size();
        std::copy_n(there.begin(), count, edges.begin());
        taken_ += count;
        return count;
    }

  private:
    FakeWire* wire_;
    std::size_t taken_ = 0;
};

}  // namespace haptic::test
