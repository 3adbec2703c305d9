// USB device model: the descriptors of a board and its replies to control requests on endpoint 0. It does not interpret
// the board's packets.
//
// One configuration; one vendor-specific interface without alternate settings; bulk OUT 0x02 and bulk IN 0x86 of 512
// bytes, as the boards' host software expects. Class codes, strings, release and power of the real boards are unknown;
// the values here identify an emulated device.
// @source Universal Serial Bus Specification 2.0, chapter 9.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "haptic/device/device_geometry.hpp"

namespace haptic::device {

inline constexpr std::uint8_t kEndpointOut = 0x02;
inline constexpr std::uint8_t kEndpointIn = 0x86;
inline constexpr std::size_t kBulkPacketBytes = 512;
inline constexpr std::uint8_t kVendorSpecific = 0xFF;  // class code of the device and its interface

/// Identifying fields of the descriptors.
struct UsbIdentity {
    std::uint16_t vendor = 0;
    std::uint16_t product = 0;
    std::uint16_t release = 0;   // binary-coded decimal
    std::string manufacturer{};  // ASCII, at most 126 characters, as the two below
    std::string product_name{};
    std::string serial{};
};

/// Identity of a USB board. Throws std::invalid_argument for a board without USB.
[[nodiscard]] UsbIdentity usb_identity(BoardKind kind);

/// Setup packet: the first eight bytes of a control transfer.
struct SetupPacket {
    std::uint8_t request_type = 0;
    std::uint8_t request = 0;
    std::uint16_t value = 0;
    std::uint16_t index = 0;
    std::uint16_t length = 0;
};

/// Decodes the little-endian bytes of the bus.
[[nodiscard]] SetupPacket decode_setup(std::span<const std::uint8_t, 8> bytes) noexcept;

class UsbDeviceModel {
  public:
    explicit UsbDeviceModel(UsbIdentity identity) : identity_(std::move(identity)) {}

    /// Returns to the state of a newly connected device that the exporting host has configured: configuration 1, no
    /// halts.
    void reset() noexcept;

    struct ControlResult {
        bool stalled = false;           // the request is not supported
        std::vector<std::byte> data{};  // at most SetupPacket::length bytes; empty without an IN data stage
    };
    /// Handles a request. A request that stalls has no effect.
    [[nodiscard]] ControlResult control(const SetupPacket& setup);

    /// Whether a bulk endpoint accepts transfers: the device is configured and the endpoint is not halted.
    [[nodiscard]] bool usable(std::uint8_t endpoint) const noexcept;

    [[nodiscard]] std::vector<std::byte> device_descriptor() const;
    [[nodiscard]] static std::vector<std::byte> qualifier_descriptor();
    /// Configuration with its interface and endpoints. At full speed, which is never used, endpoints have 64 bytes.
    enum class Speed : std::uint8_t { Full, High };
    [[nodiscard]] static std::vector<std::byte> configuration_descriptor(Speed speed);
    /// Index 0: the list of languages, only 0x0409. Empty if there is no such string.
    [[nodiscard]] std::vector<std::byte> string_descriptor(std::uint8_t index) const;

    [[nodiscard]] const UsbIdentity& identity() const noexcept { return identity_; }

  private:
    [[nodiscard]] ControlResult control_device(const SetupPacket& setup);
    [[nodiscard]] ControlResult control_interface(const SetupPacket& setup);
    [[nodiscard]] ControlResult control_endpoint(const SetupPacket& setup);
    [[nodiscard]] ControlResult descriptor(const SetupPacket& setup) const;
    [[nodiscard]] bool* halt_of(std::uint16_t endpoint) noexcept;

    UsbIdentity identity_;
    std::uint8_t configuration_ = 1;
    bool out_halted_ = false;
    bool in_halted_ = false;
};

}  // namespace haptic::device
