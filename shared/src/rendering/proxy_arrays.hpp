// Values of all proxies of a frame, one array per coordinate: loops over them are several proxies wide.
#pragma once

#include <array>
#include <cstddef>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

/// A number per proxy.
using ProxyValues = std::array<double, kMaxProxies>;

/// A vector per proxy.
struct ProxyVectors {
    ProxyValues x{};
    ProxyValues y{};
    ProxyValues z{};

    [[nodiscard]] Vec3 at(std::size_t i) const HAPTIC_RT { return {x[i], y[i], z[i]}; }
    void set(std::size_t i, const Vec3& v) HAPTIC_RT {
        x[i] = v.x;
        y[i] = v.y;
        z[i] = v.z;
    }
};

/// One plane of each proxy.
struct ProxyPlanes {
    /// m, offset where a proxy has no such plane; its normal and velocity are 0. No position is behind it.
    static constexpr double kNone = -1e300;

    ProxyVectors normal;     // unit
    ProxyValues offset{};    // m, at the time of the frame
    ProxyValues velocity{};  // m/s
};

}  // namespace haptic
