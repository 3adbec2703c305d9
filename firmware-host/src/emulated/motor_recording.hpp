// Motor recording: a CSV file of the DAC codes that reached the motors of a served board.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "emulated/firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "haptic/realtime.hpp"

namespace haptic::device {

/// Decorator of a firmware. Writes a row with the motors' codes after each packet that changed one, and one at the
/// start; columns time_s, code_0 .. code_7. time_s is that of CLOCK_MONOTONIC, so that other processes of the machine
/// can relate it to what they do. Each row is written to the file at once: a killed process loses none.
class MotorRecording final : public Firmware {
  public:
    /// Both must outlive the recording. Throws std::runtime_error if the file cannot be written.
    MotorRecording(Firmware& firmware, const EmulatedDevice& device, const std::filesystem::path& file);
    MotorRecording(const MotorRecording&) = delete;
    MotorRecording& operator=(const MotorRecording&) = delete;
    ~MotorRecording() override;

    void receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT override;
    std::size_t reply(std::span<std::byte> in, std::int64_t now_ns) HAPTIC_RT override {
        return firmware_->reply(in, now_ns);
    }
    [[nodiscard]] bool connected(std::int64_t now_ns) const HAPTIC_RT override { return firmware_->connected(now_ns); }

    /// Throws std::runtime_error if a row could not be written; there are none after it.
    void require_complete() const;

  private:
    void write_row(std::int64_t now_ns) noexcept;

    Firmware* firmware_;
    const EmulatedDevice* device_;
    std::filesystem::path path_;
    std::array<std::int16_t, kStrings> written_{};
    int file_ = -1;
    int error_ = 0;  // errno of the row that could not be written
};

}  // namespace haptic::device
