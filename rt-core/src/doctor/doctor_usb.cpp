// Checks of a board on USB and of its controller.
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

/// Those that the settings mean. Empty without any, and for a board that has no USB.
std::vector<Board> boards(const Examination& of) {
    std::vector<Board> found;
    if (!of.settings.usb) {
        return found;
    }
    for (const std::string& port : of.machine.names("/sys/bus/usb/devices")) {
        const std::string folder = std::string(kDevices) + port + "/";
        const std::string id = of.machine.line(folder + "idVendor").value_or("") + ":" +
                               of.machine.line(folder + "idProduct").value_or("");
        if (id != device::to_string(of.settings.usb->id)) {
            continue;
        }
        std::array<char, 64> node{};
        std::snprintf(node.data(), node.size(), "/dev/bus/usb/%03lld/%03lld",
                      static_cast<long long>(of.machine.number(folder + "busnum").value_or(0)),
                      static_cast<long long>(of.machine.number(folder + "devnum").value_or(0)));
        const std::string& wanted = of.settings.usb->path;
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

std::string absent(const Examination& of) {
    return of.settings.usb ? "no " + device::to_string(of.settings.usb->id) + " is plugged in"
                           : "the board of this frame has a serial line";
}

/// Interrupts of the controller behind a USB device or root hub: those of the nearest device above it that has any.
std::vector<int> controller_interrupts(const Machine& machine, const std::string& name) {
    std::error_code error;
    std::filesystem::path device = std::filesystem::canonical(machine.file(std::string(kDevices) + name), error);
    const std::filesystem::path top = std::filesystem::canonical(machine.file("/sys"), error);
    std::vector<int> numbers;
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

/// Those of all USB controllers by the names that the kernel gives to their handlers, such as xhci-hcd:usb1: for
/// controllers on a system on chip, of which /sys shows no interrupt.
std::vector<int> interrupts_by_name(const std::vector<Interrupt>& interrupts) {
    std::vector<int> numbers;
    for (const Interrupt& one : interrupts) {
        if (one.handlers.find("hcd") != std::string::npos) {
            numbers.push_back(one.number);
        }
    }
    return numbers;
}

/// The boards, or without any all root hubs.
std::vector<std::string> ends_of_controllers(const Examination& of) {
    std::vector<std::string> ends;
    for (const Board& board : boards(of)) {
        ends.push_back(board.port);
    }
    if (!ends.empty()) {
        return ends;
    }
    for (const std::string& name : of.machine.names("/sys/bus/usb/devices")) {
        if (name.starts_with("usb")) {
            ends.push_back(name);
        }
    }
    return ends;
}

}  // namespace

Finding check_usb_access(const Examination& of) {
    Finding finding{"usb_access", Verdict::Unknown, absent(of), "without it rt-core cannot open the board", {}};
    for (const Board& board : boards(of)) {
        const bool mine = of.machine.may_write(board.node);
        finding.verdict = mine && finding.verdict != Verdict::Bad ? Verdict::Good : Verdict::Bad;
        finding.found = board.port + " (" + board.node + ") " + (mine ? "may be used" : "may not be used by this user");
        if (!mine) {
            finding.remedy =
                has_udev_rule(of.machine)
                    ? "sudo usermod -aG haptic \"$USER\", and log in again"
                    : "sudo install -m 644 firmware-host/udev/70-spidar-g6.rules /etc/udev/rules.d/ && sudo "
                      "udevadm control --reload && sudo udevadm trigger";
            return finding;
        }
    }
    return finding;
}

Finding check_usb_autosuspend(const Examination& of) {
    Finding finding{"usb_autosuspend",
                    Verdict::Unknown,
                    absent(of),
                    "a board that the kernel puts to sleep between transfers takes milliseconds to answer again",
                    {}};
    for (const Board& board : boards(of)) {
        const std::string file = std::string(kDevices) + board.port + "/power/control";
        const std::string control = of.machine.line(file).value_or(std::string());
        finding.verdict = control == "auto" ? Verdict::Bad : Verdict::Good;
        finding.found =
            "the board at " + board.port + (control == "auto" ? " may be suspended" : " is never suspended");
        if (control == "auto") {
            finding.remedy = "echo on | sudo tee " + file;
            return finding;
        }
    }
    if (finding.verdict == Verdict::Unknown && of.settings.usb) {
        const bool rule = has_udev_rule(of.machine);
        finding.verdict = rule ? Verdict::Good : Verdict::Bad;
        finding.found += rule ? "; the udev rule will keep it awake" : ", and there is no udev rule to keep it awake";
        finding.remedy = rule ? std::string()
                              : "sudo install -m 644 firmware-host/udev/70-spidar-g6.rules /etc/udev/rules.d/ && sudo "
                                "udevadm control --reload";
    }
    return finding;
}

Finding check_usb_interrupt(const Examination& of) {
    Finding finding{"usb_interrupt",
                    Verdict::Unknown,
                    "no USB controller with an interrupt",
                    "the controller's interrupt ends each exchange with the board; on the loop's own processor it also "
                    "comes for every other device of that controller",
                    {}};
    const std::vector<Interrupt> interrupts = of.machine.interrupts();
    for (const std::string& end : ends_of_controllers(of)) {
        std::vector<int> numbers = controller_interrupts(of.machine, end);
        numbers = numbers.empty() ? interrupts_by_name(interrupts) : numbers;
        for (const int number : numbers) {
            const auto one = std::find_if(interrupts.begin(), interrupts.end(),
                                          [number](const Interrupt& each) { return each.number == number; });
            if (one == interrupts.end()) {
                continue;
            }
            const bool here = contains(one->cpus, of.cpu);
            finding.verdict = here ? Verdict::Bad : Verdict::Good;
            finding.found = "interrupt " + std::to_string(number) + " (" + one->handlers + ") of " + end +
                            " comes to processor " + cpu_list_text(one->cpus);
            if (here) {
                finding.remedy = of.others().empty() ? "none: use a machine with two processors at least"
                                                     : "echo " + cpu_list_text(of.others()) + " | sudo tee /proc/irq/" +
                                                           std::to_string(number) + "/smp_affinity_list";
                return finding;
            }
        }
    }
    return finding;
}

}  // namespace haptic::rt
