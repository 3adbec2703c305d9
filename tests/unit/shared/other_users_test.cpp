#include "haptic/other_users.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace haptic {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A folder that replaces /dev/shm.
class OtherUsers : public testing::Test {
  protected:
    void SetUp() override { std::filesystem::create_directories(folder); }
    void TearDown() override { std::filesystem::remove_all(folder); }
    void segment(uid_t user, const std::string& rest) const {
        std::ofstream(folder / ("haptic-" + std::to_string(user) + "-" + rest)).put('\0');
    }

    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / ("shm-" + std::to_string(getpid()));
    const uid_t other = geteuid() + 1000;
    const uid_t third = geteuid() + 1001;
    const uid_t fourth = geteuid() + 1002;
};

TEST_F(OtherUsers, AreThoseWithRingsOfTheSession) {
    segment(third, "default-state");
    segment(other, "default-contact");
    segment(other, "default-state");
    segment(fourth, "default-overlay");
    EXPECT_THAT(other_users_of("default", folder), ElementsAre(other, third, fourth));
}

TEST_F(OtherUsers, AreNeitherOurselvesNorThoseOfOtherSessions) {
    segment(geteuid(), "default-contact");
    segment(other, "my-default-contact");
    segment(other, "default-2-contact");
    segment(other, "default-contact-3");
    std::ofstream(folder / "haptic-default-contact").put('\0');
    std::ofstream(folder / "something-1-default-contact").put('\0');
    EXPECT_THAT(other_users_of("default", folder), IsEmpty());
    EXPECT_THAT(describe_other_users("default", folder), IsEmpty());
}

TEST_F(OtherUsers, AreNamedWithWhatToDo) {
    segment(other, "lab-contact");
    EXPECT_THAT(describe_other_users("lab", folder),
                AllOf(HasSubstr("session \"lab\""), HasSubstr(std::to_string(other)), HasSubstr("sudo -u")));
}

TEST_F(OtherUsers, AreNoneWhereThereIsNoSharedMemory) {
    EXPECT_THAT(other_users_of("default", folder / "missing"), IsEmpty());
}

}  // namespace
}  // namespace haptic
