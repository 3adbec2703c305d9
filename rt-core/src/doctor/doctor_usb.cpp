// Doctor checks of the USB board.
#include "doctor/doctor_usb.hpp"

#include <array>
#include <charconv>
#include <cstdio>

#include "process/period_budget.hpp"

namespace haptic::rt {
namespace {

constexpr std::int64_t kHighSpeedMbit = 480;
constexpr int kHighSpeedPacket = 512;  // bytes, the only size of a bulk packet at high speed

/// Smaller packet of the two bulk endpoints (bytes), from the descriptors in sysfs; empty if they are not there.
std::optional<int> bulk_packet_bytes(const Machine& machine, const UsbBoardEntry& board) {
    const std::string folder = std::string(kUsbDevices) + board.port + "/";
    for (const std::string& interface : machine.names(folder)) {
        // Interface 0 of the active configuration, whatever its number: "1-2:1.0".
        if (!interface.starts_with(board.port + ":") || !interface.ends_with(".0")) {
            continue;
        }
        std::optional<int> smallest;
        for (const char* const endpoint : {"/ep_02", "/ep_86"}) {
            const std::string size = machine.line(folder + interface + endpoint + "/wMaxPacketSize").value_or("");
            int bytes = 0;
            const auto [end, error] = std::from_chars(size.data(), size.data() + size.size(), bytes, 16);
            if (error != std::errc{} || end != size.data() + size.size()) {
                return std::nullopt;
            }
            smallest = std::min(smallest.value_or(bytes), bytes);
        }
        return smallest;
    }
    return std::nullopt;
}

bool has_udev_rule(const Machine& machine) {
    for (const char* const folder : {"/etc", "/usr/local/lib", "/usr/lib", "/lib"}) {
        if (machine.has(std::string(folder) + "/udev/rules.d/70-spidar-g6.rules")) {
            return true;
        }
    }
    return false;
}

}  // namespace

std::vector<UsbBoardEntry> boards(const CheckContext& context) {
    std::vector<UsbBoardEntry> found;
    if (!context.settings.usb) {
        return found;
    }
    for (const std::string& port : context.machine.names("/sys/bus/usb/devices")) {
        const std::string folder = std::string(kUsbDevices) + port + "/";
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

std::string no_board(const CheckContext& context) {
    return context.settings.usb ? "no " + device::to_string(context.settings.usb->id) + " is plugged in"
                                : "the board of this device is on a serial line";
}

Finding check_usb_access(const CheckContext& context) {
    Finding finding{
        "usb_access", Verdict::Unknown, no_board(context), "without write access rt-core cannot open the board", {}};
    for (const UsbBoardEntry& board : boards(context)) {
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
                    no_board(context),
                    "a board that the kernel suspends between transfers takes milliseconds to wake up",
                    {}};
    for (const UsbBoardEntry& board : boards(context)) {
        const std::string file = std::string(kUsbDevices) + board.port + "/power/control";
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

Finding check_usb_link(const CheckContext& context) {
    Finding finding{
        "usb_link",
        Verdict::Unknown,
        no_board(context),
        "at 12 Mbit/s the 512 bytes of a command take 0.4 ms on the cable, in packets of 64 bytes, and so do those of "
        "an answer; at 480 Mbit/s they take 10 us",
        {}};
    for (const UsbBoardEntry& board : boards(context)) {
        const std::string folder = std::string(kUsbDevices) + board.port + "/";
        const std::optional<std::int64_t> speed = context.machine.number(folder + "speed");
        const std::optional<int> packet = bulk_packet_bytes(context.machine, board);
        if (!speed || !packet) {
            finding.verdict = Verdict::Unknown;
            finding.found = "the kernel does not say how the board at " + board.port + " is connected";
            return finding;
        }
        finding.found = "the board at " + board.port + " is connected at " + std::to_string(*speed) +
                        " Mbit/s, with bulk packets of " + std::to_string(*packet) + " bytes";
        finding.verdict = *speed >= kHighSpeedMbit && *packet >= kHighSpeedPacket ? Verdict::Good : Verdict::Bad;
        if (finding.verdict == Verdict::Bad) {
            finding.remedy =
                "none from here: plug it into a port of the machine itself, without a hub, by a cable for "
                "USB 2.0 (480 Mbit/s)";
            return finding;
        }
    }
    return finding;
}

Finding check_period_budget(const CheckContext& context) {
    Finding finding{"period_budget",
                    Verdict::Unknown,
                    no_board(context),
                    "a period that does not hold its exchanges, wake-ups and computation misses deadlines",
                    {}};
    const DoctorSettings& settings = context.settings;
    PeriodDemand demand{.route = Route::Uart,
                        .baud = settings.baud,
                        .exchanges = settings.exchanges,
                        .packets = settings.packets,
                        .period_ns = settings.period_ns};
    if (settings.usb) {
        const std::vector<UsbBoardEntry> found = boards(context);
        if (found.empty()) {
            return finding;
        }
        // The root hub of the board's bus names its controller.
        const std::string folder = std::string(kUsbDevices) + found.front().port + "/";
        const std::int64_t bus = context.machine.number(folder + "busnum").value_or(0);
        const std::string controller = std::string(kUsbDevices) + "usb" + std::to_string(bus) + "/product";
        demand.route =
            context.machine.line(controller).value_or("") == device::kUsbipController ? Route::Usbip : Route::Usb;
        demand.awaits_second = false;
        demand.speed = bus_speed(context.machine.number(folder + "speed").value_or(0));
    }
    const PeriodBudget budget = budget_of(demand);
    finding.verdict = budget.verdict() == PeriodVerdict::Holds ? Verdict::Good : Verdict::Bad;
    finding.found = describe_parts(budget);
    if (finding.verdict == Verdict::Bad) {
        finding.why = describe_shortage(budget);
        finding.remedy = describe_remedies(budget);
    }
    return finding;
}

}  // namespace haptic::rt
