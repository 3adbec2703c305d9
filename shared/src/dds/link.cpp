#include "dds/link.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>

#include "dds/entities.hpp"
#include "haptic_link.h"

namespace haptic {

using namespace dds;

namespace {

// A message that waited longer for its reader is of no use.
constexpr dds_duration_t kLifespan = DDS_MSECS(100);
constexpr std::uint32_t kMaxDomain = 232;

bool is_plain(const std::string& text) {
    return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
        return std::isalnum(c) != 0 || c == '_' || c == '.' || c == ':' || c == '-';
    });
}

/// Cyclone DDS's configuration: one interface, and nothing from the environment.
std::string configuration(const LinkSettings& settings) {
    const bool loopback = settings.interface == "lo";
    std::string peers;
    for (const std::string& peer : settings.peers) {
        peers += "<Peer address=\"" + peer + "\"/>";
    }
    // On the loopback interface there is no multicast: participants are found by their ports.
    if (loopback) {
        peers += R"(<Peer address="127.0.0.1"/>)";
    }
    return std::string("<General><Interfaces><NetworkInterface name=\"") + settings.interface +
           "\"/></Interfaces><AllowMulticast>" + (loopback ? "false" : "spdp") +
           "</AllowMulticast></General><Discovery><SPDPInterval>1s</SPDPInterval><ParticipantIndex>auto</"
           "ParticipantIndex><Peers>" +
           peers + "</Peers></Discovery><Tracing><Verbosity>none</Verbosity></Tracing>";
}

/// The newest `depth` messages of a session, which are apart from those of others.
Quality quality_of(const LinkSettings& settings, std::int32_t depth) {
    return Quality{depth}.lifespan(kLifespan).partition(settings.session);
}

template <std::size_t count>
void copy(const double (&from)[count], double (&to)[count]) {
    std::copy_n(from, count, to);
}

// What has the same name in a message and in frames.h, in either direction.

template <class From, class To>
void copy_state(const From& from, To& to) {
    to.latch_time_ns = from.latch_time_ns;
    copy(from.position, to.position);
    copy(from.orientation, to.orientation);
    copy(from.linear_velocity, to.linear_velocity);
    copy(from.angular_velocity, to.angular_velocity);
    copy(from.force, to.force);
    copy(from.torque, to.torque);
    copy(from.proxy_position, to.proxy_position);
    copy(from.tension, to.tension);
    to.stiffness = from.stiffness;
    to.scale = from.scale;
    copy(from.impulse, to.impulse);
    copy(from.angular_impulse, to.angular_impulse);
    to.safety_state = from.safety_state;
    to.faults = from.faults;
    to.tick_flags = from.tick_flags;
    to.buttons = from.buttons;
}

template <class From, class To>
void copy_frame(const From& from, To& to) {
    to.state_time_ns = from.state_time_ns;
    to.plane_time_ns = from.plane_time_ns;
    to.step_ns = from.step_ns;
    to.stiffness = from.stiffness;
    to.torque_stiffness = from.torque_stiffness;
    to.static_friction = from.static_friction;
    to.dynamic_friction = from.dynamic_friction;
    to.body_work = from.body_work;
    to.flags = from.flags;
    to.compliance_rows = from.compliance_rows;
}

template <class From, class To>
void copy_proxy(const From& from, To& to) {
    copy(from.rest_offset, to.rest_offset);
    copy(from.rest_velocity, to.rest_velocity);
    to.radius = from.radius;
    copy(from.position, to.position);
    copy(from.surface_velocity, to.surface_velocity);
    to.in_contact = from.in_contact;
}

template <class From, class To>
void copy_plane(const From& from, To& to) {
    copy(from.normal, to.normal);
    to.offset = from.offset;
    to.velocity = from.velocity;
}

haptic_link_DeviceState message_of(const DeviceState& state) {
    haptic_link_DeviceState m{};
    m.abi = HAPTIC_ABI_VERSION;
    m.number = state.sequence;
    m.frame_number = state.frame_sequence;
    copy_state(state, m);
    return m;
}

bool read(const haptic_link_DeviceState& m, DeviceState& state) {
    if (m.abi != HAPTIC_ABI_VERSION) {
        return false;
    }
    state = {};
    state.sequence = m.number;
    state.frame_sequence = m.frame_number;
    copy_state(m, state);
    return true;
}

/// A frame as a message whose sequences lie in memory of its own, without allocation.
class FrameMessage {
  public:
    const haptic_link_ContactFrame& of(const ContactFrame& frame, std::int64_t clock_uncertainty_ns) {
        message_ = {};
        message_.abi = HAPTIC_ABI_VERSION;
        message_.number = frame.sequence;
        message_.state_number = frame.state_sequence;
        copy_frame(frame, message_);
        message_.clock_uncertainty_ns = clock_uncertainty_ns;
        message_.proxies._maximum = message_.proxies._length = frame.proxy_count;
        message_.proxies._buffer = proxies_.data();
        for (std::size_t i = 0; i < frame.proxy_count; ++i) {
            write(frame.proxies[i], i);
        }
        message_.compliance._maximum = message_.compliance._length =
            static_cast<std::uint32_t>(compliance_index(frame.compliance_rows, 0));
        std::copy_n(frame.compliance, message_.compliance._length, compliance_.data());
        message_.compliance._buffer = compliance_.data();
        return message_;
    }

  private:
    void write(const ProxyContact& from, std::size_t i) {
        haptic_link_Proxy& to = proxies_[i];
        copy_proxy(from, to);
        to.planes._maximum = to.planes._length = from.plane_count;
        to.planes._buffer = planes_[i].data();
        for (std::size_t p = 0; p < from.plane_count; ++p) {
            copy_plane(from.planes[p], planes_[i][p]);
        }
    }

    haptic_link_ContactFrame message_{};
    std::array<haptic_link_Proxy, kMaxProxies> proxies_{};
    std::array<std::array<haptic_link_Plane, kMaxPlanes>, kMaxProxies> planes_{};
    std::array<float, kMaxCompliances> compliance_{};
};

bool read(const haptic_link_ContactFrame& m, ContactFrame& frame) {
    // Lengths first: what follows copies as many.
    if (m.abi != HAPTIC_ABI_VERSION || m.proxies._length > kMaxProxies || m.compliance_rows > kMaxComplianceRows ||
        m.compliance._length != compliance_index(m.compliance_rows, 0)) {
        return false;
    }
    frame = {};
    frame.sequence = m.number;
    frame.state_sequence = m.state_number;
    copy_frame(m, frame);
    frame.proxy_count = m.proxies._length;
    for (std::size_t i = 0; i < frame.proxy_count; ++i) {
        const haptic_link_Proxy& from = m.proxies._buffer[i];
        ProxyContact& to = frame.proxies[i];
        if (from.planes._length > kMaxPlanes) {
            return false;
        }
        copy_proxy(from, to);
        to.plane_count = from.planes._length;
        for (std::size_t p = 0; p < to.plane_count; ++p) {
            copy_plane(from.planes._buffer[p], to.planes[p]);
        }
    }
    std::copy_n(m.compliance._buffer, m.compliance._length, frame.compliance);
    return find_defect(frame) == FrameDefect::None;
}

// Queries and replies that are kept: more than any that are on their way.
constexpr std::int32_t kClockDepth = 8;

}  // namespace

void check(const LinkSettings& settings) {
    if (!is_plain(settings.session)) {
        throw std::invalid_argument("session \"" + settings.session +
                                    "\" must have only the characters A-Z a-z 0-9 _ -");
    }
    if (!is_plain(settings.interface)) {
        throw std::invalid_argument("\"" + settings.interface + "\" is no name of a network interface");
    }
    for (const std::string& peer : settings.peers) {
        if (!is_plain(peer)) {
            throw std::invalid_argument("\"" + peer + "\" is no address of a machine");
        }
    }
    if (settings.domain > kMaxDomain) {
        throw std::invalid_argument("a DDS domain is 0 to 232, not " + std::to_string(settings.domain));
    }
}

struct LinkDomain::State {
    Entity domain;
};

LinkDomain::LinkDomain(const LinkSettings& settings) {
    check(settings);
    const dds_entity_t domain = dds_create_domain(settings.domain, configuration(settings).c_str());
    if (domain < 0) {
        throw std::runtime_error("DDS cannot use the network interface " + settings.interface + " in domain " +
                                 std::to_string(settings.domain) + "; `ip link` lists the interfaces");
    }
    state_ = std::make_unique<State>(State{{domain, "no domain"}});
}
LinkDomain::LinkDomain(LinkDomain&&) noexcept = default;
LinkDomain& LinkDomain::operator=(LinkDomain&&) noexcept = default;
LinkDomain::~LinkDomain() = default;

struct DeviceLink::State {
    explicit State(const LinkSettings& settings)
        : participant(participant_in(settings.domain)),
          states(participant, haptic_link_DeviceState_desc, "haptic/state", quality_of(settings, 1)),
          replies(participant, haptic_link_ClockReply_desc, "haptic/clock_reply", quality_of(settings, 1)),
          frames(participant, haptic_link_ContactFrame_desc, "haptic/frame", quality_of(settings, 1)),
          queries(participant, haptic_link_ClockQuery_desc, "haptic/clock_query", quality_of(settings, kClockDepth)),
          waiting(participant, {frames.get(), queries.get()}) {}

    Entity participant;
    Sender<haptic_link_DeviceState> states;
    Sender<haptic_link_ClockReply> replies;
    Receiver<haptic_link_ContactFrame> frames;
    Receiver<haptic_link_ClockQuery> queries;
    Waiting waiting;
};

DeviceLink::DeviceLink(const LinkSettings& settings) {
    check(settings);
    state_ = std::make_unique<State>(settings);
}
DeviceLink::DeviceLink(DeviceLink&&) noexcept = default;
DeviceLink& DeviceLink::operator=(DeviceLink&&) noexcept = default;
DeviceLink::~DeviceLink() = default;

void DeviceLink::wait(std::int64_t timeout_ns) {
    state_->waiting.wait(timeout_ns);
}
void DeviceLink::send(const DeviceState& state) {
    state_->states.send(message_of(state));
}
void DeviceLink::send(const ClockReplyMessage& reply) {
    state_->replies.send({reply.asker, reply.sent_ns, reply.received_ns, reply.replied_ns});
}
Taken DeviceLink::take(ContactFrame& frame) {
    return state_->frames.take([&](const haptic_link_ContactFrame& message) { return read(message, frame); });
}
Taken DeviceLink::take(ClockQueryMessage& query) {
    return state_->queries.take([&](const haptic_link_ClockQuery& message) {
        query = {.asker = message.asker, .sent_ns = message.sent_ns};
        return true;
    });
}
bool DeviceLink::matched() const {
    return state_->frames.matched();
}

struct SimulationLink::State {
    explicit State(const LinkSettings& settings)
        : participant(participant_in(settings.domain)),
          frames(participant, haptic_link_ContactFrame_desc, "haptic/frame", quality_of(settings, 1)),
          queries(participant, haptic_link_ClockQuery_desc, "haptic/clock_query", quality_of(settings, 1)),
          states(participant, haptic_link_DeviceState_desc, "haptic/state", quality_of(settings, 1)),
          replies(participant, haptic_link_ClockReply_desc, "haptic/clock_reply", quality_of(settings, kClockDepth)),
          waiting(participant, {states.get(), replies.get()}) {}

    Entity participant;
    Sender<haptic_link_ContactFrame> frames;
    Sender<haptic_link_ClockQuery> queries;
    Receiver<haptic_link_DeviceState> states;
    Receiver<haptic_link_ClockReply> replies;
    Waiting waiting;
    FrameMessage frame_message;
};

SimulationLink::SimulationLink(const LinkSettings& settings) {
    check(settings);
    state_ = std::make_unique<State>(settings);
}
SimulationLink::SimulationLink(SimulationLink&&) noexcept = default;
SimulationLink& SimulationLink::operator=(SimulationLink&&) noexcept = default;
SimulationLink::~SimulationLink() = default;

void SimulationLink::wait(std::int64_t timeout_ns) {
    state_->waiting.wait(timeout_ns);
}
void SimulationLink::send(const ContactFrame& frame, std::int64_t clock_uncertainty_ns) {
    state_->frames.send(state_->frame_message.of(frame, clock_uncertainty_ns));
}
void SimulationLink::send(const ClockQueryMessage& query) {
    state_->queries.send({query.asker, query.sent_ns});
}
Taken SimulationLink::take(DeviceState& state) {
    return state_->states.take([&](const haptic_link_DeviceState& message) { return read(message, state); });
}
Taken SimulationLink::take(ClockReplyMessage& reply) {
    return state_->replies.take([&](const haptic_link_ClockReply& message) {
        reply = {.asker = message.asker,
                 .sent_ns = message.sent_ns,
                 .received_ns = message.received_ns,
                 .replied_ns = message.replied_ns};
        return true;
    });
}
bool SimulationLink::matched() const {
    return state_->states.matched();
}

}  // namespace haptic
