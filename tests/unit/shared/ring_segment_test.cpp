#include "ring_segment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <memory>
#include <optional>

#include "haptic/frames.hpp"
#include "ring_session.hpp"

namespace haptic {
namespace {

using detail::RingHeader;
using test::RingSession;
using testing::AllOf;
using testing::HasSubstr;

constexpr RingKind kKind = RingKind::Contact;
const std::size_t kSegmentBytes = detail::RingMemory::bytes(sizeof(ContactFrame));

class RingSegmentTest : public testing::Test {
  protected:
    RingSession session_;

    /// A valid segment with no process attached, as left by two killed processes.
    void leave_sound_segment() const {
        const int fd = session_.open(kKind, O_RDWR | O_CREAT);
        ASSERT_EQ(ftruncate(fd, static_cast<off_t>(kSegmentBytes)), 0);
        void* const memory = mmap(nullptr, kSegmentBytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        ASSERT_NE(memory, MAP_FAILED);
        detail::RingMemory(memory, sizeof(ContactFrame)).initialise(kKind);
        munmap(memory, kSegmentBytes);
        close(fd);
    }
    template <class Value>
    void damage(std::size_t offset, Value value) const {
        session_.write(kKind, offset, &value, sizeof value);
    }

    /// Both roles must be refused with the same kind and a message that names the segment.
    void expect_refused(RingError::Kind kind, const testing::Matcher<std::string>& matcher) const {
        expect_role_refused<RingWriter<ContactFrame>>(kind, matcher);
        expect_role_refused<RingReader<ContactFrame>>(kind, matcher);
    }
    template <class Role>
    void expect_role_refused(RingError::Kind kind, const testing::Matcher<std::string>& matcher) const {
        try {
            const Role role(session_.name());
            ADD_FAILURE() << "was not refused";
        } catch (const RingError& error) {
            EXPECT_EQ(error.kind(), kind) << error.what();
            EXPECT_THAT(error.what(), AllOf(HasSubstr(session_.path(kKind)), matcher));
        }
    }
    void expect_works() const {
        auto frame = std::make_unique<ContactFrame>();
        RingWriter<ContactFrame> writer(session_.name());
        RingReader<ContactFrame> reader(session_.name());
        writer.publish(*frame, 0);
        EXPECT_TRUE(reader.read_newest(*frame));
    }
    std::string removal() const { return "rm " + session_.path(kKind); }
};

TEST_F(RingSegmentTest, IsPrivateToItsUserWhateverTheUmask) {
    for (const mode_t mask : {0000u, 0022u, 0777u}) {
        const mode_t before = umask(mask);
        const RingWriter<ContactFrame> writer(session_.name());
        umask(before);
        struct stat status{};
        ASSERT_EQ(stat(session_.path(kKind).c_str(), &status), 0);
        EXPECT_EQ(status.st_mode & 07777u, 0600u) << std::oct << mask;
        EXPECT_EQ(status.st_uid, geteuid());
    }
}

TEST_F(RingSegmentTest, TakesUpASoundSegmentThatWasLeftAndRemovesItAtTheEnd) {
    leave_sound_segment();
    damage(offsetof(RingHeader, progress.head), std::uint64_t{41});
    {
        auto frame = std::make_unique<ContactFrame>();
        RingWriter<ContactFrame> writer(session_.name());
        EXPECT_EQ(writer.publish(*frame, 0), 42u);
    }
    EXPECT_FALSE(session_.exists(kKind));
}

TEST_F(RingSegmentTest, RefusesAnotherMagic) {
    leave_sound_segment();
    damage(offsetof(RingHeader, identity.magic), std::uint64_t{0x1234});
    expect_refused(RingError::Kind::BadMagic, AllOf(HasSubstr("is not a contact ring"), HasSubstr(removal())));
}

TEST_F(RingSegmentTest, RefusesARingOfTheOtherKind) {
    leave_sound_segment();
    damage(offsetof(RingHeader, identity.kind), static_cast<std::uint32_t>(RingKind::State));
    expect_refused(RingError::Kind::BadMagic, AllOf(HasSubstr("is not a contact ring"), HasSubstr(removal())));
}

TEST_F(RingSegmentTest, RefusesAnotherAbiVersionAndNamesBoth) {
    leave_sound_segment();
    damage(offsetof(RingHeader, identity.abi), std::uint32_t{HAPTIC_ABI_VERSION + 1});
    expect_refused(RingError::Kind::BadAbi,
                   AllOf(HasSubstr("has ABI version " + std::to_string(HAPTIC_ABI_VERSION + 1) + ", this program has " +
                                   std::to_string(HAPTIC_ABI_VERSION)),
                         HasSubstr(removal())));
}

TEST_F(RingSegmentTest, RefusesSlotsOfAnotherSizeOrNumber) {
    leave_sound_segment();
    damage(offsetof(RingHeader, identity.slot_bytes), std::uint32_t{sizeof(ContactFrame) + 8});
    expect_refused(
        RingError::Kind::BadSize,
        AllOf(HasSubstr("slots of " + std::to_string(sizeof(ContactFrame) + 8) + " bytes"), HasSubstr(removal())));
    damage(offsetof(RingHeader, identity.slot_bytes), std::uint32_t{sizeof(ContactFrame)});
    damage(offsetof(RingHeader, identity.slot_count), std::uint32_t{kRingSlots + 1});
    expect_refused(RingError::Kind::BadSize, AllOf(HasSubstr("has 9 slots"), HasSubstr(removal())));
}

TEST_F(RingSegmentTest, RefusesATruncatedFile) {
    leave_sound_segment();
    for (const std::size_t bytes : {kSegmentBytes - 1, kSegmentBytes / 2, sizeof(RingHeader), std::size_t{100}}) {
        session_.resize(kKind, bytes);
        expect_refused(RingError::Kind::BadSize,
                       AllOf(HasSubstr("truncated"), HasSubstr(std::to_string(bytes)), HasSubstr(removal())));
    }
}

TEST_F(RingSegmentTest, RefusesAnOverlongFile) {
    leave_sound_segment();
    session_.resize(kKind, kSegmentBytes + 4096);
    expect_refused(RingError::Kind::BadSize, HasSubstr("overlong"));
}

TEST_F(RingSegmentTest, RefusesACountOfFramesThatNoRingCanReach) {
    leave_sound_segment();
    damage(offsetof(RingHeader, progress.head), ~std::uint64_t{0});
    expect_refused(RingError::Kind::Damaged, AllOf(HasSubstr("frame counter"), HasSubstr(removal())));
}

TEST_F(RingSegmentTest, RefusesASegmentThatIsOpenToOthers) {
    for (const mode_t mode : {0644u, 0660u, 0602u, 0610u}) {
        leave_sound_segment();
        ASSERT_EQ(chmod(session_.path(kKind).c_str(), mode), 0);
        expect_refused(RingError::Kind::Foreign, AllOf(HasSubstr("accessible to other users"), HasSubstr(removal())));
        session_.remove(kKind);
    }
}

TEST_F(RingSegmentTest, RefusesASymbolicLink) {
    ASSERT_EQ(symlink("/dev/null", session_.path(kKind).c_str()), 0);
    expect_refused(RingError::Kind::Foreign, HasSubstr("ls -l " + session_.path(kKind)));
}

TEST_F(RingSegmentTest, RefusesADirectoryAndAPipe) {
    ASSERT_EQ(mkdir(session_.path(kKind).c_str(), 0700), 0);
    expect_refused(RingError::Kind::Foreign, HasSubstr("ls -l " + session_.path(kKind)));
    ASSERT_EQ(rmdir(session_.path(kKind).c_str()), 0);
    ASSERT_EQ(mkfifo(session_.path(kKind).c_str(), 0600), 0);
    expect_refused(RingError::Kind::Foreign, AllOf(HasSubstr("not a regular file"), HasSubstr(removal())));
}

TEST_F(RingSegmentTest, RefusesTheSegmentOfAnotherUser) {
    if (geteuid() != 0) {
        GTEST_SKIP() << "only root can make a segment that belongs to another";
    }
    leave_sound_segment();
    ASSERT_EQ(chown(session_.path(kKind).c_str(), 12345, 12345), 0);
    expect_refused(RingError::Kind::Foreign, AllOf(HasSubstr("belongs to user 12345"), HasSubstr(removal())));
}

TEST_F(RingSegmentTest, HealsWhatACreatorLeftThatDiedAtOnce) {
    close(session_.open(kKind, O_RDWR | O_CREAT));
    expect_works();
    EXPECT_FALSE(session_.exists(kKind));
}

TEST_F(RingSegmentTest, HealsWhatACreatorLeftThatDiedBeforeTheHeaderWasComplete) {
    leave_sound_segment();
    damage(offsetof(RingHeader, identity.magic), std::uint64_t{0});
    damage(offsetof(RingHeader, identity.slot_count), std::uint32_t{0});
    expect_works();
    EXPECT_FALSE(session_.exists(kKind));
}

TEST_F(RingSegmentTest, DoesNotHealASegmentInUse) {
    const RingWriter<ContactFrame> writer(session_.name());
    damage(offsetof(RingHeader, identity.magic), std::uint64_t{0});
    expect_role_refused<RingReader<ContactFrame>>(RingError::Kind::BadMagic, HasSubstr(removal()));
}

TEST_F(RingSegmentTest, NamesTheProcessThatHasTheRole) {
    const std::string pid = std::to_string(getpid());
    const RingWriter<ContactFrame> writer(session_.name());
    expect_role_refused<RingWriter<ContactFrame>>(
        RingError::Kind::RoleTaken, AllOf(HasSubstr("has its writer: process " + pid), HasSubstr("kill " + pid)));
    const RingReader<ContactFrame> reader(session_.name());
    expect_role_refused<RingReader<ContactFrame>>(
        RingError::Kind::RoleTaken, AllOf(HasSubstr("has its reader: process " + pid), HasSubstr("kill " + pid)));
}

TEST_F(RingSegmentTest, ARefusedAttachmentDisturbsNobody) {
    RingWriter<ContactFrame> writer(session_.name());
    EXPECT_THROW(RingWriter<ContactFrame>(session_.name()), RingError);
    EXPECT_TRUE(session_.exists(kKind));
    RingReader<ContactFrame> reader(session_.name());
    EXPECT_EQ(reader.peer().session, writer.session_id());
    auto frame = std::make_unique<ContactFrame>();
    writer.publish(*frame, 0);
    EXPECT_TRUE(reader.read_newest(*frame));
}

TEST_F(RingSegmentTest, ASegmentRemovedByHandIsReplacedAndItsOldUsersLeaveTheNewOneAlone) {
    auto old_writer = std::make_unique<RingWriter<ContactFrame>>(session_.name());
    session_.remove(kKind);
    const RingWriter<ContactFrame> new_writer(session_.name());
    old_writer.reset();
    EXPECT_TRUE(session_.exists(kKind));
}

TEST_F(RingSegmentTest, GivesUpOnAProcessThatKeepsTheSegmentLocked) {
    leave_sound_segment();
    const int fd = session_.open(kKind, O_RDWR);
    struct flock request{};
    request.l_type = F_WRLCK;
    request.l_whence = SEEK_SET;
    request.l_start = static_cast<off_t>(detail::RingLock::Change);
    request.l_len = 1;
    ASSERT_EQ(fcntl(fd, F_OFD_SETLK, &request), 0);
    expect_role_refused<RingWriter<ContactFrame>>(RingError::Kind::System, HasSubstr("is locked"));
    close(fd);
    expect_works();
}

TEST(RingSegmentName, IsMadeOfUserSessionAndKind) {
    const std::string user = std::to_string(geteuid());
    EXPECT_EQ(ring_segment_name("default", RingKind::Contact), "/haptic-" + user + "-default-contact");
    EXPECT_EQ(ring_segment_name("a_B-9", RingKind::State), "/haptic-" + user + "-a_B-9-state");
    EXPECT_EQ(ring_segment_name("lab", RingKind::Overlay), "/haptic-" + user + "-lab-overlay");
    EXPECT_NO_THROW(static_cast<void>(ring_segment_name(std::string(64, 'x'), RingKind::State)));
}

TEST(RingSegmentName, RefusesNamesThatCouldLeadElsewhere) {
    for (const std::string& name : {std::string(), std::string("a/b"), std::string(".."), std::string("a b"),
                                    std::string("a\0b", 3), std::string("\xC3\xA4"), std::string(65, 'x')}) {
        try {
            static_cast<void>(ring_segment_name(name, RingKind::Contact));
            ADD_FAILURE() << '"' << name << "\" was accepted";
        } catch (const RingError& error) {
            EXPECT_EQ(error.kind(), RingError::Kind::BadSessionName);
            EXPECT_THAT(error.what(), HasSubstr("1 to 64 of the characters"));
        }
    }
    EXPECT_THROW(RingWriter<ContactFrame>("a/b"), RingError);
}

}  // namespace
}  // namespace haptic
