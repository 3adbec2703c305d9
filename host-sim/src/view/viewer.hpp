// One viewer, from within: what it was sent, what it wants, and what it is sent next. Without sockets; whoever has
// these asks for the next message when the one before has gone.
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

/// What all viewers are shown. Each number that counts something is 0 as long as there is nothing of it.
struct Shown {
    std::uint32_t scene = 0;
    std::string scene_text;                 // the message
    Bytes geometry;                         // likewise
    const EncodedMoment* moment = nullptr;  // the newest; null before the first
    std::uint64_t moments = 0;              // of this scene so far
    SampleHistory samples;                  // of this scene
    std::string device;                     // the message
    std::uint64_t devices = 0;              // such messages so far
    std::string record;                     // the message
    std::uint64_t records = 0;              // likewise
    bool ending = false;
};

/// A message to be sent.
struct Outgoing {
    bool text = false;
    Bytes bytes;
};

/// The connection is to be closed, for that reason (RFC 6455, section 7.4).
struct Closing {
    std::uint16_t code = 0;
    std::string why;
};
inline constexpr std::uint16_t kGoingAway = 1001;
inline constexpr std::uint16_t kUnsupportedData = 1003;
inline constexpr std::uint16_t kPolicyViolation = 1008;

inline constexpr double kMostRequests = 200.0;    // a second, and in one burst
inline constexpr std::size_t kMostRefusals = 32;  // that wait to be sent

class Viewer {
  public:
    /// Nothing to be done, a command for the run, or the end.
    using Heard = std::variant<std::monostate, Command, Closing>;

    /// `control`: may command.
    explicit Viewer(bool control) : control_(control) {}

    /// A whole text message came at `now_ns`.
    [[nodiscard]] Heard hear(std::string_view text, const SceneDescription& description, std::int64_t now_ns);

    /// Is told why what it asked for is not done.
    void refuse(const Refusal& refusal);

    /// Writes the next message to `message`; false, and `message` as it was, if there is none for now.
    [[nodiscard]] bool compose(const Shown& shown, std::int64_t now_ns, Outgoing& message);

    /// It has taken everything there was, a whole scene among it: another moment would be sent at once.
    [[nodiscard]] bool waits() const noexcept { return waits_; }
    /// It has been told that this is the end.
    [[nodiscard]] bool told_bye() const noexcept { return told_bye_; }
    [[nodiscard]] const Watch& watch() const noexcept { return watch_; }

  private:
    bool within_rate(std::int64_t now_ns) noexcept;
    [[nodiscard]] bool compose_notice(const Shown& shown, Outgoing& message);
    [[nodiscard]] bool compose_samples(const Shown& shown, std::int64_t now_ns, Outgoing& message);
    void compose_frame(const Shown& shown, Outgoing& message);

    bool control_ = false;
    Watch watch_;
    double allowance_ = kMostRequests;
    std::int64_t heard_ns_ = 0;
    std::deque<std::string> refusals_;

    // What it was sent of the scene.
    std::uint32_t scene_ = 0;
    std::uint32_t geometry_ = 0;
    std::uint64_t moments_ = 0;
    std::vector<std::uint64_t> surfaces_;   // versions, as EncodedMoment::surfaces
    std::vector<std::uint64_t> particles_;  // likewise
    bool samples_begun_ = false;            // since it watches them, in this scene
    std::uint64_t samples_ = 0;             // number of the next
    std::int64_t samples_ns_ = 0;
    std::uint64_t devices_ = 0;
    std::uint64_t records_ = 0;
    bool waits_ = false;
    bool told_bye_ = false;
};

}  // namespace haptic::sim::view
