#include "view/viewer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "decoded.hpp"
#include "shown_scene.hpp"

namespace haptic::sim::view {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kSecond = 1'000'000'000;

std::string text_of(const Outgoing& message) {
    return {reinterpret_cast<const char*>(message.bytes.data()), message.bytes.size()};
}

/// Something to look at, whose clock is turned by hand.
struct Stage {
    Stage() : description(test::small_description()), snapshot(test::small_snapshot()), encoder(description) {
        shown.scene = 1;
        shown.scene_text = scene_message(description, 1, false);
        shown.geometry = geometry_message(description, 1);
    }
    void show() {
        encoder.encode(snapshot, true, 1);
        shown.moment = &encoder.moment();
        ++shown.moments;
    }
    /// The next message; fails if there is none.
    Outgoing next(Viewer& viewer) {
        Outgoing message;
        EXPECT_TRUE(viewer.compose(shown, now_ns, message));
        return message;
    }
    bool has_next(Viewer& viewer) {
        Outgoing message;
        return viewer.compose(shown, now_ns, message);
    }
    Viewer::Heard say(Viewer& viewer, const std::string& text) { return viewer.hear(text, description, now_ns); }

    SceneDescription description;
    SceneSnapshot snapshot;
    MomentEncoder encoder;
    Shown shown;
    std::int64_t now_ns = kSecond;
};

TEST(Viewer, HasNothingToSeeBeforeThereIsAScene) {
    Viewer viewer(false);
    const Shown nothing;
    Outgoing message;
    EXPECT_FALSE(viewer.compose(nothing, 0, message));
    EXPECT_FALSE(viewer.waits());
}

TEST(Viewer, GetsSceneAndGeometryAndThenWaitsForAMoment) {
    Stage stage;
    Viewer viewer(false);
    EXPECT_EQ(text_of(stage.next(viewer)), stage.shown.scene_text);
    EXPECT_EQ(stage.next(viewer).bytes, stage.shown.geometry);
    EXPECT_FALSE(viewer.waits());
    EXPECT_FALSE(stage.has_next(viewer));
    EXPECT_TRUE(viewer.waits());
    stage.show();
    EXPECT_EQ(test::read_frame(stage.next(viewer).bytes).parts.size(), 3U + kRestParts);
    EXPECT_FALSE(viewer.waits());
    EXPECT_FALSE(stage.has_next(viewer));
    EXPECT_TRUE(viewer.waits());
}

TEST(Viewer, GetsWhatMovedWhileItMissedMoments) {
    Stage stage;
    Viewer slow(false);
    stage.show();
    for (int k = 0; k < 3; ++k) {
        stage.next(slow);
    }
    stage.snapshot.vertices[0].y += 0.1;  // the first body moves in a moment that it does not get
    stage.show();
    stage.snapshot.vertices[7].y += 0.1;  // and the second in the next
    stage.show();
    const auto frame = test::read_frame(stage.next(slow).bytes);
    EXPECT_NE(frame.part(1, 0), nullptr);
    EXPECT_NE(frame.part(1, 1), nullptr);
    EXPECT_EQ(frame.part(2), nullptr);
    EXPECT_FALSE(stage.has_next(slow));
}

TEST(Viewer, GetsParticlesAndPlanesOnlyIfItWatchesThem) {
    Stage stage;
    Viewer viewer(false);
    stage.show();
    stage.next(viewer);
    stage.next(viewer);
    auto frame = test::read_frame(stage.next(viewer).bytes);
    EXPECT_EQ(frame.part(3), nullptr);
    EXPECT_EQ(frame.part(5), nullptr);
    stage.say(viewer, R"({"type":"watch","particles":true,"planes":true})");
    stage.show();
    frame = test::read_frame(stage.next(viewer).bytes);
    EXPECT_NE(frame.part(3, 0), nullptr);
    EXPECT_NE(frame.part(3, 1), nullptr);
    EXPECT_NE(frame.part(5), nullptr);
}

TEST(Viewer, GetsAnotherSceneAsAWhole) {
    Stage stage;
    Viewer viewer(false);
    stage.show();
    for (int k = 0; k < 3; ++k) {
        stage.next(viewer);
    }
    stage.shown.scene = 2;
    stage.shown.scene_text = R"({"type":"scene","scene":2})";
    stage.shown.moments = 0;
    EXPECT_EQ(text_of(stage.next(viewer)), stage.shown.scene_text);
    EXPECT_EQ(stage.next(viewer).bytes, stage.shown.geometry);
    EXPECT_FALSE(stage.has_next(viewer));
    EXPECT_TRUE(viewer.waits());
    stage.show();
    EXPECT_EQ(test::read_frame(stage.next(viewer).bytes).parts.size(), 3U + kRestParts);
}

TEST(Viewer, MayOnlyLookUnlessItIsGivenControl) {
    Stage stage;
    Viewer looks(false);
    EXPECT_TRUE(std::holds_alternative<std::monostate>(stage.say(looks, R"({"type":"reset"})")));
    stage.next(looks);
    stage.next(looks);
    const Json refused = Json::parse(text_of(stage.next(looks)));
    EXPECT_EQ(refused.at("type"), "refused");
    EXPECT_EQ(refused.at("command"), "reset");
    EXPECT_THAT(refused.at("why").get<std::string>(), testing::HasSubstr("--view-control"));
    Viewer commands(true);
    const auto heard = stage.say(commands, R"({"type":"pause","on":true})");
    ASSERT_TRUE(std::holds_alternative<Command>(heard));
    EXPECT_TRUE(std::get<SetPaused>(std::get<Command>(heard)).paused);
}

TEST(Viewer, MaySayTwoHundredThingsASecondAndNoMore) {
    Stage stage;
    Viewer viewer(false);
    const std::string text = R"({"type":"watch"})";
    const auto may_go_on = [&] { return std::holds_alternative<std::monostate>(stage.say(viewer, text)); };
    for (int k = 0; k < 200; ++k) {
        ASSERT_TRUE(may_go_on());
    }
    stage.now_ns += kSecond / 200;
    EXPECT_TRUE(may_go_on());
    const auto closing = stage.say(viewer, text);
    ASSERT_TRUE(std::holds_alternative<Closing>(closing));
    EXPECT_EQ(std::get<Closing>(closing).code, 1008);
    Viewer steady(false);
    for (int k = 0; k < 2000; ++k) {
        stage.now_ns += kSecond / 200;
        ASSERT_TRUE(std::holds_alternative<std::monostate>(stage.say(steady, text)));
    }
}

TEST(Viewer, IsToldOnlySoManyRefusalsAtOnce) {
    Stage stage;
    Viewer viewer(false);
    for (int k = 0; k < 150; ++k) {
        stage.say(viewer, R"({"type":"reset"})");
    }
    std::size_t messages = 0;
    while (stage.has_next(viewer)) {
        ++messages;
    }
    EXPECT_EQ(messages, 2 + kMostRefusals);
}

TEST(Viewer, GetsSamplesFromWhereItBeganAndHearsHowManyItMissed) {
    Stage stage;
    Viewer viewer(false);
    stage.next(viewer);
    stage.next(viewer);
    const auto add = [&](std::uint64_t from, std::uint64_t to) {
        for (std::uint64_t k = from; k < to; ++k) {
            stage.shown.samples.add({1, k, {static_cast<double>(k)}});
        }
    };
    add(5000, 5003);
    EXPECT_FALSE(stage.has_next(viewer));  // it does not watch them
    stage.say(viewer, R"({"type":"watch","samples":true})");
    const auto read = [&] {
        const Outgoing message = stage.next(viewer);
        test::Reader reader(message.bytes);
        EXPECT_EQ(reader.u32(), 3U);
        (void)reader.u32();
        const double first = reader.take<double>();
        const std::uint32_t count = reader.u32();
        return std::tuple(first, count, reader.u32());
    };
    EXPECT_EQ(read(), std::tuple(5000.0, 3U, 0U));
    add(5003, 5005);
    add(5010, 5011);                       // five found no room
    EXPECT_FALSE(stage.has_next(viewer));  // thirty messages a second are enough
    stage.now_ns += kSecond / 10;
    EXPECT_EQ(read(), std::tuple(5003.0, 2U, 0U));
    EXPECT_EQ(read(), std::tuple(5010.0, 1U, 5U));
    add(5011, 5011 + 10'000);  // more than are kept
    stage.now_ns += kSecond / 10;
    const auto [first, count, dropped] = read();
    EXPECT_EQ(first, 5011.0 + 10'000 - SampleHistory::kCapacity);
    EXPECT_EQ(dropped, 10'000 - SampleHistory::kCapacity);
    EXPECT_EQ(count, 1024U);
}

TEST(Viewer, IsToldOfDeviceRecordAndEnd) {
    Stage stage;
    Viewer viewer(false);
    stage.next(viewer);
    stage.next(viewer);
    stage.shown.device = "device";
    stage.shown.devices = 1;
    stage.shown.record = "record";
    stage.shown.records = 1;
    EXPECT_EQ(text_of(stage.next(viewer)), "record");
    EXPECT_EQ(text_of(stage.next(viewer)), "device");
    EXPECT_FALSE(stage.has_next(viewer));
    stage.show();
    stage.shown.ending = true;
    EXPECT_FALSE(viewer.told_bye());
    EXPECT_EQ(text_of(stage.next(viewer)), R"({"type":"bye"})");
    EXPECT_TRUE(viewer.told_bye());
    EXPECT_FALSE(stage.has_next(viewer));
}

}  // namespace
}  // namespace haptic::sim::view
