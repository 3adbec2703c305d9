#include "view/live_view.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cinttypes>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string_view>
#include <thread>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/contact_problem.hpp"
#include "scene/state_hash.hpp"
#include "view/bounded_queue.hpp"
#include "view/device_telemetry.hpp"
#include "view/encoding.hpp"
#include "view/mesh_upload.hpp"
#include "view/page_files.hpp"
#include "view/triple_buffer.hpp"
#include "view/viewer.hpp"
#include "view/web_server.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::int64_t kSnapshotPeriodNs = kNanosecondsPerSecond / 60;
constexpr std::int64_t kDevicePeriodNs = kNanosecondsPerSecond / 5;
constexpr std::size_t kQueuedSamples = 4096;
constexpr std::size_t kQueuedCommands = 256;
constexpr int kNice = 5;  // the simulation has priority

/// A scene and the buffer of its snapshots. Each scene has its own, so that snapshots of different scenes cannot be
/// confused.
struct SceneStream {
    std::uint32_t scene = 0;
    SceneDescription description;
    TripleBuffer<SceneSnapshot> snapshots;
};

void prepare(SceneSnapshot& snapshot, const SceneDescription& description) {
    std::size_t vertices = 0;
    for (const BodyDescription& body : description.bodies) {
        vertices = std::max(vertices, body.first_vertex + body.vertices);
    }
    snapshot.vertices.resize(vertices);
    snapshot.particles.resize(description.semi_axes.size());
    snapshot.orientations.resize(description.semi_axes.size());
    snapshot.tool_vertices.resize(description.tool_vertices);
    snapshot.proxies.resize(description.proxy_radii.size());
    snapshot.planes.reserve(3 * description.proxy_radii.size());
    snapshot.forces.reserve(kMaxContactRows);
}

/// Number of rows, excluding the header and the comment lines in front of it, which start with #.
std::size_t rows_of_csv(std::string_view csv) {
    std::size_t lines = 0;
    for (std::size_t at = 0; at < csv.size();) {
        lines += csv[at] == '#' ? 0U : 1U;
        const std::size_t end = csv.find('\n', at);
        at = end == std::string_view::npos ? csv.size() : end + 1;
    }
    return lines == 0 ? 0 : lines - 1;
}

/// A name for content: its hash, in hexadecimal.
std::string tag_of(std::span<const std::byte> content) {
    StateHash hash;
    hash.add(content);
    std::array<char, 17> text{};
    (void)std::snprintf(text.data(), text.size(), "%016" PRIx64, hash.value());
    return text.data();
}

/// Gives up the inherited real-time scheduling and names the thread. Signals are left to the main thread.
void leave_real_time() {
    (void)pthread_setname_np(pthread_self(), "haptic-view");
    const sched_param none{};
    (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
    (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
}

/// Blocks all signals during its lifetime. A thread started meanwhile inherits the mask and keeps it.
class BlockedSignals {
  public:
    BlockedSignals() {
        sigset_t all{};
        (void)sigfillset(&all);
        (void)pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    BlockedSignals(const BlockedSignals&) = delete;
    BlockedSignals& operator=(const BlockedSignals&) = delete;
    ~BlockedSignals() { (void)pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

  private:
    sigset_t before_{};
};

class ServedView final : public LiveView, private WebHandler {
  public:
    explicit ServedView(const LiveViewSettings& settings);
    ServedView(const ServedView&) = delete;
    ServedView& operator=(const ServedView&) = delete;
    ~ServedView() override;

    [[nodiscard]] std::string url() const override;
    // Called on the simulation's thread.
    void set_scene(const SceneDescription& scene) override;
    [[nodiscard]] SceneSnapshot* requested_snapshot() noexcept override;
    void publish_snapshot() noexcept override;
    void add_sample(const StepSample& sample) noexcept override;
    void frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept override;
    [[nodiscard]] bool next_command(Command& command) override;
    void offer_record(std::string csv) override;

  private:
    /// One viewer, connected to the view.
    class ViewerSession final : public Connection {
      public:
        explicit ViewerSession(ServedView& view) : view_(view), viewer_(view.settings_.control) {
            view_.sessions_.push_back(this);
        }
        ViewerSession(const ViewerSession&) = delete;
        ViewerSession& operator=(const ViewerSession&) = delete;
        ~ViewerSession() override { view_.remove_session(*this); }

        [[nodiscard]] std::optional<Closing> on_message(std::string_view text) override;
        [[nodiscard]] bool next_message(Outgoing& message) override {
            return viewer_.compose(view_.state_, monotonic_now_ns(), message);
        }
        [[nodiscard]] bool has_ended() const override { return viewer_.bye_sent(); }
        [[nodiscard]] const Viewer& viewer() const noexcept { return viewer_; }

      private:
        ServedView& view_;
        Viewer viewer_;
    };

    // Called on the view's thread.
    [[nodiscard]] std::unique_ptr<Connection> connect() override { return std::make_unique<ViewerSession>(*this); }
    [[nodiscard]] std::optional<Resource> resource(std::string_view path) override;
    [[nodiscard]] std::optional<UploadAnswer> refuse_upload(std::string_view path) override;
    void take_upload(std::string_view path, std::vector<std::byte> content) override;
    [[nodiscard]] std::optional<UploadAnswer> upload_answer() override;
    void tick() override;
    void remove_session(ViewerSession& session);
    bool take_updates();
    void switch_scene(std::shared_ptr<SceneStream> stream);
    bool take_snapshot();
    bool take_samples(std::int64_t now_ns);
    bool poll_device(std::int64_t now_ns);
    void request_snapshot(std::int64_t now_ns);
    template <class Predicate>
    [[nodiscard]] bool any_viewer(Predicate&& holds) const {
        return std::any_of(sessions_.begin(), sessions_.end(),
                           [&](const ViewerSession* session) { return holds(session->viewer()); });
    }

    const LiveViewSettings settings_;

    // Shared between the threads.
    std::atomic<bool> snapshot_requested_{false};  // a viewer is ready for a snapshot
    std::atomic<bool> samples_watched_{false};     // a viewer has subscribed to samples
    BoundedQueue<NumberedSample, kQueuedSamples> samples_;
    BoundedQueue<Command, kQueuedCommands> commands_;
    std::atomic<bool> update_pending_{false};  // new_stream_ or new_record_ is set
    std::mutex mutex_;
    std::shared_ptr<SceneStream> new_stream_;
    std::shared_ptr<const std::string> new_record_;

    std::unique_ptr<DeviceTelemetry> device_;  // null: there is no session

    // Owned by the simulation's thread.
    std::shared_ptr<SceneStream> stream_;
    std::uint64_t samples_so_far_ = 0;

    // Owned by the view's thread.
    std::vector<ViewerSession*> sessions_;
    const ViewerSession* hand_owner_ = nullptr;  // moved the hand last and has not released it
    std::shared_ptr<SceneStream> shown_stream_;
    std::unique_ptr<SnapshotEncoder> encoder_;
    std::shared_ptr<const std::string> record_;
    ViewState state_;
    std::optional<DeviceInScene> device_in_scene_;  // of the newest snapshot
    std::int64_t next_request_ns_ = 0;
    std::int64_t next_device_ns_ = 0;
    std::int64_t next_samples_ns_ = 0;

    WebServer server_;
    MeshUpload upload_;  // wakes the server when it has read a mesh
    std::thread thread_;
};

ServedView::ServedView(const LiveViewSettings& settings)
    : settings_(settings),
      device_(settings.session.empty() ? nullptr : std::make_unique<DeviceTelemetry>(settings.session)),
      server_(settings.address, settings.port, *this),
      upload_([this] { server_.wake(); }) {
    const BlockedSignals blocked;
    thread_ = std::thread([this] {
        leave_real_time();
        server_.run();
    });
}

ServedView::~ServedView() {
    server_.stop();
    thread_.join();
}

std::string ServedView::url() const {
    std::string host = settings_.address;
    if (host == "0.0.0.0" || host == "::") {  // all addresses: name the machine instead
        std::array<char, 256> name{};
        host = gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
    } else if (host.find(':') != std::string::npos) {
        host = "[" + host + "]";
    }
    return "http://" + host + ":" + std::to_string(server_.port()) + "/";
}

void ServedView::set_scene(const SceneDescription& scene) {
    // Size all three buffers now, so that the simulation does not allocate later.
    auto stream = std::make_shared<SceneStream>();
    stream->scene = stream_ ? stream_->scene + 1 : 1;
    stream->description = scene;
    stream->snapshots.prepare([&](SceneSnapshot& snapshot) { prepare(snapshot, scene); });
    {
        const std::lock_guard lock(mutex_);
        new_stream_ = stream;
    }
    stream_ = std::move(stream);
    // Release: the view's thread that sees the flag also sees the stream.
    update_pending_.store(true, std::memory_order_release);
    server_.wake();
}

SceneSnapshot* ServedView::requested_snapshot() noexcept {
    // Relaxed: the buffer is this thread's in any case.
    return snapshot_requested_.load(std::memory_order_relaxed) && stream_ ? &stream_->snapshots.back() : nullptr;
}

void ServedView::publish_snapshot() noexcept {
    // Clear the request before publishing: a request for the next snapshot comes after this.
    snapshot_requested_.store(false, std::memory_order_relaxed);
    stream_->snapshots.publish();
    server_.wake();
}

void ServedView::add_sample(const StepSample& sample) noexcept {
    const std::uint64_t number = samples_so_far_++;
    if (samples_watched_.load(std::memory_order_relaxed)) {
        // If the queue is full, the gap in the numbers shows what was dropped.
        (void)samples_.push({stream_ ? stream_->scene : 0, number, sample});
    }
}

void ServedView::frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept {
    if (device_) {
        device_->frame_published(sequence, time_ns);
    }
}

bool ServedView::next_command(Command& command) {
    return commands_.pop(command);
}

void ServedView::offer_record(std::string csv) {
    auto record = std::make_shared<const std::string>(std::move(csv));
    {
        const std::lock_guard lock(mutex_);
        new_record_ = std::move(record);
    }
    update_pending_.store(true, std::memory_order_release);
    server_.wake();
}

std::optional<Closing> ServedView::ViewerSession::on_message(std::string_view text) {
    static const SceneDescription no_scene;
    const SceneDescription& scene = view_.shown_stream_ ? view_.shown_stream_->description : no_scene;
    Viewer::Outcome outcome = viewer_.on_message(text, scene, monotonic_now_ns());
    if (auto* closing = std::get_if<Closing>(&outcome)) {
        return std::move(*closing);
    }
    if (auto* command = std::get_if<Command>(&outcome)) {
        // Queue the command for the simulation, and note who holds the hand.
        const std::string type = type_of(*command);
        const bool moves = std::holds_alternative<MoveHand>(*command);
        const bool releases =
            std::holds_alternative<ReleaseHand>(*command) || std::holds_alternative<FollowScript>(*command);
        if (!view_.commands_.push(std::move(*command))) {
            viewer_.refuse({type, "host-sim is busy with earlier requests"});
        } else if (moves) {
            view_.hand_owner_ = this;
        } else if (releases) {
            view_.hand_owner_ = nullptr;
        }
    }
    return std::nullopt;
}

void ServedView::remove_session(ViewerSession& session) {
    std::erase(sessions_, &session);
    // A viewer that leaves releases the hand.
    if (hand_owner_ == &session) {
        hand_owner_ = nullptr;
        (void)commands_.push(ReleaseHand{});
    }
}

std::optional<Resource> ServedView::resource(std::string_view path) {
    if (path == "/record.csv" && record_) {
        return Resource{.type = "text/csv; charset=utf-8",
                        .content = std::as_bytes(std::span(*record_)),
                        .owner = record_,
                        .download_as = "record.csv"};
    }
    for (const PageFile& file : page_files()) {
        if (file.path == path) {
            return Resource{.type = std::string(file.type),
                            .content = file.content,
                            .owner = nullptr,
                            .download_as = {},
                            .gzip = file.gzip,
                            .tag = tag_of(file.content)};
        }
    }
    // Browsers request it on their own and report an error if it is missing.
    if (path == "/favicon.ico") {
        return Resource{};
    }
    return std::nullopt;
}

std::optional<UploadAnswer> ServedView::refuse_upload(std::string_view path) {
    if (std::optional<UploadAnswer> refusal = MeshUpload::refusal_of(path)) {
        return refusal;
    }
    if (!settings_.control) {
        return UploadAnswer{403, "View only: start host-sim with --view-control to open a mesh from this page."};
    }
    if (!shown_stream_ || shown_stream_->description.length > 0.0) {
        return UploadAnswer{409, "A recording is shown: run a scene to open a mesh."};
    }
    return std::nullopt;
}

void ServedView::take_upload(std::string_view path, std::vector<std::byte> content) {
    upload_.start(path, std::move(content));
}

std::optional<UploadAnswer> ServedView::upload_answer() {
    std::optional<MeshUpload::Outcome> outcome = upload_.take_outcome();
    if (!outcome) {
        return std::nullopt;
    }
    if (outcome->scene && !commands_.push(ChangeScene{outcome->scene->name, outcome->scene})) {
        return UploadAnswer{503, "host-sim is busy with earlier requests"};
    }
    return UploadAnswer{outcome->scene ? 200U : 422U, std::move(outcome->text)};
}

void ServedView::tick() {
    const std::int64_t now_ns = monotonic_now_ns();
    // Collect what the simulation and the device have produced.
    bool content_changed = take_updates();
    content_changed = take_snapshot() || content_changed;
    content_changed = poll_device(now_ns) || content_changed;
    content_changed = take_samples(now_ns) || content_changed;
    if (server_.stopping()) {
        state_.ending = true;
        content_changed = true;
    }
    // Offer it to the viewers, and ask the simulation for the next snapshot.
    if (content_changed) {
        server_.request_writes();
    }
    request_snapshot(now_ns);
}

bool ServedView::take_updates() {
    // The flag avoids the lock in most ticks. Acquire: pairs with the release after the data was set under the mutex.
    if (!update_pending_.exchange(false, std::memory_order_acquire)) {
        return false;
    }
    std::shared_ptr<SceneStream> stream;
    std::shared_ptr<const std::string> record;
    {
        const std::lock_guard lock(mutex_);
        stream = std::exchange(new_stream_, nullptr);
        record = std::exchange(new_record_, nullptr);
    }
    if (stream) {
        switch_scene(std::move(stream));
    }
    // Announce the new recording; it is served at /record.csv.
    if (record) {
        const std::size_t rows = rows_of_csv(*record);
        record_ = std::move(record);
        ++state_.records;
        state_.record = nlohmann::json{{"type", "record"}, {"steps", rows}, {"url", "/record.csv"}}.dump();
    }
    return true;
}

void ServedView::switch_scene(std::shared_ptr<SceneStream> stream) {
    // Encode once what every viewer of this scene is sent first.
    shown_stream_ = std::move(stream);
    encoder_ = std::make_unique<SnapshotEncoder>(shown_stream_->description);
    state_.scene = shown_stream_->scene;
    state_.scene_text = scene_message(shown_stream_->description, state_.scene, settings_.control);
    state_.geometry = geometry_message(shown_stream_->description, state_.scene);
    state_.snapshot = nullptr;
    state_.snapshots = 0;
    state_.samples.clear();
}

bool ServedView::take_snapshot() {
    if (!shown_stream_ || !shown_stream_->snapshots.take()) {
        return false;
    }
    // Particles are encoded only while a viewer is subscribed to them.
    const bool particles = any_viewer([](const Viewer& viewer) { return viewer.watch().particles; });
    encoder_->encode(shown_stream_->snapshots.front(), particles, sessions_.size());
    device_in_scene_ = shown_stream_->snapshots.front().device;
    state_.snapshot = &encoder_->encoded();
    ++state_.snapshots;
    return true;
}

bool ServedView::take_samples(std::int64_t now_ns) {
    const bool watched = any_viewer([](const Viewer& viewer) { return viewer.watch().samples; });
    samples_watched_.store(watched, std::memory_order_relaxed);
    // Drop samples of a previous scene that were still queued.
    for (NumberedSample sample; samples_.pop(sample);) {
        if (sample.scene == state_.scene) {
            state_.samples.add(sample);
        }
    }
    // Wake the viewers for samples at the snapshot rate: a run may produce samples without snapshots.
    if (!watched || now_ns < next_samples_ns_) {
        return false;
    }
    next_samples_ns_ = now_ns + kSnapshotPeriodNs;
    return true;
}

bool ServedView::poll_device(std::int64_t now_ns) {
    if (!device_ || sessions_.empty()) {
        return false;
    }
    // Poll at every tick, so as not to miss states; report less often.
    device_->poll(now_ns);
    if (now_ns < next_device_ns_) {
        return false;
    }
    next_device_ns_ = now_ns + kDevicePeriodNs;
    state_.device = device_->message(now_ns, device_in_scene_);
    ++state_.devices;
    return true;
}

void ServedView::request_snapshot(std::int64_t now_ns) {
    if (now_ns < next_request_ns_ || snapshot_requested_.load(std::memory_order_relaxed) ||
        !any_viewer([](const Viewer& viewer) { return viewer.wants_snapshot(); })) {
        return;
    }
    // Keep the average rate although ticks do not coincide with it, but do not make up for missed periods.
    next_request_ns_ = (now_ns - next_request_ns_ < kSnapshotPeriodNs ? next_request_ns_ : now_ns) + kSnapshotPeriodNs;
    snapshot_requested_.store(true, std::memory_order_relaxed);
}

}  // namespace

std::unique_ptr<LiveView> open_live_view(const LiveViewSettings& settings) {
    return std::make_unique<ServedView>(settings);
}

}  // namespace haptic::sim::view
