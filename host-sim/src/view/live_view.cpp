#include "view/live_view.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string_view>
#include <thread>
#include <utility>

#include "haptic/clock.hpp"
#include "view/bounded_queue.hpp"
#include "view/device_telemetry.hpp"
#include "view/encoding.hpp"
#include "view/newest.hpp"
#include "view/page_files.hpp"
#include "view/viewer.hpp"
#include "view/web_server.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::int64_t kMomentPeriodNs = kNanosecondsPerSecond / 60;
constexpr std::int64_t kDevicePeriodNs = kNanosecondsPerSecond / 5;
constexpr std::size_t kQueuedSamples = 4096;
constexpr std::size_t kQueuedCommands = 256;
constexpr int kNice = 5;  // the simulation goes first

/// A scene, and the moments of it. Another scene brings its own, so that no moment is taken for one of another.
struct Stage {
    std::uint32_t scene = 0;
    SceneDescription description;
    Newest<SceneSnapshot> moments;
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
}

/// Without the header, and the notes before it, which begin with #.
std::size_t rows_of_csv(std::string_view csv) {
    std::size_t lines = 0;
    for (std::size_t at = 0; at < csv.size();) {
        lines += csv[at] == '#' ? 0U : 1U;
        const std::size_t end = csv.find('\n', at);
        at = end == std::string_view::npos ? csv.size() : end + 1;
    }
    return lines == 0 ? 0 : lines - 1;
}

/// What the process inherits for its real-time work is not for this thread, and its signals are the main thread's.
void become_ordinary_thread() {
    (void)pthread_setname_np(pthread_self(), "haptic-view");
    const sched_param none{};
    (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &none);
    (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
}

/// Blocks all signals while it lives; a thread that is started meanwhile has them blocked for ever.
class SignalsBlocked {
  public:
    SignalsBlocked() {
        sigset_t all{};
        (void)sigfillset(&all);
        (void)pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    SignalsBlocked(const SignalsBlocked&) = delete;
    SignalsBlocked& operator=(const SignalsBlocked&) = delete;
    ~SignalsBlocked() { (void)pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

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
    void introduce(const SceneDescription& scene) override;
    [[nodiscard]] SceneSnapshot* wanted() noexcept override;
    void show() noexcept override;
    void add(const StepSample& sample) noexcept override;
    void frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept override;
    [[nodiscard]] bool next_command(Command& command) override;
    void offer_record(std::string csv) override;

  private:
    /// A viewer, and the way from its connection to the view and back.
    class Seat final : public Conversation {
      public:
        explicit Seat(ServedView& view) : view_(view), viewer_(view.settings_.control) { view_.seats_.push_back(this); }
        Seat(const Seat&) = delete;
        Seat& operator=(const Seat&) = delete;
        ~Seat() override { view_.leave(*this); }

        [[nodiscard]] std::optional<Closing> hear(std::string_view text) override;
        [[nodiscard]] bool next_message(Outgoing& message) override {
            return viewer_.compose(view_.shown_, monotonic_now_ns(), message);
        }
        [[nodiscard]] bool has_ended() const override { return viewer_.told_bye(); }
        [[nodiscard]] const Viewer& viewer() const noexcept { return viewer_; }

      private:
        ServedView& view_;
        Viewer viewer_;
    };

    // Of the view's thread.
    [[nodiscard]] std::unique_ptr<Conversation> join() override { return std::make_unique<Seat>(*this); }
    [[nodiscard]] std::optional<Resource> resource(std::string_view path) override;
    void tick() override;
    void leave(Seat& seat);
    bool take_news();
    void take_stage(std::shared_ptr<Stage> stage);
    bool take_moment();
    bool take_samples(std::int64_t now_ns);
    bool look_at_device(std::int64_t now_ns);
    void ask(std::int64_t now_ns);
    template <class Predicate>
    [[nodiscard]] bool any_viewer(Predicate&& holds) const {
        return std::any_of(seats_.begin(), seats_.end(), [&](const Seat* seat) { return holds(seat->viewer()); });
    }

    const LiveViewSettings settings_;

    // Between the threads.
    std::atomic<bool> asked_{false};            // a moment is waited for
    std::atomic<bool> samples_watched_{false};  // so are samples
    BoundedQueue<NumberedSample, kQueuedSamples> samples_;
    BoundedQueue<Command, kQueuedCommands> commands_;
    std::atomic<bool> news_{false};  // something was put under the mutex
    std::mutex mutex_;
    std::shared_ptr<Stage> new_stage_;
    std::shared_ptr<const std::string> new_record_;

    std::unique_ptr<DeviceTelemetry> device_;  // null: there are no rings

    // Of the simulation's thread.
    std::shared_ptr<Stage> stage_;
    std::uint64_t samples_so_far_ = 0;

    // Of the view's thread.
    std::vector<Seat*> seats_;
    const Seat* hand_ = nullptr;  // who moved the hand last, and has not let it go
    std::shared_ptr<Stage> shown_stage_;
    std::unique_ptr<MomentEncoder> encoder_;
    std::shared_ptr<const std::string> record_;
    Shown shown_;
    std::int64_t next_ask_ns_ = 0;
    std::int64_t next_device_ns_ = 0;
    std::int64_t next_samples_ns_ = 0;

    WebServer server_;
    std::thread thread_;
};

ServedView::ServedView(const LiveViewSettings& settings)
    : settings_(settings),
      device_(settings.session.empty() ? nullptr : std::make_unique<DeviceTelemetry>(settings.session)),
      server_(settings.address, settings.port, *this) {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] {
        become_ordinary_thread();
        server_.run();
    });
}

ServedView::~ServedView() {
    server_.stop();
    thread_.join();
}

std::string ServedView::url() const {
    std::string host = settings_.address;
    if (host == "0.0.0.0" || host == "::") {  // whatever address a browser has of this machine
        std::array<char, 256> name{};
        host = gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
    } else if (host.find(':') != std::string::npos) {
        host = "[" + host + "]";
    }
    return "http://" + host + ":" + std::to_string(server_.port()) + "/";
}

void ServedView::introduce(const SceneDescription& scene) {
    auto stage = std::make_shared<Stage>();
    stage->scene = stage_ ? stage_->scene + 1 : 1;
    stage->description = scene;
    stage->moments.prepare([&](SceneSnapshot& snapshot) { prepare(snapshot, scene); });
    {
        const std::lock_guard lock(mutex_);
        new_stage_ = stage;
    }
    stage_ = std::move(stage);
    news_.store(true, std::memory_order_release);
    server_.wake();
}

SceneSnapshot* ServedView::wanted() noexcept {
    // Relaxed: the buffer belongs to this thread anyway.
    return asked_.load(std::memory_order_relaxed) && stage_ ? &stage_->moments.back() : nullptr;
}

void ServedView::show() noexcept {
    // Before it is published: whoever takes it, and asks for the next one, asks after this.
    asked_.store(false, std::memory_order_relaxed);
    stage_->moments.publish();
    server_.wake();
}

void ServedView::add(const StepSample& sample) noexcept {
    const std::uint64_t number = samples_so_far_++;
    if (samples_watched_.load(std::memory_order_relaxed)) {
        (void)samples_.push(
            {stage_ ? stage_->scene : 0, number, sample});  // where there is no room, its number will be missing
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
    news_.store(true, std::memory_order_release);
    server_.wake();
}

std::optional<Closing> ServedView::Seat::hear(std::string_view text) {
    static const SceneDescription nothing;
    const SceneDescription& scene = view_.shown_stage_ ? view_.shown_stage_->description : nothing;
    Viewer::Heard heard = viewer_.hear(text, scene, monotonic_now_ns());
    if (auto* closing = std::get_if<Closing>(&heard)) {
        return std::move(*closing);
    }
    if (auto* command = std::get_if<Command>(&heard)) {
        const std::string type = type_of(*command);
        const bool moves = std::holds_alternative<MoveHand>(*command);
        const bool lets_go =
            std::holds_alternative<ReleaseHand>(*command) || std::holds_alternative<FollowScript>(*command);
        if (!view_.commands_.push(std::move(*command))) {
            viewer_.refuse({type, "host-sim has not done yet what it was asked before"});
        } else if (moves) {
            view_.hand_ = this;
        } else if (lets_go) {
            view_.hand_ = nullptr;
        }
    }
    return std::nullopt;
}

void ServedView::leave(Seat& seat) {
    std::erase(seats_, &seat);
    if (hand_ == &seat) {  // a hand that nobody holds any more
        hand_ = nullptr;
        (void)commands_.push(ReleaseHand{});
    }
}

std::optional<Resource> ServedView::resource(std::string_view path) {
    if (path == "/record.csv" && record_) {
        return Resource{"text/csv; charset=utf-8", std::as_bytes(std::span(*record_)), record_, "record.csv"};
    }
    for (const PageFile& file : page_files()) {
        if (file.path == path) {
            return Resource{std::string(file.type), file.content, nullptr, {}};
        }
    }
    if (path == "/favicon.ico") {
        return Resource{};  // browsers ask for it unbidden, and complain of an error
    }
    return std::nullopt;
}

void ServedView::tick() {
    const std::int64_t now_ns = monotonic_now_ns();
    bool invite = take_news();
    invite = take_moment() || invite;
    invite = look_at_device(now_ns) || invite;
    invite = take_samples(now_ns) || invite;
    if (server_.stopping()) {
        shown_.ending = true;
        invite = true;
    }
    if (invite) {
        server_.invite_all();
    }
    ask(now_ns);
}

bool ServedView::take_news() {
    // The flag spares the lock. Acquire: whoever sees it comes to the mutex after the one who set it.
    if (!news_.exchange(false, std::memory_order_acquire)) {
        return false;
    }
    std::shared_ptr<Stage> stage;
    std::shared_ptr<const std::string> record;
    {
        const std::lock_guard lock(mutex_);
        stage = std::exchange(new_stage_, nullptr);
        record = std::exchange(new_record_, nullptr);
    }
    if (stage) {
        take_stage(std::move(stage));
    }
    if (record) {
        const std::size_t rows = rows_of_csv(*record);
        record_ = std::move(record);
        ++shown_.records;
        shown_.record = nlohmann::json{{"type", "record"}, {"steps", rows}, {"url", "/record.csv"}}.dump();
    }
    return true;
}

void ServedView::take_stage(std::shared_ptr<Stage> stage) {
    shown_stage_ = std::move(stage);
    encoder_ = std::make_unique<MomentEncoder>(shown_stage_->description);
    shown_.scene = shown_stage_->scene;
    shown_.scene_text = scene_message(shown_stage_->description, shown_.scene, settings_.control);
    shown_.geometry = geometry_message(shown_stage_->description, shown_.scene);
    shown_.moment = nullptr;
    shown_.moments = 0;
    shown_.samples.clear();
}

bool ServedView::take_moment() {
    if (!shown_stage_ || !shown_stage_->moments.take()) {
        return false;
    }
    const bool particles = any_viewer([](const Viewer& viewer) { return viewer.watch().particles; });
    encoder_->encode(shown_stage_->moments.front(), particles, seats_.size());
    shown_.moment = &encoder_->moment();
    ++shown_.moments;
    return true;
}

bool ServedView::take_samples(std::int64_t now_ns) {
    const bool watched = any_viewer([](const Viewer& viewer) { return viewer.watch().samples; });
    samples_watched_.store(watched, std::memory_order_relaxed);
    for (NumberedSample sample; samples_.pop(sample);) {
        if (sample.scene == shown_.scene) {
            shown_.samples.add(sample);
        }
    }
    // Mostly they go with the moments; a run that shows none has samples all the same.
    if (!watched || now_ns < next_samples_ns_) {
        return false;
    }
    next_samples_ns_ = now_ns + kMomentPeriodNs;
    return true;
}

bool ServedView::look_at_device(std::int64_t now_ns) {
    if (!device_ || seats_.empty()) {
        return false;
    }
    device_->look(now_ns);
    if (now_ns < next_device_ns_) {
        return false;
    }
    next_device_ns_ = now_ns + kDevicePeriodNs;
    shown_.device = device_->message(now_ns);
    ++shown_.devices;
    return true;
}

void ServedView::ask(std::int64_t now_ns) {
    if (now_ns < next_ask_ns_ || asked_.load(std::memory_order_relaxed) ||
        !any_viewer([](const Viewer& viewer) { return viewer.waits(); })) {
        return;
    }
    // At the rate on average, though the ticks do not meet it; but what was missed is not made up for.
    next_ask_ns_ = (now_ns - next_ask_ns_ < kMomentPeriodNs ? next_ask_ns_ : now_ns) + kMomentPeriodNs;
    asked_.store(true, std::memory_order_relaxed);
}

}  // namespace

std::unique_ptr<LiveView> open_live_view(const LiveViewSettings& settings) {
    return std::make_unique<ServedView>(settings);
}

}  // namespace haptic::sim::view
