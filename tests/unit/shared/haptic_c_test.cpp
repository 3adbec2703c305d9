#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>

#include "haptic/haptic.h"
#include "haptic/ring.hpp"
#include "haptic_c_calls.h"
#include "ring_session.hpp"

namespace haptic {
namespace {

using test::RingSession;

TEST(CInterface, PushesAFrameFromCToCppAndReadsAStateBack) {
    const RingSession session;
    RingWriter<DeviceState> states(session.name());
    RingReader<ContactFrame> contacts(session.name());
    DeviceState state{};
    state.latch_time_ns = 111;
    states.publish(state, 222);

    EXPECT_EQ(haptic_c_pushes_a_frame(session.name().c_str()), 0)
        << "line of haptic_c_calls.c: " << haptic_last_error();

    auto frame = std::make_unique<ContactFrame>();
    ASSERT_TRUE(contacts.read_newest(*frame));
    EXPECT_EQ(find_defect(*frame), FrameDefect::None);
    EXPECT_EQ(frame->state_sequence, 1u);
    EXPECT_EQ(frame->state_time_ns, 111);
    EXPECT_EQ(frame->publish_time_ns, 333);
    EXPECT_EQ(frame->proxies[0].planes[0].offset, 0.25);
    EXPECT_EQ(contacts.peer().heartbeat_ns, 444);
    EXPECT_TRUE(contacts.peer().closed);
}

TEST(CInterface, ObservesBothRingsWithoutARole) {
    const RingSession session;
    EXPECT_EQ(haptic_c_observes(session.name().c_str()), 0) << "line of haptic_c_calls.c: " << haptic_last_error();
    EXPECT_FALSE(session.exists(RingKind::Contact)) << "the last role has ended";
}

TEST(CInterface, ObservesAStateAndRefusesAFrameThatRtCoreWouldRefuse) {
    const RingSession session;
    RingWriter<DeviceState> states(session.name());
    RingWriter<ContactFrame> contacts(session.name());
    haptic_state_observer* const state_observer = haptic_state_observer_open(session.name().c_str());
    haptic_contact_observer* const contact_observer = haptic_contact_observer_open(session.name().c_str());
    DeviceState state{};
    state.latch_time_ns = 111;
    states.publish(state, 0);
    auto frame = std::make_unique<ContactFrame>();
    frame->step_ns = -1;
    contacts.publish(*frame, 0);

    DeviceState seen{};
    EXPECT_EQ(haptic_state_observer_next(state_observer, &seen, 0), 1);
    EXPECT_EQ(seen.latch_time_ns, 111);
    EXPECT_EQ(haptic_contact_observer_next(contact_observer, frame.get(), 0), -1);
    EXPECT_NE(std::string(haptic_last_error()).find("step_ns"), std::string::npos) << haptic_last_error();
    haptic_contact_observer_close(contact_observer);
    haptic_state_observer_close(state_observer);
}

TEST(CInterface, NamesSharedMemoryThatCannotBeObserved) {
    const RingSession session;
    const int fd = session.open(RingKind::State, O_RDWR | O_CREAT, 0666);
    fchmod(fd, 0666);
    close(fd);
    haptic_state_observer* const observer = haptic_state_observer_open(session.name().c_str());
    DeviceState state{};
    EXPECT_EQ(haptic_state_observer_next(observer, &state, 0), -1);
    EXPECT_NE(std::string(haptic_last_error()).find(session.name()), std::string::npos) << haptic_last_error();
    haptic_state_observer_close(observer);
}

TEST(CInterface, AnswersMisuseWithAnErrorAndAText) {
    const RingSession session;
    EXPECT_EQ(haptic_c_refuses_misuse(session.name().c_str()), 0)
        << "line of haptic_c_calls.c: " << haptic_last_error();
    EXPECT_FALSE(session.exists(RingKind::Contact));
    EXPECT_FALSE(session.exists(RingKind::State));
}

TEST(CInterface, KeepsTheErrorsOfThreadsApart) {
    ASSERT_EQ(haptic_contact_writer_open("bad/one"), nullptr);
    std::string other_before;
    std::string other_after;
    std::thread([&] {
        other_before = haptic_last_error();
        static_cast<void>(haptic_contact_writer_open("bad/two"));
        other_after = haptic_last_error();
    }).join();
    EXPECT_EQ(other_before, "");
    EXPECT_NE(other_after.find("bad/two"), std::string::npos);
    EXPECT_NE(std::string(haptic_last_error()).find("bad/one"), std::string::npos);
}

}  // namespace
}  // namespace haptic
