#include "served/socket_io.hpp"

#include <sys/socket.h>

#include <cerrno>

namespace haptic::device {

int send_some(int socket, std::vector<std::byte>& output) {
    std::size_t sent = 0;
    int error = 0;
    while (sent < output.size()) {
        const ssize_t count = send(socket, output.data() + sent, output.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (count >= 0) {
            sent += static_cast<std::size_t>(count);
        } else if (errno != EINTR) {
            error = errno == EAGAIN ? 0 : errno;
            break;
        }
    }
    output.erase(output.begin(), output.begin() + static_cast<std::ptrdiff_t>(sent));
    return error;
}

}  // namespace haptic::device
