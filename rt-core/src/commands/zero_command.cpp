#include "commands/zero_command.hpp"

#include <spdlog/spdlog.h>

#include <ctime>
#include <memory>

#include "commands/open_device.hpp"
#include "haptic/clock.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

// A guard gives the device back 40 ms after the loop's end.
constexpr std::int64_t kOpenNs = 2'000'000'000;
constexpr std::int64_t kZerosNs = 500'000'000;
constexpr long kPollNs = 20'000'000;

void pause() {
    const timespec wait{0, kPollNs};
    nanosleep(&wait, nullptr);
}

std::unique_ptr<OpenedDevice> open_when_free(const RunOptions& options, const Settings& settings) {
    const std::int64_t end_ns = monotonic_now_ns() + kOpenNs;
    while (true) {
        try {
            return open_device(options, settings);
        } catch (const Refusal&) {
            if (monotonic_now_ns() >= end_ns) {
                throw;
            }
        }
        pause();
    }
}

}  // namespace

int zero_command(const RunOptions& options) {
    const Settings settings = read_settings(load_config(options.config, options.assignments));
    const std::unique_ptr<OpenedDevice> device = open_when_free(options, settings);
    const std::int64_t end_ns = monotonic_now_ns() + kZerosNs;
    device::BoardReading unused;
    device::ExchangeStatus status = device::ExchangeStatus::Failed;
    do {
        device->board().zero_motors(monotonic_now_ns());
        status = device->board().exchange({}, unused, monotonic_now_ns());
        if (status == device::ExchangeStatus::Ok) {
            spdlog::info("the motors of {} are at zero", device->description());
            return kExitDone;
        }
        pause();
    } while (monotonic_now_ns() < end_ns);
    spdlog::error("{} does not confirm that its motors are at zero: {}; cut their power", device->description(),
                  device::describe(status));
    return kExitFailed;
}

}  // namespace haptic::rt
