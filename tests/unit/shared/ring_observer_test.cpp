#include "haptic/ring_observer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "ring_memory.hpp"
#include "ring_session.hpp"

namespace haptic {
namespace {

using test::RingSession;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class RingObserverTest : public testing::Test {
  protected:
    RingSession session_;
    RingObserver<DeviceState> observer_{session_.name()};
    std::int64_t now_ns_ = 0;

    /// A state that carries its number in addition to its sequence.
    static void publish(RingWriter<DeviceState>& writer, int count = 1) {
        for (int i = 0; i < count; ++i) {
            DeviceState state{};
            const std::uint64_t sequence = writer.publish(state, 0);
            static_cast<void>(sequence);
        }
    }
    /// Sequences of all available slots.
    std::vector<std::uint64_t> take() {
        std::vector<std::uint64_t> sequences;
        DeviceState state{};
        while (observer_.next(state)) {
            sequences.push_back(state.sequence);
        }
        return sequences;
    }
    void attend_later() {
        now_ns_ += kRingAttendNs;
        observer_.attend(now_ns_);
    }
};

TEST_F(RingObserverTest, SeesNothingWhereThereIsNoSegment) {
    observer_.attend(0);
    EXPECT_FALSE(observer_.attached());
    EXPECT_FALSE(observer_.has_writer());
    EXPECT_THAT(observer_.problem(), IsEmpty());
    EXPECT_THAT(take(), IsEmpty());
    EXPECT_EQ(observer_.peer().session, 0u);
    EXPECT_FALSE(session_.exists(RingKind::State)) << "it creates none";
}

TEST_F(RingObserverTest, RefusesASessionNameThatIsNone) {
    EXPECT_THROW(RingObserver<DeviceState>("a/b"), RingError);
}

TEST_F(RingObserverTest, ReturnsEverySlotOnceInOrder) {
    RingWriter<DeviceState> writer(session_.name());
    observer_.attend(0);
    publish(writer, 3);
    EXPECT_THAT(take(), ElementsAre(1, 2, 3));
    EXPECT_THAT(take(), IsEmpty());
    publish(writer, kRingSlots);
    EXPECT_THAT(take(), ElementsAre(4, 5, 6, 7, 8, 9, 10, 11));
    EXPECT_EQ(observer_.counts().slots, 11u);
    EXPECT_EQ(observer_.counts().missed, 0u);
}

TEST_F(RingObserverTest, BringsASlotOverBitForBit) {
    RingWriter<DeviceState> writer(session_.name());
    observer_.attend(0);
    DeviceState in{};
    in.latch_time_ns = 12345;
    store(Vec3(1.0, -2.0, 3.0), in.position);
    in.tension[7] = 0.5;
    in.faults = HAPTIC_FAULT_SLACK;
    in.buttons = 0xFFFFFFFF;
    writer.publish(in, 0);
    DeviceState out{};
    ASSERT_TRUE(observer_.next(out));
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(&out), sizeof out),
              std::string(reinterpret_cast<const char*>(&in), sizeof in));
}

TEST_F(RingObserverTest, CountsWhatWasOverwrittenBeforeItLooked) {
    RingWriter<DeviceState> writer(session_.name());
    observer_.attend(0);
    publish(writer, 2);
    EXPECT_THAT(take(), ElementsAre(1, 2));
    publish(writer, 20);
    EXPECT_THAT(take(), ElementsAre(15, 16, 17, 18, 19, 20, 21, 22));
    EXPECT_EQ(observer_.counts().missed, 12u);
}

TEST_F(RingObserverTest, DoesNotMissWhatWasThereBeforeIt) {
    RingWriter<DeviceState> writer(session_.name());
    publish(writer, 100);
    observer_.attend(0);
    EXPECT_THAT(take(), ElementsAre(93, 94, 95, 96, 97, 98, 99, 100));
    EXPECT_EQ(observer_.counts().missed, 0u);
}

TEST_F(RingObserverTest, TakesNoRoleAndKeepsNoSegmentAlive) {
    std::optional<RingWriter<DeviceState>> writer(session_.name());
    observer_.attend(0);
    {
        RingReader<DeviceState> reader(session_.name());
        publish(*writer, 5);
        EXPECT_THAT(take(), ElementsAre(1, 2, 3, 4, 5));
        DeviceState state{};
        ASSERT_TRUE(reader.read_newest(state));
        EXPECT_EQ(state.sequence, 5u);
        EXPECT_EQ(reader.counts().overtaken, 0u);
    }
    EXPECT_TRUE(observer_.attached());
    writer.reset();
    EXPECT_FALSE(session_.exists(RingKind::State)) << "the last with a role removes it";
}

TEST_F(RingObserverTest, IsWithoutTheRightToWrite) {
    const RingWriter<DeviceState> writer(session_.name());
    observer_.attend(0);
    ASSERT_TRUE(observer_.attached());
    // Two mappings of the segment in this process: the writer's, and ours.
    std::ifstream maps("/proc/self/maps");
    std::vector<std::string> rights;
    for (std::string line; std::getline(maps, line);) {
        if (line.find(session_.path(RingKind::State)) != std::string::npos) {
            rights.push_back(line.substr(line.find(' ') + 1, 4));
        }
    }
    EXPECT_THAT(rights, testing::UnorderedElementsAre("rw-s", "r--s"));
}

TEST_F(RingObserverTest, AttachesWhenTheSegmentComes) {
    observer_.attend(0);
    RingWriter<DeviceState> writer(session_.name());
    publish(writer, 2);
    observer_.attend(kRingAttendNs - 1);
    EXPECT_FALSE(observer_.attached()) << "it asks the system only now and then";
    observer_.attend(kRingAttendNs);
    EXPECT_TRUE(observer_.attached());
    EXPECT_THAT(take(), ElementsAre(1, 2));
}

TEST_F(RingObserverTest, FollowsASegmentThatWasMadeAnew) {
    {
        RingWriter<DeviceState> writer(session_.name());
        observer_.attend(0);
        publish(writer, 30);
    }
    EXPECT_THAT(take(), ElementsAre(23, 24, 25, 26, 27, 28, 29, 30)) << "what was there when it ended";
    EXPECT_EQ(observer_.counts().missed, 22u);
    {
        RingWriter<DeviceState> writer(session_.name());
        publish(writer, 2);
        EXPECT_THAT(take(), IsEmpty());
        attend_later();
        EXPECT_THAT(take(), ElementsAre(1, 2));
        EXPECT_EQ(observer_.peer().session, writer.session_id());
    }
    EXPECT_EQ(observer_.counts().segments, 2u);
    EXPECT_EQ(observer_.counts().missed, 22u) << "sequences of two segments are not compared";
    attend_later();
    EXPECT_FALSE(observer_.attached());
}

TEST_F(RingObserverTest, StaysWithASegmentThatWasRemovedUnderItsWriter) {
    RingWriter<DeviceState> writer(session_.name());
    observer_.attend(0);
    session_.remove(RingKind::State);
    publish(writer, 1);
    attend_later();
    EXPECT_THAT(take(), ElementsAre(1));
    EXPECT_TRUE(observer_.has_writer());
}

TEST_F(RingObserverTest, SeesARestartedWriterGoOnInTheSameSegment) {
    const RingReader<DeviceState> reader(session_.name());
    std::uint64_t first = 0;
    {
        RingWriter<DeviceState> writer(session_.name());
        first = writer.session_id();
        observer_.attend(0);
        publish(writer, 2);
    }
    EXPECT_FALSE(observer_.has_writer());
    EXPECT_TRUE(observer_.peer().closed);
    RingWriter<DeviceState> writer(session_.name());
    publish(writer, 1);
    EXPECT_TRUE(observer_.has_writer());
    DeviceState state{};
    std::vector<std::uint64_t> sessions;
    while (observer_.next(state)) {
        sessions.push_back(state.session);
    }
    EXPECT_THAT(sessions, ElementsAre(first, first, writer.session_id()));
    EXPECT_EQ(observer_.counts().missed, 0u);
}

TEST_F(RingObserverTest, KnowsThatAKilledWriterIsGone) {
    const RingReader<DeviceState> reader(session_.name());
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        RingWriter<DeviceState> writer(session_.name());
        publish(writer, 4);
        raise(SIGKILL);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    observer_.attend(0);
    EXPECT_FALSE(observer_.has_writer());
    EXPECT_EQ(observer_.peer().writer_pid, static_cast<std::uint32_t>(child)) << "which it could not take back";
    EXPECT_THAT(take(), ElementsAre(1, 2, 3, 4));
}

TEST_F(RingObserverTest, SaysWhyASegmentCannotBeLookedAtAndTakesTheNextOne) {
    close(session_.open(RingKind::State, O_RDWR | O_CREAT));
    observer_.attend(0);
    EXPECT_FALSE(observer_.attached());
    EXPECT_THAT(observer_.problem(), IsEmpty()) << "an empty one is being created";
    const std::size_t bytes = detail::RingMemory::bytes(sizeof(DeviceState));
    session_.resize(RingKind::State, bytes);
    attend_later();
    EXPECT_FALSE(observer_.attached());
    EXPECT_THAT(observer_.problem(), IsEmpty()) << "and so is one without magic";
    const std::uint64_t magic = 42;
    session_.write(RingKind::State, 0, &magic, sizeof magic);
    attend_later();
    EXPECT_THAT(observer_.problem(), AllOf(HasSubstr(session_.path(RingKind::State)), HasSubstr("not a state ring")));
    session_.resize(RingKind::State, 100);
    attend_later();
    EXPECT_THAT(observer_.problem(), HasSubstr("truncated: 100 bytes"));
    session_.remove(RingKind::State);
    ASSERT_EQ(symlink("/etc/passwd", session_.path(RingKind::State).c_str()), 0);
    attend_later();
    EXPECT_THAT(observer_.problem(), HasSubstr("cannot be used"));
    session_.remove(RingKind::State);
    RingWriter<DeviceState> writer(session_.name());
    publish(writer, 1);
    attend_later();
    EXPECT_THAT(observer_.problem(), IsEmpty());
    EXPECT_THAT(take(), ElementsAre(1));
}

TEST_F(RingObserverTest, RefusesAnotherRelease) {
    const RingWriter<DeviceState> writer(session_.name());
    const std::uint32_t abi = HAPTIC_ABI_VERSION + 1;
    session_.write(RingKind::State, offsetof(detail::RingIdentity, abi), &abi, sizeof abi);
    observer_.attend(0);
    EXPECT_FALSE(observer_.attached());
    EXPECT_THAT(observer_.problem(), HasSubstr("ABI version"));
}

TEST_F(RingObserverTest, WithstandsDamageToWhatItLooksAt) {
    RingWriter<DeviceState> writer(session_.name());
    publish(writer, 20);
    observer_.attend(0);
    EXPECT_EQ(take().size(), kRingSlots);
    const std::size_t head_at = offsetof(detail::RingHeader, progress.head);
    for (const std::uint64_t head : {std::uint64_t{3}, ~std::uint64_t{0}, detail::kLastSequence + 1}) {
        session_.write(RingKind::State, head_at, &head, sizeof head);
        EXPECT_THAT(take(), IsEmpty());
        EXPECT_FALSE(observer_.attached());
        const std::uint64_t right = 20;
        session_.write(RingKind::State, head_at, &right, sizeof right);
        attend_later();
        EXPECT_EQ(take().size(), kRingSlots) << "it reads the whole ring again";
    }
    // A head far ahead of the stamps: no slot is valid, and the search ends.
    const std::uint64_t ahead = detail::kLastSequence;
    session_.write(RingKind::State, head_at, &ahead, sizeof ahead);
    EXPECT_THAT(take(), IsEmpty());
    EXPECT_EQ(observer_.counts().missed, detail::kLastSequence - 20);
}

TEST_F(RingObserverTest, SeesAllThatATwoSidedRingPassesWhateverItMissesIsCounted) {
    constexpr std::uint64_t kStates = 50'000;
    RingWriter<DeviceState> writer(session_.name());
    RingReader<DeviceState> reader(session_.name());
    observer_.attend(0);
    std::atomic<bool> written{false};
    std::thread thread([&] {
        for (std::uint64_t i = 1; i <= kStates; ++i) {
            DeviceState state{};
            for (double& tension : state.tension) {
                tension = static_cast<double>(i);
            }
            writer.publish(state, 0);
            if (i % kRingSlots == 0) {
                std::this_thread::yield();
            }
        }
        written = true;
    });
    std::uint64_t last = 0;
    std::uint64_t torn = 0;
    DeviceState state{};
    for (bool end = false; !end;) {
        end = written;
        while (observer_.next(state)) {
            ASSERT_GT(state.sequence, last);
            last = state.sequence;
            for (const double tension : state.tension) {
                torn += tension == static_cast<double>(state.sequence) ? 0u : 1u;
            }
        }
        static_cast<void>(reader.read_newest(state));
    }
    thread.join();
    EXPECT_EQ(last, kStates);
    EXPECT_EQ(torn, 0u);
    EXPECT_EQ(observer_.counts().slots + observer_.counts().missed, kStates);
}

}  // namespace
}  // namespace haptic
