#include "program/exit_status.hpp"

#include <map>

namespace haptic {

std::vector<std::pair<std::string, std::string>> exit_statuses(std::initializer_list<int> statuses) {
    static const std::map<int, std::string> meanings{
        {kExitDone, "The command did what it was asked, or was ended in an orderly way."},
        {kExitFailed,
         "An error: a file, a scene, a setting, a session, or output that could not be written. Also a check, such as "
         "--verify, that did not hold."},
        {kExitRefused, "The device cannot be driven on this machine."},
        {kExitFaulted, "The run ended in a fault, or a trial was unstable."},
        {kExitDiffers, "A replay differs from its recording."},
        {kExitUnfit, "rt-core doctor found a problem."},
        {kExitUsage, "Wrong arguments; nothing was done."},
    };
    std::vector<std::pair<std::string, std::string>> table;
    for (const int status : statuses) {
        table.emplace_back(std::to_string(status), meanings.at(status));
    }
    return table;
}

}  // namespace haptic
