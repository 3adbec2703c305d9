// State hash: a 64-bit fingerprint by which two runs are compared for bitwise equality.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace haptic::sim {

/// FNV-1a, 64 bits, over the bytes of the numbers in memory. -0 and 0 differ.
/// @source G. Fowler, L. Noll, K.-P. Vo, draft-eastlake-fnv
class StateHash {
  public:
    template <class T>
    void add(std::span<const T> values) noexcept {
        static_assert(std::is_trivially_copyable_v<T>);
        for (const T& value : values) {
            unsigned char bytes[sizeof(T)];
            std::memcpy(bytes, &value, sizeof(T));
            for (const unsigned char byte : bytes) {
                hash_ = (hash_ ^ byte) * 0x100000001b3u;
            }
        }
    }
    [[nodiscard]] std::uint64_t value() const noexcept { return hash_; }

  private:
    std::uint64_t hash_ = 0xcbf29ce484222325u;
};

}  // namespace haptic::sim
