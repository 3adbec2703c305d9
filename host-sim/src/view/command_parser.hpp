// Parser of the page's requests (host-sim/page/PROTOCOL.md). Pure functions; the input is untrusted.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <variant>

#include "view/command.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

inline constexpr std::size_t kMaxRequestBytes = 1024;
/// Tolerance on the length of an orientation, which is then normalised.
inline constexpr double kUnitTolerance = 1e-3;

/// The optional streams that a viewer has subscribed to.
struct Watch {
    bool particles = false;
    bool planes = false;
    bool samples = false;
};

/// A well-formed request that is not allowed or not possible now.
struct Refusal {
    std::string command;  // its message type
    std::string why;
};

/// A message outside the protocol. Its sender is disconnected.
struct Malformed {
    std::string why;  // at most 120 bytes, to fit into a close frame
};

using Request = std::variant<Watch, Command, Refusal, Malformed>;

/// Parses a message. Names and ranges are checked against `description`.
[[nodiscard]] Request parse_request(std::string_view text, const SceneDescription& description);

/// The message type of a command.
[[nodiscard]] std::string type_of(const Command& command);

/// The message "refused".
[[nodiscard]] std::string refused_message(const Refusal& refusal);

}  // namespace haptic::sim::view
