// HTTP and WebSocket for a few viewers, by libwebsockets, all on one thread. It knows who may connect and how much one
// may say or hold up; what is said it leaves to a WebHandler.
//
// Only GET and HEAD, and one WebSocket, /stream, of the subprotocol haptic-view-1. Refused are requests whose Host is
// not this machine's (400), from a page that this server did not serve (403), and more than kMostViewers (503). A
// viewer is closed, and nobody else notices, when it says anything but text messages of kLongestRequest bytes at most,
// or when its socket takes nothing for kStuckAfterNs.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "view/viewer.hpp"

namespace haptic::sim::view {

inline constexpr std::size_t kMostViewers = 128;
inline constexpr std::int64_t kStuckAfterNs = 10'000'000'000;
inline constexpr std::int64_t kTickNs = 4'000'000;
inline constexpr const char* kStreamPath = "/stream";
inline constexpr const char* kSubprotocol = "haptic-view-1";

/// What is served at a path.
struct Resource {
    std::string type;                    // e.g. "text/html; charset=utf-8"
    std::span<const std::byte> content;  // empty: there is none, which is no error
    std::shared_ptr<const void> owner;   // keeps the content; null: it is there for ever
    std::string download_as;             // a file name; empty: it is shown
};

/// One connected viewer. Calls come from the server's thread; whatever is thrown closes this viewer.
class Conversation {
  public:
    Conversation() = default;
    Conversation(const Conversation&) = delete;
    Conversation& operator=(const Conversation&) = delete;
    virtual ~Conversation() = default;

    /// A whole text message; closes the connection if it says so.
    [[nodiscard]] virtual std::optional<Closing> hear(std::string_view text) = 0;
    /// The message before has gone: writes the next one, or returns false until invited again.
    [[nodiscard]] virtual bool next_message(Outgoing& message) = 0;
    /// Nothing will follow: the connection is to be closed.
    [[nodiscard]] virtual bool has_ended() const = 0;
};

/// Calls come from the server's thread.
class WebHandler {
  public:
    WebHandler() = default;
    WebHandler(const WebHandler&) = delete;
    WebHandler& operator=(const WebHandler&) = delete;
    virtual ~WebHandler() = default;

    [[nodiscard]] virtual std::unique_ptr<Conversation> join() = 0;
    [[nodiscard]] virtual std::optional<Resource> resource(std::string_view path) = 0;
    /// Every kTickNs while somebody is connected, and after each wake().
    virtual void tick() = 0;
};

class WebServer {
  public:
    /// Listens; port 0: any that is free. `stuck_after_ns`: when a viewer whose socket takes nothing is closed. Throws
    /// std::runtime_error: the address cannot be had.
    WebServer(const std::string& address, std::uint16_t port, WebHandler& handler,
              std::int64_t stuck_after_ns = kStuckAfterNs);
    WebServer(const WebServer&) = delete;
    WebServer& operator=(const WebServer&) = delete;
    ~WebServer();

    /// The port that it listens on, also where any was asked for.
    [[nodiscard]] std::uint16_t port() const noexcept;

    /// Serves on the calling thread, until stop() and then until all conversations have ended, a quarter of a second
    /// at most.
    void run();

    /// From any thread; neither waits nor allocates.
    void wake() noexcept;
    void stop() noexcept;

    // From the server's thread.
    [[nodiscard]] bool stopping() const noexcept;
    [[nodiscard]] std::size_t viewers() const noexcept;
    /// Asks every conversation for its next message as soon as its socket takes one.
    void invite_all();

  private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace haptic::sim::view
