// USB device model: the descriptors of a board and its replies to control requests on endpoint 0. It does not interpret
// the board's packets.
//
// One configuration; one vendor-specific interface without alternate settings; bulk OUT 0x02 and bulk IN 0x86, as the
// boards' host software expects, with packets of 512 bytes at high speed and of 64 at full speed. Class codes, strings,
// release and power of the real boards are unknown; the values here identify an emulated device.
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
inline constexpr std::uint16_t kControlPacketBytes = 64;  // of endpoint 0, at both speeds
inline constexpr std::uint8_t kVendorSpecific = 0xFF;     // class code of the device and its interface

/// Speed at which the device is connected: 12 or 480 Mbit/s.
enum class UsbSpeed : std::uint8_t { Full, High };

/// Longest packet of a bulk endpoint: 64 or 512 bytes.
[[nodiscard]] constexpr std::uint16_t bulk_packet_bytes(UsbSpeed speed) noexcept {
    return speed == UsbSpeed::High ? 512 : 64;
}

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
    explicit UsbDeviceModel(UsbIdentity identity, UsbSpeed speed = UsbSpeed::High)
        : identity_(std::move(identity)), speed_(speed) {}

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
    /// Configuration with its interface and endpoints: as connected (CONFIGURATION), or as it would be at the other
    /// speed (OTHER_SPEED_CONFIGURATION).
    enum class Configuration : std::uint8_t { Current = 2, OtherSpeed = 7 };
    [[nodiscard]] std::vector<std::byte> configuration_descriptor(Configuration which) const;
    /// Index 0: the list of languages, only 0x0409. Empty if there is no such string.
    [[nodiscard]] std::vector<std::byte> string_descriptor(std::uint8_t index) const;

    [[nodiscard]] const UsbIdentity& identity() const noexcept { return identity_; }
    [[nodiscard]] UsbSpeed speed() const noexcept { return speed_; }
    /// Value of the selected configuration; 0: none.
    [[nodiscard]] std::uint8_t configuration() const noexcept { return configuration_; }

  private:
    [[nodiscard]] ControlResult control_device(const SetupPacket& setup);
    [[nodiscard]] ControlResult control_interface(const SetupPacket& setup);
    [[nodiscard]] ControlResult control_endpoint(const SetupPacket& setup);
    [[nodiscard]] ControlResult descriptor(const SetupPacket& setup) const;
    [[nodiscard]] bool* halt_of(std::uint16_t endpoint) noexcept;

    UsbIdentity identity_;
    UsbSpeed speed_;
    std::uint8_t configuration_ = 1;
    bool out_halted_ = false;
    bool in_halted_ = false;
};

}  // namespace haptic::device
