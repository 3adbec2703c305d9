#include "process/guard_channel.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>

#include "process/guard_link.hpp"

namespace haptic::rt {
namespace {

class GuardChannel : public testing::Test {
  protected:
    GuardChannel() { (void)socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()); }
    ~GuardChannel() override {
        close(ends[0]);
        if (ends[1] >= 0) {
            close(ends[1]);
        }
    }
    std::array<int, 2> ends{-1, -1};
};

ino_t inode_of(int descriptor) {
    struct stat status{};
    return fstat(descriptor, &status) == 0 ? status.st_ino : 0;
}

TEST_F(GuardChannel, CarriesEachDescriptorToItsPlace) {
    const int page = memfd_create("page", 0);
    const int device = memfd_create("device", 0);
    GuardMessage message{.priority = 82, .silence_ns = 15'000'000};
    message.zero.set_packet(std::array{std::byte{1}, std::byte{2}});
    ASSERT_TRUE(send_message(ends[0], message, {.page = page, .black_box = -1, .device = device}));
    GuardMessage received;
    GuardDescriptors descriptors;
    ASSERT_EQ(receive_message(ends[1], received, descriptors), Received::Message);
    EXPECT_EQ(received.order, GuardOrder::Begin);
    EXPECT_EQ(received.silence_ns, 15'000'000);
    EXPECT_EQ(received.zero.size, 2u);
    EXPECT_EQ(inode_of(descriptors.page), inode_of(page));
    EXPECT_EQ(descriptors.black_box, -1);
    EXPECT_EQ(inode_of(descriptors.device), inode_of(device));
    for (const int descriptor : {page, device, descriptors.page, descriptors.device}) {
        close(descriptor);
    }
}

TEST_F(GuardChannel, TellsSilenceFromTheEnd) {
    GuardMessage message;
    GuardDescriptors descriptors;
    EXPECT_EQ(receive_message(ends[0], message, descriptors), Received::Nothing);
    ASSERT_TRUE(send_message(ends[1], {.order = GuardOrder::Leave}, {}));
    close(ends[1]);
    ends[1] = -1;
    EXPECT_EQ(receive_message(ends[0], message, descriptors), Received::Message)
        << "what was said before the end counts";
    EXPECT_EQ(message.order, GuardOrder::Leave);
    EXPECT_EQ(receive_message(ends[0], message, descriptors), Received::Ended);
    EXPECT_FALSE(send_message(ends[0], message, {})) << "and no SIGPIPE";
}

TEST_F(GuardChannel, WaitsForTheAnswerNoLongerThanItMay) {
    EXPECT_FALSE(receive_grant(ends[0], 5'000'000));
    ASSERT_TRUE(send_grant(ends[1], {.process = 7, .priority = 82}));
    const auto grant = receive_grant(ends[0], 1'000'000'000);
    ASSERT_TRUE(grant);
    EXPECT_EQ(grant->priority, 82);
    close(ends[1]);
    ends[1] = -1;
    EXPECT_FALSE(receive_grant(ends[0], 60'000'000'000)) << "the guard is gone";
}

TEST(GuardSilence, IsNeverShorterThanATickMayWaitForItsBoard) {
    EXPECT_EQ(guard_silence_ns(15'000'000, 8'000'000, 1'000'000), 15'000'000);
    EXPECT_EQ(guard_silence_ns(15'000'000, 8'000'000, 4'000'000), 24'000'000);
    EXPECT_EQ(guard_silence_ns(15'000'000, 200'000'000, 10'000'000), 240'000'000);
}

}  // namespace
}  // namespace haptic::rt
