#include "usbredir/usbredir_protocol.hpp"

#include <algorithm>
#include <array>
#include <optional>

namespace haptic::device::usbredir {
namespace {

// Lengths in bytes: headers, and the part of fixed size of each type.
constexpr std::size_t kHelloHeader = 12;  // its id has 32 bits
constexpr std::size_t kHeader = 16;
constexpr std::size_t kVersionBytes = 64;
constexpr std::size_t kControlBytes = 10;
constexpr std::size_t kBulkBytes = 10;
constexpr std::size_t kMaxCapabilityWords = 16;  // we know one

constexpr std::size_t kEndpoints = 32;  // OUT 0 to 15, IN 0 to 15
constexpr std::size_t kInterfaces = 32;
constexpr std::uint8_t kControlType = 0;
constexpr std::uint8_t kBulkType = 2;
constexpr std::uint8_t kNoEndpoint = 255;
constexpr unsigned kDirectionIn = 0x80;

// Numbers of the speeds.
constexpr std::uint8_t kFullSpeed = 1;
constexpr std::uint8_t kHighSpeed = 2;

std::uint64_t load(std::span<const std::byte> bytes, std::size_t at, std::size_t size) noexcept {
    std::uint64_t value = 0;
    for (std::size_t i = size; i > 0; --i) {
        value = (value << 8U) | std::to_integer<std::uint64_t>(bytes[at + i - 1]);
    }
    return value;
}

std::uint8_t load8(std::span<const std::byte> bytes, std::size_t at) noexcept {
    return std::to_integer<std::uint8_t>(bytes[at]);
}

std::uint16_t load16(std::span<const std::byte> bytes, std::size_t at) noexcept {
    return static_cast<std::uint16_t>(load(bytes, at, 2));
}

std::uint32_t load32(std::span<const std::byte> bytes, std::size_t at) noexcept {
    return static_cast<std::uint32_t>(load(bytes, at, 4));
}

void put(std::vector<std::byte>& stream, std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) {
        stream.push_back(static_cast<std::byte>((value >> (8U * i)) & 0xFFU));
    }
}

void put8(std::vector<std::byte>& stream, std::uint8_t value) {
    put(stream, value, 1);
}

void put16(std::vector<std::byte>& stream, std::uint32_t value) {
    put(stream, value & 0xFFFFU, 2);
}

void put32(std::vector<std::byte>& stream, std::uint64_t value) {
    put(stream, value, 4);
}

void put_zeros(std::vector<std::byte>& stream, std::size_t count) {
    stream.insert(stream.end(), count, std::byte{0});
}

void put_header(std::vector<std::byte>& stream, Type type, std::size_t length, std::uint64_t id) {
    put32(stream, static_cast<std::uint32_t>(type));
    put32(stream, length);
    put(stream, id, 8);
}

/// Index of an endpoint in EndpointInfo.
constexpr std::size_t index_of(std::uint8_t endpoint) noexcept {
    return (endpoint & 0x0FU) | ((endpoint & kDirectionIn) >> 3U);
}

bool is_in(std::uint8_t endpoint) noexcept {
    return (endpoint & kDirectionIn) != 0;
}

/// Length of the fixed part of a message that a guest may send; empty for another type.
std::optional<std::size_t> fixed_bytes(std::uint32_t type) noexcept {
    switch (static_cast<Type>(type)) {
        case Type::Reset:
        case Type::GetConfiguration:
        case Type::Cancel:
        case Type::DisconnectAck:
            return 0;
        case Type::SetConfiguration:
        case Type::GetAltSetting:
            return 1;
        case Type::SetAltSetting:
            return 2;
        case Type::Control:
            return kControlBytes;
        case Type::Bulk:
            return kBulkBytes;
        default:
            return std::nullopt;
    }
}

/// The fixed part of a message of such a type, which is complete.
Message message_of(Type type, std::uint64_t id, std::span<const std::byte> fixed) {
    switch (type) {
        case Type::GetConfiguration:
            return GetConfiguration{.id = id};
        case Type::Cancel:
            return Cancel{.id = id};
        case Type::DisconnectAck:
            return DisconnectAck{};
        case Type::SetConfiguration:
            return SetConfiguration{.id = id, .configuration = load8(fixed, 0)};
        case Type::GetAltSetting:
            return GetAltSetting{.id = id, .interface = load8(fixed, 0)};
        case Type::SetAltSetting:
            return SetAltSetting{.id = id, .interface = load8(fixed, 0), .setting = load8(fixed, 1)};
        case Type::Control:
            // Endpoint, request, request type, status (of an answer), value, index, length.
            return Control{.id = id,
                           .endpoint = load8(fixed, 0),
                           .setup = {.request_type = load8(fixed, 2),
                                     .request = load8(fixed, 1),
                                     .value = load16(fixed, 4),
                                     .index = load16(fixed, 6),
                                     .length = load16(fixed, 8)}};
        case Type::Bulk:
            // Endpoint, status (of an answer), low half of the length, stream, high half of the length.
            return Bulk{.id = id,
                        .endpoint = load8(fixed, 0),
                        .length = load16(fixed, 2) | (std::uint32_t{load16(fixed, 8)} << 16U),
                        .stream = load32(fixed, 4)};
        default:
            return Reset{};
    }
}

/// Bytes of data that follow the fixed part.
std::size_t data_bytes(const Message& message) noexcept {
    if (const auto* control = std::get_if<Control>(&message)) {
        return is_in(control->endpoint) ? 0 : control->setup.length;
    }
    if (const auto* bulk = std::get_if<Bulk>(&message)) {
        return is_in(bulk->endpoint) ? 0 : bulk->length;
    }
    return 0;
}

}  // namespace

std::variant<Decoded, Incomplete, Defect> decode_hello(std::span<const std::byte> bytes) {
    if (bytes.size() < kHelloHeader) {
        return Incomplete{};
    }
    // The header's values are checked before waiting for what they announce.
    const std::size_t length = load32(bytes, 4);
    const std::size_t words = length / 4 - std::min(length / 4, kVersionBytes / 4);
    if (load32(bytes, 0) != static_cast<std::uint32_t>(Type::Hello) || length < kVersionBytes || length % 4 != 0 ||
        words > kMaxCapabilityWords) {
        return Defect{"something else than a hello of usbredir"};
    }
    if (bytes.size() < kHelloHeader + length) {
        return Incomplete{};
    }
    const std::uint32_t capabilities = words == 0 ? 0 : load32(bytes, kHelloHeader + kVersionBytes);
    return Decoded{.message = Hello{.capabilities = capabilities}, .bytes = kHelloHeader + length};
}

std::variant<Decoded, Incomplete, Defect> decode(std::span<const std::byte> bytes) {
    if (bytes.size() < kHeader) {
        return Incomplete{};
    }
    // A type that is unknown, belongs to the other side, or needs a capability or an endpoint that we do not have.
    const std::uint32_t type = load32(bytes, 0);
    const std::size_t length = load32(bytes, 4);
    const std::optional<std::size_t> fixed = fixed_bytes(type);
    if (!fixed) {
        return Defect{"a message of type " + std::to_string(type) + ", which this device has no use for"};
    }
    if (length < *fixed || length > *fixed + kLongestTransfer) {
        return Defect{"a message of type " + std::to_string(type) + " with " + std::to_string(length) + " bytes"};
    }
    if (bytes.size() < kHeader + *fixed) {
        return Incomplete{};
    }
    // The fixed part says how much data must follow.
    const Message message = message_of(static_cast<Type>(type), load(bytes, 8, 8), bytes.subspan(kHeader, *fixed));
    if (const auto* bulk = std::get_if<Bulk>(&message); bulk != nullptr && bulk->length > kLongestTransfer) {
        return Defect{"a transfer of more than 65536 bytes"};
    }
    const std::size_t data = data_bytes(message);
    if (length != *fixed + data) {
        return Defect{"a message of type " + std::to_string(type) + " with " + std::to_string(length) +
                      " bytes instead of " + std::to_string(*fixed + data)};
    }
    if (bytes.size() < kHeader + length) {
        return Incomplete{};
    }
    return Decoded{.message = message, .data = bytes.subspan(kHeader + *fixed, data), .bytes = kHeader + length};
}

void append_hello(std::vector<std::byte>& stream, std::string_view version) {
    put32(stream, static_cast<std::uint32_t>(Type::Hello));
    put32(stream, kVersionBytes + 4);
    put32(stream, 0);  // id
    // Text in a field of fixed size, padded with zeros.
    const std::string_view text = version.substr(0, kVersionBytes - 1);
    for (const char c : text) {
        put8(stream, static_cast<unsigned char>(c));
    }
    put_zeros(stream, kVersionBytes - text.size());
    put32(stream, kCapabilities);
}

void append_device_connect(std::vector<std::byte>& stream, const UsbDeviceModel& model) {
    const UsbIdentity& identity = model.identity();
    put_header(stream, Type::DeviceConnect, 10, 0);
    put8(stream, model.speed() == UsbSpeed::High ? kHighSpeed : kFullSpeed);
    put8(stream, kVendorSpecific);
    put8(stream, 0);  // subclass
    put8(stream, 0);  // protocol
    put16(stream, identity.vendor);
    put16(stream, identity.product);
    put16(stream, identity.release);
}

void append_device_disconnect(std::vector<std::byte>& stream) {
    put_header(stream, Type::DeviceDisconnect, 0, 0);
}

void append_interface_info(std::vector<std::byte>& stream, const UsbDeviceModel& model) {
    const bool configured = model.configuration() != 0;
    put_header(stream, Type::InterfaceInfo, 4 + 4 * kInterfaces, 0);
    put32(stream, configured ? 1 : 0);
    // Arrays of numbers, classes, subclasses and protocols; the only interface is number 0.
    put_zeros(stream, kInterfaces);
    put8(stream, configured ? kVendorSpecific : 0);
    put_zeros(stream, 3 * kInterfaces - 1);
}

void append_endpoint_info(std::vector<std::byte>& stream, const UsbDeviceModel& model) {
    std::array<std::uint8_t, kEndpoints> types{};
    std::array<std::uint16_t, kEndpoints> packet_bytes{};
    types.fill(kNoEndpoint);
    // Endpoint 0 in both directions, and those of the configuration.
    for (const std::uint8_t endpoint : {std::uint8_t{0x00}, std::uint8_t{0x80}}) {
        types[index_of(endpoint)] = kControlType;
        packet_bytes[index_of(endpoint)] = kControlPacketBytes;
    }
    if (model.configuration() != 0) {
        for (const std::uint8_t endpoint : {kEndpointOut, kEndpointIn}) {
            types[index_of(endpoint)] = kBulkType;
            packet_bytes[index_of(endpoint)] = bulk_packet_bytes(model.speed());
        }
    }
    // Arrays of types, intervals, interfaces and packet sizes.
    put_header(stream, Type::EndpointInfo, 5 * kEndpoints, 0);
    for (const std::uint8_t type : types) {
        put8(stream, type);
    }
    put_zeros(stream, 2 * kEndpoints);
    for (const std::uint16_t size : packet_bytes) {
        put16(stream, size);
    }
}

void append_configuration_status(std::vector<std::byte>& stream, std::uint64_t id, Status status,
                                 std::uint8_t configuration) {
    put_header(stream, Type::ConfigurationStatus, 2, id);
    put8(stream, static_cast<std::uint8_t>(status));
    put8(stream, configuration);
}

void append_alt_setting_status(std::vector<std::byte>& stream, std::uint64_t id, Status status, std::uint8_t interface,
                               std::uint8_t setting) {
    put_header(stream, Type::AltSettingStatus, 3, id);
    put8(stream, static_cast<std::uint8_t>(status));
    put8(stream, interface);
    put8(stream, setting);
}

void append_control(std::vector<std::byte>& stream, const Control& request, Status status, std::uint16_t length,
                    std::span<const std::byte> data) {
    put_header(stream, Type::Control, kControlBytes + data.size(), request.id);
    put8(stream, request.endpoint);
    put8(stream, request.setup.request);
    put8(stream, request.setup.request_type);
    put8(stream, static_cast<std::uint8_t>(status));
    put16(stream, request.setup.value);
    put16(stream, request.setup.index);
    put16(stream, length);
    stream.insert(stream.end(), data.begin(), data.end());
}

void append_bulk(std::vector<std::byte>& stream, const Bulk& request, Status status, std::uint32_t length,
                 std::span<const std::byte> data) {
    put_header(stream, Type::Bulk, kBulkBytes + data.size(), request.id);
    put8(stream, request.endpoint);
    put8(stream, static_cast<std::uint8_t>(status));
    put16(stream, length);
    put32(stream, request.stream);
    put16(stream, length >> 16U);
    stream.insert(stream.end(), data.begin(), data.end());
}

}  // namespace haptic::device::usbredir
