// Non-blocking output to a stream socket.
#pragma once

#include <cstddef>
#include <vector>

namespace haptic::device {

/// Bytes; a client with more unread output is not read from until it has caught up.
inline constexpr std::size_t kMaxUnsent = 262144;
/// Bytes read from a client at once.
inline constexpr std::size_t kReadBytes = 65536;

/// Sends as much of the output as the socket accepts without blocking, and removes it. Returns 0, or the errno with
/// which the connection was lost.
[[nodiscard]] int send_some(int socket, std::vector<std::byte>& output);

}  // namespace haptic::device
