// A listening TCP socket.
#pragma once

#include <cstdint>
#include <string>

namespace haptic::sim::view {

/// Listens on a numeric address. The descriptor is the caller's, does not block, and does not outlive an exec. Throws
/// std::runtime_error that says what to do.
[[nodiscard]] int listen_on(const std::string& address, std::uint16_t port);

/// The port that a listening socket got.
[[nodiscard]] std::uint16_t port_of(int socket);

}  // namespace haptic::sim::view
