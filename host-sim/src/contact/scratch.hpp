// Fixed-capacity array without initialisation: clearing 10 kB for each query would cost more than the query.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

namespace haptic::sim {

/// Elements have indeterminate values until they are assigned.
template <class T, std::size_t Capacity>
class Scratch {
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

  public:
    Scratch() noexcept {}  // NOLINT(modernize-use-equals-default): would be deleted

    [[nodiscard]] T& operator[](std::size_t k) noexcept { return items_[k]; }
    [[nodiscard]] const T& operator[](std::size_t k) const noexcept { return items_[k]; }
    [[nodiscard]] const T* data() const noexcept { return items_.data(); }

  private:
    union {
        std::array<T, Capacity> items_;
    };
};

}  // namespace haptic::sim
