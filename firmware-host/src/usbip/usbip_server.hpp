// USB/IP server: exports an emulated board over TCP. A Linux kernel with vhci-hcd attaches it as a USB device
// indistinguishable from a real one.
//
// Single-threaded and non-blocking: non-blocking sockets behind one epoll instance, stepped by the caller with the
// caller's time. A client that sends invalid data, sends nothing, reads nothing or disappears only loses its own
// connection. The protocol has no authentication: every client that reaches the port can use the device.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "served/server.hpp"
#include "usbip/usbip_session.hpp"

namespace haptic::device {

/// Address that a server listens on.
struct NetworkAddress {
    std::string host;
    std::uint16_t port = 0;  // 0: any free port
};

/// Parses "ADDR:PORT" or "[ADDR]:PORT". Throws std::invalid_argument with the reason.
[[nodiscard]] NetworkAddress parse_network_address(std::string_view text);

class UsbipServer final : public Server {
  public:
    static constexpr std::size_t kMaxClients = 16;
    static constexpr std::int64_t kImportTimeoutNs = 10'000'000'000;  // from connection to import

    using Report = std::function<void(std::string_view)>;

    /// Starts to listen. The firmware must outlive the server. `report` receives a line about each client. Throws
    /// std::system_error if the address is not available and std::invalid_argument for a board without USB.
    UsbipServer(const NetworkAddress& address, BoardKind kind, Firmware& firmware, UsbSpeed speed, Report report);
    UsbipServer(const UsbipServer&) = delete;
    UsbipServer& operator=(const UsbipServer&) = delete;
    ~UsbipServer() override;

    /// Actual host and port.
    [[nodiscard]] const NetworkAddress& address() const noexcept { return address_; }

    [[nodiscard]] int descriptor() const noexcept override { return epoll_; }
    [[nodiscard]] std::optional<std::int64_t> due_ns() const override;
    void step(std::int64_t now_ns) override;

    [[nodiscard]] bool imported() const noexcept { return exported_.owner() != nullptr; }
    [[nodiscard]] std::size_t clients() const noexcept { return clients_.size(); }

  private:
    struct Client {
        Client(int a_socket, std::string a_name, std::int64_t now_ns, UsbipExport& exported)
            : socket(a_socket), name(std::move(a_name)), since_ns(now_ns), session(exported) {}
        int socket;
        std::string name;  // address and port
        std::int64_t since_ns;
        UsbipSession session;
        bool imported = false;
        bool wants_to_send = false;  // as registered with epoll
        bool reading = true;
    };

    /// Follows the firmware's cable: when it is unplugged, the client that has the device is disconnected.
    void update_cable(std::int64_t now_ns);
    void accept_clients(std::int64_t now_ns);
    void read_from(Client& client, std::int64_t now_ns);
    /// Sends pending output and closes a session that has ended. Invalidates the client in that case.
    void write_to(std::list<Client>::iterator client);
    void close(std::list<Client>::iterator client, std::string_view reason);
    /// Registers with epoll what the client waits for.
    void watch(Client& client);

    Report report_;
    Firmware* firmware_;
    UsbipExport exported_;
    NetworkAddress address_;
    int epoll_ = -1;
    int listener_ = -1;
    std::list<Client> clients_;
    std::vector<std::byte> buffer_;  // receive buffer
    std::int64_t now_ns_ = 0;
};

}  // namespace haptic::device
