// Doctor checks of the USB controller: its interrupt, the thread that handles it, and its moderation. Sources: the
// kernel's kernel/irq/manage.c (names, priority and affinity of interrupt threads) and drivers/usb/host/xhci*.c, and
// the xHCI specification 1.2, 5.5.2.2 (IMOD).
#include <algorithm>
#include <charconv>
#include <system_error>

#include "doctor/doctor_usb.hpp"
#include "process/cpu_list.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {
namespace {

/// Interrupts of the controller of a USB device or root hub: those of its nearest ancestor in sysfs that has any.
std::vector<int> controller_interrupts(const Machine& machine, const std::string& name) {
    std::error_code error;
    std::filesystem::path device = std::filesystem::canonical(machine.file(std::string(kUsbDevices) + name), error);
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
    for (const UsbBoardEntry& board : boards(context)) {
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

constexpr const char* kNoInterrupt = "no USB controller with an interrupt";

/// An interrupt with a handler that serves a USB device.
struct UsbInterrupt {
    Interrupt interrupt;
    std::string device;  // "1-2", or "usb1" where no board is plugged in
};

/// Interrupts of the controllers of devices_to_trace().
std::vector<UsbInterrupt> usb_interrupts(const CheckContext& context) {
    const std::vector<Interrupt> interrupts = context.machine.interrupts();
    std::vector<UsbInterrupt> found;
    for (const std::string& device : devices_to_trace(context)) {
        std::vector<int> numbers = controller_interrupts(context.machine, device);
        numbers = numbers.empty() ? interrupts_by_name(interrupts) : numbers;
        for (const int number : numbers) {
            const auto one = std::find_if(interrupts.begin(), interrupts.end(),
                                          [number](const Interrupt& each) { return each.number == number; });
            if (one != interrupts.end()) {
                found.push_back({*one, device});
            }
        }
    }
    return found;
}

std::string described(const UsbInterrupt& one) {
    return "interrupt " + std::to_string(one.interrupt.number) + " (" + one.interrupt.handlers + ") of " + one.device;
}

/// Name of the controller of a USB device, "0000:00:14.0": the parent of its root hub in sysfs. Empty if there is none.
std::string controller_of(const Machine& machine, const std::string& name) {
    std::error_code error;
    const std::filesystem::path device =
        std::filesystem::canonical(machine.file(std::string(kUsbDevices) + name), error);
    std::filesystem::path parent;
    for (const std::filesystem::path& part : device) {
        if (part.string().starts_with("usb") && machine.has(kUsbDevices + part.string())) {
            return parent.string();
        }
        parent = part;
    }
    return {};
}

/// Shortest time between two interrupts of a controller's first interrupter, the one that its driver uses, from the
/// registers that xhci_hcd shows in debugfs; empty if it shows none.
std::optional<std::int64_t> moderation_ns(const Machine& machine, const std::string& controller) {
    constexpr std::int64_t unit_ns = 250;
    constexpr std::uint32_t interval_bits = 0xffff;  // the others count down
    const std::string file = "/sys/kernel/debug/usb/xhci/" + controller + "/reg-runtime";
    // "IR0_IMOD = 0x000000a0"
    const std::string text = machine.value_of(file, "IR0_IMOD = 0x");
    std::uint32_t bits = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bits, 16);
    if (controller.empty() || error != std::errc{} || end != text.data() + text.size()) {
        return std::nullopt;
    }
    return (bits & interval_bits) * unit_ns;
}

constexpr std::int64_t kModerationsPerPeriod = 10;

/// True if a kernel other than PREEMPT_RT was told to handle interrupts in threads.
bool has_interrupt_threads(const Machine& machine) {
    return (" " + machine.line("/proc/cmdline").value_or(std::string()) + " ").find(" threadirqs ") !=
           std::string::npos;
}

/// Good if the thread has at least the loop's priority, and runs on other processors.
void judge_thread(const CheckContext& context, const Thread& thread, Finding& finding) {
    const std::string priority = std::to_string(context.settings.priority);
    const bool good = thread.priority >= context.settings.priority && !contains(thread.cpus, context.cpu);
    finding.verdict = good ? Verdict::Good : Verdict::Bad;
    finding.found = thread.name + " (" + std::to_string(thread.id) + ") has priority " +
                    std::to_string(thread.priority) + ", the loop " + priority + "; it may run on processor " +
                    cpu_list_text(thread.cpus);
    if (!good) {
        finding.remedy =
            context.others().empty() ? kNeedsTwoProcessors : context.tune("usbthreads") + " --priority " + priority;
    }
}

}  // namespace

Finding check_usb_interrupt(const CheckContext& context) {
    Finding finding{"usb_interrupt",
                    Verdict::Unknown,
                    kNoInterrupt,
                    "the controller's interrupt ends each exchange with the board; on the loop's processor it would "
                    "also interrupt the loop for every other device of that controller",
                    {}};
    for (const UsbInterrupt& one : usb_interrupts(context)) {
        // Bad if one of them is routed to the loop's processor.
        const bool here = contains(one.interrupt.cpus, context.cpu);
        finding.verdict = here ? Verdict::Bad : Verdict::Good;
        finding.found = described(one) + " is routed to processor " + cpu_list_text(one.interrupt.cpus);
        if (here) {
            finding.remedy = context.others().empty()
                                 ? kNeedsTwoProcessors
                                 : "echo " + cpu_list_text(context.others()) + " | sudo tee /proc/irq/" +
                                       std::to_string(one.interrupt.number) + "/smp_affinity_list";
            return finding;
        }
    }
    return finding;
}

Finding check_usb_thread(const CheckContext& context) {
    Finding finding{"usb_thread",
                    Verdict::Unknown,
                    kNoInterrupt,
                    "the loop waits for this thread, which delivers the board's answers: whatever delays the thread, "
                    "even at a lower priority than the loop's, delays the loop",
                    {}};
    if (!context.settings.usb) {
        finding.found = no_board(context);
        return finding;
    }
    const std::vector<UsbInterrupt> interrupts = usb_interrupts(context);
    if (interrupts.empty()) {
        return finding;
    }
    // Other kernels than PREEMPT_RT run the handler in the interrupt itself, unless they are told to use threads.
    const std::string version = context.machine.line("/proc/sys/kernel/version").value_or(std::string());
    if (!version.empty() && !is_preempt_rt(version) && !has_interrupt_threads(context.machine)) {
        finding.verdict = Verdict::Good;
        finding.found = described(interrupts.front()) + " is handled without a thread on this kernel";
        return finding;
    }
    if (!context.machine.shows_every_process()) {
        finding.found = kHiddenProcesses;
        finding.remedy = kShowProcesses;
        return finding;
    }
    const std::vector<Thread> threads = context.machine.threads();
    for (const UsbInterrupt& one : interrupts) {
        // A shared line has a thread for each handler, and stays masked until all of them have run.
        const std::string prefix = "irq/" + std::to_string(one.interrupt.number) + "-";
        bool found = false;
        for (const Thread& thread : threads) {
            if (thread.of_kernel && thread.name.starts_with(prefix)) {
                found = true;
                judge_thread(context, thread, finding);
            }
            if (finding.verdict == Verdict::Bad) {
                return finding;
            }
        }
        if (!found) {
            finding.verdict = Verdict::Unknown;
            finding.found = described(one) + " has no thread whose name begins with " + prefix;
            return finding;
        }
    }
    return finding;
}

Finding check_usb_moderation(const CheckContext& context) {
    Finding finding{"usb_moderation",
                    Verdict::Unknown,
                    no_board(context),
                    "after an interrupt the controller holds back the next one for this time, and with it an answer of "
                    "the board",
                    {}};
    if (!context.settings.usb) {
        return finding;
    }
    finding.found = "no USB controller";
    for (const std::string& device : devices_to_trace(context)) {
        const std::string controller = controller_of(context.machine, device);
        const std::optional<std::int64_t> interval_ns = moderation_ns(context.machine, controller);
        if (!interval_ns) {
            finding.verdict = Verdict::Unknown;
            finding.found = "the kernel does not tell that time of " + (controller.empty() ? device : controller) +
                            "; xhci_hcd sets 40000 ns unless a device tree says otherwise";
            finding.remedy =
                "sudo mount -t debugfs none /sys/kernel/debug; sudo rt-core doctor, outside of its service";
            return finding;
        }
        // Each exchange may be held back once.
        const bool fits = *interval_ns * kModerationsPerPeriod <= context.settings.period_ns;
        finding.verdict = fits ? Verdict::Good : Verdict::Bad;
        finding.found = controller + " holds interrupts back for " + std::to_string(*interval_ns) +
                        " ns, of a period of " + std::to_string(context.settings.period_ns) + " ns";
        if (!fits) {
            finding.remedy =
                "none from here: xhci_hcd sets it, from imod-interval-ns of a device tree or to 40000 ns; "
                "choose a longer loop.period_s";
            return finding;
        }
    }
    return finding;
}

}  // namespace haptic::rt
