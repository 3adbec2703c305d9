#include "view/live_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "haptic/sim/scene.hpp"
#include "small_scene.hpp"
#include "socket_client.hpp"
#include "view/page_files.hpp"
#include "view/web_server.hpp"

namespace haptic::sim::view {

/// Replaces the real page.
std::span<const PageFile> page_files() {
    static const std::string script(300'000, 'x');  // more than a socket takes at once
    static constexpr std::string_view page = "<!doctype html><p>page";
    static constexpr std::string_view compressed = "script, compressed";
    static const std::array<PageFile, 2> files = {
        {{"/", "text/html; charset=utf-8", std::as_bytes(std::span(page))},
         {"/page.js", "text/javascript; charset=utf-8", std::as_bytes(std::span(script)),
          std::as_bytes(std::span(compressed))}}};
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
        view->set_scene(test::small_description());
    }
    std::string host() const { return "Host: " + own_host(port) + "\r\n"; }

    std::unique_ptr<LiveView> view;
    std::uint16_t port = 0;
};

/// One body of many vertices: a frame of it exceeds what the socket of a client that does not read can hold.
SceneDescription large_description() {
    SceneDescription scene;
    scene.name = "large";
    scene.bodies = {{"cloud", 0, 40'000, {{0, 1, 2}}, 0, 0}};
    return scene;
}

TEST(LiveViewPage, IsServedWithItsTypeAndAStrictContentPolicy) {
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
    EXPECT_EQ(request(served.port, "GET /favicon.ico", served.host()).status, 204);
}

TEST(LiveViewPage, IsCompressedOnlyForClientsThatAcceptIt) {
    const Served served;
    const auto accepting = [&](const std::string& encodings) {
        return request(served.port, "GET /page.js", served.host() + "Accept-Encoding: " + encodings + "\r\n");
    };
    for (const char* encodings : {"gzip", "deflate, gzip;q=0.8, br"}) {
        const auto script = accepting(encodings);
        EXPECT_EQ(script.header("content-encoding"), "gzip") << encodings;
        EXPECT_EQ(script.header("content-length"), "18") << encodings;
        EXPECT_EQ(script.body, "script, compressed") << encodings;
    }
    for (const char* encodings : {"br", "gzip;q=0", "x-gzip2"}) {
        const auto script = accepting(encodings);
        EXPECT_EQ(script.header("content-encoding"), "") << encodings;
        EXPECT_EQ(script.body.size(), 300'000U) << encodings;
    }
    EXPECT_EQ(accepting("gzip").header("vary"), "accept-encoding");
}

TEST(LiveViewPage, IsNotSentAgainToAClientThatHasIt) {
    const Served served;
    const std::string tag = request(served.port, "GET /page.js", served.host()).header("etag");
    ASSERT_THAT(tag, StartsWith("W/\""));
    EXPECT_NE(tag, request(served.port, "GET /", served.host()).header("etag"));
    const auto again = request(served.port, "GET /page.js", served.host() + "If-None-Match: \"x\", " + tag + "\r\n");
    EXPECT_EQ(again.status, 304);
    EXPECT_EQ(again.body, "");
    EXPECT_EQ(again.header("etag"), tag);
    const auto other = request(served.port, "GET /page.js", served.host() + "If-None-Match: \"x\"\r\n");
    EXPECT_EQ(other.status, 200);
    EXPECT_EQ(other.body.size(), 300'000U);
}

TEST(LiveViewStream, StartsWithTheSceneItsGeometryAndACompleteFrame) {
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
    EXPECT_EQ(number_at<std::uint32_t>(frame->bytes, 28), 7U);  // two bodies, tool; proxies, hand, forces, parameters
    // Later frames contain only the body that moves.
    const std::string next = client.next_binary(2);
    EXPECT_EQ(number_at<std::uint32_t>(next, 28), 5U);
    EXPECT_GT(number_at<double>(next, 16), number_at<double>(frame->bytes, 16));
}

TEST(LiveViewPage, RejectsOtherMethodsPathsHostsAndOrigins) {
    const Served served;
    EXPECT_EQ(request(served.port, "POST /", served.host() + "Content-Length: 0\r\n").status, 405);
    EXPECT_EQ(request(served.port, "DELETE /", served.host()).status, 405);
    EXPECT_EQ(request(served.port, "OPTIONS /", served.host()).status, 405);
    EXPECT_EQ(request(served.port, "GET /other", served.host()).status, 404);
    EXPECT_EQ(request(served.port, "GET /../../etc/passwd", served.host()).status, 404);
    EXPECT_EQ(request(served.port, "GET /stream", served.host()).status, 404);
    EXPECT_EQ(request(served.port, "GET /record.csv", served.host()).status, 404);
    EXPECT_EQ(request(served.port, "GET /", "").status, 400);
    EXPECT_EQ(request(served.port, "GET /", "Host: evil.example\r\n").status, 400);
    EXPECT_EQ(request(served.port, "GET /", served.host() + "Origin: http://evil.example\r\n").status, 403);
    EXPECT_EQ(request(served.port, "GET /", "Host: localhost:1\r\n").status, 200);  // through a tunnel
    EXPECT_NE(request(served.port, "GET /", served.host() + "X: " + std::string(100'000, 'x') + "\r\n").status, 200);
    EXPECT_EQ(request(served.port, "GET /", served.host()).status, 200);
}

TEST(LiveViewStream, RejectsOtherPathsProtocolsHostsAndOrigins) {
    const Served served;
    const auto status = [&](const Handshake& handshake) { return StreamClient(served.port, handshake).status(); };
    EXPECT_EQ(status({.origin = "http://" + own_host(served.port)}), 101);
    EXPECT_EQ(status({.origin = "http://evil.example"}), 403);
    EXPECT_EQ(status({.origin = "null"}), 403);
    EXPECT_EQ(status({.origin = "http://127.0.0.1:1"}), 403);
    EXPECT_EQ(status({.host = "evil.example", .origin = "http://evil.example"}), 400);
    EXPECT_EQ(status({.path = "/"}), 404);
    EXPECT_EQ(status({.subprotocol = ""}), 404);
    EXPECT_NE(status({.subprotocol = "haptic-view-2"}), 101);
    EXPECT_NE(status({.subprotocol = "pages"}), 101);
    EXPECT_NE(status({.subprotocol = "listener"}), 101);
    const auto http2 = request(served.port, "GET /stream",
                               served.host() +
                                   "Upgrade: h2c\r\nHTTP2-Settings: AAMAAABkAAQAAP__\r\n"
                                   "Sec-WebSocket-Protocol: haptic-view-1\r\n");
    EXPECT_EQ(http2.status, 404);
    EXPECT_EQ(status({}), 101);
}

TEST(LiveViewStream, IsReadOnlyWithoutControl) {
    const Served served;
    test::Run run(*served.view);
    StreamClient client(served.port);
    client.say(R"({"type":"reset"})");
    EXPECT_THAT(client.next_text("refused"), HasSubstr("--view-control"));
    EXPECT_EQ(run.commands(), 0U);
}

TEST(LiveViewStream, PassesCommandsToTheRunInOrder) {
    const Served served(true);
    test::Run run(*served.view);
    StreamClient client(served.port);
    (void)client.next_binary(2);  // the scene is known, by which a name is judged
    client.say(R"({"type":"set","key":"solver.iterations","value":9})");
    client.say(R"({"type":"hand","position":[1,2,3]})");
    client.say(R"({"type":"scene","name":"nowhere"})");
    client.say(R"({"type":"pause","on":true})");
    const Command set = run.next_command();
    ASSERT_TRUE(std::holds_alternative<SetParameter>(set));
    EXPECT_EQ(std::get<SetParameter>(set).value, 9.0);
    const Command hand = run.next_command();
    ASSERT_TRUE(std::holds_alternative<MoveHand>(hand));
    EXPECT_EQ(std::get<MoveHand>(hand).position, Vec3(1.0, 2.0, 3.0));
    EXPECT_TRUE(std::holds_alternative<SetPaused>(run.next_command()));
    EXPECT_EQ(Json::parse(client.next_text("refused")).at("command"), "scene");
}

TEST(LiveViewStream, ReleasesTheHandWhenItsOwnerLeaves) {
    const Served served(true);
    test::Run run(*served.view);
    {
        StreamClient client(served.port);
        client.say(R"({"type":"hand","position":[1,2,3]})");
        EXPECT_TRUE(std::holds_alternative<MoveHand>(run.next_command()));
    }
    EXPECT_TRUE(std::holds_alternative<ReleaseHand>(run.next_command()));
}

TEST(LiveViewStream, ClosesOnlyTheClientThatViolatesTheProtocol) {
    const Served served;
    const test::Run run(*served.view);
    StreamClient other(served.port);
    const auto code_after = [&](auto&& offend) {
        StreamClient client(served.port);
        EXPECT_EQ(client.status(), 101);
        offend(client);
        const int code = client.close_code();
        EXPECT_FALSE(other.next_binary(2).empty()) << "the other sees nothing more";
        return code;
    };
    EXPECT_EQ(code_after([](StreamClient& client) { client.say("{"); }), 1008);
    EXPECT_EQ(code_after([](StreamClient& client) { client.say(""); }), 1008);
    EXPECT_EQ(code_after([](StreamClient& client) { client.say(R"({"type":"fly"})"); }), 1008);
    EXPECT_EQ(code_after([](StreamClient& client) { client.send_frame(0x82, R"({"type":"reset"})"); }), 1003);
    EXPECT_EQ(code_after([](StreamClient& client) { client.say(std::string(1025, ' ')); }), 1008);
    EXPECT_EQ(code_after([](StreamClient& client) {
                  client.send_frame(0x01, std::string(500, ' '));
                  client.send_frame(0x00, std::string(500, ' '));
                  client.send_frame(0x80, std::string(500, ' '));
              }),
              1008);
    EXPECT_EQ(code_after([](StreamClient& client) { client.announce_frame(0x81, std::uint64_t{1} << 40U); }), 1008);
    EXPECT_EQ(code_after([](StreamClient& client) {
                  for (int k = 0; k < 400; ++k) {
                      client.say(R"({"type":"watch"})");
                  }
              }),
              1008);
    EXPECT_NE(code_after([](StreamClient& client) { client.send_frame(0x83, "no such opcode"); }), 0);
}

TEST(LiveViewStream, SendsTheCloseReasonAlsoDuringALongMessageAndNothingAfterIt) {
    SceneDescription scene = large_description();
    scene.bodies[0].triangles.clear();
    for (std::uint32_t k = 0; k + 2 < 40'000; ++k) {
        scene.bodies[0].triangles.push_back({k, k + 1, k + 2});
    }
    const auto view = open_live_view({"127.0.0.1", 0, false, ""});
    view->set_scene(scene);
    SceneSnapshot moment;
    moment.vertices.resize(40'000);
    const test::Run run(*view, moment);
    StreamClient client(test::port_in(view->url()), {.receive_buffer = 4096});
    EXPECT_EQ(client.status(), 101);
    client.say("{");
    EXPECT_EQ(client.close_code(), 1008);
    EXPECT_FALSE(client.next(200));
}

TEST(LiveViewStream, AcceptsAFragmentedMessage) {
    const Served served;
    StreamClient client(served.port);
    client.send_frame(0x01, R"({"type":)");
    client.send_frame(0x89, "a ping in between");
    client.send_frame(0x80, R"("reset"})");
    EXPECT_EQ(Json::parse(client.next_text("refused")).at("command"), "reset");
}

TEST(LiveViewStream, IsNotDelayedByAClientThatDoesNotRead) {
    const auto view = open_live_view({"127.0.0.1", 0, false, ""});
    view->set_scene(large_description());
    SceneSnapshot moment;
    moment.vertices.resize(40'000);
    const test::Run run(*view, moment);
    const std::uint16_t port = test::port_in(view->url());
    StreamClient mute(port, {.receive_buffer = 4096});
    StreamClient reads(port);
    double before = 0.0;
    for (int k = 0; k < 30; ++k) {
        const std::string frame = reads.next_binary(2);
        ASSERT_GT(frame.size(), 40'000U * 8U);
        ASSERT_GT(number_at<double>(frame, 16), before);
        before = number_at<double>(frame, 16);
    }
    // When it reads at last, it has missed the frames in between and gets the newest, complete.
    std::size_t frames = 0;
    while (number_at<double>(mute.next_binary(2), 16) < before) {
        ++frames;
    }
    EXPECT_LT(frames, 15U);
}

/// Sends endlessly to the first connection, and answers the others.
class EndlessSender final : public WebHandler {
  public:
    std::unique_ptr<Connection> connect() override { return std::make_unique<Talk>(listeners_); }
    std::optional<Resource> resource(std::string_view /*path*/) override { return std::nullopt; }
    std::optional<UploadAnswer> refuse_upload(std::string_view /*path*/) override { return UploadAnswer{404, ""}; }
    void take_upload(std::string_view /*path*/, std::vector<std::byte> /*content*/) override {}
    std::optional<UploadAnswer> upload_answer() override { return std::nullopt; }
    void tick() override {}
    int listeners() const { return listeners_; }

  private:
    class Talk final : public Connection {
      public:
        explicit Talk(std::atomic<int>& listeners) : listeners_(listeners), endless_(listeners++ == 0) {}
        Talk(const Talk&) = delete;
        Talk& operator=(const Talk&) = delete;
        ~Talk() override { --listeners_; }
        std::optional<Closing> on_message(std::string_view /*text*/) override {
            answers_ = true;
            return std::nullopt;
        }
        bool next_message(Outgoing& message) override {
            message.bytes.resize(endless_ ? 1'000'000 : 1);
            return endless_ || std::exchange(answers_, false);
        }
        [[nodiscard]] bool has_ended() const override { return false; }

      private:
        std::atomic<int>& listeners_;
        bool endless_ = false;
        bool answers_ = false;
    };

    std::atomic<int> listeners_{0};
};

/// Serves during its lifetime.
class Serving {
  public:
    explicit Serving(WebServer& server) : server_(server), thread_([&server] { server.run(); }) {}
    Serving(const Serving&) = delete;
    Serving& operator=(const Serving&) = delete;
    ~Serving() {
        server_.stop();
        thread_.join();
    }

  private:
    WebServer& server_;
    std::thread thread_;
};

TEST(WebServerThread, ClosesAClientWhoseSocketAcceptsNothing) {
    EndlessSender sender;
    WebServer server("127.0.0.1", 0, sender, 200'000'000);
    const Serving serving(server);
    StreamClient dead(server.port(), {.receive_buffer = 4096});
    while (sender.listeners() < 1) {
        std::this_thread::yield();
    }
    StreamClient alive(server.port());
    while (sender.listeners() < 2) {
        std::this_thread::yield();
    }
    while (sender.listeners() == 2) {
        alive.say("?");
        ASSERT_TRUE(alive.next());
    }
    // Data sent earlier can still be read; then the connection ends.
    while (dead.next()) {
    }
    EXPECT_TRUE(dead.ended());
    alive.say("?");
    EXPECT_TRUE(alive.next());
}

TEST(LiveViewStream, LimitsTheNumberOfViewers) {
    const Served served;
    const test::Run run(*served.view);
    std::vector<std::unique_ptr<StreamClient>> clients;
    for (std::size_t k = 0; k < kMaxViewers; ++k) {
        clients.push_back(std::make_unique<StreamClient>(served.port));
        ASSERT_EQ(clients.back()->status(), 101) << k;
    }
    EXPECT_EQ(StreamClient(served.port).status(), 503);
    EXPECT_EQ(request(served.port, "GET /", served.host()).status, 200);
    for (const auto& client : clients) {
        EXPECT_FALSE(client->next_binary(2).empty());
    }
    clients.pop_back();
    // The server notices the departure asynchronously.
    int status = 0;
    while (status != 101) {
        status = StreamClient(served.port).status();
        ASSERT_TRUE(status == 101 || status == 503);
    }
}

TEST(LiveViewStream, RestartsTheStreamForAnotherScene) {
    const Served served;
    StreamClient client(served.port);
    EXPECT_EQ(Json::parse(client.next_text("scene")).at("name"), "small");
    served.view->set_scene(large_description());
    EXPECT_EQ(Json::parse(client.next_text("scene")).at("name"), "large");
    EXPECT_EQ(number_at<std::uint32_t>(client.next_binary(1), 4), 2U);
    SceneSnapshot* snapshot = nullptr;
    while ((snapshot = served.view->requested_snapshot()) == nullptr) {
        std::this_thread::yield();
    }
    EXPECT_EQ(snapshot->vertices.size(), 40'000U);
    served.view->publish_snapshot();
    EXPECT_EQ(number_at<std::uint32_t>(client.next_binary(2), 4), 2U);
}

TEST(LiveViewStream, SendsSamplesToSubscribers) {
    const Served served;
    const test::Run run(*served.view);
    StreamClient client(served.port);
    client.say(R"({"type":"watch","samples":true})");
    std::uint32_t samples = 0;
    double end = 0.0;
    while (samples < 50) {
        const std::string message = client.next_binary(3);
        ASSERT_EQ(message.size(), 24U + 48U * number_at<std::uint32_t>(message, 16));
        EXPECT_EQ(number_at<std::uint32_t>(message, 20), 0U);
        EXPECT_GT(number_at<double>(message, 8), end);
        EXPECT_EQ(number_at<float>(message, 28), 1.0F);
        end = number_at<double>(message, 8);
        samples += number_at<std::uint32_t>(message, 16);
    }
}

TEST(LiveViewStream, OffersARecording) {
    const Served served;
    StreamClient client(served.port);
    (void)client.next_text("scene");
    served.view->offer_record("# a note is no step\ntime s,x m\n0,1\n1,2\n");
    const Json record = Json::parse(client.next_text("record"));
    EXPECT_EQ(record.at("steps"), 2);
    const auto csv = request(served.port, "GET " + record.at("url").get<std::string>(), served.host());
    EXPECT_EQ(csv.body, "# a note is no step\ntime s,x m\n0,1\n1,2\n");
    EXPECT_EQ(csv.header("content-type"), "text/csv; charset=utf-8");
    EXPECT_EQ(csv.header("content-disposition"), "attachment; filename=\"record.csv\"");
}

TEST(LiveViewStream, ReportsTheDeviceIfThereIsASession) {
    const auto view = open_live_view({"127.0.0.1", 0, false, "nobody-" + std::to_string(getpid())});
    view->set_scene(test::small_description());
    StreamClient client(test::port_in(view->url()));
    EXPECT_EQ(Json::parse(client.next_text("device")).at("connected"), false);
}

TEST(LiveViewStream, SaysByeAndEndsEvenIfAClientDoesNotRead) {
    auto served = std::make_unique<Served>();
    StreamClient client(served->port);
    const StreamClient mute(served->port, {.receive_buffer = 4096});
    (void)client.next_text("scene");
    served.reset();
    EXPECT_FALSE(client.next_text("bye").empty());
    EXPECT_EQ(client.close_code(), 1001);
}

TEST(LiveViewThread, RequestsNoSnapshotWithoutViewers) {
    const Served served;
    EXPECT_EQ(served.view->requested_snapshot(), nullptr);
    (void)request(served.port, "GET /", served.host());
    EXPECT_EQ(served.view->requested_snapshot(), nullptr);
    const StreamClient client(served.port);
    while (served.view->requested_snapshot() == nullptr) {
        std::this_thread::yield();
    }
}

/// The value of a line of /proc/self/task/TID/status.
std::string status_line(pid_t thread, const std::string& name) {
    std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/status");
    for (std::string line; std::getline(file, line);) {
        if (line.starts_with(name + ":\t")) {
            return line.substr(name.size() + 2);
        }
    }
    return {};
}

TEST(LiveViewThread, HasOrdinarySchedulingAndBlocksSignals) {
    const Served served;
    (void)request(served.port, "GET /", served.host());  // it runs
    int found = 0;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) {
        const pid_t thread = std::stoi(entry.path().filename());
        if (status_line(thread, "Name") != "haptic-view") {
            continue;
        }
        ++found;
        EXPECT_EQ(sched_getscheduler(thread), SCHED_OTHER);
        EXPECT_GT(getpriority(PRIO_PROCESS, static_cast<id_t>(thread)), 0);
        const auto blocked = std::stoull(status_line(thread, "SigBlk"), nullptr, 16);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGALRM, SIGPIPE}) {
            EXPECT_NE(blocked & (1ULL << static_cast<unsigned>(signal - 1)), 0U) << signal;
        }
    }
    EXPECT_EQ(found, 1);
}

constexpr std::string_view kTetrahedron = "v 0 0 0\nv 3 0 0\nv 0 3 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

test::HttpReply post(const Served& served, const std::string& path, std::string_view content,
                     const std::string& headers = "") {
    return request(served.port, "POST " + path,
                   served.host() + headers + "Content-Length: " + std::to_string(content.size()) + "\r\n", content);
}

TEST(PostedMesh, BecomesASceneForTheRun) {
    const Served served(true);
    const auto reply =
        post(served, "/mesh/own-body.obj", kTetrahedron, "Origin: http://" + own_host(served.port) + "\r\n");
    EXPECT_EQ(reply.status, 200) << reply.body;
    EXPECT_THAT(reply.body, HasSubstr("3 x 3 x 3 units"));
    Command command;
    ASSERT_TRUE(served.view->next_command(command));
    const auto& change = std::get<ChangeScene>(command);
    EXPECT_EQ(change.name, "own-body");
    ASSERT_TRUE(change.made);
    EXPECT_EQ(change.made->model.mesh->triangles.size(), 4U);
    EXPECT_EQ(change.made->name, "own-body");
    EXPECT_FALSE(served.view->next_command(command));
    // Another one may follow.
    EXPECT_EQ(post(served, "/mesh/other.obj", kTetrahedron).status, 200);
}

TEST(PostedMesh, IsRefusedWithAReasonIfItCannotBeTouched) {
    const Served served(true);
    const auto why = [&](const std::string& name, std::string_view content) {
        const auto reply = post(served, "/mesh/" + name, content);
        EXPECT_EQ(reply.status, 422) << name;
        return reply.body;
    };
    EXPECT_THAT(why("points.obj", "v 0 0 0\nv 1 0 0\n"), HasSubstr("points.obj: has no triangles"));
    EXPECT_THAT(why("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n"), HasSubstr("not a finite number"));
    EXPECT_THAT(why("broken.ply", "ply\n"), HasSubstr("end_header"));
    Command command;
    EXPECT_FALSE(served.view->next_command(command));
}

TEST(PostedMesh, NeedsControlAnOwnOriginAPlainNameAndABoundedLength) {
    const Served served(true);
    EXPECT_EQ(post(served, "/mesh/a.obj", kTetrahedron, "Origin: http://evil.example\r\n").status, 403);
    EXPECT_EQ(post(served, "/mesh/a.txt", kTetrahedron).status, 415);
    EXPECT_EQ(post(served, "/mesh/.obj", kTetrahedron).status, 400);
    EXPECT_EQ(post(served, "/mesh/", kTetrahedron).status, 400);
    EXPECT_EQ(post(served, "/mesh/a%20b.obj", kTetrahedron).status, 400);
    EXPECT_EQ(post(served, "/", kTetrahedron).status, 405);
    EXPECT_EQ(request(served.port, "POST /mesh/a.obj", "Host: evil.example\r\nContent-Length: 3\r\n", "v 0").status,
              400);
    EXPECT_EQ(request(served.port, "POST /mesh/a.obj", served.host() + "Content-Length: 100000000\r\n").status, 413);
    EXPECT_EQ(request(served.port, "POST /mesh/a.obj", served.host()).status, 411);
    const Served watched(false);
    EXPECT_EQ(post(watched, "/mesh/a.obj", kTetrahedron).status, 403);
    Command command;
    EXPECT_FALSE(served.view->next_command(command));
    EXPECT_FALSE(watched.view->next_command(command));
}

TEST(PostedMesh, OfAClientThatLeavesDoesNotBlockTheNext) {
    const Served served(true);
    {
        test::Connection half(served.port);
        half.send("POST /mesh/a.obj HTTP/1.1\r\n" + served.host() + "Content-Length: 1000\r\n\r\nv 0 0 0\n");
        // Meanwhile there is room for no other.
        EXPECT_EQ(request(served.port, "GET /", served.host()).status, 200);
        EXPECT_EQ(post(served, "/mesh/b.obj", kTetrahedron).status, 503);
    }
    int status = 503;
    for (int k = 0; k < 100 && status == 503; ++k) {
        status = post(served, "/mesh/b.obj", kTetrahedron).status;
    }
    EXPECT_EQ(status, 200);
}

TEST(LiveViewAddress, GivesAdviceIfItCannotListen) {
    const auto why = [](const LiveViewSettings& settings) -> std::string {
        try {
            (void)open_live_view(settings);
            return "it listens";
        } catch (const std::runtime_error& error) {
            return error.what();
        }
    };
    const Served served;
    const std::string taken = why({"127.0.0.1", served.port, false, ""});
    EXPECT_THAT(taken, HasSubstr("127.0.0.1, port " + std::to_string(served.port)));
    EXPECT_THAT(taken, HasSubstr("give another port, e.g. --view " + std::to_string(served.port + 1)));
    EXPECT_THAT(why({"203.0.113.7", 0, false, ""}), HasSubstr("does not have that address"));
    EXPECT_THAT(why({"nowhere", 0, false, ""}), HasSubstr("not an IP address"));
}

TEST(LiveViewAddress, IsAValidUrlForABrowser) {
    EXPECT_THAT(open_live_view({"127.0.0.1", 0, false, ""})->url(), testing::MatchesRegex("http://127.0.0.1:[0-9]+/"));
    const auto everywhere = open_live_view({"0.0.0.0", 0, false, ""});
    const std::string host = everywhere->url().substr(7, everywhere->url().size() - 8);
    EXPECT_EQ(request(test::port_in(everywhere->url()), "GET /", "Host: " + host + "\r\n").status, 200);
}

}  // namespace
}  // namespace haptic::sim::view
