// Viewer session, without sockets: what one viewer has been sent, what it subscribed to, and what it is sent next. The
// caller asks for the next message once the previous one has been sent.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "view/command_parser.hpp"
#include "view/encoding.hpp"
#include "view/sample_history.hpp"

namespace haptic::sim::view {

/// Content that all viewers are shown. A counter is 0 until the first item of its kind exists.
struct ViewState {
    std::uint32_t scene = 0;
    std::string scene_text;                     // the message "scene"
    Bytes geometry;                             // the message "geometry"
    const EncodedSnapshot* snapshot = nullptr;  // the newest; null before the first
    std::uint64_t snapshots = 0;                // of this scene so far
    SampleHistory samples;                      // of this scene
    std::string device;                         // the message "device"
    std::uint64_t devices = 0;                  // number of such messages so far
    std::string record;                         // the message "record"
    std::uint64_t records = 0;                  // number of such messages so far
    // host-sim is about to end
    bool ending = false;
};

/// A message to send.
struct Outgoing {
    bool text = false;
    Bytes bytes;
};

/// A request to close the connection, with its status code and reason (RFC 6455, section 7.4).
struct Closing {
    std::uint16_t code = 0;
    std::string why;
};
inline constexpr std::uint16_t kGoingAway = 1001;
inline constexpr std::uint16_t kUnsupportedData = 1003;
inline constexpr std::uint16_t kPolicyViolation = 1008;

inline constexpr double kMaxRequests = 200.0;    // per second, and in one burst
inline constexpr std::size_t kMaxRefusals = 32;  // waiting to be sent; more are dropped

class Viewer {
  public:
    /// Nothing to do, a command for the run, or the end of the connection.
    using Outcome = std::variant<std::monostate, Command, Closing>;

    /// `control`: the viewer may change the run.
    explicit Viewer(bool control) : control_(control) {}

    /// Handles a complete text message received at `now_ns` (monotonic).
    [[nodiscard]] Outcome on_message(std::string_view text, const SceneDescription& description, std::int64_t now_ns);

    /// Queues the reason for which a request is not carried out.
    void refuse(const Refusal& refusal);

    /// Writes the next message to `message`; returns false and leaves `message` unchanged if there is none for now.
    [[nodiscard]] bool compose(const ViewState& state, std::int64_t now_ns, Outgoing& message);

    /// The viewer has received everything, including a whole scene, so a new snapshot would be sent at once.
    [[nodiscard]] bool wants_snapshot() const noexcept { return wants_snapshot_; }
    /// The message "bye" has been sent.
    [[nodiscard]] bool bye_sent() const noexcept { return bye_sent_; }
    [[nodiscard]] const Watch& watch() const noexcept { return watch_; }

  private:
    bool take_allowance(std::int64_t now_ns) noexcept;
    [[nodiscard]] bool compose_notice(const ViewState& state, Outgoing& message);
    [[nodiscard]] bool compose_samples(const ViewState& state, std::int64_t now_ns, Outgoing& message);
    void compose_frame(const ViewState& state, Outgoing& message);

    bool control_ = false;
    Watch watch_;
    double allowance_ = kMaxRequests;
    std::int64_t last_message_ns_ = 0;
    std::deque<std::string> refusals_;

    // Versions and counters of what this viewer has been sent.
    std::uint32_t scene_ = 0;
    std::uint32_t geometry_ = 0;
    std::uint64_t snapshots_ = 0;
    std::vector<std::uint64_t> surfaces_;   // versions, as EncodedSnapshot::surfaces
    std::vector<std::uint64_t> particles_;  // versions, as EncodedSnapshot::particles
    bool samples_begun_ = false;            // since it subscribed to them, in this scene
    std::uint64_t samples_ = 0;             // number of the next sample
    std::int64_t samples_ns_ = 0;
    std::uint64_t devices_ = 0;
    std::uint64_t records_ = 0;
    bool wants_snapshot_ = false;
    bool bye_sent_ = false;
};

}  // namespace haptic::sim::view
