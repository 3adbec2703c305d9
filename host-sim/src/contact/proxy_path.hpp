// Proxy path: the piecewise linear path of a proxy's centre during one step. It certifies that no surface was crossed.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "haptic/types.hpp"

namespace haptic::sim {

/// Position of the centre at a time of the step. Between two knots the centre and all surfaces move linearly; between
/// two knots of equal time the surfaces rest.
struct PathKnot {
    double time = 0.0;   // in [0, 1]
    Vec3 position{0.0};  // m
};

/// Fixed memory for one proxy and one step. The contact code appends; the verification, which shares no code with it,
/// checks every piece. Any continuous path that crosses no surface proves that the centre changed side of none,
/// whatever computed it.
class ProxyPath {
  public:
    /// More than all moves of one step together: see ContactSettings.
    static constexpr std::size_t kCapacity = 1024;

    void restart(const Vec3& position) noexcept {
        count_ = 0;
        complete_ = true;
        append(0.0, position);
    }
    void append(double time, const Vec3& position) noexcept {
        if (count_ < kCapacity) {
            knots_[count_++] = {time, position};
        } else {
            complete_ = false;
        }
    }
    /// Drops all knots after the first `knots`, which the proxy did not follow.
    void rewind(std::size_t knots) noexcept { count_ = knots < count_ ? knots : count_; }
    [[nodiscard]] std::span<const PathKnot> knots() const noexcept { return {knots_.data(), count_}; }
    /// False once a knot was dropped for lack of space; the path then proves nothing.
    [[nodiscard]] bool complete() const noexcept { return complete_; }

  private:
    std::array<PathKnot, kCapacity> knots_{};
    std::size_t count_ = 0;
    bool complete_ = true;
};

}  // namespace haptic::sim
