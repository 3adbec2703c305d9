// Doctor checks of the privileges of this process, read from /proc/self/limits and its capabilities.
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

/// Soft limit as in /proc/self/limits: a number or "unlimited"; empty if it cannot be read.
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

/// A privilege that either a resource limit or a capability grants.
struct Right {
    std::string name;
    std::string why;
    std::string limit;  // its name in /proc/self/limits
    std::string unit;   // of the limit, as printed
    int capability;
    const char* capability_name;
    std::int64_t enough;  // smallest sufficient limit; -1: only "unlimited"
};

bool is_enough(const std::string& soft, std::int64_t enough) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(soft.data(), soft.data() + soft.size(), value);
    return soft == "unlimited" ||
           (error == std::errc{} && end == soft.data() + soft.size() && enough >= 0 && value >= enough);
}

Finding check_right(const CheckContext& context, const Right& right) {
    const std::string soft = soft_limit(context.machine, right.limit);
    if (has_capability(context.machine, right.capability)) {
        return {right.name, Verdict::Good, std::string("granted by ") + right.capability_name, right.why, {}};
    }
    if (soft.empty()) {
        return {right.name, Verdict::Unknown, "/proc/self/limits cannot be read", right.why, {}};
    }
    const bool granted = is_enough(soft, right.enough);
    return {right.name, granted ? Verdict::Good : Verdict::Bad,
            "this user's limit is " + soft + (soft == "unlimited" ? "" : right.unit), right.why,
            granted ? std::string() : remedy(context.machine)};
}

}  // namespace

Finding check_priority(const CheckContext& context) {
    const int needed = context.settings.priority + 1;
    return check_right(context,
                       {.name = "priority",
                        .why = "without SCHED_FIFO the loop shares the processor with every other program; it needs "
                               "priority " +
                               std::to_string(context.settings.priority) + ", its watchdog " + std::to_string(needed),
                        .limit = "Max realtime priority",
                        .unit = "",
                        .capability = kSysNice,
                        .capability_name = "CAP_SYS_NICE",
                        .enough = needed});
}

Finding check_memory_lock(const CheckContext& context) {
    return check_right(context, {.name = "memory_lock",
                                 .why = "memory that is not locked may cause a page fault in the middle of a tick",
                                 .limit = "Max locked memory",
                                 .unit = " bytes",
                                 .capability = kIpcLock,
                                 .capability_name = "CAP_IPC_LOCK",
                                 .enough = -1});
}

}  // namespace haptic::rt
