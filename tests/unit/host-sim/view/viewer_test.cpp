#include "view/viewer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "decoded.hpp"
#include "small_scene.hpp"

namespace haptic::sim::view {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kSecond = 1'000'000'000;

std::string text_of(const Outgoing& message) {
    return {reinterpret_cast<const char*>(message.bytes.data()), message.bytes.size()};
}

/// A scene to view, with a clock set by the test.
struct TestScene {
    TestScene() : description(test::small_description()), snapshot(test::small_snapshot()), encoder(description) {
        state.scene = 1;
        state.scene_text = scene_message(description, 1, false);
        state.geometry = geometry_message(description, 1);
    }
    void publish() {
        encoder.encode(snapshot, true, 1);
        state.snapshot = &encoder.encoded();
        ++state.snapshots;
    }
    /// The next message; fails if there is none.
    Outgoing next(Viewer& viewer) {
        Outgoing message;
        EXPECT_TRUE(viewer.compose(state, now_ns, message));
        return message;
    }
    bool has_next(Viewer& viewer) {
        Outgoing message;
        return viewer.compose(state, now_ns, message);
    }
    Viewer::Outcome say(Viewer& viewer, const std::string& text) {
        return viewer.on_message(text, description, now_ns);
    }

    SceneDescription description;
    SceneSnapshot snapshot;
    SnapshotEncoder encoder;
    ViewState state;
    std::int64_t now_ns = kSecond;
};

TEST(Viewer, GetsNothingBeforeTheFirstScene) {
    Viewer viewer(false);
    const ViewState nothing;
    Outgoing message;
    EXPECT_FALSE(viewer.compose(nothing, 0, message));
    EXPECT_FALSE(viewer.wants_snapshot());
}

TEST(Viewer, GetsSceneAndGeometryAndThenWantsASnapshot) {
    TestScene scene;
    Viewer viewer(false);
    EXPECT_EQ(text_of(scene.next(viewer)), scene.state.scene_text);
    EXPECT_EQ(scene.next(viewer).bytes, scene.state.geometry);
    EXPECT_FALSE(viewer.wants_snapshot());
    EXPECT_FALSE(scene.has_next(viewer));
    EXPECT_TRUE(viewer.wants_snapshot());
    scene.publish();
    EXPECT_EQ(test::read_frame(scene.next(viewer).bytes).parts.size(), 3U + kRemainingParts);
    EXPECT_FALSE(viewer.wants_snapshot());
    EXPECT_FALSE(scene.has_next(viewer));
    EXPECT_TRUE(viewer.wants_snapshot());
}

TEST(Viewer, GetsBodiesThatMovedInMissedSnapshots) {
    TestScene scene;
    Viewer slow(false);
    scene.publish();
    for (int k = 0; k < 3; ++k) {
        scene.next(slow);
    }
    scene.snapshot.vertices[0].y += 0.1;  // the first body moves in a snapshot that it does not get
    scene.publish();
    scene.snapshot.vertices[7].y += 0.1;  // and the second in the next
    scene.publish();
    const auto frame = test::read_frame(scene.next(slow).bytes);
    EXPECT_NE(frame.part(1, 0), nullptr);
    EXPECT_NE(frame.part(1, 1), nullptr);
    EXPECT_EQ(frame.part(2), nullptr);
    EXPECT_FALSE(scene.has_next(slow));
}

TEST(Viewer, GetsParticlesAndPlanesOnlyIfSubscribed) {
    TestScene scene;
    Viewer viewer(false);
    scene.publish();
    scene.next(viewer);
    scene.next(viewer);
    auto frame = test::read_frame(scene.next(viewer).bytes);
    EXPECT_EQ(frame.part(3), nullptr);
    EXPECT_EQ(frame.part(5), nullptr);
    scene.say(viewer, R"({"type":"watch","particles":true,"planes":true})");
    scene.publish();
    frame = test::read_frame(scene.next(viewer).bytes);
    EXPECT_NE(frame.part(3, 0), nullptr);
    EXPECT_NE(frame.part(3, 1), nullptr);
    EXPECT_NE(frame.part(5), nullptr);
}

TEST(Viewer, GetsACompleteNewScene) {
    TestScene scene;
    Viewer viewer(false);
    scene.publish();
    for (int k = 0; k < 3; ++k) {
        scene.next(viewer);
    }
    scene.state.scene = 2;
    scene.state.scene_text = R"({"type":"scene","scene":2})";
    scene.state.snapshots = 0;
    EXPECT_EQ(text_of(scene.next(viewer)), scene.state.scene_text);
    EXPECT_EQ(scene.next(viewer).bytes, scene.state.geometry);
    EXPECT_FALSE(scene.has_next(viewer));
    EXPECT_TRUE(viewer.wants_snapshot());
    scene.publish();
    EXPECT_EQ(test::read_frame(scene.next(viewer).bytes).parts.size(), 3U + kRemainingParts);
}

TEST(Viewer, IsReadOnlyWithoutControl) {
    TestScene scene;
    Viewer looks(false);
    EXPECT_TRUE(std::holds_alternative<std::monostate>(scene.say(looks, R"({"type":"reset"})")));
    scene.next(looks);
    scene.next(looks);
    const Json refused = Json::parse(text_of(scene.next(looks)));
    EXPECT_EQ(refused.at("type"), "refused");
    EXPECT_EQ(refused.at("command"), "reset");
    EXPECT_THAT(refused.at("why").get<std::string>(), testing::HasSubstr("--view-control"));
    Viewer commands(true);
    const auto heard = scene.say(commands, R"({"type":"pause","on":true})");
    ASSERT_TRUE(std::holds_alternative<Command>(heard));
    EXPECT_TRUE(std::get<SetPaused>(std::get<Command>(heard)).paused);
}

TEST(Viewer, MaySendTwoHundredMessagesPerSecond) {
    TestScene scene;
    Viewer viewer(false);
    const std::string text = R"({"type":"watch"})";
    const auto may_go_on = [&] { return std::holds_alternative<std::monostate>(scene.say(viewer, text)); };
    for (int k = 0; k < 200; ++k) {
        ASSERT_TRUE(may_go_on());
    }
    scene.now_ns += kSecond / 200;
    EXPECT_TRUE(may_go_on());
    const auto closing = scene.say(viewer, text);
    ASSERT_TRUE(std::holds_alternative<Closing>(closing));
    EXPECT_EQ(std::get<Closing>(closing).code, 1008);
    Viewer steady(false);
    for (int k = 0; k < 2000; ++k) {
        scene.now_ns += kSecond / 200;
        ASSERT_TRUE(std::holds_alternative<std::monostate>(scene.say(steady, text)));
    }
}

TEST(Viewer, QueuesALimitedNumberOfRefusals) {
    TestScene scene;
    Viewer viewer(false);
    for (int k = 0; k < 150; ++k) {
        scene.say(viewer, R"({"type":"reset"})");
    }
    std::size_t messages = 0;
    while (scene.has_next(viewer)) {
        ++messages;
    }
    EXPECT_EQ(messages, 2 + kMaxRefusals);
}

TEST(Viewer, GetsSamplesFromItsSubscriptionOnAndTheNumberMissed) {
    TestScene scene;
    Viewer viewer(false);
    scene.next(viewer);
    scene.next(viewer);
    const auto add = [&](std::uint64_t from, std::uint64_t to) {
        for (std::uint64_t k = from; k < to; ++k) {
            scene.state.samples.add({1, k, {static_cast<double>(k)}});
        }
    };
    add(5000, 5003);
    EXPECT_FALSE(scene.has_next(viewer));  // not subscribed
    scene.say(viewer, R"({"type":"watch","samples":true})");
    const auto read = [&] {
        const Outgoing message = scene.next(viewer);
        test::Reader reader(message.bytes);
        EXPECT_EQ(reader.u32(), 3U);
        (void)reader.u32();
        const double first = reader.take<double>();
        const std::uint32_t count = reader.u32();
        return std::tuple(first, count, reader.u32());
    };
    EXPECT_EQ(read(), std::tuple(5000.0, 3U, 0U));
    add(5003, 5005);
    add(5010, 5011);                       // five were dropped
    EXPECT_FALSE(scene.has_next(viewer));  // at most thirty messages per second
    scene.now_ns += kSecond / 10;
    EXPECT_EQ(read(), std::tuple(5003.0, 2U, 0U));
    EXPECT_EQ(read(), std::tuple(5010.0, 1U, 5U));
    add(5011, 5011 + 10'000);  // more than are kept
    scene.now_ns += kSecond / 10;
    const auto [first, count, dropped] = read();
    EXPECT_EQ(first, 5011.0 + 10'000 - SampleHistory::kCapacity);
    EXPECT_EQ(dropped, 10'000 - SampleHistory::kCapacity);
    EXPECT_EQ(count, 1024U);
}

TEST(Viewer, GetsDeviceRecordAndByeMessages) {
    TestScene scene;
    Viewer viewer(false);
    scene.next(viewer);
    scene.next(viewer);
    scene.state.device = "device";
    scene.state.devices = 1;
    scene.state.record = "record";
    scene.state.records = 1;
    EXPECT_EQ(text_of(scene.next(viewer)), "record");
    EXPECT_EQ(text_of(scene.next(viewer)), "device");
    EXPECT_FALSE(scene.has_next(viewer));
    scene.publish();
    scene.state.ending = true;
    EXPECT_FALSE(viewer.bye_sent());
    EXPECT_EQ(text_of(scene.next(viewer)), R"({"type":"bye"})");
    EXPECT_TRUE(viewer.bye_sent());
    EXPECT_FALSE(scene.has_next(viewer));
}

}  // namespace
}  // namespace haptic::sim::view
