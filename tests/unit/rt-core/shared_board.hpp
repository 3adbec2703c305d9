// Emulated board whose motors stay visible to another process after the driving process has died, and whose exchange
// can be made to hang.
#pragma once

#include <sys/mman.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <new>
#include <system_error>

#include "haptic/device/emulated_board.hpp"

namespace haptic::rt::test {

/// State of the motors, in memory shared with a child process.
struct SharedMotors {
    std::array<std::atomic<std::int16_t>, kStrings> dac_codes{};
    std::atomic<int> zeros_sent{0};     // by zero_motors()
    std::atomic<bool> hang{false};      // the next exchange does not return while this is set
    std::atomic<bool> hanging{false};   // an exchange is hanging
    std::atomic<bool> overflow{false};  // the next exchange overflows the stack
    std::atomic<bool> ready{false};     // free for use by the test

    void set(const device::MotorCommand& command) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            dac_codes[i].store(command.dac_codes[i]);
        }
    }
    [[nodiscard]] int sum() const {
        int sum = 0;
        for (const auto& dac_code : dac_codes) {
            sum += dac_code.load();
        }
        return sum;
    }
};

class SharedMotorsPage {
  public:
    SharedMotorsPage()
        : memory_(mmap(nullptr, sizeof(SharedMotors), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) {
        if (memory_ == MAP_FAILED) {
            throw std::system_error(errno, std::generic_category(), "mmap");
        }
        motors_ = new (memory_) SharedMotors;
    }
    SharedMotorsPage(const SharedMotorsPage&) = delete;
    SharedMotorsPage& operator=(const SharedMotorsPage&) = delete;
    ~SharedMotorsPage() { munmap(memory_, sizeof(SharedMotors)); }
    [[nodiscard]] SharedMotors& operator*() const { return *motors_; }
    [[nodiscard]] SharedMotors* operator->() const { return motors_; }

  private:
    void* memory_;
    SharedMotors* motors_ = nullptr;
};

inline void sleep_ms(int milliseconds) {
    const timespec time{milliseconds / 1000, milliseconds % 1000 * 1'000'000L};
    nanosleep(&time, nullptr);
}

/// Recursion that uses this many bytes of stack; written so that the compiler cannot shrink its stack frames.
inline int use_stack(std::size_t bytes) HAPTIC_RT {
    std::array<char, 4096> frame{};
    asm volatile("" : : "r"(frame.data()) : "memory");
    return bytes < frame.size() ? frame[0] : use_stack(bytes - frame.size()) + frame[0];
}

/// More than the stack of any test.
constexpr std::size_t kTooMuchStack = std::size_t{256} << 20;

class SharedBoard final : public device::Board {
  public:
    explicit SharedBoard(SharedMotors& motors) : motors_(&motors), board_({.geometry = device::spidar_g6_x3r()}) {}

    device::ExchangeStatus exchange(const device::MotorCommand& command, device::BoardReading& reading,
                                    std::int64_t now_ns) HAPTIC_RT override {
        while (motors_->hang.load()) {  // no sleep: the real-time sanitizer forbids it in a tick
            motors_->hanging.store(true);
        }
        motors_->hanging.store(false);
        if (motors_->overflow.load()) {
            use_stack(kTooMuchStack);
        }
        motors_->set(command);
        return board_.exchange(command, reading, now_ns);
    }
    void zero_motors(std::int64_t /*now_ns*/) HAPTIC_RT override {
        motors_->set(device::MotorCommand{});
        motors_->zeros_sent.fetch_add(1);
    }

  private:
    SharedMotors* motors_;
    device::EmulatedBoard board_;
};

}  // namespace haptic::rt::test
