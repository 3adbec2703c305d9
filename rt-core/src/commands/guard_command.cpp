#include "commands/guard_command.hpp"

#include <spdlog/spdlog.h>

#include <memory>
#include <stdexcept>

#include "commands/black_box_command.hpp"
#include "commands/run_command.hpp"
#include "process/guard.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {

int guard_command(int socket) {
    std::unique_ptr<Guard> guard;
    try {
        guard = std::make_unique<Guard>(socket);
    } catch (const std::runtime_error& error) {
        throw Refusal(error.what());
    }
    if (guard->run() == Guard::End::Left) {
        return kExitDone;
    }
    // The motors are at zero; there is time now.
    if (guard->status() == device::ExchangeStatus::Ok) {
        spdlog::error("guard: the loop's process is gone; the motors were set to zero");
    } else {
        spdlog::error("guard: the loop's process is gone, and the zeros for the motors failed: {}",
                      device::describe(guard->status()));
    }
    if (guard->black_box() >= 0 && !guard->black_box_kept()) {
        try {
            if (const auto file = save_black_box(read_left_black_box(guard->black_box()))) {
                spdlog::error("guard: the last ticks are in {}", file->string());
            }
        } catch (const std::runtime_error& error) {
            spdlog::error("guard: {}", error.what());
        }
    }
    return kExitFaulted;
}

}  // namespace haptic::rt
