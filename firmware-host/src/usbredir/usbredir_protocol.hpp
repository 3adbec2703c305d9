// usbredir 0.7 messages, the side of the device: encoding and decoding, without state or sockets.
//
// QEMU's device `usb-redir` (the guest) and the program that has the device (the host) send each other messages: a
// header with type, length and id, a part of fixed size for each type, and for a transfer its data. Each side begins
// with a hello, which carries its version and capabilities. Transfers are answered with a message of the same type and
// id. All integers are little-endian. Capabilities change the layout of some messages; both sides must have those of
// kCapabilities, as QEMU has since 1.6, so that there is one layout.
// @source usbredir 0.13: docs/usb-redirection-protocol.md, usbredirproto.h
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "served/served_usb_device.hpp"

namespace haptic::device::usbredir {

/// Type of a message.
enum class Type : std::uint32_t {
    Hello = 0,
    DeviceConnect = 1,
    DeviceDisconnect = 2,
    Reset = 3,
    InterfaceInfo = 4,
    EndpointInfo = 5,
    SetConfiguration = 6,
    GetConfiguration = 7,
    ConfigurationStatus = 8,
    SetAltSetting = 9,
    GetAltSetting = 10,
    AltSettingStatus = 11,
    Cancel = 21,
    DisconnectAck = 24,
    Control = 100,
    Bulk = 101,
};

// Bits of the capabilities.
inline constexpr std::uint32_t kConnectDeviceVersion = 1U << 1U;  // release in DeviceConnect
inline constexpr std::uint32_t kDisconnectAck = 1U << 3U;         // DisconnectAck after DeviceDisconnect
inline constexpr std::uint32_t kPacketSizes = 1U << 4U;           // packet sizes in EndpointInfo
inline constexpr std::uint32_t kIds64 = 1U << 5U;                 // ids of 64 bits, except in the hello
inline constexpr std::uint32_t kBulkLength32 = 1U << 6U;          // lengths of 32 bits in Bulk
inline constexpr std::uint32_t kCapabilities =
    kConnectDeviceVersion | kDisconnectAck | kPacketSizes | kIds64 | kBulkLength32;

/// Longest accepted transfer, bytes. QEMU's xHCI hands over what the guest's driver submits: usbfs at most 16 KiB.
inline constexpr std::uint32_t kLongestTransfer = 65536;

/// Result of a request.
enum class Status : std::uint8_t {
    Ok = 0,
    Cancelled = 1,
    Invalid = 2,
    IoError = 3,
    Stall = 4,
    Timeout = 5,
    Babble = 6
};

// Messages of the guest.
struct Hello {
    std::uint32_t capabilities = 0;
};
struct Reset {};
struct SetConfiguration {
    std::uint64_t id = 0;
    std::uint8_t configuration = 0;
};
struct GetConfiguration {
    std::uint64_t id = 0;
};
struct SetAltSetting {
    std::uint64_t id = 0;
    std::uint8_t interface = 0;
    std::uint8_t setting = 0;
};
struct GetAltSetting {
    std::uint64_t id = 0;
    std::uint8_t interface = 0;
};
struct Cancel {
    std::uint64_t id = 0;  // of the transfer
};
struct DisconnectAck {};
/// A control transfer; `setup.length` bytes of data follow if the endpoint is OUT.
struct Control {
    std::uint64_t id = 0;
    std::uint8_t endpoint = 0;  // 0x00 or 0x80
    SetupPacket setup{};
};
/// A bulk transfer; `length` bytes of data follow if the endpoint is OUT.
struct Bulk {
    std::uint64_t id = 0;
    std::uint8_t endpoint = 0;  // with the direction
    std::uint32_t length = 0;   // at most kLongestTransfer
    std::uint32_t stream = 0;   // repeated in the answer
};
using Message = std::variant<Hello, Reset, SetConfiguration, GetConfiguration, SetAltSetting, GetAltSetting, Cancel,
                             DisconnectAck, Control, Bulk>;

/// A message and the bytes that it occupies.
struct Decoded {
    Message message;
    std::span<const std::byte> data{};  // of an OUT transfer
    std::size_t bytes = 0;
};

/// Not all bytes of the message are there yet.
struct Incomplete {};

/// Why a message is invalid. The stream is then lost.
struct Defect {
    std::string what;
};

/// Decodes the hello, which must be the first message: its header is shorter than the others.
[[nodiscard]] std::variant<Decoded, Incomplete, Defect> decode_hello(std::span<const std::byte> bytes);
/// Decodes the first message of the bytes, after the hello.
[[nodiscard]] std::variant<Decoded, Incomplete, Defect> decode(std::span<const std::byte> bytes);

// Each function appends one message to a stream.
void append_hello(std::vector<std::byte>& stream, std::string_view version);
void append_device_connect(std::vector<std::byte>& stream, const UsbDeviceModel& model);
void append_device_disconnect(std::vector<std::byte>& stream);
/// Interface and endpoints of the selected configuration. The guest needs both before the device is connected.
void append_interface_info(std::vector<std::byte>& stream, const UsbDeviceModel& model);
void append_endpoint_info(std::vector<std::byte>& stream, const UsbDeviceModel& model);
void append_configuration_status(std::vector<std::byte>& stream, std::uint64_t id, Status status,
                                 std::uint8_t configuration);
void append_alt_setting_status(std::vector<std::byte>& stream, std::uint64_t id, Status status, std::uint8_t interface,
                               std::uint8_t setting);
/// Answer to a control transfer: `length` bytes were moved; `data` only if they came from the device.
void append_control(std::vector<std::byte>& stream, const Control& request, Status status, std::uint16_t length,
                    std::span<const std::byte> data);
/// Answer to a bulk transfer.
void append_bulk(std::vector<std::byte>& stream, const Bulk& request, Status status, std::uint32_t length,
                 std::span<const std::byte> data);

}  // namespace haptic::device::usbredir
