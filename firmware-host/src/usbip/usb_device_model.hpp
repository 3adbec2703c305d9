// The USB device that a board is: its descriptors and its answers on endpoint 0. Knows nothing of packets' meaning.
//
// One configuration, one vendor-specific interface without alternates, bulk OUT 0x02 and bulk IN 0x86 of 512 bytes, as
// the boards' host software uses them. Class codes, strings, release and power of the real boards are not known; here
// they say that the device is emulated.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <haptic/device/variant.hpp>

namespace haptic::device {

inline constexpr std::uint8_t kEndpointOut = 0x02;
inline constexpr std::uint8_t kEndpointIn = 0x86;
inline constexpr std::size_t kBulkPacketBytes = 512;

/// What tells one USB device from another.
struct UsbIdentity {
    std::uint16_t vendor = 0;
    std::uint16_t product = 0;
    std::uint16_t release = 0;   // binary-coded decimal
    std::string manufacturer{};  // these three ASCII, at most 126 characters
    std::string product_name{};
    std::string serial{};
};

/// Of a board with a USB plug. Throws std::invalid_argument for one without.
[[nodiscard]] UsbIdentity usb_identity(BoardKind kind);

/// The eight bytes that begin a control transfer.
struct SetupPacket {
    std::uint8_t request_type = 0;
    std::uint8_t request = 0;
    std::uint16_t value = 0;
    std::uint16_t index = 0;
    std::uint16_t length = 0;
};

/// Little-endian, as on the bus.
[[nodiscard]] SetupPacket decode_setup(std::span<const std::uint8_t, 8> bytes) noexcept;

class UsbDeviceModel {
  public:
    explicit UsbDeviceModel(UsbIdentity identity) : identity_(std::move(identity)) {}

    /// What a device is after it was plugged in and configured by the host that exports it.
    void reset() noexcept;

    struct ControlResult {
        bool stalled = false;           // the request is not one of this device's
        std::vector<std::byte> data{};  // at most SetupPacket::length bytes; empty where nothing goes in
    };
    /// Answers a request. Those that stall change nothing.
    [[nodiscard]] ControlResult control(const SetupPacket& setup);

    /// Whether a bulk endpoint takes transfers: the device is configured and the endpoint not halted.
    [[nodiscard]] bool usable(std::uint8_t endpoint) const noexcept;

    [[nodiscard]] std::vector<std::byte> device_descriptor() const;
    [[nodiscard]] static std::vector<std::byte> qualifier_descriptor();
    /// With interface and endpoints. At full speed, which this device is never used at, endpoints are of 64 bytes.
    enum class Speed : std::uint8_t { Full, High };
    [[nodiscard]] static std::vector<std::byte> configuration_descriptor(Speed speed);
    /// Language 0x0409; index 0 is the list of languages. Empty where there is none.
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
