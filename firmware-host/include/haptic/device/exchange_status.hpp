// Outcome of talking to a board: the status of one exchange, and the exception of a board that cannot be started.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string_view>

namespace haptic::device {

/// Result of an exchange. Every value except Ok leaves the reading unchanged.
enum class ExchangeStatus : std::uint8_t {
    Ok,
    Timeout,       // no reply within the transport's time limit
    Short,         // reply has the wrong length
    Malformed,     // reply cannot be decoded
    Stale,         // reply belongs to an earlier command
    Stalled,       // endpoint refused the transfer
    Disconnected,  // device is gone
    Failed,        // bus lost a packet, or a part of one
};
inline constexpr std::size_t kExchangeStatuses = 8;

/// A short phrase for reports.
[[nodiscard]] std::string_view describe(ExchangeStatus status) noexcept;

/// A board could not be opened or started. what() says what is wrong and what to do about it.
class BoardError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

}  // namespace haptic::device
