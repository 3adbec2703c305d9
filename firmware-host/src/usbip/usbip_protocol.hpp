// Messages of USB/IP 1.1.1: the server's half, bytes to structures and back. No state, no sockets.
//
// A connection begins with one operation: OP_REQ_DEVLIST is answered with the devices that are exported, OP_REQ_IMPORT
// with the one that from now on belongs to this connection. After an import the client sends USBIP_CMD_SUBMIT (one
// transfer, with its data if that goes out) and USBIP_CMD_UNLINK (take one back), each a header of 48 bytes. All
// integers are big-endian, but for the 8 bytes of a control transfer's set-up packet, which are as on the bus.
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

// Bytes of each message, or of its fixed part.
inline constexpr std::size_t kOperationBytes = 8;
inline constexpr std::size_t kBusIdBytes = 32;
inline constexpr std::size_t kDeviceBytes = 312;
inline constexpr std::size_t kUrbBytes = 48;

/// The longest transfer that is taken, bytes. usbfs sends no more than 16 KiB at a time.
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

/// What a client is told about a device, apart from its interfaces.
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

/// What a client's transfers name a device by.
[[nodiscard]] constexpr std::uint32_t device_id(const DeviceRecord& record) noexcept {
    return (record.bus << 16U) | record.address;
}

inline constexpr std::uint32_t kShortIsError = 0x0001;  // transfer flag: an IN that is shorter than asked has failed
inline constexpr std::uint32_t kZeroPacket = 0x0040;    // transfer flag: end an OUT of whole packets with an empty one

/// USBIP_CMD_SUBMIT. The data of an OUT transfer follow its header.
struct Submit {
    std::uint32_t sequence = 0;
    std::uint32_t device = 0;
    bool in = false;
    std::uint8_t endpoint = 0;  // 0..15, without the direction
    std::uint32_t flags = 0;
    std::uint32_t length = 0;         // at most kLongestTransfer
    std::uint32_t packets_field = 0;  // 0 or 0xffffffff, both of which say "not isochronous"; the reply repeats it
    std::array<std::uint8_t, 8> setup{};
};

/// USBIP_CMD_UNLINK.
struct Unlink {
    std::uint32_t sequence = 0;
    std::uint32_t device = 0;
    std::uint32_t target = 0;  // the sequence of what is to be taken back
};

/// Why a header cannot be understood. After it the stream is lost: where the next header begins is not known.
enum class Defect : std::uint8_t { Command, Direction, Endpoint, Length, Isochronous };

[[nodiscard]] std::string_view describe(Defect defect) noexcept;

[[nodiscard]] OperationHeader decode_operation(std::span<const std::byte, kOperationBytes> bytes) noexcept;
/// The text before the first zero byte.
[[nodiscard]] std::string decode_bus_id(std::span<const std::byte, kBusIdBytes> bytes);
[[nodiscard]] std::variant<Submit, Unlink, Defect> decode_urb(std::span<const std::byte, kUrbBytes> bytes) noexcept;

// How a transfer ended: Linux' error numbers, as the protocol has them.
inline constexpr std::int32_t kOk = 0;
inline constexpr std::int32_t kStalled = -32;           // EPIPE
inline constexpr std::int32_t kBabble = -75;            // EOVERFLOW: the device sent more than there was room for
inline constexpr std::int32_t kConnectionReset = -104;  // ECONNRESET: taken back
inline constexpr std::int32_t kShortTransfer = -121;    // EREMOTEIO: shorter than asked, where that is an error

// Each appends one message to a stream.
void append_device_list(std::vector<std::byte>& stream, std::span<const DeviceRecord> devices,
                        std::span<const InterfaceRecord> interfaces_of_each);
/// The record is sent with Ok only.
void append_import(std::vector<std::byte>& stream, OperationStatus status, const DeviceRecord& device,
                   std::size_t interfaces);
/// The reply to an OUT transfer: how many bytes of it were taken.
void append_out_reply(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status, std::uint32_t taken);
/// The reply to an IN transfer, with its data.
void append_in_reply(std::vector<std::byte>& stream, const Submit& submit, std::int32_t status,
                     std::span<const std::byte> data);
void append_unlink_reply(std::vector<std::byte>& stream, const Unlink& unlink, std::int32_t status);

}  // namespace haptic::device::usbip
