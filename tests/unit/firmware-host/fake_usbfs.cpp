#include "fake_usbfs.hpp"

#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <umockdev.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <deque>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "emulated/make_firmware.hpp"
#include "haptic/clock.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::test {
namespace {

constexpr std::size_t kPacketBytes = 512;
constexpr std::size_t kShortBytes = 100;
constexpr unsigned char kEndpointOut = 0x02;
constexpr unsigned char kDirectionIn = 0x80;
constexpr int kHighSpeed = 3;  // USB_SPEED_HIGH

using Packet = std::vector<std::byte>;

/// Memory of a request in the requesting process.
using Memory = UMockdevIoctlData;

usbdevfs_urb& urb_of(Memory* memory) {
    return *reinterpret_cast<usbdevfs_urb*>(memory->data);
}

/// Resolves a pointer in that memory; the result is owned by the memory.
Memory* resolve(Memory* memory, std::size_t offset, std::size_t length) {
    Memory* const inner = umockdev_ioctl_data_resolve(memory, offset, length, nullptr);
    if (inner != nullptr) {
        g_object_unref(inner);
    }
    return inner;
}

std::string hex(const std::vector<unsigned char>& bytes) {
    std::string text;
    for (const unsigned char byte : bytes) {
        std::array<char, 3> two{};
        std::snprintf(two.data(), two.size(), "%02X", byte);
        text += two.data();
    }
    return text;
}

/// Device descriptor, and one configuration with interface 0 and two endpoints.
std::vector<unsigned char> descriptors(const FakeUsbfs::Settings& s) {
    const auto low = [](unsigned word) { return static_cast<unsigned char>(word & 0xFFU); };
    const auto high = [](unsigned word) { return static_cast<unsigned char>(word >> 8U); };
    return {18,
            1,
            0,
            2,
            0xFF,
            0,
            0,
            64,
            low(s.id.vendor),
            high(s.id.vendor),
            low(s.id.product),
            high(s.id.product),
            0,
            1,
            0,
            0,
            0,
            1,  // device: bcdDevice 1.00, no strings, 1 configuration
            9,
            2,
            32,
            0,
            1,
            1,
            0,
            0x80,
            50,  // configuration 1: 32 bytes, 1 interface
            9,
            4,
            0,
            0,
            2,
            0xFF,
            0,
            0,
            0,  // interface 0, alternate setting 0, 2 endpoints
            7,
            5,
            kEndpointOut,
            2,
            0,
            2,
            0,  // bulk, 512 bytes
            7,
            5,
            s.endpoint_in,
            s.endpoint_attributes,
            0,
            2,
            0};
}

}  // namespace

struct FakeUsbBoard::State {
    explicit State(const FakeUsbfs::Settings& s)
        : settings(s), device(s.device), firmware(device::make_firmware(s.device.geometry.board, device)) {}
    ~State() { drop_requests(); }

    FakeUsbfs::Settings settings;
    std::string node;
    std::string syspath;
    bool present = true;  // its files exist

    mutable std::mutex mutex;
    device::EmulatedDevice device;
    std::unique_ptr<device::Firmware> firmware;

    Fault fault = Fault::None;
    bool unplugged = false;
    int commands_left = -1;  // until it is unplugged; negative: never
    bool occupied = false;
    bool halted_in = false;
    bool halted_out = false;
    int commands = 0;
    int halts_cleared = 0;
    int resets = 0;
    int early_commands = 0;

    UMockdevIoctlClient* client = nullptr;  // last one to open the device
    std::deque<Packet> answers;             // replies in the board's buffer
    std::deque<Packet> held;                // replies held back
    std::deque<Memory*> waiting_in;         // pending URBs
    std::deque<Memory*> waiting_out;
    std::deque<Memory*> ended;

    void drop_requests() {
        for (std::deque<Memory*>* queue : {&waiting_in, &waiting_out, &ended}) {
            for (Memory* const urb : *queue) {
                g_object_unref(urb);
            }
            queue->clear();
        }
    }

    void end(Memory* urb, int status, int length) {
        urb_of(urb).status = status;
        urb_of(urb).actual_length = length;
        ended.push_back(urb);
    }

    void end_all(std::deque<Memory*>& queue, int status) {
        while (!queue.empty()) {
            Memory* const urb = queue.front();
            queue.pop_front();
            end(urb, status, 0);
        }
    }

    void unplug() {
        unplugged = true;
        end_all(waiting_in, -ESHUTDOWN);
        end_all(waiting_out, -ESHUTDOWN);
    }

    /// Passes a command to the firmware; the fault determines what happens to its reply.
    void take(const Packet& command) {
        ++commands;
        early_commands += waiting_in.empty() ? 1 : 0;
        const std::int64_t now_ns = monotonic_now_ns();
        firmware->receive(command, now_ns);
        Packet answer(kPacketBytes);
        answer.resize(firmware->reply(answer, now_ns));
        if (!answer.empty()) {
            if (fault == Fault::Short) {
                answer.resize(kShortBytes);
            }
            (fault == Fault::Silent ? held : answers).push_back(answer);
        }
        if (fault == Fault::StallIn) {
            halted_in = true;
            answers.clear();
        }
        if (commands_left > 0 && --commands_left == 0) {
            answers.clear();
            unplug();
        }
    }

    void serve() {
        while (!waiting_out.empty() && (halted_out || fault == Fault::StallOut)) {
            halted_out = true;
            end_all(waiting_out, -EPIPE);
        }
        while (!waiting_out.empty() && fault != Fault::Blocked) {
            Memory* const urb = waiting_out.front();
            waiting_out.pop_front();
            const usbdevfs_urb& out = urb_of(urb);
            const auto* bytes = static_cast<const std::byte*>(out.buffer);
            end(urb, 0, out.buffer_length);
            take(Packet(bytes, bytes + out.buffer_length));
        }
        if (halted_in) {
            end_all(waiting_in, -EPIPE);
        }
        while (!waiting_in.empty() && !answers.empty()) {
            Memory* const urb = waiting_in.front();
            waiting_in.pop_front();
            const Packet answer = std::move(answers.front());
            answers.pop_front();
            usbdevfs_urb& in = urb_of(urb);
            const std::size_t length = std::min(answer.size(), static_cast<std::size_t>(in.buffer_length));
            if (fault == Fault::Protocol) {
                end(urb, -EPROTO, 0);
            } else if (fault == Fault::Overflow) {
                end(urb, -EOVERFLOW, in.buffer_length);
            } else {
                std::memcpy(in.buffer, answer.data(), length);
                end(urb, 0, static_cast<int>(length));
            }
        }
    }

    // Results of requests: 0 or more, or a negative errno.
    long control(Memory* argument);
    long bulk(Memory* argument);
    long bulk_in(Memory* memory);
    long submit(Memory* argument);
    long reap(Memory* argument);
    long discard(Memory* argument);
    long clear_halt(Memory* argument);
    long answer_to(UMockdevIoctlClient* from, unsigned long request, Memory* argument);
};

long FakeUsbBoard::State::control(Memory* argument) {
    Memory* const memory = resolve(argument, 0, sizeof(usbdevfs_ctrltransfer));
    const auto& transfer = *reinterpret_cast<usbdevfs_ctrltransfer*>(memory->data);
    constexpr unsigned char kGetConfiguration = 8;
    if (transfer.bRequestType != kDirectionIn || transfer.bRequest != kGetConfiguration || transfer.wLength < 1) {
        return -EPIPE;
    }
    resolve(memory, offsetof(usbdevfs_ctrltransfer, data), transfer.wLength)->data[0] = 1;
    return 1;
}

long FakeUsbBoard::State::bulk(Memory* argument) {
    Memory* const memory = resolve(argument, 0, sizeof(usbdevfs_bulktransfer));
    const auto& transfer = *reinterpret_cast<usbdevfs_bulktransfer*>(memory->data);
    if (transfer.ep == settings.endpoint_in) {
        return bulk_in(memory);
    }
    if (transfer.ep != kEndpointOut) {
        return -EINVAL;
    }
    if (halted_out || fault == Fault::StallOut) {
        halted_out = true;
        return -EPIPE;
    }
    if (fault == Fault::Blocked || (fault == Fault::Full && !answers.empty())) {
        return -ETIMEDOUT;
    }
    const unsigned length = transfer.len;
    const Memory* const data = resolve(memory, offsetof(usbdevfs_bulktransfer, data), length);
    const auto* bytes = reinterpret_cast<const std::byte*>(data->data);
    take(Packet(bytes, bytes + length));
    serve();
    return static_cast<long>(length);
}

/// A reply for a request that waits, after the transfers that were submitted before it.
long FakeUsbBoard::State::bulk_in(Memory* memory) {
    if (halted_in) {
        return -EPIPE;
    }
    if (!waiting_in.empty() || answers.empty()) {
        return -ETIMEDOUT;
    }
    const unsigned wanted = reinterpret_cast<const usbdevfs_bulktransfer*>(memory->data)->len;
    const Packet answer = std::move(answers.front());
    answers.pop_front();
    const std::size_t length = std::min<std::size_t>(answer.size(), wanted);
    std::memcpy(resolve(memory, offsetof(usbdevfs_bulktransfer, data), wanted)->data, answer.data(), length);
    return static_cast<long>(length);
}

long FakeUsbBoard::State::submit(Memory* argument) {
    Memory* const memory = resolve(argument, 0, sizeof(usbdevfs_urb));
    usbdevfs_urb& urb = urb_of(memory);
    if (urb.type != USBDEVFS_URB_TYPE_BULK || (urb.endpoint != kEndpointOut && urb.endpoint != settings.endpoint_in)) {
        return -EINVAL;
    }
    if (urb.buffer_length > 0) {
        resolve(memory, offsetof(usbdevfs_urb, buffer), static_cast<std::size_t>(urb.buffer_length));
    }
    g_object_ref(memory);
    ((urb.endpoint & kDirectionIn) != 0 ? waiting_in : waiting_out).push_back(memory);
    serve();
    return 0;
}

long FakeUsbBoard::State::reap(Memory* argument) {
    if (ended.empty()) {
        return unplugged ? -ENODEV : -EAGAIN;
    }
    Memory* const urb = ended.front();
    ended.pop_front();
    umockdev_ioctl_data_set_ptr(resolve(argument, 0, sizeof(void*)), 0, urb);
    g_object_unref(urb);
    return 0;
}

long FakeUsbBoard::State::discard(Memory* argument) {
    const unsigned long address = *reinterpret_cast<unsigned long*>(argument->data);
    for (std::deque<Memory*>* queue : {&waiting_in, &waiting_out}) {
        const auto found =
            std::find_if(queue->begin(), queue->end(), [&](const Memory* urb) { return urb->client_addr == address; });
        if (found != queue->end()) {
            Memory* const urb = *found;
            queue->erase(found);
            end(urb, -ENOENT, 0);
            return 0;
        }
    }
    return -EINVAL;
}

long FakeUsbBoard::State::clear_halt(Memory* argument) {
    const unsigned endpoint = *reinterpret_cast<unsigned*>(resolve(argument, 0, sizeof(unsigned))->data);
    bool& halted = (endpoint & kDirectionIn) != 0 ? halted_in : halted_out;
    if (halted) {
        halted = false;
        fault = Fault::None;
        ++halts_cleared;
    }
    return 0;
}

long FakeUsbBoard::State::answer_to(UMockdevIoctlClient* from, unsigned long request, Memory* argument) {
    if (from != client) {
        client = from;
        drop_requests();
    }
    if (request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY) {
        return reap(argument);
    }
    if (unplugged) {
        return -ENODEV;
    }
    switch (request) {
        case USBDEVFS_GET_CAPABILITIES:
            *reinterpret_cast<std::uint32_t*>(resolve(argument, 0, sizeof(std::uint32_t))->data) =
                USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
            return 0;
        case USBDEVFS_CONNECTINFO: {
            auto& info =
                *reinterpret_cast<usbdevfs_connectinfo*>(resolve(argument, 0, sizeof(usbdevfs_connectinfo))->data);
            info.devnum = static_cast<unsigned>(settings.number);
            info.slow = 0;
            return 0;
        }
        case USBDEVFS_GET_SPEED:
            return kHighSpeed;
        case USBDEVFS_CONTROL:
            return control(argument);
        case USBDEVFS_CLAIMINTERFACE:
        case USBDEVFS_DISCONNECT_CLAIM:
            return occupied ? -EBUSY : 0;
        case USBDEVFS_GETDRIVER:
            return -ENODATA;
        case USBDEVFS_RELEASEINTERFACE:
            return 0;
        case USBDEVFS_RESET:
            ++resets;
            return 0;
        case USBDEVFS_CLEAR_HALT:
            return clear_halt(argument);
        case USBDEVFS_BULK:
            return bulk(argument);
        case USBDEVFS_SUBMITURB:
            return submit(argument);
        case USBDEVFS_DISCARDURB:
            return discard(argument);
        default:
            return -ENOTTY;
    }
}

FakeUsbBoard::FakeUsbBoard(std::unique_ptr<State> state) : state_(std::move(state)) {}
FakeUsbBoard::~FakeUsbBoard() = default;

void FakeUsbBoard::misbehave(Fault fault) {
    const std::lock_guard lock(state_->mutex);
    state_->fault = fault;
}

void FakeUsbBoard::release_answers() {
    const std::lock_guard lock(state_->mutex);
    state_->fault = Fault::None;
    std::move(state_->held.begin(), state_->held.end(), std::back_inserter(state_->answers));
    state_->held.clear();
    state_->serve();
}

void FakeUsbBoard::leave_stale_answer(std::vector<std::byte> packet) {
    const std::lock_guard lock(state_->mutex);
    state_->answers.push_back(std::move(packet));
}

void FakeUsbBoard::unplug_after(int commands) {
    const std::lock_guard lock(state_->mutex);
    state_->commands_left = commands;
    if (commands == 0) {
        state_->unplug();
    }
}

void FakeUsbBoard::occupy() {
    const std::lock_guard lock(state_->mutex);
    state_->occupied = true;
}

void FakeUsbBoard::hold_buttons(std::uint8_t buttons) {
    const std::lock_guard lock(state_->mutex);
    state_->device.set_buttons(buttons);
}

std::array<std::int16_t, kStrings> FakeUsbBoard::dac_codes() const {
    const std::lock_guard lock(state_->mutex);
    return state_->device.dac_codes();
}

Pose FakeUsbBoard::grip_pose() const {
    const std::lock_guard lock(state_->mutex);
    return state_->device.grip_pose();
}

int FakeUsbBoard::commands() const {
    const std::lock_guard lock(state_->mutex);
    return state_->commands;
}

int FakeUsbBoard::halts_cleared() const {
    const std::lock_guard lock(state_->mutex);
    return state_->halts_cleared;
}

int FakeUsbBoard::resets() const {
    const std::lock_guard lock(state_->mutex);
    return state_->resets;
}

int FakeUsbBoard::early_commands() const {
    const std::lock_guard lock(state_->mutex);
    return state_->early_commands;
}

struct FakeUsbfs::State {
    UMockdevTestbed* testbed = umockdev_testbed_new();
    UMockdevIoctlBase* handler = umockdev_ioctl_base_new();
    std::mutex mutex;
    std::vector<std::unique_ptr<FakeUsbBoard>> boards;

    State() { g_signal_connect(handler, "handle-ioctl", G_CALLBACK(&State::on_ioctl), this); }
    ~State() {
        g_object_unref(testbed);
        g_object_unref(handler);
    }

    FakeUsbBoard* board_at(const std::string& node) {
        const std::lock_guard lock(mutex);
        // The latest one: device numbers are reused.
        const auto found = std::find_if(boards.rbegin(), boards.rend(),
                                        [&](const auto& board) { return board->state_->node == node; });
        return found == boards.rend() ? nullptr : found->get();
    }

    static gboolean on_ioctl(UMockdevIoctlBase* /*handler*/, UMockdevIoctlClient* client, State* self) {
        FakeUsbBoard* const board = self->board_at(umockdev_ioctl_client_get_devnode(client));
        if (board == nullptr) {
            return FALSE;
        }
        FakeUsbBoard::State& state = *board->state_;
        long answer = 0;
        {
            const std::lock_guard lock(state.mutex);
            answer = state.answer_to(client, umockdev_ioctl_client_get_request(client),
                                     umockdev_ioctl_client_get_arg(client));
        }
        umockdev_ioctl_client_complete(client, answer < 0 ? -1 : answer, answer < 0 ? static_cast<int>(-answer) : 0);
        return TRUE;
    }
};

FakeUsbfs::FakeUsbfs() : state_(std::make_unique<State>()) {
    if (umockdev_in_mock_environment() == FALSE) {
        throw std::runtime_error("umockdev is not preloaded: run this by ctest, or by umockdev-wrapper");
    }
}

FakeUsbfs::~FakeUsbfs() = default;

FakeUsbBoard& FakeUsbfs::plug(Settings settings) {
    auto board = std::make_unique<FakeUsbBoard::State>(settings);
    std::array<char, 64> node{};
    std::snprintf(node.data(), node.size(), "bus/usb/001/%03d", settings.number);
    board->node = std::string("/dev/") + node.data();
    board->syspath = "/devices/usb1/" + settings.port;
    const std::string bytes = hex(descriptors(settings));
    std::array<char, 16> vendor{};
    std::array<char, 16> product{};
    std::snprintf(vendor.data(), vendor.size(), "%04x", settings.id.vendor);
    std::snprintf(product.data(), product.size(), "%04x", settings.id.product);
    const std::string text = "P: " + board->syspath + "\nN: " + node.data() + "=" + bytes +
                             "\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DEVNAME=" + board->node +
                             "\nA: busnum=1\\n\nA: devnum=" + std::to_string(settings.number) +
                             "\\n\nA: speed=" + std::to_string(settings.speed_mbit) +
                             "\\n\nA: bConfigurationValue=1\\n\nA: idVendor=" + vendor.data() +
                             "\\n\nA: idProduct=" + product.data() + "\\n\nH: descriptors=" + bytes + "\n";
    GError* error = nullptr;
    const std::string path = board->node;
    FakeUsbBoard& result = *new FakeUsbBoard(std::move(board));
    {
        const std::lock_guard lock(state_->mutex);
        state_->boards.emplace_back(&result);
    }
    if (umockdev_testbed_attach_ioctl(state_->testbed, path.c_str(), state_->handler, &error) == FALSE ||
        umockdev_testbed_add_from_string(state_->testbed, text.c_str(), &error) == FALSE) {
        throw std::runtime_error(std::string("umockdev: ") + (error != nullptr ? error->message : "no reason given"));
    }
    return result;
}

void FakeUsbfs::remove(FakeUsbBoard& board) {
    FakeUsbBoard::State& state = *board.state_;
    board.unplug_after(0);
    if (state.present) {
        umockdev_testbed_remove_device(state_->testbed, ("/sys" + state.syspath).c_str());
        umockdev_testbed_detach_ioctl(state_->testbed, state.node.c_str(), nullptr);
        state.present = false;
    }
}

}  // namespace haptic::test
