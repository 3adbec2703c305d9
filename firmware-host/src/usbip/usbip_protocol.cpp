#include "usbip/usbip_protocol.hpp"

#include <algorithm>

namespace haptic::device::usbip {
namespace {

constexpr std::uint32_t kCommandSubmit = 1;
constexpr std::uint32_t kCommandUnlink = 2;
constexpr std::uint32_t kReturnSubmit = 3;
constexpr std::uint32_t kReturnUnlink = 4;

constexpr std::uint32_t kDirectionIn = 1;
constexpr std::uint32_t kHighestEndpoint = 15;
constexpr std::uint32_t kNotIsochronous = 0xFFFFFFFF;

constexpr std::size_t kPathBytes = 256;
constexpr std::size_t kReturnPadding = 8;
constexpr std::size_t kUnlinkPadding = 24;

std::uint32_t load32(std::span<const std::byte> bytes, std::size_t at) noexcept {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        value = (value << 8U) | std::to_integer<std::uint32_t>(bytes[at + i]);
    }
    return value;
}

std::uint16_t load16(std::span<const std::byte> bytes, std::size_t at) noexcept {
    const auto high = std::to_integer<std::uint32_t>(bytes[at]);
    const auto low = std::to_integer<std::uint32_t>(bytes[at + 1]);
    return static_cast<std::uint16_t>((high << 8U) | low);
}

void put8(std::vector<std::byte>& stream, std::uint32_t value) {
    stream.push_back(static_cast<std::byte>(value & 0xFFU));
}

void put16(std::vector<std::byte>& stream, std::uint32_t value) {
    put8(stream, value >> 8U);
    put8(stream, value);
}

void put32(std::vector<std::byte>& stream, std::uint32_t value) {
    put16(stream, value >> 16U);
    put16(stream, value);
}

void put_zeros(std::vector<std::byte>& stream, std::size_t count) {
    stream.insert(stream.end(), count, std::byte{0});
}

/// Text in a field of fixed size, zero-padded and zero-terminated.
void put_text(std::vector<std::byte>& stream, std::string_view text, std::size_t size) {
    const std::string_view kept = text.substr(0, size - 1);
    for (const char c : kept) {
        put8(stream, static_cast<unsigned char>(c));
    }
    put_zeros(stream, size - kept.size());
}

void put_operation(std::vector<std::byte>& stream, std::uint16_t code, OperationStatus status) {
    put16(stream, kVersion);
    put16(stream, code);
    put32(stream, static_cast<std::uint32_t>(status));
}

void put_device(std::vector<std::byte>& stream, const DeviceRecord& device, std::size_t interfaces) {
    put_text(stream, device.path, kPathBytes);
    put_text(stream, device.bus_id, kBusIdBytes);
    put32(stream, device.bus);
    put32(stream, device.address);
    put32(stream, device.speed);
    put16(stream, device.vendor);
    put16(stream, device.product);
    put16(stream, device.release);
    put8(stream, device.device_class);
    put8(stream, device.device_subclass);
    put8(stream, device.device_protocol);
    put8(stream, device.configuration);
    put8(stream, device.configurations);
    put8(stream, static_cast<std::uint32_t>(interfaces));
}

/// Header of a reply. Device, direction and endpoint are zero: clients match replies by sequence number.
void put_basic(std::vector<std::byte>& stream, std::uint32_t command, std::uint32_t sequence) {
    put32(stream, command);
    put32(stream, sequence);
    put_zeros(stream, 12);
}

void put_return(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status, std::uint32_t length) {
    put_basic(stream, kReturnSubmit, submit.sequence);
    put32(stream, static_cast<std::uint32_t>(status));
    put32(stream, length);
    put32(stream, 0);  // start frame
    put32(stream, submit.packets_field);
    put32(stream, 0);  // isochronous errors
    put_zeros(stream, kReturnPadding);
}

}  // namespace

std::string_view describe(Defect defect) noexcept {
    switch (defect) {
        case Defect::Command:
            return "a command that is neither SUBMIT nor UNLINK";
        case Defect::Direction:
            return "a direction that is neither OUT nor IN";
        case Defect::Endpoint:
            return "an endpoint above 15";
        case Defect::Length:
            return "a transfer of more than 65536 bytes";
        case Defect::Isochronous:
            return "an isochronous transfer, which the device does not support";
    }
    return "an unknown defect";
}

OperationHeader decode_operation(std::span<const std::byte, kOperationBytes> bytes) noexcept {
    return {.version = load16(bytes, 0), .code = load16(bytes, 2), .status = load32(bytes, 4)};
}

std::string decode_bus_id(std::span<const std::byte, kBusIdBytes> bytes) {
    std::string text;
    for (const std::byte byte : bytes) {
        if (byte == std::byte{0}) {
            break;
        }
        text.push_back(static_cast<char>(byte));
    }
    return text;
}

std::variant<Submit, Unlink, Defect> decode_urb(std::span<const std::byte, kUrbBytes> bytes) noexcept {
    // Common header: command, sequence, device, direction, endpoint.
    const std::uint32_t command = load32(bytes, 0);
    const std::uint32_t sequence = load32(bytes, 4);
    const std::uint32_t device = load32(bytes, 8);
    const std::uint32_t direction = load32(bytes, 12);
    const std::uint32_t endpoint = load32(bytes, 16);
    if (command == kCommandUnlink) {
        return Unlink{.sequence = sequence, .device = device, .target = load32(bytes, 20)};
    }
    if (command != kCommandSubmit) {
        return Defect::Command;
    }
    // SUBMIT: validate every field that later code depends on.
    if (direction > kDirectionIn) {
        return Defect::Direction;
    }
    if (endpoint > kHighestEndpoint) {
        return Defect::Endpoint;
    }
    Submit submit{
        .sequence = sequence,
        .device = device,
        .in = direction == kDirectionIn,
        .endpoint = static_cast<std::uint8_t>(endpoint),
        .flags = load32(bytes, 20),
        .length = load32(bytes, 24),  // signed in the protocol: as unsigned, a negative length exceeds the limit
        .packets_field = load32(bytes, 32)};
    if (submit.length > kLongestTransfer) {
        return Defect::Length;
    }
    if (submit.packets_field != 0 && submit.packets_field != kNotIsochronous) {
        return Defect::Isochronous;
    }
    for (std::size_t i = 0; i < submit.setup.size(); ++i) {
        submit.setup[i] = std::to_integer<std::uint8_t>(bytes[40 + i]);
    }
    return submit;
}

void append_device_list(std::vector<std::byte>& stream, std::span<const DeviceRecord> devices,
                        std::span<const InterfaceRecord> interfaces_of_each) {
    put_operation(stream, kReplyDeviceList, OperationStatus::Ok);
    put32(stream, static_cast<std::uint32_t>(devices.size()));
    for (const DeviceRecord& device : devices) {
        put_device(stream, device, interfaces_of_each.size());
        for (const InterfaceRecord& interface : interfaces_of_each) {
            put8(stream, interface.interface_class);
            put8(stream, interface.subclass);
            put8(stream, interface.protocol);
            put8(stream, 0);
        }
    }
}

void append_import(std::vector<std::byte>& stream, OperationStatus status, const DeviceRecord& device,
                   std::size_t interfaces) {
    put_operation(stream, kReplyImport, status);
    if (status == OperationStatus::Ok) {
        put_device(stream, device, interfaces);
    }
}

void append_out_reply(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status, std::uint32_t taken) {
    put_return(stream, submit, status, taken);
}

void append_in_reply(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status,
                     std::span<const std::byte> data) {
    put_return(stream, submit, status, static_cast<std::uint32_t>(data.size()));
    stream.insert(stream.end(), data.begin(), data.end());
}

void append_unlink_reply(std::vector<std::byte>& stream, const Unlink& unlink, std::int32_t status) {
    put_basic(stream, kReturnUnlink, unlink.sequence);
    put32(stream, static_cast<std::uint32_t>(status));
    put_zeros(stream, kUnlinkPadding);
}

}  // namespace haptic::device::usbip
