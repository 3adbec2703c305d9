#include "commands/guard_command.hpp"

#include <spdlog/spdlog.h>

#include <memory>
#include <stdexcept>
#include <string>

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
    // The motors are at zero; there is time now. Save the last ticks first: a standard error that blocks would keep
    // them.
    std::string note;
    if (guard->black_box() >= 0 && !guard->black_box_kept()) {
        try {
            if (const auto file = save_black_box(read_left_black_box(guard->black_box()))) {
                note = "the last ticks are in " + file->string();
            }
        } catch (const std::runtime_error& error) {
            note = error.what();
        }
    }
    if (guard->status() == device::ExchangeStatus::Ok) {
        spdlog::error("guard: the loop's process is gone; the motors were set to zero");
    } else {
        spdlog::error("guard: the loop's process is gone, and the zeros for the motors failed: {}",
                      device::describe(guard->status()));
    }
    if (!note.empty()) {
        spdlog::error("guard: {}", note);
    }
    return kExitFaulted;
}

}  // namespace haptic::rt
