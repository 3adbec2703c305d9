#include "view/command_parser.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "small_scene.hpp"

namespace haptic::sim::view {
namespace {

using testing::HasSubstr;

Request parse(std::string_view text) {
    SceneDescription scene = test::small_description();
    scene.length = 12.0;
    return parse_request(text, scene);
}

/// The command of type `Wanted` that the text must contain.
template <class Wanted>
Wanted command(std::string_view text) {
    const Request request = parse(text);
    const auto* any = std::get_if<Command>(&request);
    const auto* wanted = any == nullptr ? nullptr : std::get_if<Wanted>(any);
    EXPECT_NE(wanted, nullptr) << text;
    return wanted == nullptr ? Wanted{} : *wanted;
}

TEST(CommandParser, ReadsEveryMessageOfTheProtocol) {
    const SetParameter set = command<SetParameter>(R"({"type":"set","key":"solver.iterations","value":7})");
    EXPECT_EQ(set.parameter, 1U);
    EXPECT_EQ(set.value, 7.0);
    EXPECT_EQ(command<SetParameter>(R"({"type":"set","key":"contact.method","value":1})").parameter, 2U);
    EXPECT_TRUE(command<SetPaused>(R"({"type":"pause","on":true})").paused);
    EXPECT_EQ(command<SingleStep>(R"({"type":"step","steps":1000})").steps, 1000);
    EXPECT_EQ(command<SingleStep>(R"({"type":"step"})").steps, 1);
    command<Reset>(R"({"type":"reset"})");
    EXPECT_EQ(command<ChangeScene>(R"({"type":"scene","name":"other"})").name, "other");
    EXPECT_TRUE(command<SetRecording>(R"({"type":"record","on":true})").on);
    command<ReleaseHand>(R"({"type":"release"})");
    command<FollowScript>(R"({"type":"script"})");
    EXPECT_EQ(command<Seek>(R"({"type":"seek","time":12})").time, 12.0);
    EXPECT_EQ(command<SetSpeed>(R"({"type":"speed","speed":0.01})").speed, 0.01);
    const Request watch = parse(R"({"type":"watch","planes":true,"samples":false})");
    ASSERT_TRUE(std::holds_alternative<Watch>(watch));
    EXPECT_TRUE(std::get<Watch>(watch).planes);
    EXPECT_FALSE(std::get<Watch>(watch).particles);
}

TEST(CommandParser, ReadsTheHandWithOrWithoutOrientationAndCurl) {
    const MoveHand bare = command<MoveHand>(R"({"type":"hand","position":[1,-2.5,1000]})");
    EXPECT_EQ(bare.position, Vec3(1.0, -2.5, 1000.0));
    EXPECT_FALSE(bare.orientation);
    EXPECT_FALSE(bare.curl);
    const MoveHand full =
        command<MoveHand>(R"({"type":"hand","position":[0,0,0],"orientation":[0.6004,0,0.8,0],"curl":1})");
    ASSERT_TRUE(full.orientation);
    EXPECT_NEAR(full.orientation->w * full.orientation->w + full.orientation->y * full.orientation->y, 1.0, 1e-15);
    EXPECT_NEAR(full.orientation->w / full.orientation->y, 0.6004 / 0.8, 1e-15);
    EXPECT_EQ(full.curl, 1.0);
}

TEST(CommandParser, RejectsMessagesOutsideTheProtocolAsMalformed) {
    const std::vector<std::string> texts = {
        "",
        "null",
        "[]",
        "{",
        "{}",
        "\xff\xfe",
        R"({"type":7})",
        R"({"type":"fly"})",
        R"({"type":"reset","now":true})",
        R"({"type":"reset"} )" + std::string(1, '\0'),
        R"({"type":"watch","planes":1})",
        R"({"type":"pause"})",
        R"({"type":"pause","on":"yes"})",
        R"({"type":"set","key":"coupling.stiffness"})",
        R"({"type":"set","key":"coupling.stiffness","value":"20"})",
        R"({"type":"set","key":"coupling.stiffness","value":NaN})",
        R"({"type":"set","key":"coupling.stiffness","value":1e999})",
        R"({"type":"set","key":["coupling.stiffness"],"value":1})",
        R"({"type":"step","steps":"1"})",
        R"({"type":"scene","name":null})",
        R"({"type":"hand"})",
        R"({"type":"hand","position":[1,2]})",
        R"({"type":"hand","position":[1,2,3,4]})",
        R"({"type":"hand","position":[1,2,"3"]})",
        R"({"type":"hand","position":{"x":1,"y":2,"z":3}})",
        R"({"type":"hand","position":[0,0,0],"orientation":[1,0,0]})",
        R"({"type":"hand","position":[0,0,0],"curl":true})",
        R"({"type":"seek"})",
        R"({"type":"speed","speed":[]})",
        R"({"type":")" + std::string(900, 'x') + R"("})",
        R"({"type":"reset"})" + std::string(kMaxRequestBytes, ' '),
        std::string(1000, '['),
    };
    for (const std::string& text : texts) {
        const Request request = parse(text);
        ASSERT_TRUE(std::holds_alternative<Malformed>(request)) << text;
        const std::string& why = std::get<Malformed>(request).why;
        EXPECT_FALSE(why.empty()) << text;
        EXPECT_LE(why.size(), 120U) << text;
    }
}

TEST(CommandParser, RefusesImpossibleCommandsWithAReason) {
    struct Case {
        std::string text;
        std::string why;
    };
    const std::vector<Case> cases = {
        {R"({"type":"set","key":"nothing","value":1})", "no parameter"},
        {R"({"type":"set","key":"coupling.stiffness","value":100.5})", "coupling.stiffness must be from 0.0 to 100.0"},
        {R"({"type":"set","key":"coupling.stiffness","value":-0.1})", "must be from"},
        {R"({"type":"set","key":"solver.iterations","value":1.5})", "whole"},
        {R"({"type":"set","key":"contact.method","value":2})", "from 0.0 to 1.0"},
        {R"({"type":"set","key":"contact.method","value":0.5})", "whole"},
        {R"({"type":"step","steps":0})", "1 to 1000"},
        {R"({"type":"step","steps":1001})", "1 to 1000"},
        {R"({"type":"step","steps":1.5})", "whole"},
        {R"({"type":"step","steps":1e300})", "1 to 1000"},
        {R"({"type":"scene","name":"../../etc/passwd"})", "no scene"},
        {R"({"type":"hand","position":[0,0,1000.1]})", "1000.0 m"},
        {R"({"type":"hand","position":[-1e308,0,0]})", "1000.0 m"},
        {R"({"type":"hand","position":[0,0,0],"orientation":[0,0,0,0]})", "unit"},
        {R"({"type":"hand","position":[0,0,0],"orientation":[1.002,0,0,0]})", "unit"},
        {R"({"type":"hand","position":[0,0,0],"orientation":[1e200,1e200,0,0]})", "unit"},
        {R"({"type":"hand","position":[0,0,0],"curl":1.01})", "curl"},
        {R"({"type":"seek","time":12.1})", "0 to 12.0 s"},
        {R"({"type":"seek","time":-1})", "0 to 12.0 s"},
        {R"({"type":"speed","speed":0})", "0.01 to 10.0"},
        {R"({"type":"speed","speed":11})", "0.01 to 10.0"},
    };
    for (const Case& c : cases) {
        const Request request = parse(c.text);
        ASSERT_TRUE(std::holds_alternative<Refusal>(request)) << c.text;
        EXPECT_THAT(std::get<Refusal>(request).why, HasSubstr(c.why)) << c.text;
        EXPECT_EQ(std::get<Refusal>(request).command, nlohmann::json::parse(c.text).at("type").get<std::string>())
            << c.text;
    }
}

TEST(CommandParser, RefusesToSeekInALiveRun) {
    const Request request = parse_request(R"({"type":"seek","time":0.5})", test::small_description());
    ASSERT_TRUE(std::holds_alternative<Refusal>(request));
    EXPECT_THAT(std::get<Refusal>(request).why, HasSubstr("not a recording"));
}

TEST(CommandParser, NamesEachCommandByItsMessageType) {
    EXPECT_EQ(type_of(SetParameter{}), "set");
    EXPECT_EQ(type_of(MoveHand{}), "hand");
    EXPECT_EQ(type_of(SetSpeed{}), "speed");
    const auto refused = nlohmann::json::parse(refused_message({"set", "a \"quoted\" \xff why"}));
    EXPECT_EQ(refused.at("type"), "refused");
    EXPECT_EQ(refused.at("command"), "set");
    EXPECT_THAT(refused.at("why").get<std::string>(), HasSubstr("\"quoted\""));
}

}  // namespace
}  // namespace haptic::sim::view
