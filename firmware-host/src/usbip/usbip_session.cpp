#include "usbip/usbip_session.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

namespace haptic::device {
namespace {

constexpr const char* kBusId = "1-1";
constexpr std::uint32_t kHighSpeed = 3;
constexpr std::array<usbip::InterfaceRecord, 1> kInterfaces = {{{kVendorSpecific, 0, 0}}};
constexpr std::uint8_t kInputFlag = 0x80;
constexpr std::size_t kImportBytes = usbip::kOperationBytes + usbip::kBusIdBytes;

usbip::DeviceRecord record_of(const UsbIdentity& identity) {
    return {.path = "/sys/devices/haptic/firmware-host/usb1/1-1",
            .bus_id = kBusId,
            .bus = 1,
            .address = 2,
            .speed = kHighSpeed,
            .vendor = identity.vendor,
            .product = identity.product,
            .release = identity.release,
            .device_class = kVendorSpecific,
            .configuration = 1,
            .configurations = 1};
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

UsbipExport::UsbipExport(BoardKind kind, Firmware& firmware)
    : firmware_(&firmware), model_(usb_identity(kind)), record_(record_of(model_.identity())) {}

UsbipSession::~UsbipSession() {
    if (owns_device()) {
        exported_->owner_ = nullptr;
    }
}

void UsbipSession::end(std::string reason) {
    reason_ = std::move(reason);
    ended_ = true;
    input_.clear();
    pending_.clear();
    if (owns_device()) {
        exported_->owner_ = nullptr;
    }
}

void UsbipSession::drop(std::string reason) {
    output_.clear();
    end(std::move(reason));
}

void UsbipSession::receive(std::span<const std::byte> bytes, std::int64_t now_ns) {
    if (ended_) {
        return;
    }
    // Complete messages are handled in place, without a copy. An incomplete one is kept in input_ until its rest
    // arrives.
    const bool joined = !input_.empty();
    if (joined) {
        input_.insert(input_.end(), bytes.begin(), bytes.end());
    }
    std::vector<std::byte> joined_input;
    joined_input.swap(input_);
    std::span<const std::byte> rest = joined ? std::span<const std::byte>(joined_input) : bytes;
    // Handle message by message. 0 bytes used: the rest is incomplete.
    while (!rest.empty() && !ended_) {
        const std::size_t used = handle(rest, now_ns);
        if (used == 0) {
            break;
        }
        rest = rest.subspan(used);
    }
    // Keep the incomplete rest.
    if (!ended_) {
        input_.assign(rest.begin(), rest.end());
    }
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
    exported_->model_.reset();
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
        submit_control(submit);
    } else if (submit.in) {
        submit_in(submit, now_ns);
    } else {
        submit_out(submit, data, now_ns);
    }
    return total;
}

void UsbipSession::submit_control(const usbip::Submit& submit) {
    // The device model answers; a request that it does not know stalls the endpoint.
    const SetupPacket setup = decode_setup(submit.setup);
    UsbDeviceModel& model = exported_->model_;
    const UsbDeviceModel::ControlResult result = model.control(setup);
    const std::int32_t status = result.stalled ? usbip::kStalled : usbip::kOk;
    if (submit.in) {
        // A reply is cut to the length that the client asked for.
        const std::size_t count = std::min<std::size_t>(result.data.size(), submit.length);
        usbip::append_in_reply(output_, submit, status, std::span(result.data).first(count));
    } else {
        usbip::append_out_reply(output_, submit, status, result.stalled ? 0 : submit.length);
    }
    // A request may have halted IN or deconfigured the device.
    if (!model.usable(kEndpointIn)) {
        fail_pending(usbip::kStalled);
    }
}

void UsbipSession::submit_out(const usbip::Submit& submit, std::span<const std::byte> data, std::int64_t now_ns) {
    // A halted endpoint stalls.
    if (!exported_->model_.usable(submit.endpoint)) {
        usbip::append_out_reply(output_, submit, usbip::kStalled, 0);
        return;
    }
    // As on the bus, the OUT transfer completes before the IN transfers that its packets cause.
    const bool whole_packets = data.size() % kBulkPacketBytes == 0;
    usbip::append_out_reply(output_, submit, usbip::kOk, submit.length);
    // Split into bus packets. A transfer of whole packets ends with an empty one only if kZeroPacket asks for it.
    for (std::span<const std::byte> rest = data; !rest.empty();) {
        const std::size_t count = std::min(rest.size(), kBulkPacketBytes);
        exported_->firmware_->receive(rest.first(count), now_ns);
        rest = rest.subspan(count);
    }
    if (data.empty() || (whole_packets && (submit.flags & usbip::kZeroPacket) != 0)) {
        exported_->firmware_->receive({}, now_ns);
    }
    // The firmware may have answered: complete the waiting IN transfers.
    complete_pending(now_ns);
}

void UsbipSession::submit_in(const usbip::Submit& submit, std::int64_t now_ns) {
    if (!exported_->model_.usable(submit.endpoint | kInputFlag)) {
        usbip::append_in_reply(output_, submit, usbip::kStalled, {});
        return;
    }
    // Bounds the memory that one client can occupy.
    if (pending_.size() >= kMaxPending) {
        end("left more than " + std::to_string(kMaxPending) + " transfers pending");
        return;
    }
    // The transfer waits for data from the firmware, which may be ready already.
    pending_.push_back({submit, {}});
    complete_pending(now_ns);
}

void UsbipSession::unlink(const usbip::Unlink& unlink) {
    const auto found = std::find_if(pending_.begin(), pending_.end(),
                                    [&](const PendingIn& pending) { return pending.submit.sequence == unlink.target; });
    // A transfer that is no longer pending has already been replied to; the client reads that reply before this one.
    usbip::append_unlink_reply(output_, unlink, found == pending_.end() ? usbip::kOk : usbip::kConnectionReset);
    if (found != pending_.end()) {
        pending_.erase(found);
    }
}

void UsbipSession::complete_pending(std::int64_t now_ns) {
    std::array<std::byte, kBulkPacketBytes> packet{};
    while (!pending_.empty()) {
        // Packet by packet to the oldest transfer; a transfer may take several.
        const std::size_t count = exported_->firmware_->reply(packet, now_ns);
        if (count == 0) {
            return;
        }
        if (add_packet(std::span<const std::byte>(packet).first(count))) {
            pending_.pop_front();
        }
    }
}

bool UsbipSession::add_packet(std::span<const std::byte> packet) {
    PendingIn& pending = pending_.front();
    // Space left in the oldest transfer.
    const std::size_t room = pending.submit.length - pending.data.size();
    const std::span<const std::byte> taken = packet.first(std::min(room, packet.size()));
    pending.data.insert(pending.data.end(), taken.begin(), taken.end());
    // More data than requested is babble. A transfer ends when it is full or with a packet shorter than the maximum.
    const bool is_short = pending.data.size() < pending.submit.length;
    if (packet.size() > room) {
        usbip::append_in_reply(output_, pending.submit, usbip::kBabble, pending.data);
        return true;
    }
    if (is_short && packet.size() == kBulkPacketBytes) {
        return false;
    }
    // A short transfer is complete, and an error only if the client says so.
    const bool failed = is_short && (pending.submit.flags & usbip::kShortIsError) != 0;
    usbip::append_in_reply(output_, pending.submit, failed ? usbip::kShortTransfer : usbip::kOk, pending.data);
    return true;
}

void UsbipSession::fail_pending(std::int32_t status) {
    for (const PendingIn& pending : pending_) {
        usbip::append_in_reply(output_, pending.submit, status, pending.data);
    }
    pending_.clear();
}

}  // namespace haptic::device
