#include "program/results.hpp"

#include <exception>
#include <stdexcept>

#include "program/exit_status.hpp"
#include "program/run_program.hpp"

namespace haptic {

void write_for(const std::string& option, const std::function<void()>& write) {
    try {
        write();
    } catch (const std::exception& error) {
        throw std::runtime_error(option + ": " + message_of(error));
    }
}

void Results::write(const std::function<void()>& write) {
    try {
        write();
    } catch (const std::exception& error) {
        problems_.push_back(message_of(error));
    }
}

int Results::status(int of_run) const noexcept {
    return of_run == kExitDone && !problems_.empty() ? kExitFailed : of_run;
}

}  // namespace haptic
