// Cuts a byte stream, which arrives in pieces of any size, into messages.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace haptic::device {

class MessageStream {
  public:
    /// Takes bytes of the stream. `handle` is called with all bytes that follow the last message: it handles the first
    /// message of them and returns its length, or 0 if it is incomplete; it is called again for the rest. Complete
    /// messages are handled in place, without a copy; an incomplete one is kept until its rest arrives.
    template <class Handle>
    void receive(std::span<const std::byte> bytes, Handle handle) {
        const bool joined = !kept_.empty();
        if (joined) {
            kept_.insert(kept_.end(), bytes.begin(), bytes.end());
        }
        std::vector<std::byte> joined_bytes;
        joined_bytes.swap(kept_);
        std::span<const std::byte> rest = joined ? std::span<const std::byte>(joined_bytes) : bytes;
        while (!rest.empty()) {
            const std::size_t used = handle(rest);
            if (used == 0) {
                break;
            }
            rest = rest.subspan(used);
        }
        kept_.assign(rest.begin(), rest.end());
    }

  private:
    std::vector<std::byte> kept_;  // an incomplete message
};

}  // namespace haptic::device
