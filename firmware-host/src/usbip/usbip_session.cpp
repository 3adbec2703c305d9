#include "usbip/usbip_session.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

namespace haptic::device {
namespace {

constexpr const char* kBusId = "1-1";
// Numbers of the speeds, as in Linux (enum usb_device_speed).
constexpr std::uint32_t kFullSpeed = 2;
constexpr std::uint32_t kHighSpeed = 3;
constexpr std::array<usbip::InterfaceRecord, 1> kInterfaces = {{{kVendorSpecific, 0, 0}}};
constexpr std::uint8_t kInputFlag = 0x80;
constexpr std::size_t kImportBytes = usbip::kOperationBytes + usbip::kBusIdBytes;

usbip::DeviceRecord record_of(const UsbDeviceModel& model) {
    const UsbIdentity& identity = model.identity();
    return {.path = "/sys/devices/haptic/firmware-host/usb1/1-1",
            .bus_id = kBusId,
            .bus = 1,
            .address = 2,
            .speed = model.speed() == UsbSpeed::High ? kHighSpeed : kFullSpeed,
            .vendor = identity.vendor,
            .product = identity.product,
            .release = identity.release,
            .device_class = kVendorSpecific,
            .configuration = 1,
            .configurations = 1};
}

std::int32_t status_of(TransferStatus status) noexcept {
    switch (status) {
        case TransferStatus::Ok:
            return usbip::kOk;
        case TransferStatus::Stalled:
            return usbip::kStalled;
        case TransferStatus::Babble:
            return usbip::kBabble;
        case TransferStatus::Short:
            return usbip::kShortTransfer;
        case TransferStatus::Cancelled:
            return usbip::kConnectionReset;
    }
    return usbip::kStalled;
}

/// Quotes text from a client; unprintable characters become '?'.
std::string quoted(const std::string& text) {
    std::string shown = "'";
    for (const char c : text) {
        shown.push_back(c >= ' ' && c <= '~' ? c : '?');
    }
    return shown + "'";
}

}  // namespace

UsbipExport::UsbipExport(BoardKind kind, Firmware& firmware, UsbSpeed speed)
    : device_(kind, firmware, speed), record_(record_of(device_.model())) {}

UsbipSession::~UsbipSession() {
    release_device();
}

void UsbipSession::release_device() {
    if (owns_device()) {
        exported_->device_.reconnect();  // discards what is pending
        exported_->owner_ = nullptr;
    }
}

void UsbipSession::end(std::string reason) {
    reason_ = std::move(reason);
    ended_ = true;
    release_device();
}

void UsbipSession::drop(std::string reason) {
    output_.clear();
    end(std::move(reason));
}

void UsbipSession::receive(std::span<const std::byte> bytes, std::int64_t now_ns) {
    input_.receive(bytes, [&](std::span<const std::byte> rest) { return ended_ ? rest.size() : handle(rest, now_ns); });
}

std::size_t UsbipSession::handle(std::span<const std::byte> bytes, std::int64_t now_ns) {
    return owns_device() ? handle_urb(bytes, now_ns) : handle_operation(bytes);
}

std::size_t UsbipSession::handle_operation(std::span<const std::byte> bytes) {
    if (bytes.size() < usbip::kOperationBytes) {
        return 0;
    }
    const usbip::OperationHeader header = usbip::decode_operation(bytes.first<usbip::kOperationBytes>());
    if (header.version != usbip::kVersion) {
        end("not USB/IP version 1.1.1");
        return bytes.size();
    }
    // List: one reply, then the connection ends.
    if (header.code == usbip::kRequestDeviceList) {
        const bool available =
            exported_->plugged && exported_->owner_ == nullptr;  // a device in use cannot be imported
        usbip::append_device_list(output_, std::span(&exported_->record_, available ? 1U : 0U), kInterfaces);
        end("");
        return bytes.size();
    }
    // Import: the bus id follows the header; from then on the connection carries URBs.
    if (header.code != usbip::kRequestImport) {
        end("an operation other than list or import");
        return bytes.size();
    }
    if (bytes.size() < kImportBytes) {
        return 0;
    }
    import(usbip::decode_bus_id(bytes.subspan<usbip::kOperationBytes, usbip::kBusIdBytes>()));
    return kImportBytes;
}

void UsbipSession::import(const std::string& bus_id) {
    using usbip::OperationStatus;
    const usbip::DeviceRecord& record = exported_->record_;
    // A refusal is a reply with a status, and ends the connection.
    if (!exported_->plugged || bus_id != record.bus_id) {
        usbip::append_import(output_, OperationStatus::NoDevice, record, 0);
        end("asked for " + quoted(bus_id) + ", which is not exported");
        return;
    }
    // A device has one client at a time.
    if (exported_->owner_ != nullptr) {
        usbip::append_import(output_, OperationStatus::Busy, record, 0);
        end("refused: another client has the device");
        return;
    }
    // Grant: the client sees a newly connected device.
    exported_->owner_ = this;
    exported_->device_.reconnect();
    usbip::append_import(output_, OperationStatus::Ok, record, kInterfaces.size());
}

std::size_t UsbipSession::handle_urb(std::span<const std::byte> bytes, std::int64_t now_ns) {
    if (bytes.size() < usbip::kUrbBytes) {
        return 0;
    }
    // Every message begins with a header of fixed size: defect, unlink or submit.
    const auto message = usbip::decode_urb(bytes.first<usbip::kUrbBytes>());
    if (const auto* defect = std::get_if<usbip::Defect>(&message)) {
        end("sent " + std::string(usbip::describe(*defect)));
        return bytes.size();
    }
    if (const auto* unlinked = std::get_if<usbip::Unlink>(&message)) {
        unlink(*unlinked);
        return usbip::kUrbBytes;
    }
    // A transfer for the imported device.
    const auto& submit = std::get<usbip::Submit>(message);
    if (submit.device != usbip::device_id(exported_->record_)) {
        end("sent a transfer to a device that it has not imported");
        return bytes.size();
    }
    // The data of an OUT transfer follows the header: wait until all of it has arrived.
    const std::size_t total = usbip::kUrbBytes + (submit.in ? 0 : submit.length);
    if (bytes.size() < total) {
        return 0;
    }
    // Endpoint 0 is the control endpoint; the others are bulk endpoints.
    const std::span<const std::byte> data = bytes.subspan(usbip::kUrbBytes, total - usbip::kUrbBytes);
    if (submit.endpoint == 0) {
        submit_control(submit, now_ns);
    } else if (submit.in) {
        submit_in(submit, now_ns);
    } else {
        submit_out(submit, data, now_ns);
    }
    return total;
}

void UsbipSession::submit_control(const usbip::Submit& submit, std::int64_t now_ns) {
    // The device answers; a request that it does not know stalls the endpoint.
    const UsbDeviceModel::ControlResult result = exported_->device_.control(decode_setup(submit.setup));
    const std::int32_t status = result.stalled ? usbip::kStalled : usbip::kOk;
    if (submit.in) {
        // A reply is cut to the length that the client asked for.
        const std::size_t count = std::min<std::size_t>(result.data.size(), submit.length);
        usbip::append_in_reply(output_, submit, status, std::span(result.data).first(count));
    } else {
        usbip::append_out_reply(output_, submit, status, result.stalled ? 0 : submit.length);
    }
    complete_pending(now_ns);
}

void UsbipSession::submit_out(const usbip::Submit& submit, std::span<const std::byte> data, std::int64_t now_ns) {
    const TransferStatus status =
        exported_->device_.send(submit.endpoint, data, (submit.flags & usbip::kZeroPacket) != 0, now_ns);
    usbip::append_out_reply(output_, submit, status_of(status), status == TransferStatus::Ok ? submit.length : 0);
    // The firmware may have answered: complete the waiting IN transfers.
    complete_pending(now_ns);
}

void UsbipSession::submit_in(const usbip::Submit& submit, std::int64_t now_ns) {
    const auto reply = [this, submit](TransferStatus status, std::span<const std::byte> data) {
        usbip::append_in_reply(output_, submit, status_of(status), data);
    };
    const bool accepted = exported_->device_.receive(submit.endpoint | kInputFlag,
                                                     {.id = submit.sequence,
                                                      .length = submit.length,
                                                      .short_is_error = (submit.flags & usbip::kShortIsError) != 0,
                                                      .done = reply},
                                                     now_ns);
    if (!accepted) {
        end("left more than " + std::to_string(kMaxPending) + " transfers pending");
    }
}

void UsbipSession::unlink(const usbip::Unlink& unlink) {
    // A transfer that is no longer pending has already been replied to; the client reads that reply before this one.
    const bool cancelled = exported_->device_.cancel(unlink.target);
    usbip::append_unlink_reply(output_, unlink, cancelled ? usbip::kConnectionReset : usbip::kOk);
}

void UsbipSession::complete_pending(std::int64_t now_ns) {
    if (owns_device()) {
        exported_->device_.complete_pending(now_ns);
    }
}

}  // namespace haptic::device
