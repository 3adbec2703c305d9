#include "emulated/motor_recording.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include "haptic/clock.hpp"
#include "haptic/types.hpp"

namespace haptic::device {
namespace {

// A time of 20 digits and eight codes of at most 5 characters, with separators.
constexpr std::size_t kLongestRow = 128;

/// Returns 0 or an errno. A row that is written in part is lost: the disk is full.
int write_all(int file, std::string_view text) noexcept {
    const ssize_t count = write(file, text.data(), text.size());
    if (count < 0) {
        return errno;
    }
    return static_cast<std::size_t>(count) == text.size() ? 0 : ENOSPC;
}

}  // namespace

MotorRecording::MotorRecording(Firmware& firmware, const EmulatedDevice& device, const std::filesystem::path& file)
    : firmware_(&firmware), device_(&device), path_(file) {
    file_ = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    error_ = file_ < 0 ? errno : write_all(file_, "time_s,code_0,code_1,code_2,code_3,code_4,code_5,code_6,code_7\n");
    if (error_ != 0) {
        const std::string problem = std::system_category().message(error_);
        if (file_ >= 0) {
            close(file_);
        }
        throw std::runtime_error(file.string() + ": cannot be written: " + problem);
    }
    write_row(monotonic_now_ns());
}

MotorRecording::~MotorRecording() {
    close(file_);
}

void MotorRecording::require_complete() const {
    if (error_ != 0) {
        throw std::runtime_error(path_.string() +
                                 ": the recording is incomplete: " + std::system_category().message(error_));
    }
}

void MotorRecording::receive(std::span<const std::byte> out, std::int64_t now_ns) HAPTIC_RT {
    firmware_->receive(out, now_ns);
    if (device_->dac_codes() != written_ && error_ == 0) {
        HAPTIC_RT_EXCEPTION_BEGIN(
            "a row to the page cache; in a served board only, which no loop of this process drives")
        write_row(now_ns);
        HAPTIC_RT_EXCEPTION_END
    }
}

void MotorRecording::write_row(std::int64_t now_ns) noexcept {
    written_ = device_->dac_codes();
    std::array<char, kLongestRow> row{};
    int length = std::snprintf(row.data(), row.size(), "%" PRId64 ".%09" PRId64, now_ns / kNanosecondsPerSecond,
                               now_ns % kNanosecondsPerSecond);
    for (const std::int16_t code : written_) {
        const auto used = static_cast<std::size_t>(length);
        length += std::snprintf(row.data() + used, row.size() - used, ",%d", code);
    }
    const auto used = static_cast<std::size_t>(length);
    row[used] = '\n';
    error_ = write_all(file_, {row.data(), used + 1});
}

}  // namespace haptic::device
