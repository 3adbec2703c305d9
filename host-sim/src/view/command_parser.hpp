// What a page says, from text (host-sim/page/PROTOCOL.md). Pure; believes nothing.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <variant>

#include "view/command.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

inline constexpr std::size_t kLongestRequest = 1024;  // bytes
/// How far an orientation may be from unit length. It is normalised.
inline constexpr double kUnitTolerance = 1e-3;

/// What a viewer wants to be sent beside the frames themselves.
struct Watch {
    bool particles = false;
    bool planes = false;
    bool samples = false;
};

/// Well-formed, but nothing that can be done here.
struct Refusal {
    std::string command;  // its type
    std::string why;
};

/// Not of the protocol. Whoever sent it is no page of ours.
struct Malformed {
    std::string why;  // at most 120 bytes: it fits into a close frame
};

using Request = std::variant<Watch, Command, Refusal, Malformed>;

/// Reads a message. Names and ranges are those of `description`.
[[nodiscard]] Request parse_request(std::string_view text, const SceneDescription& description);

/// What a command's message is called.
[[nodiscard]] std::string type_of(const Command& command);

/// The message "refused".
[[nodiscard]] std::string refused_message(const Refusal& refusal);

}  // namespace haptic::sim::view
