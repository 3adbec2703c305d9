// Listening TCP socket.
#pragma once

#include <cstdint>
#include <string>

namespace haptic::sim::view {

/// Listens on a numeric address. The returned descriptor is non-blocking and close-on-exec; the caller owns it. Throws
/// std::runtime_error with advice.
[[nodiscard]] int listen_on(const std::string& address, std::uint16_t port);

/// The port that a listening socket is bound to.
[[nodiscard]] std::uint16_t port_of(int socket);

}  // namespace haptic::sim::view
