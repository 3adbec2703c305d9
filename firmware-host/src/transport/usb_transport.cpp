// USB transport, cold half: opens, drains and closes a device. usb_exchange.cpp holds the real-time half.
#include "transport/usb_transport.hpp"

#include <fcntl.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <system_error>

#include "haptic/clock.hpp"
#include "transport/handover.hpp"
#include "transport/usb_link.hpp"
#include "transport/usb_syscalls.hpp"

namespace haptic::device {
namespace {

constexpr int kInterface = 0;
constexpr unsigned kDrainMs = 10;
constexpr int kMaxStalePackets = 64;
constexpr std::int64_t kCancelNs = 1'000'000'000;

std::string hex(unsigned value) {
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), "0x%02x", value);
    return text.data();
}

[[noreturn]] void fail(const std::filesystem::path& node, const std::string& problem) {
    throw UsbError(node.string() + ": " + problem);
}

void require(int result, const std::filesystem::path& node, const std::string& what) {
    if (result < 0) {
        fail(node, what + ": " + libusb_strerror(static_cast<libusb_error>(result)));
    }
}

int open_node(const std::filesystem::path& node) {
    const int file = ::open(node.c_str(), O_RDWR | O_CLOEXEC);
    if (file >= 0) {
        return file;
    }
    const int error = errno;
    if (error == EACCES || error == EPERM) {
        fail(node,
             "permission denied for this user. Install the udev rule 70-spidar-g6.rules into /etc/udev/rules.d, run "
             "'sudo udevadm control --reload && sudo udevadm trigger', and reconnect the device");
    }
    fail(node, "cannot be opened: " + std::system_category().message(error));
}

/// Refuses a device without the boards' bulk endpoints, with a list of those that it has.
void check_endpoints(libusb_device* device, const std::filesystem::path& node) {
    libusb_config_descriptor* config = nullptr;
    require(libusb_get_active_config_descriptor(device, &config), node, "has no active configuration");
    bool has_out = false;
    bool has_in = false;
    std::string found;
    if (config->bNumInterfaces > kInterface && config->interface[kInterface].num_altsetting > 0) {
        const libusb_interface_descriptor& alternate = config->interface[kInterface].altsetting[0];
        for (int i = 0; i < alternate.bNumEndpoints; ++i) {
            const libusb_endpoint_descriptor& endpoint = alternate.endpoint[i];
            const bool bulk = (endpoint.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) == LIBUSB_TRANSFER_TYPE_BULK;
            has_out = has_out || (bulk && endpoint.bEndpointAddress == UsbTransport::kEndpointOut);
            has_in = has_in || (bulk && endpoint.bEndpointAddress == UsbTransport::kEndpointIn);
            found += (found.empty() ? "" : ", ") + hex(endpoint.bEndpointAddress) + (bulk ? " (bulk)" : " (not bulk)");
        }
    }
    libusb_free_config_descriptor(config);
    if (!has_out || !has_in) {
        fail(node,
             "is not a board known to this driver: the bulk endpoints 0x02 and 0x86 are required in interface 0, it "
             "has " +
                 (found.empty() ? "none" : found));
    }
}

extern "C" void LIBUSB_CALL on_transfer_ended(libusb_transfer* transfer) {
    static_cast<UsbSlot*>(transfer->user_data)->submitted = false;
}

void allocate(UsbSlot& slot, libusb_device_handle* handle, unsigned char endpoint) {
    slot.transfer = libusb_alloc_transfer(0);
    if (slot.transfer == nullptr) {
        throw std::bad_alloc();
    }
    // Without a libusb time-out, which would arm a timer for each transfer and cancel it.
    libusb_fill_bulk_transfer(slot.transfer, handle, endpoint, slot.buffer.data(), static_cast<int>(slot.buffer.size()),
                              &on_transfer_ended, &slot, 0);
}

void claim(libusb_device_handle* handle, const std::filesystem::path& node) {
    libusb_set_auto_detach_kernel_driver(handle, 1);
    int result = 0;
    const bool free = take_over([&] {
        result = libusb_claim_interface(handle, kInterface);
        return result != LIBUSB_ERROR_BUSY;
    });
    if (!free) {
        fail(node, "in use by another program. End that program, or select another device");
    }
    require(result, node, "its interface cannot be claimed");
}

}  // namespace

UsbTransport::Link::~Link() {
    if (halt_clearer.joinable()) {
        ending.store(true);
        sem_post(&clear_request);
        halt_clearer.join();
        sem_destroy(&clear_request);
    }
    if (handle != nullptr) {
        cancel_all(kCancelNs);
        libusb_release_interface(handle, kInterface);
        libusb_close(handle);
    }
    if (node >= 0) {
        ::close(node);  // the kernel then ends the remaining transfers: nothing writes to the buffers
    }
    for (const UsbSlot* const slot : slots()) {
        libusb_free_transfer(slot->transfer);
    }
    if (context != nullptr) {
        libusb_exit(context);
    }
}

bool UsbTransport::Link::cancel_all(std::int64_t max_wait_ns) noexcept {
    for (const UsbSlot* const slot : slots()) {
        if (slot->submitted) {
            libusb_cancel_transfer(slot->transfer);
        }
    }
    const std::int64_t end_ns = monotonic_now_ns() + max_wait_ns;
    while (busy() && monotonic_now_ns() < end_ns) {
        timeval wait{0, 10'000};
        libusb_handle_events_timeout_completed(context, &wait, nullptr);
    }
    return !busy();
}

UsbTransport::UsbTransport(const Settings& settings) : settings_(settings) {
    if (settings.timeout_ns <= 0) {
        throw std::invalid_argument("USB transport: the time-out must be positive");
    }
}

UsbTransport::~UsbTransport() {
    close();
}

void UsbTransport::open(const std::filesystem::path& path) {
    close();
    auto link = std::make_unique<Link>();
    link->node = open_node(path);
    // We discover devices ourselves; libusb would run a permanent thread for that.
    libusb_set_option(nullptr, LIBUSB_OPTION_NO_DEVICE_DISCOVERY);
    require(libusb_init(&link->context), path, "libusb cannot be initialised");
    libusb_set_option(link->context, LIBUSB_OPTION_LOG_LEVEL, LIBUSB_LOG_LEVEL_NONE);
    // libusb wraps our own descriptor of the node, so that send_last() can use it without libusb.
    require(libusb_wrap_sys_device(link->context, link->node, &link->handle), path, "libusb cannot open it");
    check_endpoints(libusb_get_device(link->handle), path);
    claim(link->handle, path);
    allocate(link->in, link->handle, kEndpointIn);
    allocate(link->out[0], link->handle, kEndpointOut);
    allocate(link->out[1], link->handle, kEndpointOut);

    // Thread that clears halts on request.
    sem_init(&link->clear_request, 0, 0);
    Link* const cleared = link.get();
    link->halt_clearer = std::thread([cleared] {
        while (true) {
            while (sem_wait(&cleared->clear_request) != 0) {
            }
            if (cleared->ending.load()) {
                return;
            }
            // Relaxed: the semaphore orders these loads after the stores of start_clearing().
            if (cleared->stalled[0].load(std::memory_order_relaxed)) {
                libusb_clear_halt(cleared->handle, kEndpointOut);
            }
            if (cleared->stalled[1].load(std::memory_order_relaxed)) {
                libusb_clear_halt(cleared->handle, kEndpointIn);
            }
            // Release: the next exchange starts only after both halts are cleared.
            cleared->clearing.store(false, std::memory_order_release);
        }
    });
    link_ = std::move(link);
    try {
        drain();
    } catch (...) {
        link_.reset();
        throw;
    }
    // Release: send_last() in another thread or a signal handler now finds a usable node.
    node_.store(link_->node, std::memory_order_release);
}

void UsbTransport::close() noexcept {
    node_.store(-1, std::memory_order_release);
    link_.reset();
}

bool UsbTransport::reset() {
    if (link_ == nullptr) {
        return false;
    }
    link_->cancel_all(kCancelNs);
    return libusb_reset_device(link_->handle) == 0;
}

bool UsbTransport::gone() const noexcept {
    if (link_ == nullptr || link_->lost) {
        return true;
    }
    usbdevfs_connectinfo info{};
    return ioctl(link_->node, USBDEVFS_CONNECTINFO, &info) < 0 && errno == ENODEV;
}

void UsbTransport::drain() {
    if (link_ == nullptr) {
        throw UsbError("USB device: not open");
    }
    Link& link = *link_;
    if (!link.cancel_all(kCancelNs)) {
        throw UsbError("USB device: a transfer cannot be cancelled. Reconnect the device");
    }
    while (link.clearing.load(std::memory_order_acquire)) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));  // bounded by the kernel
    }
    // Resets the data toggle, as the vendor's driver does. Only for IN: if the board does not reset its toggle of OUT
    // as it should, it would lose the next command.
    if (libusb_clear_halt(link.handle, kEndpointIn) == LIBUSB_ERROR_NO_DEVICE) {
        link.lost = true;
        throw UsbError("USB device: disconnected during opening");
    }
    // Read until the endpoint is silent for kDrainMs.
    for (int i = 0; i < kMaxStalePackets; ++i) {
        int received = 0;
        const int result = libusb_bulk_transfer(link.handle, kEndpointIn, link.in.buffer.data(),
                                                static_cast<int>(link.in.buffer.size()), &received, kDrainMs);
        if (result == LIBUSB_ERROR_TIMEOUT && received == 0) {
            return;
        }
        if (result == LIBUSB_ERROR_NO_DEVICE) {
            link.lost = true;
            throw UsbError("USB device: disconnected during opening");
        }
        if (result == LIBUSB_ERROR_PIPE) {
            libusb_clear_halt(link.handle, kEndpointIn);
        }
    }
    throw UsbError("USB device: keeps sending unrequested packets (" + std::to_string(kMaxStalePackets) +
                   "). Reconnect the device");
}

}  // namespace haptic::device
