// Checks of what the kernel grants to this user, without trying: /proc/self/limits and the capabilities.
#include <charconv>
#include <sstream>

#include "doctor/doctor_checks.hpp"

namespace haptic::rt {
namespace {

// linux/capability.h
constexpr int kIpcLock = 14;
constexpr int kSysNice = 23;

bool has_capability(const Machine& machine, int number) {
    const std::string text = machine.value_of("/proc/self/status", "CapEff:");
    std::uint64_t bits = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bits, 16);
    return error == std::errc{} && end == text.data() + text.size() && ((bits >> number) & 1U) != 0;
}

/// The soft limit as /proc/self/limits has it: a number or "unlimited"; empty if it cannot be read.
std::string soft_limit(const Machine& machine, const std::string& name) {
    std::istringstream values(machine.value_of("/proc/self/limits", name));
    std::string soft;
    values >> soft;
    return soft;
}

std::string remedy(const Machine& machine) {
    return machine.has("/etc/security/limits.d/haptic.conf")
               ? "sudo usermod -aG haptic \"$USER\", and log in again"
               : "sudo setcap cap_sys_nice,cap_ipc_lock+ep \"$(command -v rt-core)\"";
}

/// A right that either a limit or a capability grants.
struct Right {
    std::string name;
    std::string why;
    std::string limit;  // as /proc/self/limits calls it
    std::string unit;   // of the limit, as it is shown
    int capability;
    const char* capability_name;
    std::int64_t enough;  // of the limit; -1: only "unlimited"
};

bool is_enough(const std::string& soft, std::int64_t enough) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(soft.data(), soft.data() + soft.size(), value);
    return soft == "unlimited" ||
           (error == std::errc{} && end == soft.data() + soft.size() && enough >= 0 && value >= enough);
}

Finding check_right(const Examination& of, const Right& right) {
    const std::string soft = soft_limit(of.machine, right.limit);
    if (has_capability(of.machine, right.capability)) {
        return {right.name, Verdict::Good, std::string("granted by ") + right.capability_name, right.why, {}};
    }
    if (soft.empty()) {
        return {right.name, Verdict::Unknown, "/proc/self/limits cannot be read", right.why, {}};
    }
    const bool granted = is_enough(soft, right.enough);
    return {right.name, granted ? Verdict::Good : Verdict::Bad,
            "the limit of this user is " + soft + (soft == "unlimited" ? "" : right.unit), right.why,
            granted ? std::string() : remedy(of.machine)};
}

}  // namespace

Finding check_priority(const Examination& of) {
    const int needed = of.settings.priority + 1;
    return check_right(of,
                       {.name = "priority",
                        .why = "without SCHED_FIFO the loop waits its turn behind every other program; it needs " +
                               std::to_string(of.settings.priority) + ", and its watchdog " + std::to_string(needed),
                        .limit = "Max realtime priority",
                        .unit = "",
                        .capability = kSysNice,
                        .capability_name = "CAP_SYS_NICE",
                        .enough = needed});
}

Finding check_memory_lock(const Examination& of) {
    return check_right(of, {.name = "memory_lock",
                            .why = "memory that is not locked may have to be fetched in the middle of a tick",
                            .limit = "Max locked memory",
                            .unit = " bytes",
                            .capability = kIpcLock,
                            .capability_name = "CAP_IPC_LOCK",
                            .enough = -1});
}

}  // namespace haptic::rt
