// Web server: HTTP and WebSocket for a few viewers by libwebsockets, all on one thread. It decides who may connect and
// limits what a viewer may send or hold up; the content of messages is the WebHandler's.
//
// It accepts GET and HEAD, one POST at a time where its handler allows it, of at most kMaxUploadBytes and of announced
// length, and one WebSocket, /stream, of subprotocol haptic-view-1. It rejects requests whose
// Host is not this machine (400), requests from a page that this server did not serve (403), and viewers beyond
// kMaxViewers (503). It closes a viewer that sends anything but text messages of at most kMaxRequestBytes, or whose
// socket accepts nothing for kStuckAfterNs; other viewers are not affected.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "view/viewer.hpp"

namespace haptic::sim::view {

inline constexpr std::size_t kMaxViewers = 128;
inline constexpr std::int64_t kStuckAfterNs = 10'000'000'000;
inline constexpr std::int64_t kTickNs = 4'000'000;
inline constexpr std::size_t kMaxUploadBytes = 32U << 20U;
inline constexpr const char* kStreamPath = "/stream";
inline constexpr const char* kSubprotocol = "haptic-view-1";

/// Content served at a path. A client that has the content of the same tag is told so instead (304).
struct Resource {
    std::string type;                    // e.g. "text/html; charset=utf-8"
    std::span<const std::byte> content;  // empty: the path exists but has no content (204)
    std::shared_ptr<const void> owner;   // keeps the content alive; null: static content
    std::string download_as;             // a file name; empty: shown in the browser
    std::span<const std::byte> gzip{};   // the content compressed, for clients that accept it; empty: it is not
    std::string tag{};                   // names this content, without quotes; empty: clients do not keep it
};

/// Answer to content that a client has posted: an HTTP status and a text for its user.
struct UploadAnswer {
    unsigned status = 200;
    std::string text;
};

/// One connected viewer. Called from the server's thread; an exception closes this viewer.
class Connection {
  public:
    Connection() = default;
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;
    virtual ~Connection() = default;

    /// Handles a complete text message. Returns a Closing to close the connection.
    [[nodiscard]] virtual std::optional<Closing> on_message(std::string_view text) = 0;
    /// Writes the next message once the previous one has been sent; returns false if there is none until the next
    /// request_writes().
    [[nodiscard]] virtual bool next_message(Outgoing& message) = 0;
    /// No more messages will follow; the server closes the connection.
    [[nodiscard]] virtual bool has_ended() const = 0;
};

/// Supplier of content. Called from the server's thread.
class WebHandler {
  public:
    WebHandler() = default;
    WebHandler(const WebHandler&) = delete;
    WebHandler& operator=(const WebHandler&) = delete;
    virtual ~WebHandler() = default;

    [[nodiscard]] virtual std::unique_ptr<Connection> connect() = 0;
    [[nodiscard]] virtual std::optional<Resource> resource(std::string_view path) = 0;
    /// Why nothing may be posted to this path now, before any of it is received; empty if it may.
    [[nodiscard]] virtual std::optional<UploadAnswer> refuse_upload(std::string_view path) = 0;
    /// Takes the whole content that was posted to a path. Must not block: the answer may come later.
    virtual void take_upload(std::string_view path, std::vector<std::byte> content) = 0;
    /// The answer to what was taken last, once, when there is one. Asked at each tick().
    [[nodiscard]] virtual std::optional<UploadAnswer> upload_answer() = 0;
    /// Called every kTickNs while a viewer is connected, and after each wake().
    virtual void tick() = 0;
};

class WebServer {
  public:
    /// Starts to listen; port 0 selects a free port. A viewer whose socket accepts nothing for `stuck_after_ns` is
    /// closed. Throws std::runtime_error if the address is not available.
    WebServer(const std::string& address, std::uint16_t port, WebHandler& handler,
              std::int64_t stuck_after_ns = kStuckAfterNs);
    WebServer(const WebServer&) = delete;
    WebServer& operator=(const WebServer&) = delete;
    ~WebServer();

    /// The port that it listens on, also when port 0 was given.
    [[nodiscard]] std::uint16_t port() const noexcept;

    /// Serves on the calling thread until stop(), then until all connections have closed, at most a quarter of a second
    /// longer.
    void run();

    /// Callable from any thread; neither blocks nor allocates.
    void wake() noexcept;
    void stop() noexcept;

    // To be called from the server's thread.
    [[nodiscard]] bool stopping() const noexcept;
    [[nodiscard]] std::size_t viewers() const noexcept;
    /// Asks every connection for its next message as soon as its socket is writable.
    void request_writes();

  private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace haptic::sim::view
