#include "dds/ros_topics.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "dds/entities.hpp"
#include "haptic/clock.hpp"
#include "haptic/numeric.hpp"
#include "haptic/ring.hpp"
#include "haptic/ring_observer.hpp"
#include "haptic/types.hpp"
#include "joined.hpp"
#include "ros_messages.h"

namespace haptic {

using namespace dds;

namespace {

using Header = std_msgs_msg_dds__Header_;
using Stamp = builtin_interfaces_msg_dds__Time_;
using RosVector = geometry_msgs_msg_dds__Vector3_;
using RosStatus = diagnostic_msgs_msg_dds__DiagnosticStatus_;

constexpr std::int64_t kLostNs = kNanosecondsPerSecond / 2;  // without a state: no rt-core
constexpr std::int64_t kStallNs = 20'000'000;                // without a run: what waits, or still comes in, is old
constexpr std::size_t kButtons = 3;
constexpr std::int32_t kDepth = 10;  // of ROS 2's default

// diagnostic_msgs/DiagnosticStatus.
enum class Level : std::uint8_t { Ok = 0, Warning = 1, Error = 2, Stale = 3 };

/// ROS's default, for its readers of either reliability. What a reader lacks for a tenth of a second is not sent again.
Quality quality_for_ros() {
    return Quality{kDepth}.reliable().lifespan(kNanosecondsPerSecond / 10);
}

/// ROS's time, which is that of the wall clock, of a time of CLOCK_MONOTONIC.
Stamp stamp_of(std::int64_t monotonic_ns) {
    const std::int64_t ns = monotonic_ns + real_minus_monotonic_ns();
    return {static_cast<std::int32_t>(ns / kNanosecondsPerSecond),
            static_cast<std::uint32_t>(ns % kNanosecondsPerSecond)};
}

RosVector ros_vector(const double (&v)[3]) {
    return {v[0], v[1], v[2]};
}

Level level_of(const DeviceState& state) {
    if (state.faults != 0 || state.safety_state == HAPTIC_FAULTED) {
        return Level::Error;
    }
    return state.safety_state == HAPTIC_RUNNING ? Level::Ok : Level::Warning;
}

/// Names and values of a diagnostic message; owns the texts to which the message points.
class Values {
  public:
    void add(std::string name, std::string value) { texts_.push_back({std::move(name), std::move(value)}); }
    void put_into(RosStatus& status) {
        pairs_.clear();
        for (auto& [name, value] : texts_) {
            pairs_.push_back({name.data(), value.data()});
        }
        status.values._maximum = status.values._length = static_cast<std::uint32_t>(pairs_.size());
        status.values._buffer = pairs_.data();
    }

  private:
    std::vector<std::pair<std::string, std::string>> texts_;
    std::vector<diagnostic_msgs_msg_dds__KeyValue_> pairs_;
};

bool is_ros_name(const std::string& name) {
    bool begins = true;
    for (const char c : name) {
        const auto u = static_cast<unsigned char>(c);
        const bool allowed = begins ? std::isalpha(u) != 0 || c == '_' : std::isalnum(u) != 0 || c == '_' || c == '/';
        if (!allowed) {
            return false;
        }
        begins = c == '/';
    }
    return !begins;
}

}  // namespace

void check(const RosSettings& settings) {
    if (!is_ros_name(settings.names)) {
        throw std::invalid_argument(
            "\"" + settings.names +
            "\" is no name for topics of ROS 2: words of the characters A-Z a-z 0-9 _ joined by /, "
            "none beginning with a digit");
    }
}

/// From ROS 2's topic to the ring of the session.
struct OverlayPath {
    OverlayPath(const Entity& participant, const std::string& name, const std::string& session)
        : topic(participant, geometry_msgs_msg_dds__WrenchStamped__desc, name, Quality{1}), ring(session) {}

    Receiver<geometry_msgs_msg_dds__WrenchStamped_> topic;  // the newest of what either kind of writer sends
    RingWriter<WrenchOverlay> ring;
};

struct RosTopics::State {
    State(const RosSettings& ros, const LinkSettings& link)
        : settings(ros),
          session(link.session),
          frame_id(settings.names + "_device"),
          participant(participant_in(link.domain)),
          poses(participant, geometry_msgs_msg_dds__PoseStamped__desc, topic("pose"), quality_for_ros()),
          twists(participant, geometry_msgs_msg_dds__TwistStamped__desc, topic("twist"), quality_for_ros()),
          wrenches(participant, geometry_msgs_msg_dds__WrenchStamped__desc, topic("wrench"), quality_for_ros()),
          joys(participant, sensor_msgs_msg_dds__Joy__desc, topic("joy"), quality_for_ros()),
          diagnostics(participant, diagnostic_msgs_msg_dds__DiagnosticArray__desc, "rt/diagnostics", quality_for_ros()),
          states(link.session) {
        std::replace(frame_id.begin(), frame_id.end(), '/', '_');
        if (settings.overlay) {
            overlays = std::make_unique<OverlayPath>(participant, topic("wrench_overlay"), link.session);
        }
    }

    [[nodiscard]] std::string topic(const std::string& name) const { return "rt/" + settings.names + "/" + name; }
    /// Whether a state latched then is to be published: the nearest to each period's end.
    bool is_due(std::int64_t latch_ns) {
        const auto period_ns = static_cast<std::int64_t>(1e9 / settings.rate_hz);
        if (latch_ns + period_ns / 4 < next_ns) {
            return false;
        }
        next_ns = std::max(next_ns + period_ns, latch_ns + period_ns / 2);
        return true;
    }
    /// Takes the newest overlay, unless it may have waited while this process stood still.
    void take_overlay(OverlayPath& path, std::int64_t now_ns);
    [[nodiscard]] bool read(const geometry_msgs_msg_dds__WrenchStamped_& message);
    void publish();
    void publish_diagnostics(std::int64_t now_ns, const RelayCounts& relay);

    RosSettings settings;
    std::string session;
    std::string frame_id;
    Entity participant;
    Sender<geometry_msgs_msg_dds__PoseStamped_> poses;
    Sender<geometry_msgs_msg_dds__TwistStamped_> twists;
    Sender<geometry_msgs_msg_dds__WrenchStamped_> wrenches;
    Sender<sensor_msgs_msg_dds__Joy_> joys;
    Sender<diagnostic_msgs_msg_dds__DiagnosticArray_> diagnostics;
    std::unique_ptr<OverlayPath> overlays;  // none unless asked for
    WrenchOverlay overlay{};
    RingObserver<DeviceState> states;
    DeviceState state{};       // the newest
    DeviceState next_state{};  // not valid until it was read whole
    std::int64_t last_run_ns = 0;
    std::int64_t fresh_from_ns = 0;  // overlays that are taken before are older than they seem
    std::int64_t next_ns = 0;
    std::int64_t seen_ns = 0;  // 0: no state yet
    std::int64_t diagnose_ns = 0;
    RosCounts counts;
};

/// A wrench in the device frame, whose name may be left out. Nothing else says what its axes are.
bool RosTopics::State::read(const geometry_msgs_msg_dds__WrenchStamped_& message) {
    const auto& [force, torque] = message.wrench;
    overlay.force[0] = force.x;
    overlay.force[1] = force.y;
    overlay.force[2] = force.z;
    overlay.torque[0] = torque.x;
    overlay.torque[1] = torque.y;
    overlay.torque[2] = torque.z;
    const std::string_view frame = message.header.frame_id;
    return (frame.empty() || frame == frame_id) && is_finite(to_vec3(overlay.force)) &&
           is_finite(to_vec3(overlay.torque));
}

void RosTopics::State::take_overlay(OverlayPath& path, std::int64_t now_ns) {
    // After a stall, as by SIGSTOP, messages wait here, and some still in the socket for the thread that receives.
    if (now_ns - last_run_ns > kStallNs) {
        fresh_from_ns = now_ns + kStallNs;
    }
    last_run_ns = now_ns;
    if (now_ns < fresh_from_ns) {
        while (path.topic.take([](const auto& /*old*/) { return true; }) != Taken::Nothing) {
        }
        return;
    }
    const Taken taken = path.topic.take([this](const auto& message) { return read(message); });
    counts.refused += taken == Taken::Refused ? 1u : 0u;
    if (taken == Taken::Message) {
        // Its stamp is that of another clock: rt-core counts the age from here.
        overlay.arrival_time_ns = now_ns;
        (void)path.ring.publish(overlay, now_ns);
        ++counts.overlays;
    }
}

void RosTopics::State::publish() {
    const Header header = {stamp_of(state.latch_time_ns), frame_id.data()};
    const double (&p)[3] = state.position;
    const double (&q)[4] = state.orientation;
    poses.send({header, {{p[0], p[1], p[2]}, {q[1], q[2], q[3], q[0]}}});
    twists.send({header, {ros_vector(state.linear_velocity), ros_vector(state.angular_velocity)}});
    wrenches.send({header, {ros_vector(state.force), ros_vector(state.torque)}});
    // Buttons one by one; the device has no axes but its pose.
    std::array<std::int32_t, kButtons> pressed{};
    for (std::size_t k = 0; k < kButtons; ++k) {
        pressed[k] = static_cast<std::int32_t>(state.buttons >> k & 1u);
    }
    sensor_msgs_msg_dds__Joy_ joy{};
    joy.header = header;
    joy.buttons._maximum = joy.buttons._length = kButtons;
    joy.buttons._buffer = pressed.data();
    joys.send(joy);
    ++counts.states;
}

void RosTopics::State::publish_diagnostics(std::int64_t now_ns, const RelayCounts& relay) {
    const bool lost = seen_ns == 0 || now_ns - seen_ns > kLostNs;
    std::string name = "haptic: session " + session;
    std::string hardware = "spidar-g6";
    std::string message = lost ? "no rt-core" : std::string(safety_state_name(state.safety_state));
    Values values;
    if (!lost) {
        values.add("faults", detail::joined(fault_names(state.faults), ", "));
        values.add("tick", detail::joined(tick_flag_names(state.tick_flags), ", "));
        values.add("rendered stiffness, N/m", std::to_string(state.stiffness));
        values.add("rendered part of the wrench", std::to_string(state.scale));
    }
    values.add("states not seen", std::to_string(states.counts().missed));
    values.add("overlays passed on", std::to_string(counts.overlays));
    values.add("overlays refused", std::to_string(counts.refused));
    values.add("frames from another machine", std::to_string(relay.frames));
    values.add("frames refused", std::to_string(relay.refused + relay.late + relay.displaced));
    RosStatus status{};
    status.level = static_cast<std::uint8_t>(lost ? Level::Stale : level_of(state));
    status.name = name.data();
    status.message = message.data();
    status.hardware_id = hardware.data();
    values.put_into(status);
    diagnostic_msgs_msg_dds__DiagnosticArray_ array{};
    array.header = {stamp_of(now_ns), frame_id.data()};
    array.status._maximum = array.status._length = 1;
    array.status._buffer = &status;
    diagnostics.send(array);
}

RosTopics::RosTopics(const RosSettings& settings, const LinkSettings& link) {
    check(settings);
    state_ = std::make_unique<State>(settings, link);
}
RosTopics::RosTopics(RosTopics&&) noexcept = default;
RosTopics& RosTopics::operator=(RosTopics&&) noexcept = default;
RosTopics::~RosTopics() = default;

void RosTopics::run_once(std::int64_t now_ns, const RelayCounts& relay) {
    State& s = *state_;
    if (s.overlays) {
        s.take_overlay(*s.overlays, now_ns);
    }
    s.states.attend(now_ns);
    while (s.states.next(s.next_state)) {
        s.state = s.next_state;
        s.seen_ns = now_ns;
        if (s.is_due(s.state.latch_time_ns)) {
            s.publish();
        }
    }
    if (now_ns >= s.diagnose_ns) {
        s.publish_diagnostics(now_ns, relay);
        s.diagnose_ns = now_ns + kNanosecondsPerSecond;
    }
}

const RosCounts& RosTopics::counts() const {
    return state_->counts;
}

}  // namespace haptic
