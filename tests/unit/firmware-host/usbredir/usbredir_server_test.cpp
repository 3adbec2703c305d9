// UsbredirServer over a real Unix socket. The guest is libusbredirparser, the library that QEMU's usb-redir speaks
// with; the server does not use it.
#include "usbredir/usbredir_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <usbredirparser.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "cabled_firmware.hpp"
#include "codecs/sh4_codec.hpp"
#include "emulated/make_firmware.hpp"
#include "haptic/device/emulated_device.hpp"

namespace haptic::device {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

using Bytes = std::vector<std::byte>;

constexpr int kPatienceMs = 5000;  // for bytes on the socket; a test that waits this long fails
constexpr std::uint8_t kOut = 0x02;
constexpr std::uint8_t kIn = 0x86;

// Capabilities of QEMU 7.2.
const std::vector<int> kQemu = {usb_redir_cap_connect_device_version,  usb_redir_cap_filter,
                                usb_redir_cap_ep_info_max_packet_size, usb_redir_cap_64bits_ids,
                                usb_redir_cap_32bits_bulk_length,      usb_redir_cap_bulk_streams,
                                usb_redir_cap_device_disconnect_ack,   usb_redir_cap_bulk_receiving};

/// Answer to a transfer.
struct Transfer {
    std::uint64_t id = 0;
    int endpoint = 0;
    int status = 0;
    std::uint32_t length = 0;
    Bytes data{};
};

/// The guest's end of the protocol.
class Guest {
  public:
    explicit Guest(const std::filesystem::path& path, const std::vector<int>& capabilities = kQemu)
        : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)), parser_(usbredirparser_create()) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
        if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
            throw std::system_error(errno, std::generic_category(), "connect");
        }
        parser_->priv = this;
        parser_->log_func = [](void* priv, int level, const char* text) {
            if (level <= usbredirparser_warning) {
                of(priv).complaints.emplace_back(text);
            }
        };
        parser_->read_func = [](void* priv, std::uint8_t* data, int count) {
            const ssize_t got = recv(of(priv).socket_, data, static_cast<std::size_t>(count), 0);
            if (got == 0) {
                of(priv).closed = true;
                return -1;
            }
            return got < 0 ? 0 : static_cast<int>(got);
        };
        parser_->write_func = [](void* priv, std::uint8_t* data, int count) {
            return static_cast<int>(::send(of(priv).socket_, data, static_cast<std::size_t>(count), MSG_NOSIGNAL));
        };
        listen_for_devices();
        listen_for_answers();
        std::array<std::uint32_t, USB_REDIR_CAPS_SIZE> bits{};
        for (const int capability : capabilities) {
            usbredirparser_caps_set_cap(bits.data(), capability);
        }
        usbredirparser_init(parser_, "a test", bits.data(), USB_REDIR_CAPS_SIZE, 0);
        send_all();
    }
    Guest(const Guest&) = delete;
    Guest& operator=(const Guest&) = delete;
    ~Guest() {
        usbredirparser_destroy(parser_);
        close();
    }
    void close() {
        if (socket_ >= 0) {
            ::close(socket_);
        }
        socket_ = -1;
    }

    [[nodiscard]] int socket() const { return socket_; }
    void read() { usbredirparser_do_read(parser_); }
    /// Sends what is queued: requests, and the parser's own acknowledgement of a disconnect.
    void send_all() { ASSERT_EQ(usbredirparser_do_write(parser_), 0); }

    void ask_control(std::uint64_t id, std::uint8_t type, std::uint8_t request, std::uint16_t value,
                     std::uint16_t index, std::uint16_t length) {
        usb_redir_control_packet_header header{};
        header.endpoint = type & 0x80U;
        header.requesttype = type;
        header.request = request;
        header.value = value;
        header.index = index;
        header.length = length;
        usbredirparser_send_control_packet(parser_, id, &header, nullptr, 0);
        send_all();
    }
    void ask_in(std::uint64_t id, std::uint32_t length) {
        usb_redir_bulk_packet_header header{};
        header.endpoint = kIn;
        header.length = length & 0xFFFFU;
        header.length_high = static_cast<std::uint16_t>(length >> 16U);
        usbredirparser_send_bulk_packet(parser_, id, &header, nullptr, 0);
        send_all();
    }
    void send_out(std::uint64_t id, const Bytes& data) {
        usb_redir_bulk_packet_header header{};
        header.endpoint = kOut;
        header.length = static_cast<std::uint16_t>(data.size());
        Bytes copy = data;
        usbredirparser_send_bulk_packet(parser_, id, &header, reinterpret_cast<std::uint8_t*>(copy.data()),
                                        static_cast<int>(copy.size()));
        send_all();
    }
    void cancel(std::uint64_t id) {
        usbredirparser_send_cancel_data_packet(parser_, id);
        send_all();
    }
    void reset() {
        usbredirparser_send_reset(parser_);
        send_all();
    }
    void set_configuration(std::uint64_t id, std::uint8_t configuration) {
        usb_redir_set_configuration_header header{configuration};
        usbredirparser_send_set_configuration(parser_, id, &header);
        send_all();
    }
    void get_configuration(std::uint64_t id) {
        usbredirparser_send_get_configuration(parser_, id);
        send_all();
    }
    void set_alt_setting(std::uint64_t id, std::uint8_t interface, std::uint8_t setting) {
        usb_redir_set_alt_setting_header header{interface, setting};
        usbredirparser_send_set_alt_setting(parser_, id, &header);
        send_all();
    }
    void get_alt_setting(std::uint64_t id, std::uint8_t interface) {
        usb_redir_get_alt_setting_header header{interface};
        usbredirparser_send_get_alt_setting(parser_, id, &header);
        send_all();
    }
    void start_interrupt_receiving() {
        usb_redir_start_interrupt_receiving_header header{kIn};
        usbredirparser_send_start_interrupt_receiving(parser_, 1, &header);
        send_all();
    }
    /// The answer to a transfer; null until it is there.
    [[nodiscard]] const Transfer* answer(std::uint64_t id) const {
        const auto found =
            std::find_if(answers.begin(), answers.end(), [&](const Transfer& answer) { return answer.id == id; });
        return found == answers.end() ? nullptr : &*found;
    }

    bool closed = false;
    std::vector<std::string> complaints;  // of the parser
    std::string version;
    int connects = 0;
    int disconnects = 0;
    // Aligned, which the protocol's packed structures need not be: gtest refers to their numbers.
    alignas(std::uint32_t) usb_redir_device_connect_header device{};
    alignas(std::uint32_t) usb_redir_interface_info_header interfaces{};
    alignas(std::uint32_t) usb_redir_ep_info_header endpoints{};
    bool endpoints_before_device = false;
    std::vector<Transfer> answers;
    std::vector<std::array<int, 3>> configurations;  // id, status, configuration
    std::vector<std::array<int, 4>> settings;        // id, status, interface, alternate setting

  private:
    static Guest& of(void* priv) { return *static_cast<Guest*>(priv); }

    void listen_for_devices() {
        parser_->hello_func = [](void* priv, usb_redir_hello_header* hello) { of(priv).version = hello->version; };
        parser_->device_connect_func = [](void* priv, usb_redir_device_connect_header* header) {
            of(priv).device = *header;
            ++of(priv).connects;
            of(priv).endpoints_before_device = of(priv).endpoints.type[2] == usb_redir_type_bulk;
        };
        parser_->device_disconnect_func = [](void* priv) { ++of(priv).disconnects; };
        parser_->interface_info_func = [](void* priv, usb_redir_interface_info_header* header) {
            of(priv).interfaces = *header;
        };
        parser_->ep_info_func = [](void* priv, usb_redir_ep_info_header* header) { of(priv).endpoints = *header; };
    }
    void listen_for_answers() {
        parser_->configuration_status_func = [](void* priv, std::uint64_t id,
                                                usb_redir_configuration_status_header* header) {
            of(priv).configurations.push_back({static_cast<int>(id), header->status, header->configuration});
        };
        parser_->alt_setting_status_func = [](void* priv, std::uint64_t id,
                                              usb_redir_alt_setting_status_header* header) {
            of(priv).settings.push_back({static_cast<int>(id), header->status, header->interface, header->alt});
        };
        parser_->control_packet_func = [](void* priv, std::uint64_t id, usb_redir_control_packet_header* header,
                                          std::uint8_t* data, int length) {
            of(priv).keep({.id = id, .endpoint = header->endpoint, .status = header->status, .length = header->length},
                          data, length);
        };
        parser_->bulk_packet_func = [](void* priv, std::uint64_t id, usb_redir_bulk_packet_header* header,
                                       std::uint8_t* data, int length) {
            of(priv).keep({.id = id,
                           .endpoint = header->endpoint,
                           .status = header->status,
                           .length = header->length | (std::uint32_t{header->length_high} << 16U)},
                          data, length);
        };
    }
    void keep(Transfer transfer, std::uint8_t* data, int length) {
        const auto* bytes = reinterpret_cast<const std::byte*>(data);
        transfer.data.assign(bytes, bytes + length);
        usbredirparser_free_packet_data(parser_, data);
        answers.push_back(std::move(transfer));
    }

    int socket_;
    usbredirparser* parser_;
};

Bytes sh4_packet(std::uint16_t dac_code) {
    Sh4Command command;
    command.dac_codes.fill(dac_code);
    Sh4Packet packet;
    encode(command, packet);
    return {packet.begin(), packet.end()};
}

class UsbredirServerTest : public testing::Test {
  protected:
    UsbredirServerTest() { serve(UsbSpeed::High); }
    ~UsbredirServerTest() override {
        server.reset();
        std::filesystem::remove_all(folder);
    }

    void serve(UsbSpeed speed) {
        server.reset();
        server = std::make_unique<UsbredirServer>(path, BoardKind::Sh4, firmware, speed,
                                                  [this](std::string_view line) { reports.emplace_back(line); });
    }
    /// Steps the server and the guest until the condition holds. Fails if nothing arrives any more.
    testing::AssertionResult until(Guest& guest, const std::function<bool()>& condition) {
        while (true) {
            server->step(now_ns);
            guest.read();
            if (condition()) {
                return testing::AssertionSuccess();
            }
            if (guest.closed) {
                return testing::AssertionFailure() << "the server closed the connection";
            }
            pollfd either[] = {{server->descriptor(), POLLIN, 0}, {guest.socket(), POLLIN, 0}};
            if (poll(either, 2, kPatienceMs) <= 0) {
                return testing::AssertionFailure() << "nothing arrived";
            }
        }
    }
    testing::AssertionResult until_answered(Guest& guest, std::uint64_t id) {
        return until(guest, [&] { return guest.answer(id) != nullptr; });
    }
    testing::AssertionResult until_connected(Guest& guest) {
        return until(guest, [&] { return guest.connects == 1; });
    }
    /// Steps until the server has closed the guest's connection.
    testing::AssertionResult until_closed(Guest& guest) {
        return until(guest, [&] { return guest.closed; });
    }

    /// Steps until the server has found that its guest is gone.
    void wait_until_gone() {
        const auto gone = [&] {
            return std::any_of(reports.begin(), reports.end(),
                               [](const std::string& line) { return line.starts_with("the guest is gone"); });
        };
        pollfd alone{server->descriptor(), POLLIN, 0};
        while (!gone()) {
            ASSERT_EQ(poll(&alone, 1, kPatienceMs), 1);
            server->step(now_ns);
        }
    }

    std::filesystem::path folder = [] {
        std::string text = std::filesystem::temp_directory_path() / "usbredir-XXXXXX";
        return std::filesystem::path(mkdtemp(text.data()));
    }();
    std::filesystem::path path = folder / "board";
    std::int64_t now_ns = 1'000'000'000;
    EmulatedDevice device{{.geometry = spidar_g6_x3r()}};
    CabledFirmware firmware{device};
    std::vector<std::string> reports;
    std::unique_ptr<UsbredirServer> server;
};

TEST_F(UsbredirServerTest, ConnectsTheBoardWithItsIdsAndEndpointsAtTheServedSpeed) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    EXPECT_TRUE(server->connected());
    EXPECT_THAT(guest.version, HasSubstr("firmware-host"));
    EXPECT_TRUE(guest.endpoints_before_device) << "QEMU needs them before it attaches the device";
    EXPECT_EQ(guest.device.speed, usb_redir_speed_high);
    EXPECT_EQ(guest.device.vendor_id, 0x0CEC);
    EXPECT_EQ(guest.device.product_id, 0x0205);
    EXPECT_EQ(guest.device.device_version_bcd, 0x0001);
    EXPECT_EQ(guest.device.device_class, 0xFF);
    EXPECT_EQ(guest.interfaces.interface_count, 1u);
    EXPECT_EQ(guest.interfaces.interface_class[0], 0xFF);
    // Endpoints by the protocol's index: OUT 0 to 15, IN 16 to 31.
    for (int i = 0; i < 32; ++i) {
        const int expected = i == 0 || i == 16   ? usb_redir_type_control
                             : i == 2 || i == 22 ? usb_redir_type_bulk
                                                 : usb_redir_type_invalid;
        EXPECT_EQ(guest.endpoints.type[i], expected) << i;
        EXPECT_EQ(guest.endpoints.max_packet_size[i], expected == usb_redir_type_control ? 64
                                                      : expected == usb_redir_type_bulk  ? 512
                                                                                         : 0)
            << i;
    }
    EXPECT_TRUE(guest.complaints.empty()) << guest.complaints.front();
}

TEST_F(UsbredirServerTest, AtFullSpeedPacketsHave64BytesAndAnExchangeIsTheSame) {
    serve(UsbSpeed::Full);
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    EXPECT_EQ(guest.device.speed, usb_redir_speed_full);
    EXPECT_EQ(guest.endpoints.max_packet_size[2], 64);
    EXPECT_EQ(guest.endpoints.max_packet_size[22], 64);
    guest.ask_control(1, 0x80, 6, 0x0200, 0, 255);
    guest.ask_in(2, 512);
    guest.send_out(3, sh4_packet(45));
    ASSERT_TRUE(until_answered(guest, 2));
    const Bytes& configuration = guest.answer(1)->data;
    ASSERT_EQ(configuration.size(), 32u);
    EXPECT_EQ(configuration[1], std::byte{2}) << "the current configuration";
    EXPECT_EQ(configuration[22], std::byte{64}) << "wMaxPacketSize of OUT";
    EXPECT_EQ(configuration[29], std::byte{64}) << "of IN";
    EXPECT_EQ(guest.answer(2)->data.size(), 512u);
    EXPECT_EQ(device.dac_codes()[7], 45);
}

TEST_F(UsbredirServerTest, CarriesPacketsToTheBoardAndItsAnswersBack) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    constexpr std::uint64_t kLongId = 0x1234'5678'9ABC'DEF0;  // QEMU's ids are addresses of the guest
    guest.ask_in(kLongId, 512);
    guest.send_out(2, sh4_packet(45));
    ASSERT_TRUE(until_answered(guest, kLongId));
    ASSERT_EQ(guest.answers.size(), 2u);
    EXPECT_EQ(guest.answers[0].id, 2u) << "the OUT is answered first";
    EXPECT_EQ(guest.answers[0].status, usb_redir_success);
    EXPECT_EQ(guest.answers[0].length, 512u);
    EXPECT_EQ(guest.answers[0].endpoint, kOut);
    EXPECT_EQ(guest.answers[1].status, usb_redir_success);
    EXPECT_EQ(guest.answers[1].endpoint, kIn);
    ASSERT_EQ(guest.answers[1].data.size(), 512u);
    EXPECT_EQ(guest.answers[1].data[0], std::byte{45}) << "the echo of the first D/A";
    EXPECT_EQ(device.dac_codes()[7], 45);
    EXPECT_TRUE(guest.complaints.empty()) << guest.complaints.front();
}

TEST_F(UsbredirServerTest, AnswersControlTransfersAndStallsWhatTheBoardDoesNotKnow) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.ask_control(1, 0x80, 6, 0x0100, 0, 18);  // device descriptor
    guest.ask_control(2, 0x80, 6, 0x0302, 0x0409, 255);
    guest.ask_control(3, 0xC0, 1, 0, 0, 8);  // a vendor request
    ASSERT_TRUE(until_answered(guest, 3));
    ASSERT_EQ(guest.answer(1)->data.size(), 18u);
    EXPECT_EQ(guest.answer(1)->data[8], std::byte{0xEC});
    EXPECT_EQ(guest.answer(2)->data[1], std::byte{3}) << "a string";
    EXPECT_EQ(guest.answer(3)->status, usb_redir_stall);
    EXPECT_TRUE(guest.answer(3)->data.empty());
    EXPECT_TRUE(guest.complaints.empty()) << guest.complaints.front();
}

TEST_F(UsbredirServerTest, SelectsConfigurationsAndTellsTheEndpointsOfEach) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.get_configuration(1);
    guest.set_configuration(2, 0);
    ASSERT_TRUE(until(guest, [&] { return guest.configurations.size() == 2; }));
    EXPECT_EQ(guest.interfaces.interface_count, 0u);
    EXPECT_EQ(guest.endpoints.type[2], usb_redir_type_invalid);
    guest.send_out(3, sh4_packet(45));
    ASSERT_TRUE(until_answered(guest, 3));
    EXPECT_EQ(guest.answer(3)->status, usb_redir_stall) << "it has no such endpoint now";
    guest.set_configuration(4, 1);
    guest.set_configuration(5, 2);
    ASSERT_TRUE(until(guest, [&] { return guest.configurations.size() == 4; }));
    EXPECT_EQ(guest.endpoints.type[2], usb_redir_type_bulk);
    const std::vector<std::array<int, 3>> expected = {
        {1, usb_redir_success, 1}, {2, usb_redir_success, 0}, {4, usb_redir_success, 1}, {5, usb_redir_stall, 1}};
    EXPECT_EQ(guest.configurations, expected);
}

TEST_F(UsbredirServerTest, HasOneAlternateSettingOfOneInterface) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.get_alt_setting(1, 0);
    guest.set_alt_setting(2, 0, 0);
    guest.set_alt_setting(3, 0, 1);
    guest.get_alt_setting(4, 1);
    ASSERT_TRUE(until(guest, [&] { return guest.settings.size() == 4; }));
    const std::vector<std::array<int, 4>> expected = {{1, usb_redir_success, 0, 0},
                                                      {2, usb_redir_success, 0, 0},
                                                      {3, usb_redir_stall, 0, 1},
                                                      {4, usb_redir_stall, 1, 0}};
    EXPECT_EQ(guest.settings, expected);
}

TEST_F(UsbredirServerTest, ACancelledTransferIsAnsweredOnceAndTheNextGetsTheReply) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.ask_in(1, 512);
    guest.cancel(1);
    ASSERT_TRUE(until_answered(guest, 1));
    EXPECT_EQ(guest.answer(1)->status, usb_redir_cancelled);
    EXPECT_EQ(guest.answer(1)->endpoint, kIn);
    guest.cancel(1);  // nothing is left to cancel
    guest.ask_in(2, 512);
    guest.send_out(3, sh4_packet(45));
    ASSERT_TRUE(until_answered(guest, 2));
    EXPECT_EQ(guest.answer(2)->status, usb_redir_success);
    EXPECT_EQ(guest.answers.size(), 3u);
}

TEST_F(UsbredirServerTest, AReplyThatDoesNotFitIsBabble) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.ask_in(1, 100);
    guest.send_out(2, sh4_packet(45));
    ASSERT_TRUE(until_answered(guest, 1));
    EXPECT_EQ(guest.answer(1)->status, usb_redir_babble);
    EXPECT_EQ(guest.answer(1)->data.size(), 100u);
}

TEST_F(UsbredirServerTest, AResetOfTheBusCancelsWhatIsPending) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.ask_in(1, 512);
    guest.reset();
    ASSERT_TRUE(until_answered(guest, 1));
    EXPECT_EQ(guest.answer(1)->status, usb_redir_cancelled);
    guest.ask_in(2, 512);
    guest.send_out(3, sh4_packet(45));
    ASSERT_TRUE(until_answered(guest, 2));
    EXPECT_EQ(guest.answer(2)->status, usb_redir_success);
}

TEST_F(UsbredirServerTest, TheCableOutDisconnectsTheDeviceAndInConnectsItAgain) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.ask_in(1, 512);
    ASSERT_TRUE(until(guest, [&] { return server->due_ns() == now_ns + kUsbPollNs; })) << "it asks for the reply";
    firmware.plugged = false;
    ASSERT_TRUE(until(guest, [&] { return guest.disconnects == 1; }));
    EXPECT_FALSE(server->connected());
    EXPECT_THAT(reports, Contains("unplugged"));
    EXPECT_EQ(server->due_ns(), now_ns + UsbredirServer::kCablePollNs) << "nothing else tells it of the cable";
    // What was on its way is answered with an error.
    guest.send_out(2, sh4_packet(45));
    guest.ask_control(3, 0x80, 6, 0x0100, 0, 18);
    ASSERT_TRUE(until_answered(guest, 3));
    EXPECT_EQ(guest.answer(2)->status, usb_redir_ioerror);
    EXPECT_EQ(guest.answer(3)->status, usb_redir_ioerror);
    EXPECT_EQ(device.dac_codes()[0], 0);
    // In again.
    firmware.plugged = true;
    ASSERT_TRUE(until(guest, [&] { return guest.connects == 2; }));
    guest.ask_in(4, 512);
    guest.send_out(5, sh4_packet(46));
    ASSERT_TRUE(until_answered(guest, 4));
    EXPECT_EQ(guest.answer(4)->data[0], std::byte{46});
    EXPECT_EQ(guest.answer(1), nullptr) << "lost with the cable";
    EXPECT_TRUE(guest.complaints.empty()) << guest.complaints.front();
}

TEST_F(UsbredirServerTest, ACableThatIsInAgainAtOnceWaitsUntilTheGuestKnowsThatItWasOut) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    firmware.plugged = false;
    ASSERT_TRUE(until(guest, [&] { return guest.disconnects == 1; }));
    firmware.plugged = true;
    server->step(now_ns);
    EXPECT_FALSE(server->connected());
    guest.send_all();  // the acknowledgement
    ASSERT_TRUE(until(guest, [&] { return guest.connects == 2; }));
}

TEST_F(UsbredirServerTest, AnUnpluggedBoardIsConnectedWhenItIsPluggedIn) {
    firmware.plugged = false;
    Guest guest(path);
    ASSERT_TRUE(until(guest, [&] { return !guest.version.empty(); }));
    server->step(now_ns);
    EXPECT_FALSE(server->connected());
    firmware.plugged = true;
    ASSERT_TRUE(until_connected(guest));
}

TEST_F(UsbredirServerTest, ASecondGuestIsSentAwayAndGetsTheDeviceWhenTheFirstIsGone) {
    auto first = std::make_unique<Guest>(path);
    ASSERT_TRUE(until_connected(*first));
    Guest second(path);
    EXPECT_TRUE(until_closed(second));
    EXPECT_THAT(reports, Contains(HasSubstr("another guest refused")));
    first->ask_in(1, 512);
    first.reset();
    wait_until_gone();
    EXPECT_FALSE(server->connected());
    EXPECT_THAT(reports, Contains("the guest is gone: closed the connection"));
    EXPECT_EQ(server->due_ns(), std::nullopt) << "nothing to wake up for";
    Guest third(path);
    EXPECT_TRUE(until_connected(third));
}

TEST_F(UsbredirServerTest, AGuestThatIsTooOldIsToldWhy) {
    Guest guest(path, {usb_redir_cap_connect_device_version});
    EXPECT_TRUE(until_closed(guest));
    EXPECT_THAT(reports, Contains(HasSubstr("is too old")));
}

TEST_F(UsbredirServerTest, AGuestThatAsksForWhatTheBoardHasNotLosesItsConnectionAndMayComeAgain) {
    Guest guest(path);
    ASSERT_TRUE(until_connected(guest));
    guest.start_interrupt_receiving();
    EXPECT_TRUE(until_closed(guest));
    EXPECT_THAT(reports, Contains(HasSubstr("type 15, which this device has no use for")));
    Guest next(path);
    EXPECT_TRUE(until_connected(next));
}

TEST_F(UsbredirServerTest, LeavesNoSocketAndReplacesOneThatNobodyListensAt) {
    server.reset();
    EXPECT_FALSE(std::filesystem::exists(path));
    // As a killed server leaves it.
    const int killed = ::socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    ASSERT_EQ(bind(killed, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ::close(killed);
    ASSERT_TRUE(std::filesystem::exists(path));
    serve(UsbSpeed::High);
    Guest guest(path);
    EXPECT_TRUE(until_connected(guest));
}

TEST_F(UsbredirServerTest, RefusesASocketInUseAnotherFileAndAPathThatIsTooLong) {
    const auto serve_at = [&](const std::filesystem::path& where) {
        const UsbredirServer second(where, BoardKind::Sh4, firmware, UsbSpeed::High, [](std::string_view) {});
    };
    EXPECT_THROW(serve_at(path), std::system_error);
    std::ofstream(folder / "notes") << "keep me";
    EXPECT_THROW(serve_at(folder / "notes"), std::system_error);
    EXPECT_TRUE(std::filesystem::exists(folder / "notes"));
    EXPECT_THROW(serve_at(folder / std::string(200, 'x')), std::invalid_argument);
    EXPECT_THROW(serve_at("/no/such/folder/board"), std::system_error);
    wait_until_gone();  // the second looked whether somebody listens
    Guest guest(path);
    EXPECT_TRUE(until_connected(guest)) << "the first still serves";
}

}  // namespace
}  // namespace haptic::device
