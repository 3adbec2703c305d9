// Serves an emulated board over USB/IP (TCP), so that a Linux kernel with vhci-hcd gets a USB device that it cannot
// tell from one with a cable.
//
// One thread, no waiting: sockets that do not block behind one epoll instance, stepped by the caller with the caller's
// time. A client that sends rubbish, sends nothing, reads nothing or vanishes costs its own connection at most. The
// protocol knows no passwords: whoever reaches the port has the device.
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

#include "usbip/server.hpp"
#include "usbip/usbip_session.hpp"

namespace haptic::device {

/// Where a server listens.
struct NetworkAddress {
    std::string host;
    std::uint16_t port = 0;  // 0: any free one
};

/// Of "ADDR:PORT" or "[ADDR]:PORT". Throws std::invalid_argument that says what is wrong.
[[nodiscard]] NetworkAddress parse_network_address(std::string_view text);

class UsbipServer final : public Server {
  public:
    static constexpr std::size_t kMostClients = 16;
    static constexpr std::int64_t kPatienceNs = 10'000'000'000;  // for a client that has not imported anything yet
    static constexpr std::int64_t kAnswerPollNs = 250'000;  // how often a firmware is asked that has not answered yet

    using Report = std::function<void(std::string_view)>;

    /// Listens. The firmware must outlive the server; `report` is told a line about each client. Throws
    /// std::system_error if the address cannot be had and std::invalid_argument for a board without a USB plug.
    UsbipServer(const NetworkAddress& address, BoardKind kind, Firmware& firmware, Report report);
    UsbipServer(const UsbipServer&) = delete;
    UsbipServer& operator=(const UsbipServer&) = delete;
    ~UsbipServer() override;

    /// Host and port where it listens really.
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
        bool wants_to_send = false;  // as epoll was told
        bool reading = true;
    };

    /// Whether the firmware says that the cable is in. A client that has the device loses it when it is pulled.
    void look_at_cable(std::int64_t now_ns);
    void accept_clients(std::int64_t now_ns);
    void read_from(Client& client, std::int64_t now_ns);
    /// Sends what can be sent, and closes what has ended. The client may be gone afterwards.
    void write_to(std::list<Client>::iterator client);
    void close(std::list<Client>::iterator client, std::string_view reason);
    void watch(Client& client);

    Report report_;
    Firmware* firmware_;
    UsbipExport exported_;
    NetworkAddress address_;
    int epoll_ = -1;
    int listener_ = -1;
    std::list<Client> clients_;
    std::vector<std::byte> buffer_;  // what is received goes through it
    std::int64_t now_ns_ = 0;
};

}  // namespace haptic::device
