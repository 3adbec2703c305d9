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
#include <charconv>
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

constexpr std::size_t kMaxSockets = kMaxViewers + 32;  // the additional ones are for page requests
// Limits on what the kernel buffers per viewer: a longer queue would only delay what the viewer sees.
constexpr int kSendBuffer = 262144;
constexpr int kMaxUnsent = 131072;
// Time for viewers to take the last message after stop().
constexpr std::int64_t kShutdownNs = 250'000'000;

// Names of the library's "protocols" besides the stream: HTTP pages, the listening socket and the timer.
constexpr const char* kPages = "pages";
constexpr const char* kListener = "listener";
constexpr const char* kTimer = "timer";

/// Headers of every response.
const lws_protocol_vhost_options* security_headers() {
    static const lws_protocol_vhost_options sniff{nullptr, nullptr, "x-content-type-options:", "nosniff"};
    static const lws_protocol_vhost_options frame{&sniff, nullptr, "x-frame-options:", "DENY"};
    static const lws_protocol_vhost_options referrer{&frame, nullptr, "referrer-policy:", "no-referrer"};
    static const lws_protocol_vhost_options cache{&referrer, nullptr, "cache-control:", "no-cache"};
    return &cache;
}

bool has_protocol(lws* wsi, const char* protocol) {
    return std::strcmp(lws_get_protocol(wsi)->name, protocol) == 0;
}

/// Restores the process's SIGPIPE action, which the library changes when it is initialised.
class SigpipeGuard {
  public:
    SigpipeGuard() { (void)sigaction(SIGPIPE, nullptr, &before_); }
    SigpipeGuard(const SigpipeGuard&) = delete;
    SigpipeGuard& operator=(const SigpipeGuard&) = delete;
    ~SigpipeGuard() { (void)sigaction(SIGPIPE, &before_, nullptr); }

  private:
    struct sigaction before_{};
};

/// Spare file descriptor. When none is left, a pending connection could not even be refused and accept() would report
/// it for ever; closing the spare one makes room to accept and close it.
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

/// The socket of one viewer.
struct ViewerSocket {
    std::unique_ptr<Connection> connection;
    std::string received;                 // fragments of the current message
    std::vector<unsigned char> outgoing;  // LWS_PRE bytes for the library, then the message
    std::size_t sent = 0;                 // bytes of `outgoing`, including LWS_PRE
    bool text = false;
    std::int64_t waiting_since_ns = 0;  // since when a write has been pending; 0: none is
    std::optional<Closing> closing;     // set: close after the message in progress
};

/// The content that a client posts, until it is answered.
struct Upload {
    lws* wsi = nullptr;  // null: the client has left
    std::string path;
    std::size_t length = 0;  // bytes announced
    std::vector<std::byte> content;
    bool taken = false;  // by the handler
    std::optional<UploadAnswer> answer;
};

/// The number of a Content-Length header; none for any other text.
std::optional<std::size_t> length_of(const std::string& header) {
    std::size_t length = 0;
    const auto [end, error] = std::from_chars(header.data(), header.data() + header.size(), length);
    return error == std::errc() && end == header.data() + header.size() ? std::optional(length) : std::nullopt;
}

}  // namespace

class WebServer::Impl {
  public:
    Impl(const std::string& address, std::uint16_t port, WebHandler& handler, std::int64_t stuck_after_ns);
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl();

    // The public interface; see WebServer.
    [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
    void run();
    void wake() noexcept { lws_cancel_service(context_); }
    void stop() noexcept;
    [[nodiscard]] bool stopping() const noexcept { return stop_.load(std::memory_order_relaxed); }
    [[nodiscard]] std::size_t viewers() const noexcept { return viewers_.size(); }
    void request_writes();

  private:
    /// Callback of the C library: exceptions must not pass through it.
    static int on_event(lws* wsi, lws_callback_reasons reason, void* user, void* in, std::size_t length);
    static const std::array<lws_protocols, 5>& protocols();
    int on(lws* wsi, lws_callback_reasons reason, const void* in, std::size_t length);

    // Listening socket and timer.
    void adopt(int descriptor, const char* protocol);
    int on_descriptor_readable(lws* wsi);
    void accept_all(int listener);
    void add_socket(int socket);
    // One upload: from its request to the answer.
    int start_upload(lws* wsi, std::string_view path);
    int receive_upload(lws* wsi, const void* in, std::size_t length);
    int finish_upload(lws* wsi);
    void collect_answer();
    int write_page(lws* wsi);
    // One viewer: from the upgrade of its request to the close frame.
    int check_upgrade(lws* wsi);
    void join(lws* wsi);
    int on_message(lws* wsi, std::string_view fragment);
    int write(lws* wsi);
    int write_chunk(lws* wsi, ViewerSocket& viewer);
    int close(lws* wsi, const Closing& closing);
    int close_later(lws* wsi, ViewerSocket& viewer, const Closing& closing);
    void request_write(lws* wsi, ViewerSocket& viewer);
    void forget(lws* wsi);
    // All viewers.
    void tick();
    void close_stuck(std::int64_t now_ns);
    void update_timer();

    WebHandler& handler_;
    std::int64_t stuck_after_ns_ = 0;
    std::uint16_t port_ = 0;
    PageReplies pages_;
    SpareDescriptor spare_;
    std::optional<Upload> upload_;
    std::set<const lws*> sockets_;  // accepted and not yet closed
    std::map<lws*, ViewerSocket> viewers_;
    std::set<lws*> closing_;  // former viewers whose close frame is being sent
    std::atomic<bool> stop_{false};
    std::int64_t end_ns_ = 0;  // after stop(): when run() returns at the latest
    bool ended_ = false;
    bool timer_armed_ = false;
    int timer_ = -1;  // owned by the library once adopted
    lws_context* context_ = nullptr;
};

const std::array<lws_protocols, 5>& WebServer::Impl::protocols() {
    static const std::array<lws_protocols, 5> list = {{{kPages, on_event, 0, 0, 0, nullptr, 0},
                                                       {kSubprotocol, on_event, 0, kMaxRequestBytes, 0, nullptr, 0},
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
        // Close only this connection: memory ran out, or its handler failed.
        return -1;
    }
}

WebServer::Impl::Impl(const std::string& address, std::uint16_t port, WebHandler& handler, std::int64_t stuck_after_ns)
    : handler_(handler), stuck_after_ns_(stuck_after_ns) {
    // Open the listening socket first: its errors are the user's to correct.
    const int listener = listen_on(address, port);
    port_ = port_of(listener);
    const SigpipeGuard keep;
    lws_set_log_level(0, nullptr);
    // The library opens no socket of its own and does not change user or group; it checks text messages for UTF-8.
    lws_context_creation_info info{};
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.protocols = protocols().data();
    info.headers = security_headers();
    info.options = LWS_SERVER_OPTION_VALIDATE_UTF8;
    info.server_string = "host-sim";
    info.gid = static_cast<decltype(info.gid)>(-1);
    info.uid = static_cast<decltype(info.uid)>(-1);
    info.fd_limit_per_thread = static_cast<unsigned>(kMaxSockets) + 16;
    info.timeout_secs = kRequestTimeoutS;
    info.user = this;
    // The constructor owns the listener until the library has adopted it.
    context_ = lws_create_context(&info);
    if (context_ == nullptr) {
        (void)::close(listener);
        throw std::runtime_error("--view: cannot initialise libwebsockets; check free memory and file descriptors");
    }
    adopt(listener, kListener);
    // The library's own timers round down to milliseconds and busy-wait for the remainder, so use a timerfd.
    timer_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    adopt(timer_, kTimer);
}

WebServer::Impl::~Impl() {
    lws_context_destroy(context_);
}

/// Hands a descriptor over to the library, which owns it from here on. Destroys the context and throws on failure.
void WebServer::Impl::adopt(int descriptor, const char* protocol) {
    lws_sock_file_fd_type adopted{};
    adopted.filefd = descriptor;
    if (descriptor < 0 || lws_adopt_descriptor_vhost(lws_get_vhost_by_name(context_, "default"),
                                                     LWS_ADOPT_RAW_FILE_DESC, adopted, protocol, nullptr) == nullptr) {
        if (descriptor >= 0) {
            (void)::close(descriptor);
        }
        lws_context_destroy(context_);
        throw std::runtime_error(std::string("--view: cannot set up the ") + protocol +
                                 "; check free file descriptors");
    }
}

void WebServer::Impl::run() {
    while (!ended_ && lws_service(context_, 0) >= 0) {
    }
}

void WebServer::Impl::stop() noexcept {
    stop_.store(true, std::memory_order_relaxed);  // relaxed: the system call in wake() orders it
    wake();
}

int WebServer::Impl::on(lws* wsi, lws_callback_reasons reason, const void* in, std::size_t length) {
    const auto text = [&] { return std::string_view(static_cast<const char*>(in), length); };
    switch (reason) {
        case LWS_CALLBACK_RAW_RX_FILE:
            return on_descriptor_readable(wsi);
        // Decide on a new WebSocket, first by request, then by subprotocol.
        case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
            return check_upgrade(wsi);
        case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
            return has_protocol(wsi, kSubprotocol) ? 0 : 1;
        // Ordinary HTTP.
        case LWS_CALLBACK_HTTP:
            return lws_hdr_total_length(wsi, WSI_TOKEN_POST_URI) > 0 ? start_upload(wsi, text())
                                                                     : pages_.start(wsi, handler_.resource(text()));
        case LWS_CALLBACK_HTTP_BODY:
            return receive_upload(wsi, in, length);
        case LWS_CALLBACK_HTTP_BODY_COMPLETION:
            return finish_upload(wsi);
        case LWS_CALLBACK_HTTP_WRITEABLE:
            return write_page(wsi);
        // An open WebSocket.
        case LWS_CALLBACK_ESTABLISHED:
            join(wsi);
            return 0;
        case LWS_CALLBACK_RECEIVE:
            return on_message(wsi, text());
        case LWS_CALLBACK_SERVER_WRITEABLE:
            return write(wsi);
        // Any end, of either kind; several of these may come for one socket.
        case LWS_CALLBACK_CLOSED:
        case LWS_CALLBACK_CLOSED_HTTP:
        case LWS_CALLBACK_WSI_DESTROY:
            forget(wsi);
            return 0;
        case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
            // Reported once per protocol; handle it once.
            if (has_protocol(wsi, kPages)) {
                tick();
            }
            return 0;
        default:
            return lws_callback_http_dummy(wsi, reason, nullptr, const_cast<void*>(in), length);
    }
}

/// The listening socket or the timer is readable. Always returns 0: both must continue whatever happens.
int WebServer::Impl::on_descriptor_readable(lws* wsi) {
    try {
        if (has_protocol(wsi, kListener)) {
            accept_all(lws_get_socket_fd(wsi));
        } else {
            std::uint64_t times = 0;
            (void)::read(timer_, &times, sizeof(times));
            tick();
        }
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): out of memory; retry at the next event
    }
    return 0;
}

void WebServer::Impl::accept_all(int listener) {
    while (true) {
        const int socket = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (socket >= 0) {
            add_socket(socket);
        } else if (errno == EMFILE || errno == ENFILE) {
            // Out of descriptors: use the spare one to refuse the connection.
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

void WebServer::Impl::add_socket(int socket) {
    if (sockets_.size() >= kMaxSockets) {
        (void)::close(socket);
        return;
    }
    // Send at once, and bound what the kernel queues.
    const int yes = 1;
    (void)setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
    (void)setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof(kSendBuffer));
    (void)setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kMaxUnsent, sizeof(kMaxUnsent));
    if (const lws* wsi = lws_adopt_socket(context_, socket); wsi != nullptr) {
        sockets_.insert(wsi);
    }
}

/// Decides on a POST before its content is received.
int WebServer::Impl::start_upload(lws* wsi, std::string_view path) {
    if (pages_.reject_foreign(wsi)) {
        return -1;
    }
    const std::optional<std::size_t> length = length_of(request_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH));
    std::optional<UploadAnswer> refusal = handler_.refuse_upload(path);
    if (!refusal && !length) {
        refusal = {HTTP_STATUS_LENGTH_REQUIRED, "The length of the content must be given."};
    }
    if (!refusal && *length > kMaxUploadBytes) {
        refusal = {HTTP_STATUS_REQ_ENTITY_TOO_LARGE,
                   "More than the " + std::to_string(kMaxUploadBytes >> 20U) + " MiB allowed."};
    }
    if (!refusal && (upload_ || stopping())) {
        refusal = {HTTP_STATUS_SERVICE_UNAVAILABLE, "Another file is being read; try again when it is."};
    }
    if (refusal) {
        (void)refuse_request(wsi, refusal->status, refusal->text.c_str());
        return -1;
    }
    upload_ = {.wsi = wsi, .path = std::string(path), .length = *length, .content = {}, .taken = false, .answer = {}};
    upload_->content.reserve(*length);
    return 0;
}

int WebServer::Impl::receive_upload(lws* wsi, const void* in, std::size_t length) {
    if (!upload_ || upload_->wsi != wsi || upload_->taken || upload_->content.size() + length > upload_->length) {
        return -1;
    }
    const auto* const bytes = static_cast<const std::byte*>(in);
    upload_->content.insert(upload_->content.end(), bytes, bytes + length);
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, kRequestTimeoutS);  // progress restarts the timeout
    return 0;
}

int WebServer::Impl::finish_upload(lws* wsi) {
    if (!upload_ || upload_->wsi != wsi || upload_->taken) {
        return -1;
    }
    upload_->taken = true;
    handler_.take_upload(upload_->path, std::move(upload_->content));
    lws_set_timeout(wsi, NO_PENDING_TIMEOUT, 0);  // the answer takes its time
    return 0;
}

void WebServer::Impl::collect_answer() {
    if (!upload_ || !upload_->taken || upload_->answer) {
        return;
    }
    upload_->answer = handler_.upload_answer();
    if (!upload_->answer) {
        return;
    }
    if (upload_->wsi == nullptr) {
        upload_.reset();
        return;
    }
    (void)lws_callback_on_writable(upload_->wsi);
}

int WebServer::Impl::write_page(lws* wsi) {
    if (!upload_ || upload_->wsi != wsi || !upload_->answer) {
        return pages_.resume(wsi);
    }
    const UploadAnswer answer = std::move(*upload_->answer);
    upload_.reset();
    lws_set_timeout(wsi, PENDING_TIMEOUT_HTTP_CONTENT, kRequestTimeoutS);
    return pages_.answer(wsi, answer.status, answer.text);
}

/// Decides on a WebSocket upgrade. Returns 0 to accept it, 1 if the request has been answered.
int WebServer::Impl::check_upgrade(lws* wsi) {
    if (pages_.reject_foreign(wsi)) {
        return 1;
    }
    // Only WebSocket upgrades of the stream: the library would also accept HTTP/2.
    if (request_header(wsi, WSI_TOKEN_GET_URI) != kStreamPath || request_header(wsi, WSI_TOKEN_PROTOCOL).empty() ||
        strcasecmp(request_header(wsi, WSI_TOKEN_UPGRADE).c_str(), "websocket") != 0) {
        return refuse_request(wsi, HTTP_STATUS_NOT_FOUND,
                              "The stream is the WebSocket /stream, subprotocol haptic-view-1.");
    }
    if (viewers_.size() >= kMaxViewers || stopping()) {
        return refuse_request(wsi, HTTP_STATUS_SERVICE_UNAVAILABLE, "The maximum number of viewers is connected.");
    }
    return 0;
}

void WebServer::Impl::join(lws* wsi) {
    ViewerSocket& viewer = viewers_[wsi];
    viewer.connection = handler_.connect();
    request_write(wsi, viewer);
    update_timer();
}

int WebServer::Impl::on_message(lws* wsi, std::string_view fragment) {
    const auto found = viewers_.find(wsi);
    if (found == viewers_.end() || found->second.closing) {
        return 0;  // ignore messages after the decision to close
    }
    ViewerSocket& viewer = found->second;
    if (lws_frame_is_binary(wsi) != 0) {
        return close_later(wsi, viewer, {kUnsupportedData, "only text messages are accepted"});
    }
    // Include the announced but not yet received part of the frame in the limit.
    if (viewer.received.size() + fragment.size() + lws_remaining_packet_payload(wsi) > kMaxRequestBytes) {
        return close_later(wsi, viewer,
                           {kPolicyViolation, "longer than " + std::to_string(kMaxRequestBytes) + " bytes"});
    }
    viewer.received += fragment;
    if (lws_is_final_fragment(wsi) == 0) {
        return 0;
    }
    // The message is complete: handle it.
    const std::string text = std::exchange(viewer.received, {});
    if (const std::optional<Closing> closing = viewer.connection->on_message(text)) {
        return close_later(wsi, viewer, *closing);
    }
    request_write(wsi, viewer);
    return 0;
}

int WebServer::Impl::write(lws* wsi) {
    const auto found = viewers_.find(wsi);
    if (found == viewers_.end()) {
        return 0;
    }
    ViewerSocket& viewer = found->second;
    // The socket is writable: it is not stuck.
    viewer.waiting_since_ns = 0;
    if (viewer.closing) {
        return close(wsi, Closing(*viewer.closing));
    }
    // Continue the message in progress before starting the next one.
    if (viewer.sent < viewer.outgoing.size()) {
        return write_chunk(wsi, viewer);
    }
    Outgoing message;
    if (viewer.connection->next_message(message)) {
        // Copy the message behind the space that the library needs for its header.
        viewer.text = message.text;
        viewer.outgoing.resize(LWS_PRE + message.bytes.size());
        std::transform(message.bytes.begin(), message.bytes.end(), viewer.outgoing.begin() + LWS_PRE,
                       [](std::byte byte) { return std::to_integer<unsigned char>(byte); });
        viewer.sent = LWS_PRE;
        return write_chunk(wsi, viewer);
    }
    return viewer.connection->has_ended() ? close(wsi, {kGoingAway, "host-sim is ending"}) : 0;
}

/// Writes the next chunk of a message. Chunks distinguish a slow socket from a stuck one. The library writes each
/// chunk's header in front of it, over bytes already sent.
int WebServer::Impl::write_chunk(lws* wsi, ViewerSocket& viewer) {
    const std::size_t length = std::min(viewer.outgoing.size() - viewer.sent, kBytesPerWrite);
    const bool first = viewer.sent == LWS_PRE;
    const bool last = viewer.sent + length == viewer.outgoing.size();
    const int flags = lws_write_ws_flags(viewer.text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY, first, last);
    if (lws_write(wsi, viewer.outgoing.data() + viewer.sent, length, static_cast<lws_write_protocol>(flags)) <
        static_cast<int>(length)) {
        return -1;
    }
    viewer.sent += length;
    request_write(wsi, viewer);
    return 0;
}

/// Sends a close frame and forgets the viewer: nothing may follow the frame, and later messages are ignored.
int WebServer::Impl::close(lws* wsi, const Closing& closing) {
    std::string why = closing.why;
    lws_close_reason(wsi, static_cast<lws_close_status>(closing.code), reinterpret_cast<unsigned char*>(why.data()),
                     why.size());
    viewers_.erase(wsi);
    closing_.insert(wsi);
    return -1;
}

/// Defers the close frame: the library does not send one while a message is in progress.
int WebServer::Impl::close_later(lws* wsi, ViewerSocket& viewer, const Closing& closing) {
    viewer.closing = closing;
    request_write(wsi, viewer);
    return 0;
}

void WebServer::Impl::request_write(lws* wsi, ViewerSocket& viewer) {
    if (viewer.waiting_since_ns == 0) {
        viewer.waiting_since_ns = monotonic_now_ns();
        (void)lws_callback_on_writable(wsi);
    }
}

void WebServer::Impl::request_writes() {
    for (auto& [wsi, viewer] : viewers_) {
        request_write(wsi, viewer);
    }
}

void WebServer::Impl::forget(lws* wsi) {
    pages_.forget(wsi);
    // What the handler has taken is still to be answered, if to nobody.
    if (upload_ && upload_->wsi == wsi) {
        upload_->wsi = nullptr;
        if (!upload_->taken) {
            upload_.reset();
        }
    }
    viewers_.erase(wsi);
    closing_.erase(wsi);
    sockets_.erase(wsi);
}

void WebServer::Impl::tick() {
    const std::int64_t now_ns = monotonic_now_ns();
    // The first tick after stop() starts the shutdown period.
    if (stopping() && end_ns_ == 0) {
        end_ns_ = now_ns + kShutdownNs;
        request_writes();
    }
    // Let the handler produce messages, then drop stuck viewers.
    handler_.tick();
    collect_answer();
    close_stuck(now_ns);
    // End when all viewers have gone or the shutdown period is over.
    ended_ = stopping() && ((viewers_.empty() && closing_.empty()) || now_ns >= end_ns_);
    update_timer();
}

void WebServer::Impl::close_stuck(std::int64_t now_ns) {
    for (auto& [wsi, viewer] : viewers_) {
        if (viewer.waiting_since_ns != 0 && now_ns - viewer.waiting_since_ns > stuck_after_ns_) {
            lws_set_timeout(wsi, PENDING_TIMEOUT_KILLED_BY_PARENT, LWS_TO_KILL_ASYNC);
        }
    }
}

/// Arms the timer while a viewer is connected or closing.
void WebServer::Impl::update_timer() {
    const bool needed = !viewers_.empty() || !closing_.empty();
    if (needed == timer_armed_) {
        return;
    }
    timer_armed_ = needed;
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
void WebServer::request_writes() {
    impl_->request_writes();
}

}  // namespace haptic::sim::view
