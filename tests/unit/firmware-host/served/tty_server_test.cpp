#include "served/tty_server.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "boards/uart_board.hpp"
#include "emulated/uart_firmware.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/emulated_device.hpp"
#include "transport/serial_transport.hpp"

namespace haptic::device {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class TtyServerTest : public testing::Test {
  protected:
    void TearDown() override { std::filesystem::remove(link); }

    EmulatedDevice device{{.geometry = built_in_geometry("SpidarG6X4"), .power_up = {9, 8, 7, 6, 5, 4, 3, 2}}};
    UartFirmware firmware{device};
    std::filesystem::path link =
        std::filesystem::temp_directory_path() / ("haptic-tty-" + std::to_string(getpid()) + "-link");
};

/// Steps a server in a separate thread, as `serve` does.
class Served {
  public:
    explicit Served(TtyServer& server)
        : thread_([this, &server] {
              for (std::int64_t now_ns = 1; !done_; now_ns += 1'000'000) {
                  pollfd watched{server.descriptor(), POLLIN, 0};
                  poll(&watched, 1, 1);
                  server.step(now_ns);
              }
          }) {}
    Served(const Served&) = delete;
    Served& operator=(const Served&) = delete;
    ~Served() {
        done_ = true;
        thread_.join();
    }

  private:
    std::atomic<bool> done_{false};
    std::thread thread_;
};

TEST_F(TtyServerTest, IsALineOfUartBoardsForWhoeverOpensIt) {
    TtyServer server(firmware, link);
    const Served served(server);
    for (int session = 0; session < 2; ++session) {
        SerialTransport transport(session == 0 ? link : server.path(), {.timeout_ns = 50'000'000});
        UartBoard board(transport);
        board.start();
        BoardReading reading;
        ASSERT_EQ(board.exchange({{1, 2, 3, 4, -5, -6, -7, -8}}, reading, 0), ExchangeStatus::Ok) << session;
        EXPECT_EQ(reading.counters, (std::array<std::uint32_t, kStrings>{9, 8, 7, 6, 5, 4, 3, 2}));
    }
}

TEST_F(TtyServerTest, HasNothingToDoAWhileAfterItsLastInput) {
    TtyServer server(firmware, {});
    server.step(0);
    EXPECT_FALSE(server.due_ns());
    const int line = open(server.path().c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    ASSERT_EQ(write(line, "\x08", 1), 1);
    pollfd watched{server.descriptor(), POLLIN, 0};
    ASSERT_EQ(poll(&watched, 1, 1000), 1);
    server.step(1'000'000'000);
    ASSERT_TRUE(server.due_ns());
    EXPECT_GT(*server.due_ns(), 1'000'000'000);
    server.step(2'000'000'000);
    EXPECT_FALSE(server.due_ns());
    close(line);
}

TEST_F(TtyServerTest, LosesAnswersThatNobodyFetchesRatherThanWait) {
    TtyServer server(firmware, {});
    const int line = open(server.path().c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    const std::vector<char> request(9, '\x08');  // board info, repeatedly
    for (int k = 0; k < 3000; ++k) {
        ASSERT_GE(write(line, request.data(), request.size()), 0);
        server.step(k);
    }
    close(line);
}

TEST_F(TtyServerTest, LinksInPlaceOfALinkAndOfNothingElse) {
    std::filesystem::create_symlink("/dev/pts/of-a-server-that-was-killed", link);
    {
        const TtyServer server(firmware, link);
        EXPECT_EQ(std::filesystem::read_symlink(link), server.path());
    }
    EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(link)));
    std::ofstream(link) << "mine";
    EXPECT_THAT([&] { TtyServer(firmware, link); }, ThrowsMessage<std::runtime_error>(HasSubstr(link.string())));
    EXPECT_TRUE(std::filesystem::is_regular_file(link));
}

}  // namespace
}  // namespace haptic::device
