#include "haptic/ring.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ring_session.hpp"

namespace haptic {
namespace {

using test::RingSession;

// Everything from the proxies to the end of the frame.
constexpr std::size_t kVariableBytes = sizeof(ContactFrame) - offsetof(ContactFrame, proxies);

std::string bytes_of(const ContactFrame& frame) {
    return {reinterpret_cast<const char*>(&frame), sizeof frame};
}

class Ring : public testing::Test {
  protected:
    RingSession session_;
    std::unique_ptr<ContactFrame> in_ = std::make_unique<ContactFrame>();
    std::unique_ptr<ContactFrame> out_ = std::make_unique<ContactFrame>();
};

TEST_F(Ring, BringsAFrameOverBitForBit) {
    RingWriter<ContactFrame> writer(session_.name());
    RingReader<ContactFrame> reader(session_.name());
    in_->proxy_count = kMaxProxies;
    in_->compliance_rows = kMaxComplianceRows;
    auto* const bytes = reinterpret_cast<unsigned char*>(in_->proxies);
    for (std::size_t i = 0; i < kVariableBytes; ++i) {
        bytes[i] = static_cast<unsigned char>(i * 37 + i / 256);
    }
    in_->plane_time_ns = 12345;
    EXPECT_EQ(writer.publish(*in_, 99), 1u);
    ASSERT_TRUE(reader.read_newest(*out_));
    EXPECT_EQ(bytes_of(*out_), bytes_of(*in_));
    EXPECT_EQ(out_->sequence, 1u);
    EXPECT_EQ(out_->session, writer.session_id());
}

TEST_F(Ring, CopiesOnlyTheProxiesInUse) {
    RingWriter<ContactFrame> writer(session_.name());
    RingReader<ContactFrame> reader(session_.name());
    in_->proxy_count = 2;
    for (ProxyContact& proxy : in_->proxies) {
        proxy.in_contact = 1;
    }
    out_->proxies[2].in_contact = 7;
    writer.publish(*in_, 0);
    ASSERT_TRUE(reader.read_newest(*out_));
    EXPECT_EQ(out_->proxies[1].in_contact, 1u);
    EXPECT_EQ(out_->proxies[2].in_contact, 7u);
}

TEST_F(Ring, CopiesOnlyTheCompliancesInUse) {
    RingWriter<ContactFrame> writer(session_.name());
    RingReader<ContactFrame> reader(session_.name());
    in_->compliance_rows = 2;
    for (std::size_t i = 0; i < 5; ++i) {
        in_->compliance[i] = static_cast<float>(i + 1);
        out_->compliance[i] = -1.0F;
    }
    writer.publish(*in_, 0);
    ASSERT_TRUE(reader.read_newest(*out_));
    // Two rows have three elements; the copy ends at the next multiple of eight bytes.
    EXPECT_EQ(std::vector<float>(out_->compliance, out_->compliance + 5), (std::vector<float>{1, 2, 3, 4, -1}));
}

TEST_F(Ring, CopiesNoMoreThanTheSlotWhateverTheFrameSays) {
    RingWriter<ContactFrame> writer(session_.name());
    RingReader<ContactFrame> reader(session_.name());
    in_->proxy_count = 0xFFFFFFFF;
    writer.publish(*in_, 0);
    ASSERT_TRUE(reader.read_newest(*out_));
    EXPECT_EQ(find_defect(*out_), FrameDefect::ProxyCount);
}

TEST_F(Ring, ReturnsTheNewestOnceAndCountsTheSkipped) {
    RingWriter<ContactFrame> writer(session_.name());
    RingReader<ContactFrame> reader(session_.name());
    EXPECT_FALSE(reader.read_newest(*out_));
    writer.publish(*in_, 0);
    EXPECT_TRUE(reader.read_newest(*out_));
    EXPECT_FALSE(reader.read_newest(*out_));
    for (int i = 0; i < 100; ++i) {
        writer.publish(*in_, 0);
    }
    EXPECT_TRUE(reader.read_newest(*out_));
    EXPECT_EQ(out_->sequence, 101u);
    EXPECT_FALSE(reader.read_newest(*out_));
    EXPECT_EQ(reader.counts().frames, 2u);
    EXPECT_EQ(reader.counts().skipped, 99u);
    EXPECT_EQ(reader.counts().overtaken, 0u);
}

TEST_F(Ring, EitherSideMayComeFirst) {
    RingReader<DeviceState> reader(session_.name());
    RingWriter<DeviceState> writer(session_.name());
    DeviceState state{};
    state.latch_time_ns = 5;
    writer.publish(state, 0);
    DeviceState read{};
    ASSERT_TRUE(reader.read_newest(read));
    EXPECT_EQ(read.latch_time_ns, 5);
}

TEST_F(Ring, TheTwoRingsOfASessionAreApart) {
    RingWriter<ContactFrame> contacts(session_.name());
    const RingWriter<DeviceState> states(session_.name());
    contacts.publish(*in_, 0);
    RingReader<DeviceState> reader(session_.name());
    DeviceState read{};
    EXPECT_FALSE(reader.read_newest(read));
}

TEST_F(Ring, ANewWriterContinuesTheNumbersUnderAnotherSession) {
    RingReader<ContactFrame> reader(session_.name());
    std::uint64_t first_session = 0;
    {
        RingWriter<ContactFrame> writer(session_.name());
        first_session = writer.session_id();
        writer.publish(*in_, 10);
        writer.publish(*in_, 11);
    }
    EXPECT_TRUE(reader.peer().closed);
    EXPECT_EQ(reader.peer().writer_pid, 0u);
    RingWriter<ContactFrame> writer(session_.name());
    EXPECT_FALSE(reader.peer().closed);
    EXPECT_EQ(reader.peer().heartbeat_ns, 0);
    EXPECT_NE(writer.session_id(), first_session);
    ASSERT_TRUE(reader.read_newest(*out_)) << "what the first writer published last is still there";
    EXPECT_EQ(out_->sequence, 2u);
    EXPECT_EQ(out_->session, first_session);
    writer.publish(*in_, 12);
    ASSERT_TRUE(reader.read_newest(*out_));
    EXPECT_EQ(out_->sequence, 3u);
    EXPECT_EQ(out_->session, writer.session_id());
}

TEST_F(Ring, ANewReaderSeesWhatWasPublishedBeforeIt) {
    RingWriter<ContactFrame> writer(session_.name());
    writer.publish(*in_, 0);
    {
        RingReader<ContactFrame> reader(session_.name());
        EXPECT_TRUE(reader.read_newest(*out_));
    }
    RingReader<ContactFrame> reader(session_.name());
    EXPECT_TRUE(reader.read_newest(*out_));
    EXPECT_EQ(reader.counts().skipped, 0u);
}

TEST_F(Ring, TellsTheReaderOfItsWriter) {
    const RingReader<ContactFrame> reader(session_.name());
    EXPECT_EQ(reader.peer().session, 0u);
    EXPECT_EQ(reader.peer().writer_pid, 0u);
    RingWriter<ContactFrame> writer(session_.name());
    EXPECT_EQ(reader.peer().session, writer.session_id());
    EXPECT_EQ(reader.peer().writer_pid, static_cast<std::uint32_t>(getpid()));
    EXPECT_EQ(reader.peer().heartbeat_ns, 0);
    writer.beat(77);
    EXPECT_EQ(reader.peer().heartbeat_ns, 77);
    writer.publish(*in_, 78);
    EXPECT_EQ(reader.peer().heartbeat_ns, 78);
}

TEST_F(Ring, TheLastToLeaveRemovesTheSegment) {
    {
        auto writer = std::make_unique<RingWriter<ContactFrame>>(session_.name());
        const RingReader<ContactFrame> reader(session_.name());
        EXPECT_TRUE(session_.exists(RingKind::Contact));
        writer.reset();
        EXPECT_TRUE(session_.exists(RingKind::Contact));
    }
    EXPECT_FALSE(session_.exists(RingKind::Contact));
    {
        auto reader = std::make_unique<RingReader<ContactFrame>>(session_.name());
        const RingWriter<ContactFrame> writer(session_.name());
        reader.reset();
        EXPECT_TRUE(session_.exists(RingKind::Contact));
    }
    EXPECT_FALSE(session_.exists(RingKind::Contact));
}

TEST_F(Ring, MovesWithItsRole) {
    RingWriter<ContactFrame> first(session_.name());
    const std::uint64_t id = first.session_id();
    RingWriter<ContactFrame> second(std::move(first));
    EXPECT_EQ(second.session_id(), id);
    EXPECT_EQ(second.publish(*in_, 0), 1u);
    EXPECT_THROW(RingWriter<ContactFrame>(session_.name()), RingError);
    RingReader<ContactFrame> reader(session_.name());
    RingReader<ContactFrame> moved(std::move(reader));
    EXPECT_TRUE(moved.read_newest(*out_));
}

TEST_F(Ring, MoveAssignmentGivesTheOldRoleBack) {
    const RingSession other;
    RingWriter<ContactFrame> writer(session_.name());
    writer = RingWriter<ContactFrame>(other.name());
    EXPECT_FALSE(session_.exists(RingKind::Contact));
    EXPECT_TRUE(other.exists(RingKind::Contact));
    EXPECT_NO_THROW(RingWriter<ContactFrame>(session_.name()));
}

}  // namespace
}  // namespace haptic
