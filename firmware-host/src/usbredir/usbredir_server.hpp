// usbredir server: puts an emulated board behind the USB controller of a virtual machine. QEMU connects to its Unix
// socket and is the guest of the protocol.
//
// Single-threaded and non-blocking, stepped by the caller with the caller's time. A device has one guest at a time. A
// guest that breaks the protocol only loses its connection, and may connect again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "served/served_usb_device.hpp"
#include "served/server.hpp"
#include "usbredir/usbredir_session.hpp"

namespace haptic::device {

/// Throws std::invalid_argument if a Unix socket cannot have this path, because it is too long.
void check_socket_path(const std::filesystem::path& path);

class UsbredirServer final : public Server {
  public:
    /// Interval at which the cable is looked at while a guest is connected: it may be unplugged in silence.
    static constexpr std::int64_t kCablePollNs = 10'000'000;

    using Report = std::function<void(std::string_view)>;

    /// Listens at a Unix socket, which is removed with the server and replaces one that nobody listens at. The firmware
    /// must outlive the server. `report` receives a line about each guest and each change of the cable. Throws
    /// std::invalid_argument for a board without USB and as check_socket_path(), and std::system_error if the socket
    /// cannot be made.
    UsbredirServer(const std::filesystem::path& path, BoardKind kind, Firmware& firmware, UsbSpeed speed,
                   Report report);
    UsbredirServer(const UsbredirServer&) = delete;
    UsbredirServer& operator=(const UsbredirServer&) = delete;
    ~UsbredirServer() override;

    [[nodiscard]] int descriptor() const noexcept override { return epoll_; }
    [[nodiscard]] std::optional<std::int64_t> due_ns() const override;
    void step(std::int64_t now_ns) override;

    /// A guest has the device.
    [[nodiscard]] bool connected() const noexcept { return session_ && session_->connected(); }

  private:
    void accept_guests();
    void read(std::int64_t now_ns);
    /// Sends the session's output. Closes the guest, and with it the session, if it has ended or is lost.
    void write(UsbredirSession& session);
    void update_cable(std::int64_t now_ns);
    void close_guest(std::string_view reason);

    Report report_;
    ServedUsbDevice device_;
    std::filesystem::path path_;
    bool plugged_ = true;
    int epoll_ = -1;
    int listener_ = -1;
    int guest_ = -1;                  // socket of the guest, -1 without one
    std::uint32_t guest_events_ = 0;  // as registered with epoll
    std::optional<UsbredirSession> session_;
    std::vector<std::byte> buffer_;  // receive buffer
    std::int64_t now_ns_ = 0;
};

}  // namespace haptic::device
