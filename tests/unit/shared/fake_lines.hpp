// Lines of a GPIO chip that no machine has: what is set is remembered, may be refused, and goes over a wire to whoever
// captures its edges.
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

/// An output line and the edges that it makes, with times of its own. Neither allocates nor locks.
class FakeWire {
  public:
    static constexpr std::size_t kRoom = 1 << 16;

    /// The line goes over this instant in each call; what follows is `step_ns` later.
    std::int64_t time_ns = 0;
    std::int64_t step_ns = 1000;
    int error = 0;                    // errno of each call from now on; 0: none is refused
    std::uint64_t calls = 0;          // of the line
    std::atomic<bool> broken{false};  // the edges cannot be read any more

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

/// The end of the wire that is set; the wire must outlive it.
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

/// The other end.
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
