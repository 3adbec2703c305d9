#include "usbredir/usbredir_session.hpp"

#include <algorithm>
#include <utility>
#include <variant>

namespace haptic::device {
namespace {

using usbredir::Status;

// Standard requests that the protocol has messages for.
// @source Universal Serial Bus Specification 2.0, section 9.4.
constexpr SetupPacket set_configuration(std::uint8_t configuration) {
    return {.request_type = 0x00, .request = 9, .value = configuration};
}
constexpr SetupPacket get_configuration() {
    return {.request_type = 0x80, .request = 8, .length = 1};
}
constexpr SetupPacket set_interface(std::uint8_t interface, std::uint8_t setting) {
    return {.request_type = 0x01, .request = 11, .value = setting, .index = interface};
}
constexpr SetupPacket get_interface(std::uint8_t interface) {
    return {.request_type = 0x81, .request = 10, .index = interface, .length = 1};
}

Status status_of(TransferStatus status) noexcept {
    switch (status) {
        case TransferStatus::Ok:
        case TransferStatus::Short:  // is the guest's own business
            return Status::Ok;
        case TransferStatus::Stalled:
            return Status::Stall;
        case TransferStatus::Babble:
            return Status::Babble;
        case TransferStatus::Cancelled:
            return Status::Cancelled;
    }
    return Status::IoError;
}

/// The first byte; 0 without one.
std::uint8_t first_of(const std::vector<std::byte>& data) {
    return data.empty() ? std::uint8_t{0} : std::to_integer<std::uint8_t>(data.front());
}

}  // namespace

UsbredirSession::UsbredirSession(ServedUsbDevice& device, bool plugged) : device_(&device), plugged_(plugged) {
    device_->reconnect();
    usbredir::append_hello(output_, "haptic firmware-host " HAPTIC_VERSION);
}

void UsbredirSession::end(std::string reason) {
    reason_ = std::move(reason);
    link_ = Link::Absent;
    device_->reconnect();
}

void UsbredirSession::receive(std::span<const std::byte> bytes, std::int64_t now_ns) {
    input_.receive(bytes,
                   [&](std::span<const std::byte> rest) { return ended() ? rest.size() : handle(rest, now_ns); });
}

std::size_t UsbredirSession::handle(std::span<const std::byte> bytes, std::int64_t now_ns) {
    const auto result = link_ == Link::Greeting ? usbredir::decode_hello(bytes) : usbredir::decode(bytes);
    if (const auto* defect = std::get_if<usbredir::Defect>(&result)) {
        end("sent " + defect->what);
        return bytes.size();
    }
    const auto* decoded = std::get_if<usbredir::Decoded>(&result);
    if (decoded == nullptr) {
        return 0;
    }
    std::visit([&](const auto& message) { answer(message, decoded->data, now_ns); }, decoded->message);
    return decoded->bytes;
}

void UsbredirSession::set_plugged(bool plugged) {
    plugged_ = plugged;
    if (!plugged && link_ == Link::Connected) {
        // What was under way is lost; the guest ends it by itself.
        device_->reconnect();
        usbredir::append_device_disconnect(output_);
        link_ = Link::Disconnecting;
    }
    connect_if_possible();
}

void UsbredirSession::connect_if_possible() {
    if (plugged_ && link_ == Link::Absent && !ended()) {
        device_->reconnect();
        // The guest needs the endpoints before the device.
        usbredir::append_interface_info(output_, device_->model());
        usbredir::append_endpoint_info(output_, device_->model());
        usbredir::append_device_connect(output_, device_->model());
        link_ = Link::Connected;
    }
}

void UsbredirSession::complete_pending(std::int64_t now_ns) {
    if (connected()) {
        device_->complete_pending(now_ns);
    }
}

UsbredirSession::Answer UsbredirSession::control(const SetupPacket& setup) {
    if (!connected()) {
        return {};
    }
    UsbDeviceModel::ControlResult result = device_->control(setup);
    return {.status = result.stalled ? Status::Stall : Status::Ok, .data = std::move(result.data)};
}

void UsbredirSession::answer(const usbredir::Hello& hello, Data /*data*/, std::int64_t /*now_ns*/) {
    if ((hello.capabilities & usbredir::kCapabilities) != usbredir::kCapabilities) {
        end("is too old: it lacks capabilities of usbredir 0.6, as QEMU has since 1.6");
        return;
    }
    link_ = Link::Absent;
    connect_if_possible();
}

void UsbredirSession::answer(const usbredir::Reset& /*reset*/, Data /*data*/, std::int64_t /*now_ns*/) {
    if (connected()) {
        device_->reset_bus();
    }
}

void UsbredirSession::answer(const usbredir::SetConfiguration& request, Data /*data*/, std::int64_t now_ns) {
    const Answer result = control(set_configuration(request.configuration));
    // The guest learns the endpoints of the new configuration before it continues.
    usbredir::append_interface_info(output_, device_->model());
    usbredir::append_endpoint_info(output_, device_->model());
    usbredir::append_configuration_status(output_, request.id, result.status, device_->model().configuration());
    complete_pending(now_ns);
}

void UsbredirSession::answer(const usbredir::GetConfiguration& request, Data /*data*/, std::int64_t /*now_ns*/) {
    const Answer result = control(get_configuration());
    usbredir::append_configuration_status(output_, request.id, result.status, first_of(result.data));
}

void UsbredirSession::answer(const usbredir::SetAltSetting& request, Data /*data*/, std::int64_t now_ns) {
    const Answer result = control(set_interface(request.interface, request.setting));
    usbredir::append_alt_setting_status(output_, request.id, result.status, request.interface, request.setting);
    complete_pending(now_ns);
}

void UsbredirSession::answer(const usbredir::GetAltSetting& request, Data /*data*/, std::int64_t /*now_ns*/) {
    const Answer result = control(get_interface(request.interface));
    usbredir::append_alt_setting_status(output_, request.id, result.status, request.interface, first_of(result.data));
}

void UsbredirSession::answer(const usbredir::Cancel& cancel, Data /*data*/, std::int64_t /*now_ns*/) {
    // A transfer that is no longer pending has been answered already.
    if (device_->cancel(cancel.id)) {
        usbredir::append_bulk(output_, {.id = cancel.id, .endpoint = kEndpointIn}, Status::Cancelled, 0, {});
    }
}

void UsbredirSession::answer(const usbredir::DisconnectAck& /*ack*/, Data /*data*/, std::int64_t /*now_ns*/) {
    if (link_ != Link::Disconnecting) {
        end("acknowledged that the device is gone, which it was not");
        return;
    }
    link_ = Link::Absent;
    connect_if_possible();
}

void UsbredirSession::answer(const usbredir::Control& request, Data /*data*/, std::int64_t now_ns) {
    const Answer result = control(request.setup);
    const bool in = (request.endpoint & 0x80U) != 0;
    const std::size_t moved = in ? result.data.size() : result.status == Status::Ok ? request.setup.length : 0U;
    usbredir::append_control(output_, request, result.status, static_cast<std::uint16_t>(moved),
                             in ? Data(result.data) : Data());
    complete_pending(now_ns);
}

void UsbredirSession::answer(const usbredir::Bulk& request, Data data, std::int64_t now_ns) {
    if (!connected()) {
        usbredir::append_bulk(output_, request, Status::IoError, 0, {});
        return;
    }
    if ((request.endpoint & 0x80U) == 0) {
        const TransferStatus status = device_->send(request.endpoint, data, false, now_ns);
        usbredir::append_bulk(output_, request, status_of(status), status == TransferStatus::Ok ? request.length : 0,
                              {});
        complete_pending(now_ns);
        return;
    }
    const auto reply = [this, request](TransferStatus status, Data received) {
        usbredir::append_bulk(output_, request, status_of(status), static_cast<std::uint32_t>(received.size()),
                              received);
    };
    if (!device_->receive(request.endpoint, {.id = request.id, .length = request.length, .done = reply}, now_ns)) {
        end("left more than " + std::to_string(ServedUsbDevice::kMaxPending) + " transfers pending");
    }
}

}  // namespace haptic::device
