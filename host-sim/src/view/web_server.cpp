#include "view/web_server.hpp"

#include <fcntl.h>
#include <libwebsockets.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "haptic/clock.hpp"
#include "view/listener.hpp"
#include "view/page_replies.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::size_t kMostSockets = kMostViewers + 32;  // the rest are for pages
constexpr std::size_t kChunk = 65536;                    // bytes that are written at once
// What the kernel may hold back for one viewer: more would only make what it shows old.
constexpr int kSendBuffer = 262144;
constexpr int kUnsentAtMost = 131072;
constexpr std::int64_t kFarewellNs = 250'000'000;

// What the library calls protocols beside that of the stream: of pages, the listening socket and the timer.
constexpr const char* kPages = "pages";
constexpr const char* kListener = "listener";
constexpr const char* kTimer = "timer";

/// Of every response.
const lws_protocol_vhost_options* security_headers() {
    static const lws_protocol_vhost_options sniff{nullptr, nullptr, "x-content-type-options:", "nosniff"};
    static const lws_protocol_vhost_options frame{&sniff, nullptr, "x-frame-options:", "DENY"};
    static const lws_protocol_vhost_options referrer{&frame, nullptr, "referrer-policy:", "no-referrer"};
    static const lws_protocol_vhost_options cache{&referrer, nullptr, "cache-control:", "no-cache"};
    return &cache;
}

bool speaks(lws* wsi, const char* protocol) {
    return std::strcmp(lws_get_protocol(wsi)->name, protocol) == 0;
}

/// The library ignores SIGPIPE for the whole process, which is not for it to decide.
class SigpipeAsItWas {
  public:
    SigpipeAsItWas() { (void)sigaction(SIGPIPE, nullptr, &before_); }
    SigpipeAsItWas(const SigpipeAsItWas&) = delete;
    SigpipeAsItWas& operator=(const SigpipeAsItWas&) = delete;
    ~SigpipeAsItWas() { (void)sigaction(SIGPIPE, &before_, nullptr); }

  private:
    struct sigaction before_{};
};

/// A descriptor in reserve: with none left a connection cannot even be refused, and would be offered for ever.
class SpareDescriptor {
  public:
    SpareDescriptor() { open(); }
    SpareDescriptor(const SpareDescriptor&) = delete;
    SpareDescriptor& operator=(const SpareDescriptor&) = delete;
    ~SpareDescriptor() { close(); }
    void open() { descriptor_ = ::open("/dev/null", O_RDONLY | O_CLOEXEC); }
    void close() {
        if (descriptor_ >= 0) {
            (void)::close(descriptor_);
            descriptor_ = -1;
        }
    }

  private:
    int descriptor_ = -1;
};

/// A viewer's connection.
struct Connection {
    std::unique_ptr<Conversation> conversation;
    std::string heard;                    // the fragments of a message so far
    std::vector<unsigned char> outgoing;  // LWS_PRE bytes for the library, then the message
    std::size_t sent = 0;                 // with those
    bool text = false;
    std::int64_t asked_ns = 0;       // since when the socket has taken nothing; 0: nothing waits for it
    std::optional<Closing> closing;  // as soon as what is on its way has gone
};

}  // namespace

class WebServer::Impl {
  public:
    Impl(const std::string& address, std::uint16_t port, WebHandler& handler, std::int64_t stuck_after_ns);
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl();

    [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
    void run();
    void wake() noexcept { lws_cancel_service(context_); }
    void stop() noexcept;
    [[nodiscard]] bool stopping() const noexcept { return stop_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::size_t viewers() const noexcept { return connections_.size(); }
    void invite_all();

  private:
    /// The library calls back as C does: nothing may be thrown through it.
    static int on_event(lws* wsi, lws_callback_reasons reason, void* user, void* in, std::size_t length);
    static const std::array<lws_protocols, 5>& protocols();
    int on(lws* wsi, lws_callback_reasons reason, const void* in, std::size_t length);

    void adopt(int descriptor, const char* protocol);
    int take_from(lws* wsi);
    void accept_all(int listener);
    void admit(int socket);
    int check_upgrade(lws* wsi);
    void join(lws* wsi);
    int hear(lws* wsi, std::string_view fragment);
    int write(lws* wsi);
    int write_chunk(lws* wsi, Connection& connection);
    int close(lws* wsi, const Closing& closing);
    int close_later(lws* wsi, Connection& connection, const Closing& closing);
    void invite(lws* wsi, Connection& connection);
    void forget(lws* wsi);
    void tick();
    void close_stuck(std::int64_t now_ns);
    void keep_time();

    WebHandler& handler_;
    std::int64_t stuck_after_ns_ = 0;
    std::uint16_t port_ = 0;
    PageReplies pages_;
    SpareDescriptor spare_;
    std::set<const lws*> sockets_;  // accepted, and not yet closed
    std::map<lws*, Connection> connections_;
    std::set<lws*> closing_;  // were connections; their close frame is on its way
    std::atomic<bool> stop_{false};
    std::int64_t end_ns_ = 0;  // once it stops: when it ends at the latest
    bool ended_ = false;
    bool ticking_ = false;
    int timer_ = -1;  // the library's, as soon as it has it
    lws_context* context_ = nullptr;
};

const std::array<lws_protocols, 5>& WebServer::Impl::protocols() {
    static const std::array<lws_protocols, 5> list = {{{kPages, on_event, 0, 0, 0, nullptr, 0},
                                                       {kSubprotocol, on_event, 0, kLongestRequest, 0, nullptr, 0},
                                                       {kListener, on_event, 0, 0, 0, nullptr, 0},
                                                       {kTimer, on_event, 0, 0, 0, nullptr, 0},
                                                       {nullptr, nullptr, 0, 0, 0, nullptr, 0}}};
    return list;
}

int WebServer::Impl::on_event(lws* wsi, lws_callback_reasons reason, void* /*user*/, void* in, std::size_t length) {
    auto* server = static_cast<Impl*>(lws_context_user(lws_get_context(wsi)));
    try {
        return server->on(wsi, reason, in, length);
    } catch (const std::exception&) {
        return -1;  // ends this connection alone: memory ran out, or what it was told of could not be computed
    }
}

WebServer::Impl::Impl(const std::string& address, std::uint16_t port, WebHandler& handler, std::int64_t stuck_after_ns)
    : handler_(handler), stuck_after_ns_(stuck_after_ns) {
    const int listener = listen_on(address, port);
    port_ = port_of(listener);
    const SigpipeAsItWas keep;
    lws_set_log_level(0, nullptr);
    lws_context_creation_info info{};
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.protocols = protocols().data();
    info.headers = security_headers();
    info.options = LWS_SERVER_OPTION_VALIDATE_UTF8;
    info.server_string = "host-sim";
    info.gid = static_cast<decltype(info.gid)>(-1);
    info.uid = static_cast<decltype(info.uid)>(-1);
    info.fd_limit_per_thread = static_cast<unsigned>(kMostSockets) + 16;
    info.timeout_secs = kRequestPatienceS;
    info.user = this;
    context_ = lws_create_context(&info);
    if (context_ == nullptr) {
        (void)::close(listener);
        throw std::runtime_error("--view: libwebsockets could not be set up; is there memory, are there descriptors?");
    }
    adopt(listener, kListener);
    // A timer of the library's own would be rounded down to milliseconds, and the rest of each spent in a busy loop.
    timer_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    adopt(timer_, kTimer);
}

WebServer::Impl::~Impl() {
    lws_context_destroy(context_);
}

/// The descriptor is the library's from here on.
void WebServer::Impl::adopt(int descriptor, const char* protocol) {
    lws_sock_file_fd_type adopted{};
    adopted.filefd = descriptor;
    if (descriptor < 0 || lws_adopt_descriptor_vhost(lws_get_vhost_by_name(context_, "default"),
                                                     LWS_ADOPT_RAW_FILE_DESC, adopted, protocol, nullptr) == nullptr) {
        if (descriptor >= 0) {
            (void)::close(descriptor);
        }
        lws_context_destroy(context_);
        throw std::runtime_error(std::string("--view: there is no ") + protocol + "; are there descriptors left?");
    }
}

void WebServer::Impl::run() {
    while (!ended_ && lws_service(context_, 0) >= 0) {
    }
}

void WebServer::Impl::stop() noexcept {
    stop_.store(true, std::memory_order_relaxed);  // wake() is a system call that orders it
    wake();
}

int WebServer::Impl::on(lws* wsi, lws_callback_reasons reason, const void* in, std::size_t length) {
    const auto text = [&] { return std::string_view(static_cast<const char*>(in), length); };
    switch (reason) {
        case LWS_CALLBACK_RAW_RX_FILE:
            return take_from(wsi);
        case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
            return check_upgrade(wsi);
        case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
            return speaks(wsi, kSubprotocol) ? 0 : 1;
        case LWS_CALLBACK_HTTP:
            return pages_.begin(wsi, handler_.resource(text()));
        case LWS_CALLBACK_HTTP_WRITEABLE:
            return pages_.go_on(wsi);
        case LWS_CALLBACK_ESTABLISHED:
            join(wsi);
            return 0;
        case LWS_CALLBACK_RECEIVE:
            return hear(wsi, text());
        case LWS_CALLBACK_SERVER_WRITEABLE:
            return write(wsi);
        case LWS_CALLBACK_CLOSED:
        case LWS_CALLBACK_CLOSED_HTTP:
        case LWS_CALLBACK_WSI_DESTROY:
            forget(wsi);
            return 0;
        case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
            if (speaks(wsi, kPages)) {  // of each protocol it is told once
                tick();
            }
            return 0;
        default:
            return lws_callback_http_dummy(wsi, reason, nullptr, const_cast<void*>(in), length);
    }
}

/// Of the listening socket and the timer, both of which have to go on whatever happens.
int WebServer::Impl::take_from(lws* wsi) {
    try {
        if (speaks(wsi, kListener)) {
            accept_all(lws_get_socket_fd(wsi));
        } else {
            std::uint64_t times = 0;
            (void)::read(timer_, &times, sizeof(times));
            tick();
        }
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): memory ran out: perhaps there is some next time
    }
    return 0;
}

void WebServer::Impl::accept_all(int listener) {
    while (true) {
        const int socket = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (socket >= 0) {
            admit(socket);
        } else if (errno == EMFILE || errno == ENFILE) {
            spare_.close();
            const int refused = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
            if (refused >= 0) {
                (void)::close(refused);
            }
            spare_.open();
            return;
        } else if (errno != EINTR && errno != ECONNABORTED) {
            return;
        }
    }
}

void WebServer::Impl::admit(int socket) {
    if (sockets_.size() >= kMostSockets) {
        (void)::close(socket);
        return;
    }
    const int yes = 1;
    (void)setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
    (void)setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof(kSendBuffer));
    (void)setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kUnsentAtMost, sizeof(kUnsentAtMost));
    if (const lws* wsi = lws_adopt_socket(context_, socket); wsi != nullptr) {
        sockets_.insert(wsi);
    }
}

/// 0: go on; 1: answered.
int WebServer::Impl::check_upgrade(lws* wsi) {
    if (pages_.refuse_stranger(wsi)) {
        return 1;
    }
    // The library would also speak HTTP/2, which nothing here needs.
    if (request_header(wsi, WSI_TOKEN_GET_URI) != kStreamPath || request_header(wsi, WSI_TOKEN_PROTOCOL).empty() ||
        strcasecmp(request_header(wsi, WSI_TOKEN_UPGRADE).c_str(), "websocket") != 0) {
        return refuse_request(wsi, HTTP_STATUS_NOT_FOUND,
                              "The stream is a WebSocket, /stream, subprotocol haptic-view-1.");
    }
    if (connections_.size() >= kMostViewers || stopping()) {
        return refuse_request(wsi, HTTP_STATUS_SERVICE_UNAVAILABLE, "There are as many viewers as there can be.");
    }
    return 0;
}

void WebServer::Impl::join(lws* wsi) {
    Connection& connection = connections_[wsi];
    connection.conversation = handler_.join();
    invite(wsi, connection);
    keep_time();
}

int WebServer::Impl::hear(lws* wsi, std::string_view fragment) {
    const auto found = connections_.find(wsi);
    if (found == connections_.end() || found->second.closing) {
        return 0;  // it has said enough
    }
    Connection& connection = found->second;
    if (lws_frame_is_binary(wsi) != 0) {
        return close_later(wsi, connection, {kUnsupportedData, "only text is understood"});
    }
    // What a frame announces counts as much as what has come of it.
    if (connection.heard.size() + fragment.size() + lws_remaining_packet_payload(wsi) > kLongestRequest) {
        return close_later(wsi, connection,
                           {kPolicyViolation, "longer than " + std::to_string(kLongestRequest) + " bytes"});
    }
    connection.heard += fragment;
    if (lws_is_final_fragment(wsi) == 0) {
        return 0;
    }
    const std::string text = std::exchange(connection.heard, {});
    if (const std::optional<Closing> closing = connection.conversation->hear(text)) {
        return close_later(wsi, connection, *closing);
    }
    invite(wsi, connection);
    return 0;
}

int WebServer::Impl::write(lws* wsi) {
    const auto found = connections_.find(wsi);
    if (found == connections_.end()) {
        return 0;
    }
    Connection& connection = found->second;
    connection.asked_ns = 0;
    if (connection.closing) {
        return close(wsi, Closing(*connection.closing));
    }
    if (connection.sent < connection.outgoing.size()) {
        return write_chunk(wsi, connection);
    }
    Outgoing message;
    if (connection.conversation->next_message(message)) {
        connection.text = message.text;
        connection.outgoing.resize(LWS_PRE + message.bytes.size());
        std::transform(message.bytes.begin(), message.bytes.end(), connection.outgoing.begin() + LWS_PRE,
                       [](std::byte byte) { return std::to_integer<unsigned char>(byte); });
        connection.sent = LWS_PRE;
        return write_chunk(wsi, connection);
    }
    return connection.conversation->has_ended() ? close(wsi, {kGoingAway, "host-sim ends"}) : 0;
}

/// A message goes in pieces, so that one who takes it slowly is told from one who takes nothing. The library writes a
/// piece's header in front of it, over what has gone already.
int WebServer::Impl::write_chunk(lws* wsi, Connection& connection) {
    const std::size_t length = std::min(connection.outgoing.size() - connection.sent, kChunk);
    const bool first = connection.sent == LWS_PRE;
    const bool last = connection.sent + length == connection.outgoing.size();
    const int flags = lws_write_ws_flags(connection.text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY, first, last);
    if (lws_write(wsi, connection.outgoing.data() + connection.sent, length, static_cast<lws_write_protocol>(flags)) <
        static_cast<int>(length)) {
        return -1;
    }
    connection.sent += length;
    invite(wsi, connection);
    return 0;
}

/// Nothing may follow a close frame, and nothing that is said after it counts.
int WebServer::Impl::close(lws* wsi, const Closing& closing) {
    std::string why = closing.why;
    lws_close_reason(wsi, static_cast<lws_close_status>(closing.code), reinterpret_cast<unsigned char*>(why.data()),
                     why.size());
    connections_.erase(wsi);
    closing_.insert(wsi);
    return -1;
}

/// The library sends no close frame while a piece of a message is still on its way.
int WebServer::Impl::close_later(lws* wsi, Connection& connection, const Closing& closing) {
    connection.closing = closing;
    invite(wsi, connection);
    return 0;
}

void WebServer::Impl::invite(lws* wsi, Connection& connection) {
    if (connection.asked_ns == 0) {
        connection.asked_ns = monotonic_now_ns();
        (void)lws_callback_on_writable(wsi);
    }
}

void WebServer::Impl::invite_all() {
    for (auto& [wsi, connection] : connections_) {
        invite(wsi, connection);
    }
}

void WebServer::Impl::forget(lws* wsi) {
    pages_.forget(wsi);
    connections_.erase(wsi);
    closing_.erase(wsi);
    sockets_.erase(wsi);
}

void WebServer::Impl::tick() {
    const std::int64_t now_ns = monotonic_now_ns();
    if (stopping() && end_ns_ == 0) {
        end_ns_ = now_ns + kFarewellNs;
        invite_all();
    }
    handler_.tick();
    close_stuck(now_ns);
    ended_ = stopping() && ((connections_.empty() && closing_.empty()) || now_ns >= end_ns_);
    keep_time();
}

void WebServer::Impl::close_stuck(std::int64_t now_ns) {
    for (auto& [wsi, connection] : connections_) {
        if (connection.asked_ns != 0 && now_ns - connection.asked_ns > stuck_after_ns_) {
            lws_set_timeout(wsi, PENDING_TIMEOUT_KILLED_BY_PARENT, LWS_TO_KILL_ASYNC);
        }
    }
}

/// Ticks while there is somebody to tick for.
void WebServer::Impl::keep_time() {
    const bool needed = !connections_.empty() || !closing_.empty();
    if (needed == ticking_) {
        return;
    }
    ticking_ = needed;
    const timespec period{0, needed ? kTickNs : 0};
    const itimerspec timer{period, period};
    (void)timerfd_settime(timer_, 0, &timer, nullptr);
}

WebServer::WebServer(const std::string& address, std::uint16_t port, WebHandler& handler, std::int64_t stuck_after_ns)
    : impl_(std::make_unique<Impl>(address, port, handler, stuck_after_ns)) {}
WebServer::~WebServer() = default;

std::uint16_t WebServer::port() const noexcept {
    return impl_->port();
}
void WebServer::run() {
    impl_->run();
}
void WebServer::wake() noexcept {
    impl_->wake();
}
void WebServer::stop() noexcept {
    impl_->stop();
}
bool WebServer::stopping() const noexcept {
    return impl_->stopping();
}
std::size_t WebServer::viewers() const noexcept {
    return impl_->viewers();
}
void WebServer::invite_all() {
    impl_->invite_all();
}

}  // namespace haptic::sim::view
