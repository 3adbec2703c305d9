#include "haptic/device/usb_discovery.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <system_error>

namespace haptic::device {
namespace {

constexpr const char* kDevices = "/sys/bus/usb/devices";

/// Number in a sysfs file; empty if the file disappeared with its device.
std::optional<unsigned> number_in(const std::filesystem::path& file, int base) {
    std::ifstream stream(file);
    std::string text;
    unsigned number = 0;
    if (!(stream >> text) || std::from_chars(text.data(), text.data() + text.size(), number, base).ec != std::errc{}) {
        return std::nullopt;
    }
    return number;
}

std::string first_line(const std::filesystem::path& file) {
    std::ifstream stream(file);
    std::string line;
    std::getline(stream, line);
    return line;
}

std::optional<UsbDevice> read_device(const std::filesystem::path& folder) {
    // Device directories have these four files; interface directories do not.
    const auto vendor = number_in(folder / "idVendor", 16);
    const auto product = number_in(folder / "idProduct", 16);
    const auto bus = number_in(folder / "busnum", 10);
    const auto number = number_in(folder / "devnum", 10);
    if (!vendor || !product || !bus || !number) {
        return std::nullopt;  // an interface ("1-2:1.0"), or a device being removed
    }
    std::array<char, 64> node{};
    std::snprintf(node.data(), node.size(), "/dev/bus/usb/%03u/%03u", *bus, *number);
    // The root hub of each bus names its controller.
    const std::filesystem::path root_hub = folder.parent_path() / ("usb" + std::to_string(*bus));
    return UsbDevice{{static_cast<std::uint16_t>(*vendor), static_cast<std::uint16_t>(*product)},
                     folder.filename().string(),
                     node.data(),
                     static_cast<int>(number_in(folder / "speed", 10).value_or(0)),
                     first_line(root_hub / "product") == kUsbipController};
}

std::optional<std::uint16_t> four_hex_digits(std::string_view text) {
    std::uint16_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, 16);
    if (text.size() != 4 || error != std::errc{} || end != text.data() + text.size()) {
        return std::nullopt;
    }
    return number;
}

bool is_at(const UsbDevice& device, const std::string& path) {
    return path.empty() || device.port == path || device.node == path;
}

}  // namespace

std::string to_string(UsbId id) {
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), "%04x:%04x", id.vendor, id.product);
    return text.data();
}

std::optional<UsbId> parse_usb_id(std::string_view text) {
    if (text.size() != 9 || text[4] != ':') {
        return std::nullopt;
    }
    const auto vendor = four_hex_digits(text.substr(0, 4));
    const auto product = four_hex_digits(text.substr(5));
    if (!vendor || !product) {
        return std::nullopt;
    }
    return UsbId{*vendor, *product};
}

std::optional<UsbId> usb_id_of(BoardKind kind) {
    switch (kind) {
        case BoardKind::Sh4:
            return UsbId{0x0cec, 0x0205};
        case BoardKind::Simple:
            return UsbId{0x0cec, 0x0203};
        case BoardKind::Uart:
            break;
    }
    return std::nullopt;
}

std::string to_string(const UsbDevice& device) {
    return to_string(device.id) + " at " + device.port + " (" + device.node.string() + ")";
}

std::vector<UsbDevice> list_usb_devices() {
    std::vector<UsbDevice> devices;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(kDevices, none)) {
        if (const auto device = read_device(entry.path())) {
            devices.push_back(*device);
        }
    }
    std::sort(devices.begin(), devices.end(), [](const UsbDevice& a, const UsbDevice& b) { return a.port < b.port; });
    return devices;
}

std::vector<UsbDevice> candidates(const std::vector<UsbDevice>& devices, const UsbSelection& selection) {
    std::vector<UsbDevice> fitting;
    std::copy_if(devices.begin(), devices.end(), std::back_inserter(fitting),
                 [&](const UsbDevice& device) { return device.id == selection.id && is_at(device, selection.path); });
    return fitting;
}

std::string describe_absence(const std::vector<UsbDevice>& devices, const UsbSelection& selection) {
    std::string text = "no USB device " + to_string(selection.id) +
                       (selection.path.empty() ? std::string() : " at " + selection.path) + ". ";
    if (devices.empty()) {
        return text + "This machine has no USB device at all: does its kernel support USB (" + kDevices + ")?";
    }
    text += "Connected devices:";
    for (const UsbDevice& device : devices) {
        text += "\n  " + to_string(device);
    }
    return text + "\nCheck power and cable of the device; device.usb_id and device.usb_path select another one";
}

}  // namespace haptic::device
