// UsbipServer over real loopback sockets, stepped by the test with its own time.
#include "usbip/usbip_server.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <stdexcept>
#include <system_error>

#include "cabled_firmware.hpp"
#include "codecs/sh4_codec.hpp"
#include "emulated/make_firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "usbip_bytes.hpp"

namespace haptic::device {
namespace {

using test::Bytes;
using test::hex;
using test::import_request;
using test::joined;
using test::submit_in;
using test::submit_out;
using test::word_at;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

constexpr int kPatienceMs = 5000;  // for bytes on the loopback; a test that waits this long fails

/// A client's socket.
class Peer {
  public:
    explicit Peer(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(port);
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
            throw std::system_error(errno, std::generic_category(), "connect");
        }
    }
    Peer(const Peer&) = delete;
    Peer& operator=(const Peer&) = delete;
    ~Peer() { close(); }

    void send(const Bytes& bytes) const {
        ASSERT_EQ(::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
    }
    /// Sends as many bytes as the kernel accepts immediately.
    [[nodiscard]] ssize_t send_what_goes(const Bytes& bytes) const {
        return ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    void close() {
        if (socket_ >= 0) {
            ::close(socket_);
        }
        socket_ = -1;
    }
    /// Ends the connection with a reset, as after a power failure of the client.
    void abort() {
        const linger now{1, 0};
        setsockopt(socket_, SOL_SOCKET, SO_LINGER, &now, sizeof now);
        close();
    }
    [[nodiscard]] int socket() const { return socket_; }

  private:
    int socket_;
};

class UsbipServerTest : public testing::Test {
  protected:
    /// Steps the server until the peer has received `bytes` or nothing more arrives; returns the bytes. The end of the
    /// connection ends them.
    Bytes receive(const Peer& peer, std::size_t bytes) {
        Bytes all;
        while (all.size() < bytes) {
            step();
            std::array<std::byte, 4096> buffer{};
            const ssize_t count =
                recv(peer.socket(), buffer.data(), std::min(buffer.size(), bytes - all.size()), MSG_DONTWAIT);
            if (count > 0) {
                all.insert(all.end(), buffer.begin(), buffer.begin() + count);
            } else if (count == 0 || errno != EAGAIN || !wait_for(peer)) {
                break;
            }
        }
        return all;
    }
    /// Whether the server has closed the connection.
    bool is_closed(const Peer& peer) {
        while (true) {
            step();
            std::byte byte{};
            const ssize_t count = recv(peer.socket(), &byte, 1, MSG_DONTWAIT | MSG_PEEK);
            if (count >= 0 || errno != EAGAIN) {
                return count <= 0;
            }
            if (!wait_for(peer)) {
                return false;
            }
        }
    }
    /// Waits until the server or the peer has work.
    bool wait_for(const Peer& peer) {
        pollfd either[] = {{server.descriptor(), POLLIN, 0}, {peer.socket(), POLLIN, 0}};
        return poll(either, 2, kPatienceMs) > 0;
    }
    void wait_and_step() {
        pollfd server_alone{server.descriptor(), POLLIN, 0};
        ASSERT_EQ(poll(&server_alone, 1, kPatienceMs), 1);
        step();
    }
    void step() { server.step(now_ns); }
    void import_by(const Peer& peer) {
        peer.send(import_request());
        const Bytes reply = receive(peer, 8 + 312);
        ASSERT_EQ(reply.size(), 8u + 312);
        ASSERT_EQ(word_at(reply, 4), 0u);
    }

    std::int64_t now_ns = 1'000'000'000;
    EmulatedDevice device{{.geometry = spidar_g6_x3r()}};
    CabledFirmware firmware{device};
    std::vector<std::string> reports;
    UsbipServer server{{"127.0.0.1", 0}, BoardKind::Sh4, firmware, UsbSpeed::High, [this](std::string_view line) {
                           reports.emplace_back(line);
                       }};
};

Bytes sh4_packet(std::uint16_t dac_code) {
    Sh4Command command;
    command.dac_codes.fill(dac_code);
    Sh4Packet packet;
    encode(command, packet);
    return {packet.begin(), packet.end()};
}

TEST(NetworkAddress, IsHostAndPort) {
    EXPECT_EQ(parse_network_address("127.0.0.1:3240").host, "127.0.0.1");
    EXPECT_EQ(parse_network_address("127.0.0.1:3240").port, 3240);
    EXPECT_EQ(parse_network_address("[::1]:0").host, "::1");
    EXPECT_EQ(parse_network_address("localhost:65535").port, 65535);
    for (const char* wrong : {"", "3240", "127.0.0.1", ":3240", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1",
                              "127.0.0.1:32x", "::1:3240", "[]:1"}) {
        EXPECT_THROW(static_cast<void>(parse_network_address(wrong)), std::invalid_argument) << wrong;
    }
}

TEST_F(UsbipServerTest, RefusesAnAddressThatIsTakenOrNotOfThisMachine) {
    const auto serve_at = [&](const NetworkAddress& address) {
        const UsbipServer second(address, BoardKind::Sh4, firmware, UsbSpeed::High, [](std::string_view) {});
    };
    EXPECT_THROW(serve_at(server.address()), std::system_error);
    EXPECT_THROW(serve_at({"192.0.2.1", 0}), std::system_error);
    EXPECT_THROW(serve_at({"no such host", 0}), std::invalid_argument);
}

TEST_F(UsbipServerTest, ListensOnAPortOfItsOwnChoiceIfNoneWasAskedFor) {
    EXPECT_EQ(server.address().host, "127.0.0.1");
    EXPECT_GT(server.address().port, 0);
}

TEST_F(UsbipServerTest, ListsTheDeviceAndClosesTheConnection) {
    const Peer peer(server.address().port);
    peer.send(hex("0111 8005 00000000"));
    EXPECT_EQ(receive(peer, 1000).size(), 12u + 312 + 4);
    EXPECT_EQ(server.clients(), 0u);
}

TEST_F(UsbipServerTest, CarriesPacketsToTheBoardAndItsAnswersBack) {
    const Peer peer(server.address().port);
    import_by(peer);
    EXPECT_THAT(reports, Contains(HasSubstr("imported by 127.0.0.1:")));
    peer.send(joined({submit_in(1, 6, 512), submit_out(2, 2, sh4_packet(45))}));
    const Bytes answers = receive(peer, 48 + 48 + 512);
    ASSERT_EQ(answers.size(), 48u + 48 + 512);
    EXPECT_EQ(word_at(answers, 4), 2u) << "the OUT is answered first";
    EXPECT_EQ(word_at(answers, 48 + 4), 1u);
    EXPECT_EQ(device.dac_codes()[7], 45);
    EXPECT_EQ(answers[96], std::byte{45}) << "the echo of the first D/A";
}

TEST_F(UsbipServerTest, ASecondClientIsToldThatTheDeviceIsBusyAndGetsItWhenTheFirstIsGone) {
    auto first = std::make_unique<Peer>(server.address().port);
    import_by(*first);
    const Peer second(server.address().port);
    second.send(import_request());
    EXPECT_EQ(receive(second, 1000), hex("0111 0003 00000002"));
    first.reset();
    wait_and_step();
    EXPECT_FALSE(server.imported());
    EXPECT_THAT(reports, Contains(AllOf(HasSubstr("has lost the device"), HasSubstr("closed the connection"))));
    const Peer third(server.address().port);
    import_by(third);
}

TEST_F(UsbipServerTest, AClientThatIsResetInTheMiddleOfATransferFreesTheDevice) {
    Peer peer(server.address().port);
    import_by(peer);
    Bytes half = submit_out(1, 2, sh4_packet(45));
    half.resize(300);
    peer.send(joined({submit_in(2, 6, 512), half}));
    wait_and_step();
    peer.abort();
    wait_and_step();
    EXPECT_EQ(server.clients(), 0u);
    EXPECT_EQ(device.dac_codes()[0], 0) << "half a packet is none";
    const Peer next(server.address().port);
    import_by(next);
}

TEST_F(UsbipServerTest, AClientThatSendsRubbishLosesItsConnectionAndNobodyElseDoes) {
    const Peer good(server.address().port);
    import_by(good);
    const Peer bad(server.address().port);
    bad.send(hex("474554202f20485454502f312e310d0a0d0a"));
    EXPECT_TRUE(is_closed(bad));
    good.send(submit_out(2, 2, sh4_packet(45)));
    EXPECT_EQ(receive(good, 48).size(), 48u);
}

TEST_F(UsbipServerTest, AClientThatAsksForNothingIsSentAwayInTime) {
    const Peer silent(server.address().port);
    wait_and_step();
    ASSERT_EQ(server.clients(), 1u);
    ASSERT_TRUE(server.due_ns().has_value());
    EXPECT_EQ(*server.due_ns(), now_ns + UsbipServer::kImportTimeoutNs);
    now_ns += UsbipServer::kImportTimeoutNs - 1;
    step();
    EXPECT_EQ(server.clients(), 1u);
    now_ns += 1;
    step();
    EXPECT_EQ(server.clients(), 0u);
    EXPECT_EQ(server.due_ns(), std::nullopt);
}

TEST_F(UsbipServerTest, AClientThatHasImportedMayBeSilentForAsLongAsItLikes) {
    const Peer peer(server.address().port);
    import_by(peer);
    now_ns += 1000 * UsbipServer::kImportTimeoutNs;
    step();
    EXPECT_TRUE(server.imported());
    EXPECT_EQ(server.due_ns(), std::nullopt) << "nothing to wake up for";
}

TEST_F(UsbipServerTest, AWaitingTransferMakesItAskTheFirmwareAgain) {
    const Peer peer(server.address().port);
    import_by(peer);
    peer.send(submit_in(1, 6, 512));
    wait_and_step();
    EXPECT_EQ(server.due_ns(), now_ns + kUsbPollNs);
    const Bytes packet = sh4_packet(45);
    firmware.receive(packet, now_ns);
    step();
    EXPECT_EQ(receive(peer, 48 + 512).size(), 48u + 512);
    EXPECT_EQ(server.due_ns(), std::nullopt);
}

TEST_F(UsbipServerTest, AClientThatReadsNothingIsNotReadFromEither) {
    const Peer peer(server.address().port);
    import_by(peer);
    // Requests with long replies. Eventually the server stops reading and the kernel's buffers are full.
    Bytes requests;
    for (std::uint32_t i = 0; i < 256; ++i) {
        requests = joined({requests, submit_in(i, 0, 255, 0, hex("80 06 0203 0904 ff00"))});
    }
    ssize_t sent = 0;
    int rounds = 0;
    for (int refused = 0; refused < 3 && rounds < 100'000; ++rounds) {
        const ssize_t count = peer.send_what_goes(requests);
        refused = count < 0 ? refused + 1 : 0;
        sent += std::max<ssize_t>(count, 0);
        step();
        if (count < 0) {
            pollfd writable{peer.socket(), POLLOUT, 0};
            poll(&writable, 1, 20);
            step();
        }
    }
    EXPECT_LT(rounds, 100'000) << "it takes whatever comes";
    EXPECT_GT(sent, 0);
    EXPECT_TRUE(server.imported());
    // Other clients are still served.
    const Peer other(server.address().port);
    other.send(hex("0111 8005 00000000"));
    EXPECT_EQ(receive(other, 12).size(), 12u);
    // The server continues when the client reads again.
    EXPECT_EQ(receive(peer, 1'000'000).size(), 1'000'000u);
}

TEST_F(UsbipServerTest, NoMoreClientsThanItKeeps) {
    std::vector<std::unique_ptr<Peer>> peers;
    for (std::size_t i = 0; i < UsbipServer::kMaxClients + 1; ++i) {
        peers.push_back(std::make_unique<Peer>(server.address().port));
        wait_and_step();
    }
    EXPECT_EQ(server.clients(), UsbipServer::kMaxClients);
    EXPECT_TRUE(is_closed(*peers.back()));
    EXPECT_THAT(reports, Contains(HasSubstr("16 clients are connected already")));
}

TEST_F(UsbipServerTest, UnpluggingTakesTheDeviceAwayUntilItIsPluggedAgain) {
    const Peer peer(server.address().port);
    import_by(peer);
    firmware.plugged = false;
    EXPECT_TRUE(is_closed(peer));
    const Peer second(server.address().port);
    second.send(import_request());
    EXPECT_EQ(receive(second, 1000), hex("0111 0003 00000004"));
    firmware.plugged = true;
    const Peer third(server.address().port);
    import_by(third);
}

}  // namespace
}  // namespace haptic::device
