// Doctor checks of the USB board and its controller.
#include <array>
#include <cstdio>
#include <system_error>

#include "doctor/doctor_checks.hpp"
#include "process/cpu_list.hpp"

namespace haptic::rt {
namespace {

constexpr const char* kDevices = "/sys/bus/usb/devices/";

struct Board {
    std::string port;  // "1-2.4"
    std::string node;  // "/dev/bus/usb/001/007"
};

/// Plugged-in boards that match the settings; empty for a board without USB.
std::vector<Board> boards(const CheckContext& context) {
    std::vector<Board> found;
    if (!context.settings.usb) {
        return found;
    }
    for (const std::string& port : context.machine.names("/sys/bus/usb/devices")) {
        const std::string folder = std::string(kDevices) + port + "/";
        // Match the USB id, then the configured port or device node.
        const std::string id = context.machine.line(folder + "idVendor").value_or("") + ":" +
                               context.machine.line(folder + "idProduct").value_or("");
        if (id != device::to_string(context.settings.usb->id)) {
            continue;
        }
        std::array<char, 64> node{};
        std::snprintf(node.data(), node.size(), "/dev/bus/usb/%03lld/%03lld",
                      static_cast<long long>(context.machine.number(folder + "busnum").value_or(0)),
                      static_cast<long long>(context.machine.number(folder + "devnum").value_or(0)));
        const std::string& wanted = context.settings.usb->path;
        if (wanted.empty() || wanted == port || wanted == node.data()) {
            found.push_back({port, node.data()});
        }
    }
    return found;
}

bool has_udev_rule(const Machine& machine) {
    for (const char* const folder : {"/etc", "/usr/local/lib", "/usr/lib", "/lib"}) {
        if (machine.has(std::string(folder) + "/udev/rules.d/70-spidar-g6.rules")) {
            return true;
        }
    }
    return false;
}

std::string absent(const CheckContext& context) {
    return context.settings.usb ? "no " + device::to_string(context.settings.usb->id) + " is plugged in"
                                : "the board of this device is on a serial line";
}

/// Interrupts of the controller of a USB device or root hub: those of its nearest ancestor in sysfs that has any.
std::vector<int> controller_interrupts(const Machine& machine, const std::string& name) {
    std::error_code error;
    std::filesystem::path device = std::filesystem::canonical(machine.file(std::string(kDevices) + name), error);
    const std::filesystem::path top = std::filesystem::canonical(machine.file("/sys"), error);
    std::vector<int> numbers;
    // Walk up to the root of sysfs until a device has interrupts: MSI vectors, else its legacy line.
    for (; !error && device != top && device.has_relative_path() && numbers.empty(); device = device.parent_path()) {
        const std::string relative = "/sys/" + std::filesystem::relative(device, top).string();
        for (const std::string& number : machine.names(relative + "/msi_irqs")) {
            const std::vector<int> parsed = parse_cpu_list(number);
            numbers.insert(numbers.end(), parsed.begin(), parsed.end());
        }
        if (const std::int64_t line = machine.number(relative + "/irq").value_or(0); numbers.empty() && line > 0) {
            numbers.push_back(static_cast<int>(line));
        }
    }
    return numbers;
}

/// Interrupts of all USB controllers, found by handler names such as xhci-hcd:usb1. For controllers on a system on
/// chip, whose interrupts are not in /sys.
std::vector<int> interrupts_by_name(const std::vector<Interrupt>& interrupts) {
    std::vector<int> numbers;
    for (const Interrupt& one : interrupts) {
        if (one.handlers.find("hcd") != std::string::npos) {
            numbers.push_back(one.number);
        }
    }
    return numbers;
}

/// USB devices whose controllers matter: the boards, or all root hubs if no board is plugged in.
std::vector<std::string> devices_to_trace(const CheckContext& context) {
    std::vector<std::string> devices;
    for (const Board& board : boards(context)) {
        devices.push_back(board.port);
    }
    if (!devices.empty()) {
        return devices;
    }
    for (const std::string& name : context.machine.names("/sys/bus/usb/devices")) {
        if (name.starts_with("usb")) {
            devices.push_back(name);
        }
    }
    return devices;
}

}  // namespace

Finding check_usb_access(const CheckContext& context) {
    Finding finding{
        "usb_access", Verdict::Unknown, absent(context), "without write access rt-core cannot open the board", {}};
    for (const Board& board : boards(context)) {
        const bool mine = context.machine.may_write(board.node);
        finding.verdict = mine && finding.verdict != Verdict::Bad ? Verdict::Good : Verdict::Bad;
        finding.found =
            board.port + " (" + board.node + ") is " + (mine ? "accessible" : "not accessible to this user");
        if (!mine) {
            finding.remedy =
                has_udev_rule(context.machine)
                    ? "sudo usermod -aG haptic \"$USER\", and log in again"
                    : "sudo install -m 644 firmware-host/udev/70-spidar-g6.rules /etc/udev/rules.d/ && sudo "
                      "udevadm control --reload && sudo udevadm trigger";
            return finding;
        }
    }
    return finding;
}

Finding check_usb_autosuspend(const CheckContext& context) {
    Finding finding{"usb_autosuspend",
                    Verdict::Unknown,
                    absent(context),
                    "a board that the kernel suspends between transfers takes milliseconds to wake up",
                    {}};
    for (const Board& board : boards(context)) {
        const std::string file = std::string(kDevices) + board.port + "/power/control";
        const std::string control = context.machine.line(file).value_or(std::string());
        finding.verdict = control == "auto" ? Verdict::Bad : Verdict::Good;
        finding.found =
            "the board at " + board.port + (control == "auto" ? " may be suspended" : " is never suspended");
        if (control == "auto") {
            finding.remedy = "echo on | sudo tee " + file;
            return finding;
        }
    }
    // No board is plugged in: check whether the udev rule would keep it awake.
    if (finding.verdict == Verdict::Unknown && context.settings.usb) {
        const bool rule = has_udev_rule(context.machine);
        finding.verdict = rule ? Verdict::Good : Verdict::Bad;
        finding.found +=
            rule ? "; the udev rule will keep it awake" : ", and no udev rule is installed to keep it awake";
        finding.remedy = rule ? std::string()
                              : "sudo install -m 644 firmware-host/udev/70-spidar-g6.rules /etc/udev/rules.d/ && sudo "
                                "udevadm control --reload";
    }
    return finding;
}

Finding check_usb_interrupt(const CheckContext& context) {
    Finding finding{"usb_interrupt",
                    Verdict::Unknown,
                    "no USB controller with an interrupt",
                    "the controller's interrupt ends each exchange with the board; on the loop's processor it would "
                    "also interrupt the loop for every other device of that controller",
                    {}};
    const std::vector<Interrupt> interrupts = context.machine.interrupts();
    for (const std::string& device : devices_to_trace(context)) {
        // Interrupts of the controller of this device.
        std::vector<int> numbers = controller_interrupts(context.machine, device);
        numbers = numbers.empty() ? interrupts_by_name(interrupts) : numbers;
        for (const int number : numbers) {
            const auto one = std::find_if(interrupts.begin(), interrupts.end(),
                                          [number](const Interrupt& each) { return each.number == number; });
            if (one == interrupts.end()) {
                continue;
            }
            // Bad if one of them is routed to the loop's processor.
            const bool here = contains(one->cpus, context.cpu);
            finding.verdict = here ? Verdict::Bad : Verdict::Good;
            finding.found = "interrupt " + std::to_string(number) + " (" + one->handlers + ") of " + device +
                            " is routed to processor " + cpu_list_text(one->cpus);
            if (here) {
                finding.remedy = context.others().empty()
                                     ? kNeedsTwoProcessors
                                     : "echo " + cpu_list_text(context.others()) + " | sudo tee /proc/irq/" +
                                           std::to_string(number) + "/smp_affinity_list";
                return finding;
            }
        }
    }
    return finding;
}

}  // namespace haptic::rt
