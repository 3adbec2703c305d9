#include "view/live_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "shown_scene.hpp"
#include "socket_client.hpp"
#include "view/page_files.hpp"

namespace haptic::sim::view {

/// In place of the page that host-sim has.
std::span<const PageFile> page_files() {
    static const std::string script(300'000, 'x');  // more than a socket takes at once
    static constexpr std::string_view page = "<!doctype html><p>page";
    static const std::array<PageFile, 2> files = {
        {{"/", "text/html; charset=utf-8", std::as_bytes(std::span(page))},
         {"/page.js", "text/javascript; charset=utf-8", std::as_bytes(std::span(script))}}};
    return files;
}

namespace {

using testing::HasSubstr;
using testing::StartsWith;
using Json = nlohmann::json;
using test::Handshake;
using test::number_at;
using test::own_host;
using test::request;
using test::StreamClient;

struct Served {
    explicit Served(bool control = false) : view(open_live_view({"127.0.0.1", 0, control, ""})) {
        port = test::port_in(view->url());
        view->introduce(test::small_description());
    }
    std::string host() const { return "Host: " + own_host(port) + "\r\n"; }

    std::unique_ptr<LiveView> view;
    std::uint16_t port = 0;
};

TEST(LiveViewPage, IsServedAsWhatItIsAndMayLoadNothingFromElsewhere) {
    const Served served;
    const auto page = request(served.port, "GET /", served.host());
    EXPECT_EQ(page.status, 200);
    EXPECT_EQ(page.body, "<!doctype html><p>page");
    EXPECT_EQ(page.header("content-type"), "text/html; charset=utf-8");
    EXPECT_EQ(page.header("content-length"), "22");
    EXPECT_EQ(page.header("x-content-type-options"), "nosniff");
    EXPECT_EQ(page.header("cache-control"), "no-cache");
    EXPECT_THAT(page.header("content-security-policy"), StartsWith("default-src 'self'; connect-src 'self' ws://"));
    EXPECT_THAT(page.header("content-security-policy"), HasSubstr("ws://" + own_host(served.port) + " "));
    const auto script = request(served.port, "GET /page.js", served.host());
    EXPECT_EQ(script.body, std::string(300'000, 'x'));
    const auto head = request(served.port, "HEAD /page.js", served.host());
    EXPECT_EQ(head.status, 200);
    EXPECT_EQ(head.header("content-length"), "300000");
    EXPECT_EQ(head.body, "");
}

TEST(LiveViewStream, BeginsWithTheSceneItsGeometryAndAFrameOfAllBodies) {
    const Served served;
    const test::Run run(*served.view);
    StreamClient client(served.port);
    ASSERT_EQ(client.status(), 101);
    const auto scene = client.next();
    ASSERT_TRUE(scene);
    EXPECT_EQ(Json::parse(scene->bytes).at("type"), "scene");
    EXPECT_EQ(Json::parse(scene->bytes).at("control"), false);
    const auto geometry = client.next();
    ASSERT_TRUE(geometry);
    EXPECT_EQ(number_at<std::uint32_t>(geometry->bytes, 0), 1U);
    const auto frame = client.next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(number_at<std::uint32_t>(frame->bytes, 0), 2U);
    EXPECT_EQ(number_at<std::uint32_t>(frame->bytes, 28), 6U);  // two bodies, tool; proxies, hand, parameters
    // From then on only the body that moves is sent.
    const std::string next = client.next_binary(2);
    EXPECT_EQ(number_at<std::uint32_t>(next, 28), 4U);
    EXPECT_GT(number_at<double>(next, 16), number_at<double>(frame->bytes, 16));
}

}  // namespace
}  // namespace haptic::sim::view
