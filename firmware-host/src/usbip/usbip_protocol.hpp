// USB/IP 1.1.1 messages, server side: encoding and decoding, without state or sockets.
//
// A connection starts with one operation. OP_REQ_DEVLIST returns the exported devices; OP_REQ_IMPORT attaches one
// device to this connection. After an import the client sends USBIP_CMD_SUBMIT (one transfer, followed by its data if
// OUT) and USBIP_CMD_UNLINK (cancel one), each with a header of 48 bytes. All integers are big-endian, except the 8
// bytes of a control transfer's setup packet, which are in bus order.
// @source Linux kernel documentation, usb/usbip_protocol
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace haptic::device::usbip {

inline constexpr std::uint16_t kVersion = 0x0111;

// Length of each message or of its fixed part, bytes.
inline constexpr std::size_t kOperationBytes = 8;
inline constexpr std::size_t kBusIdBytes = 32;
inline constexpr std::size_t kDeviceBytes = 312;
inline constexpr std::size_t kUrbBytes = 48;

/// Longest accepted transfer, bytes. usbfs sends at most 16 KiB at a time.
inline constexpr std::uint32_t kLongestTransfer = 65536;

inline constexpr std::uint16_t kRequestDeviceList = 0x8005;
inline constexpr std::uint16_t kReplyDeviceList = 0x0005;
inline constexpr std::uint16_t kRequestImport = 0x8003;
inline constexpr std::uint16_t kReplyImport = 0x0003;

enum class OperationStatus : std::uint32_t { Ok = 0, Refused = 1, Busy = 2, NoDevice = 4 };

struct OperationHeader {
    std::uint16_t version = 0;
    std::uint16_t code = 0;
    std::uint32_t status = 0;
};

/// Description of a device for clients, without its interfaces.
struct DeviceRecord {
    std::string path;    // at most 255 bytes
    std::string bus_id;  // at most 31 bytes
    std::uint32_t bus = 0;
    std::uint32_t address = 0;
    std::uint32_t speed = 0;  // 3: high
    std::uint16_t vendor = 0;
    std::uint16_t product = 0;
    std::uint16_t release = 0;
    std::uint8_t device_class = 0;
    std::uint8_t device_subclass = 0;
    std::uint8_t device_protocol = 0;
    std::uint8_t configuration = 0;
    std::uint8_t configurations = 0;
};

struct InterfaceRecord {
    std::uint8_t interface_class = 0;
    std::uint8_t subclass = 0;
    std::uint8_t protocol = 0;
};

/// Identifier of a device in a client's transfers.
[[nodiscard]] constexpr std::uint32_t device_id(const DeviceRecord& record) noexcept {
    return (record.bus << 16U) | record.address;
}

inline constexpr std::uint32_t kShortIsError = 0x0001;  // URB_SHORT_NOT_OK: an IN transfer shorter than requested fails
inline constexpr std::uint32_t kZeroPacket =
    0x0040;  // URB_ZERO_PACKET: end an OUT transfer of whole packets with an empty one

/// USBIP_CMD_SUBMIT. The data of an OUT transfer follows its header.
struct Submit {
    std::uint32_t sequence = 0;
    std::uint32_t device = 0;
    bool in = false;
    std::uint8_t endpoint = 0;  // 0..15, without the direction
    std::uint32_t flags = 0;
    std::uint32_t length = 0;         // at most kLongestTransfer
    std::uint32_t packets_field = 0;  // 0 or 0xffffffff, both mean "not isochronous"; repeated in the reply
    std::array<std::uint8_t, 8> setup{};
};

/// USBIP_CMD_UNLINK.
struct Unlink {
    std::uint32_t sequence = 0;
    std::uint32_t device = 0;
    std::uint32_t target = 0;  // sequence number of the transfer to cancel
};

/// Why a header is invalid. The position of the next header is then unknown and the stream is lost.
enum class Defect : std::uint8_t { Command, Direction, Endpoint, Length, Isochronous };

[[nodiscard]] std::string_view describe(Defect defect) noexcept;

[[nodiscard]] OperationHeader decode_operation(std::span<const std::byte, kOperationBytes> bytes) noexcept;
/// Text up to the first zero byte.
[[nodiscard]] std::string decode_bus_id(std::span<const std::byte, kBusIdBytes> bytes);
[[nodiscard]] std::variant<Submit, Unlink, Defect> decode_urb(std::span<const std::byte, kUrbBytes> bytes) noexcept;

// Result of a transfer: negative Linux errno values, as the protocol defines.
inline constexpr std::int32_t kOk = 0;
inline constexpr std::int32_t kStalled = -32;           // EPIPE
inline constexpr std::int32_t kBabble = -75;            // EOVERFLOW: the device sent more than requested
inline constexpr std::int32_t kConnectionReset = -104;  // ECONNRESET: cancelled
inline constexpr std::int32_t kShortTransfer = -121;    // EREMOTEIO: shorter than requested, with kShortIsError

// Each function appends one message to a stream.
void append_device_list(std::vector<std::byte>& stream, std::span<const DeviceRecord> devices,
                        std::span<const InterfaceRecord> interfaces_of_each);
/// The record is sent only with Ok.
void append_import(std::vector<std::byte>& stream, OperationStatus status, const DeviceRecord& device,
                   std::size_t interfaces);
/// Reply to an OUT transfer, with the number of bytes accepted.
void append_out_reply(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status, std::uint32_t taken);
/// Reply to an IN transfer, with its data.
void append_in_reply(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status,
                     std::span<const std::byte> data);
void append_unlink_reply(std::vector<std::byte>& stream, const Unlink& unlink, std::int32_t status);

}  // namespace haptic::device::usbip
