#include "usbip/usbip_session.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

namespace haptic::device {
namespace {

constexpr const char* kBusId = "1-1";
constexpr std::uint32_t kHighSpeed = 3;
constexpr std::uint8_t kVendorSpecific = 0xFF;
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

/// Printable characters of a foreign text.
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
    waiting_.clear();
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
    // The usual case, whole messages, is handled where it lies; what is left of the last one waits for its rest.
    const bool joined = !input_.empty();
    if (joined) {
        input_.insert(input_.end(), bytes.begin(), bytes.end());
    }
    std::vector<std::byte> kept;
    kept.swap(input_);
    std::span<const std::byte> rest = joined ? std::span<const std::byte>(kept) : bytes;
    while (!rest.empty() && !ended_) {
        const std::size_t used = handle(rest, now_ns);
        if (used == 0) {
            break;
        }
        rest = rest.subspan(used);
    }
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
        end("not USB/IP of version 1.1.1");
        return bytes.size();
    }
    if (header.code == usbip::kRequestDeviceList) {
        const bool available = exported_->plugged && exported_->owner_ == nullptr;  // others are not to be imported
        usbip::append_device_list(output_, std::span(&exported_->record_, available ? 1U : 0U), kInterfaces);
        end("");
        return bytes.size();
    }
    if (header.code != usbip::kRequestImport) {
        end("an operation that is neither a list nor an import");
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
    if (!exported_->plugged || bus_id != record.bus_id) {
        usbip::append_import(output_, OperationStatus::NoDevice, record, 0);
        end("asked for " + quoted(bus_id) + ", which is not here");
        return;
    }
    if (exported_->owner_ != nullptr) {
        usbip::append_import(output_, OperationStatus::Busy, record, 0);
        end("refused: another client has the device");
        return;
    }
    exported_->owner_ = this;
    exported_->model_.reset();
    usbip::append_import(output_, OperationStatus::Ok, record, kInterfaces.size());
}

std::size_t UsbipSession::handle_urb(std::span<const std::byte> bytes, std::int64_t now_ns) {
    if (bytes.size() < usbip::kUrbBytes) {
        return 0;
    }
    const auto message = usbip::decode_urb(bytes.first<usbip::kUrbBytes>());
    if (const auto* defect = std::get_if<usbip::Defect>(&message)) {
        end("sent " + std::string(usbip::describe(*defect)));
        return bytes.size();
    }
    if (const auto* unlinked = std::get_if<usbip::Unlink>(&message)) {
        unlink(*unlinked);
        return usbip::kUrbBytes;
    }
    const auto& submit = std::get<usbip::Submit>(message);
    if (submit.device != usbip::device_id(exported_->record_)) {
        end("sent a transfer to a device that it has not imported");
        return bytes.size();
    }
    const std::size_t total = usbip::kUrbBytes + (submit.in ? 0 : submit.length);
    if (bytes.size() < total) {
        return 0;
    }
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
    const SetupPacket setup = decode_setup(submit.setup);
    UsbDeviceModel& model = exported_->model_;
    const UsbDeviceModel::ControlResult result = model.control(setup);
    const std::int32_t status = result.stalled ? usbip::kStalled : usbip::kOk;
    if (submit.in) {
        const std::size_t count = std::min<std::size_t>(result.data.size(), submit.length);
        usbip::append_in_reply(output_, submit, status, std::span(result.data).first(count));
    } else {
        usbip::append_out_reply(output_, submit, status, result.stalled ? 0 : submit.length);
    }
    if (!model.usable(kEndpointIn)) {
        fail_waiting(usbip::kStalled);
    }
}

void UsbipSession::submit_out(const usbip::Submit& submit, std::span<const std::byte> data, std::int64_t now_ns) {
    if (!exported_->model_.usable(submit.endpoint)) {
        usbip::append_out_reply(output_, submit, usbip::kStalled, 0);
        return;
    }
    const bool whole_packets = data.size() % kBulkPacketBytes == 0;
    usbip::append_out_reply(output_, submit, usbip::kOk, submit.length);
    for (std::span<const std::byte> rest = data; !rest.empty();) {
        const std::size_t count = std::min(rest.size(), kBulkPacketBytes);
        exported_->firmware_->receive(rest.first(count), now_ns);
        rest = rest.subspan(count);
    }
    if (data.empty() || (whole_packets && (submit.flags & usbip::kZeroPacket) != 0)) {
        exported_->firmware_->receive({}, now_ns);
    }
    fill(now_ns);
}

void UsbipSession::submit_in(const usbip::Submit& submit, std::int64_t now_ns) {
    if (!exported_->model_.usable(submit.endpoint | kInputFlag)) {
        usbip::append_in_reply(output_, submit, usbip::kStalled, {});
        return;
    }
    if (waiting_.size() >= kMostWaiting) {
        end("left more than " + std::to_string(kMostWaiting) + " transfers waiting");
        return;
    }
    waiting_.push_back({submit, {}});
    fill(now_ns);
}

void UsbipSession::unlink(const usbip::Unlink& unlink) {
    const auto found = std::find_if(waiting_.begin(), waiting_.end(),
                                    [&](const Waiting& waiting) { return waiting.submit.sequence == unlink.target; });
    // What is not there any more was answered before: the client has that answer, or will read it before this one.
    usbip::append_unlink_reply(output_, unlink, found == waiting_.end() ? usbip::kOk : usbip::kConnectionReset);
    if (found != waiting_.end()) {
        waiting_.erase(found);
    }
}

void UsbipSession::fill(std::int64_t now_ns) {
    std::array<std::byte, kBulkPacketBytes> packet{};
    while (!waiting_.empty()) {
        const std::size_t count = exported_->firmware_->reply(packet, now_ns);
        if (count == 0) {
            return;
        }
        if (add_packet(std::span<const std::byte>(packet).first(count))) {
            waiting_.pop_front();
        }
    }
}

bool UsbipSession::add_packet(std::span<const std::byte> packet) {
    Waiting& waiting = waiting_.front();
    const std::size_t room = waiting.submit.length - waiting.data.size();
    const std::span<const std::byte> taken = packet.first(std::min(room, packet.size()));
    waiting.data.insert(waiting.data.end(), taken.begin(), taken.end());
    const bool is_short = waiting.data.size() < waiting.submit.length;
    if (packet.size() > room) {
        usbip::append_in_reply(output_, waiting.submit, usbip::kBabble, waiting.data);
        return true;
    }
    if (is_short && packet.size() == kBulkPacketBytes) {
        return false;
    }
    const bool failed = is_short && (waiting.submit.flags & usbip::kShortIsError) != 0;
    usbip::append_in_reply(output_, waiting.submit, failed ? usbip::kShortTransfer : usbip::kOk, waiting.data);
    return true;
}

void UsbipSession::fail_waiting(std::int32_t status) {
    for (const Waiting& waiting : waiting_) {
        usbip::append_in_reply(output_, waiting.submit, status, waiting.data);
    }
    waiting_.clear();
}

}  // namespace haptic::device
