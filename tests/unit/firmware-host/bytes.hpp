// Packets as hexadecimal text, for tests.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <vector>

namespace haptic::device::test {

using Bytes = std::vector<std::byte>;

/// The bytes, zero-padded to a length.
inline Bytes bytes(std::initializer_list<int> values, std::size_t length = 0) {
    Bytes result;
    result.reserve(values.size());
    for (const int value : values) {
        result.push_back(static_cast<std::byte>(value));
    }
    if (length > result.size()) {
        result.resize(length);
    }
    return result;
}

template <typename Container>
Bytes bytes_of(const Container& container) {
    return Bytes(container.begin(), container.end());
}

}  // namespace haptic::device::test
