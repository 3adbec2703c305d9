// Kernel table: the long loops of the tick over rows and proxies, compiled once for each instruction set and chosen at
// run time.
//
// All entries give the same bits: contact_rows.hpp is compiled with other flags for each (shared/CMakeLists.txt), and
// each element is computed on its own, in the order of the source.
#pragma once

#include <cstddef>

#include "haptic/realtime.hpp"
#include "rendering/proxy_arrays.hpp"

namespace haptic {

/// A plane of each proxy at work.
struct PushingPlanes {
    const ProxyPlanes* planes;
    const double* force;  // m, l of each proxy
};

struct ContactKernels {
    /// y -= sum of factors[i] * rows[i], i < count; rows and y have `length` elements.
    void (*subtract_rows)(double* y, const double* factors, const double* const* rows, std::size_t count,
                          std::size_t length) HAPTIC_RT;
    /// rotated = R (v + factor w) of the first `count` vectors; `r` are the columns of R.
    void (*rotate)(const double* r, const ProxyVectors& v, double factor, const ProxyVectors& w, std::size_t count,
                   ProxyVectors& rotated) HAPTIC_RT;
    /// depth = offset + velocity * age_s - n . position.
    void (*find_depths)(const ProxyPlanes& planes, double age_s, const ProxyVectors& position, std::size_t count,
                        double* depth) HAPTIC_RT;
    /// pull += force * n; touches = 1 where a force is positive.
    void (*add_pull)(const PushingPlanes& pushing, std::size_t count, double* touches, ProxyVectors& pull) HAPTIC_RT;
    /// product = a x b.
    void (*cross)(const ProxyVectors& a, const ProxyVectors& b, std::size_t count, ProxyVectors& product) HAPTIC_RT;
    /// With p = force * (announced * velocity of the plane - n . rest): power += p, velocity += p n.
    void (*add_power)(const PushingPlanes& pushing, double announced, const ProxyVectors& rest, std::size_t count,
                      double* power, ProxyVectors& velocity) HAPTIC_RT;
    /// squares = max(squares, |d - elapsed_s * velocity * n|^2), where the plane pushes; where none does (touches is
    /// 0), where the plane exists.
    void (*relative_squares)(const PushingPlanes& pushing, double elapsed_s, const ProxyVectors& d,
                             const double* touches, std::size_t count, double* squares) HAPTIC_RT;
};

extern const ContactKernels kBaselineContactKernels;  // 128-bit registers: every x86-64 and aarch64
#if defined(__x86_64__)
extern const ContactKernels kAvx2ContactKernels;
#endif

/// The entry for the widest registers of this machine. Not for the tick: it may detect them.
[[nodiscard]] const ContactKernels& widest_contact_kernels() noexcept;

}  // namespace haptic
