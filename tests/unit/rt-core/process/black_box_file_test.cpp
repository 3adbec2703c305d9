#include "process/black_box_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/statfs.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "tick/recorder.hpp"
#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::size_t kTicks = 8;

TickRecord numbered(std::int64_t number) {
    TickRecord record;
    record.now_ns = number;
    return record;
}

class BlackBoxFileTest : public testing::Test {
  protected:
    ~BlackBoxFileTest() override { std::filesystem::remove(BlackBoxFile::path_of(session)); }
    std::string session = test::unique_session();
};

TEST_F(BlackBoxFileTest, LeavesNothingAfterAnOrderlyEnd) {
    {
        const BlackBoxFile file(session, BlackBox::bytes(kTicks), "run.killed.csv");
        EXPECT_EQ(file.memory().size(), BlackBox::bytes(kTicks));
        EXPECT_TRUE(std::filesystem::exists(BlackBoxFile::path_of(session)));
        EXPECT_THAT([&] { (void)read_left_black_box(session, 0.0); },
                    ThrowsMessage<std::runtime_error>(HasSubstr("in use")));
    }
    EXPECT_FALSE(std::filesystem::exists(BlackBoxFile::path_of(session)));
    EXPECT_FALSE(read_left_black_box(session, 0.0));
}

TEST_F(BlackBoxFileTest, KeepsTheTicksOfAKilledProcessAndWhereTheyBelong) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        const BlackBoxFile file(session, BlackBox::bytes(kTicks), "run.killed.csv");
        BlackBox box(kTicks);
        box.store_in(file.memory());
        for (std::int64_t i = 0; i < 5; ++i) {
            box.push(numbered(i));
        }
        (void)raise(SIGKILL);
    }
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    auto left = read_left_black_box(session, 0.0);
    ASSERT_TRUE(left);
    EXPECT_EQ(left->csv, std::filesystem::absolute("run.killed.csv"));
    EXPECT_EQ(left->file, BlackBoxFile::path_of(session));
    const BlackBox box(left->memory);
    ASSERT_EQ(box.size(), 5u);
    EXPECT_EQ(box.at(4).now_ns, 4);
}

TEST_F(BlackBoxFileTest, IsOnAFileSystemThatNeverWritesPagesBack) {
    const BlackBoxFile file(session, BlackBox::bytes(kTicks), "run.killed.csv");
    struct statfs status{};
    ASSERT_EQ(fstatfs(file.descriptor(), &status), 0);
    constexpr auto tmpfs = 0x01021994;
    EXPECT_EQ(status.f_type, tmpfs);
}

TEST_F(BlackBoxFileTest, IsAnErrorAtTheStartWhereItDoesNotFitOrExists) {
    EXPECT_THAT([&] { BlackBoxFile(session, std::size_t{1} << 50, "a.csv"); },
                ThrowsMessage<std::runtime_error>(HasSubstr("cannot be had")));
    EXPECT_FALSE(std::filesystem::exists(BlackBoxFile::path_of(session)));
    const BlackBoxFile file(session, BlackBox::bytes(kTicks), "a.csv");
    EXPECT_THAT([&] { BlackBoxFile(session, BlackBox::bytes(kTicks), "a.csv"); },
                ThrowsMessage<std::runtime_error>(HasSubstr("cannot be created")));
}

}  // namespace
}  // namespace haptic::rt
