#include "served/usb_device_model.hpp"

#include <algorithm>
#include <stdexcept>

namespace haptic::device {
namespace {

// USB 2.0 specification, chapter 9: request fields (9.3), request codes (9.4), descriptor types (9.5).
constexpr unsigned kDirectionIn = 0x80;
constexpr unsigned kTypeMask = 0x60;  // 0: standard
constexpr unsigned kRecipientMask = 0x1F;
constexpr unsigned kRecipientDevice = 0;
constexpr unsigned kRecipientInterface = 1;
constexpr unsigned kRecipientEndpoint = 2;

constexpr std::uint8_t kGetStatus = 0;
constexpr std::uint8_t kClearFeature = 1;
constexpr std::uint8_t kSetFeature = 3;
constexpr std::uint8_t kSetAddress = 5;
constexpr std::uint8_t kGetDescriptor = 6;
constexpr std::uint8_t kGetConfiguration = 8;
constexpr std::uint8_t kSetConfiguration = 9;
constexpr std::uint8_t kGetInterface = 10;
constexpr std::uint8_t kSetInterface = 11;

constexpr std::uint8_t kDevice = 1;
constexpr std::uint8_t kConfiguration = 2;
constexpr std::uint8_t kString = 3;
constexpr std::uint8_t kInterface = 4;
constexpr std::uint8_t kEndpoint = 5;
constexpr std::uint8_t kQualifier = 6;
constexpr std::uint8_t kOtherSpeed = 7;

constexpr std::uint16_t kHaltFeature = 0;
constexpr std::uint8_t kSelfPowered = 0xC0;  // the motors need more power than the bus supplies
constexpr std::uint8_t kHalfMilliamperes = 50;
constexpr std::uint8_t kBulk = 2;
constexpr std::size_t kLongestString = 126;
constexpr std::uint16_t kUsEnglish = 0x0409;

using Bytes = std::vector<std::byte>;

void put8(Bytes& bytes, unsigned value) {
    bytes.push_back(static_cast<std::byte>(value & 0xFFU));
}

void put16(Bytes& bytes, unsigned value) {
    put8(bytes, value);
    put8(bytes, value >> 8U);
}

UsbDeviceModel::ControlResult stall() {
    return {.stalled = true};
}

UsbDeviceModel::ControlResult done() {
    return {};
}

UsbDeviceModel::ControlResult reply_with(Bytes data, std::uint16_t length) {
    data.resize(std::min<std::size_t>(data.size(), length));
    return {.stalled = false, .data = std::move(data)};
}

UsbDeviceModel::ControlResult status_word(unsigned word, std::uint16_t length) {
    Bytes data;
    put16(data, word);
    return reply_with(std::move(data), length);
}

void put_endpoint(Bytes& bytes, std::uint8_t address, std::uint16_t packet_bytes) {
    put8(bytes, 7);
    put8(bytes, kEndpoint);
    put8(bytes, address);
    put8(bytes, kBulk);
    put16(bytes, packet_bytes);
    put8(bytes, 0);  // bInterval of a high-speed bulk OUT endpoint: never NAKs
}

}  // namespace

UsbIdentity usb_identity(BoardKind kind) {
    switch (kind) {
        case BoardKind::Sh4:
            return {0x0CEC, 0x0205, 0x0001, "haptic firmware-host", "Spidar-G6 SH4 board (emulated)", "emulated"};
        case BoardKind::Simple:
            return {0x0CEC, 0x0203, 0x0001, "haptic firmware-host", "Spidar-G6 Simple board (emulated)", "emulated"};
        case BoardKind::Uart:
            break;
    }
    throw std::invalid_argument("this device geometry's board is on a serial line, not on USB: serve it with --tty");
}

SetupPacket decode_setup(std::span<const std::uint8_t, 8> bytes) noexcept {
    const auto word = [&](std::size_t at) {
        return static_cast<std::uint16_t>(static_cast<unsigned>(bytes[at]) |
                                          (static_cast<unsigned>(bytes[at + 1]) << 8U));
    };
    return {bytes[0], bytes[1], word(2), word(4), word(6)};
}

void UsbDeviceModel::reset() noexcept {
    configuration_ = 1;
    out_halted_ = false;
    in_halted_ = false;
}

bool UsbDeviceModel::usable(std::uint8_t endpoint) const noexcept {
    return configuration_ == 1 &&
           ((endpoint == kEndpointOut && !out_halted_) || (endpoint == kEndpointIn && !in_halted_));
}

Bytes UsbDeviceModel::device_descriptor() const {
    // USB 2.0, table 9-8.
    Bytes bytes;
    put8(bytes, 18);
    put8(bytes, kDevice);
    put16(bytes, 0x0200);  // USB 2.0
    put8(bytes, kVendorSpecific);
    put16(bytes, 0);  // subclass, protocol
    put8(bytes, kControlPacketBytes);
    put16(bytes, identity_.vendor);
    put16(bytes, identity_.product);
    put16(bytes, identity_.release);
    put8(bytes, 1);  // string index of the manufacturer
    put8(bytes, 2);  // of the product
    put8(bytes, 3);  // of the serial number
    put8(bytes, 1);  // number of configurations
    return bytes;
}

Bytes UsbDeviceModel::qualifier_descriptor() {
    // USB 2.0, table 9-9: the device at the other speed.
    Bytes bytes;
    put8(bytes, 10);
    put8(bytes, kQualifier);
    put16(bytes, 0x0200);
    put8(bytes, kVendorSpecific);
    put16(bytes, 0);
    put8(bytes, kControlPacketBytes);
    put8(bytes, 1);
    put8(bytes, 0);
    return bytes;
}

Bytes UsbDeviceModel::configuration_descriptor(Configuration which) const {
    const bool high = (speed_ == UsbSpeed::High) == (which == Configuration::Current);
    const std::uint16_t packet_bytes = bulk_packet_bytes(high ? UsbSpeed::High : UsbSpeed::Full);
    // Configuration descriptor, table 9-10. Its total length includes interface and endpoints.
    Bytes bytes;
    put8(bytes, 9);
    put8(bytes, static_cast<unsigned>(which));
    put16(bytes, 9 + 9 + 7 + 7);
    put8(bytes, 1);  // number of interfaces
    put8(bytes, 1);  // value of this configuration
    put8(bytes, 0);  // no string
    put8(bytes, kSelfPowered);
    put8(bytes, kHalfMilliamperes);

    // Interface descriptor, table 9-12.
    put8(bytes, 9);
    put8(bytes, kInterface);
    put8(bytes, 0);  // number
    put8(bytes, 0);  // alternate setting
    put8(bytes, 2);  // number of endpoints
    put8(bytes, kVendorSpecific);
    put16(bytes, 0);
    put8(bytes, 0);  // no string

    // Endpoint descriptors, table 9-13.
    put_endpoint(bytes, kEndpointOut, packet_bytes);
    put_endpoint(bytes, kEndpointIn, packet_bytes);
    return bytes;
}

Bytes UsbDeviceModel::string_descriptor(std::uint8_t index) const {
    Bytes bytes;
    const auto finished = [&] {
        bytes[0] = static_cast<std::byte>(bytes.size());
        return bytes;
    };
    put8(bytes, 0);
    put8(bytes, kString);
    if (index == 0) {
        put16(bytes, kUsEnglish);
        return finished();
    }
    const std::array<const std::string*, 3> texts = {&identity_.manufacturer, &identity_.product_name,
                                                     &identity_.serial};
    if (index > texts.size()) {
        return {};
    }
    // ASCII to UTF-16LE.
    for (const char c : std::string_view(*texts[index - 1U]).substr(0, kLongestString)) {
        put16(bytes, static_cast<unsigned char>(c));
    }
    return finished();
}

UsbDeviceModel::ControlResult UsbDeviceModel::descriptor(const SetupPacket& setup) const {
    const auto type = static_cast<std::uint8_t>(setup.value >> 8U);
    const auto index = static_cast<std::uint8_t>(setup.value & 0xFFU);
    if (type == kString) {
        Bytes text = string_descriptor(index);
        return text.empty() ? stall() : reply_with(std::move(text), setup.length);
    }
    if (index != 0) {
        return stall();
    }
    switch (type) {
        case kDevice:
            return reply_with(device_descriptor(), setup.length);
        case kConfiguration:
            return reply_with(configuration_descriptor(Configuration::Current), setup.length);
        case kQualifier:
            return reply_with(qualifier_descriptor(), setup.length);
        case kOtherSpeed:
            return reply_with(configuration_descriptor(Configuration::OtherSpeed), setup.length);
        default:
            return stall();
    }
}

UsbDeviceModel::ControlResult UsbDeviceModel::control_device(const SetupPacket& setup) {
    const bool in = (setup.request_type & kDirectionIn) != 0;
    if (in) {
        switch (setup.request) {
            case kGetStatus:
                return status_word(1, setup.length);  // self-powered, no remote wakeup
            case kGetDescriptor:
                return descriptor(setup);
            case kGetConfiguration:
                return reply_with({static_cast<std::byte>(configuration_)}, setup.length);
            default:
                return stall();
        }
    }
    switch (setup.request) {
        case kSetAddress:
            return done();  // the exporting host assigns addresses
        case kSetConfiguration:
            // 0: back to the address state; 1: the only configuration. Both clear the halts (9.1.1.5).
            if (setup.value > 1) {
                return stall();
            }
            reset();
            configuration_ = static_cast<std::uint8_t>(setup.value);
            return done();
        default:
            return stall();
    }
}

UsbDeviceModel::ControlResult UsbDeviceModel::control_interface(const SetupPacket& setup) {
    if (setup.index != 0 || configuration_ == 0) {
        return stall();
    }
    const bool in = (setup.request_type & kDirectionIn) != 0;
    if (in && setup.request == kGetStatus) {
        return status_word(0, setup.length);
    }
    if (in && setup.request == kGetInterface) {
        return reply_with({std::byte{0}}, setup.length);
    }
    // Selecting an alternate setting clears the halts of its endpoints (9.1.1.5).
    if (!in && setup.request == kSetInterface && setup.value == 0) {
        out_halted_ = false;
        in_halted_ = false;
        return done();
    }
    return stall();
}

bool* UsbDeviceModel::halt_of(std::uint16_t endpoint) noexcept {
    if (configuration_ == 0) {
        return nullptr;
    }
    return endpoint == kEndpointOut ? &out_halted_ : endpoint == kEndpointIn ? &in_halted_ : nullptr;
}

UsbDeviceModel::ControlResult UsbDeviceModel::control_endpoint(const SetupPacket& setup) {
    const bool in = (setup.request_type & kDirectionIn) != 0;
    if ((setup.index & ~kDirectionIn) == 0) {  // the control endpoint cannot be halted
        return in && setup.request == kGetStatus ? status_word(0, setup.length) : stall();
    }
    bool* halt = halt_of(setup.index);
    if (halt == nullptr) {
        return stall();
    }
    if (in && setup.request == kGetStatus) {
        return status_word(*halt ? 1 : 0, setup.length);
    }
    if (!in && setup.value == kHaltFeature && (setup.request == kClearFeature || setup.request == kSetFeature)) {
        *halt = setup.request == kSetFeature;
        return done();
    }
    return stall();
}

UsbDeviceModel::ControlResult UsbDeviceModel::control(const SetupPacket& setup) {
    if ((setup.request_type & kTypeMask) != 0) {
        return stall();  // no class or vendor requests
    }
    switch (setup.request_type & kRecipientMask) {
        case kRecipientDevice:
            return control_device(setup);
        case kRecipientInterface:
            return control_interface(setup);
        case kRecipientEndpoint:
            return control_endpoint(setup);
        default:
            return stall();
    }
}

}  // namespace haptic::device
