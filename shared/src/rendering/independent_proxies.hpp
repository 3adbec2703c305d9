// Normal forces of independent proxies: the contact problem (contact_problem.hpp) of each proxy of a limp tool, which
// has at most three rows, without friction.
//
// With w = W_rr, the same for all rows, and the coupling c_rs = W_rs / w of two planes, the forces solve A (w l) = b
// for the planes that push, where A has a diagonal of 1. There are eight sets of planes. The solution is the one in
// which each force and each distance to a plane that does not push is positive. Rounding can leave no such set, so the
// one is taken whose smallest of these numbers is the largest. All eight are computed, several proxies at a time. A set
// of three is solved by A = L D L^T, whose first two steps are those of planes 0 and 1 alone. A is positive definite,
// because c_rs is at most 1 - kSurfaceShare.
#pragma once

#include <array>
#include <cstddef>

#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "rendering/proxy_arrays.hpp"

namespace haptic {

class IndependentProxies {
  public:
    /// compliance: k W_rr of each row.
    void load(const std::array<ProxyPlanes, kMaxPlanes>& planes, std::size_t plane_count, std::size_t proxies,
              double compliance) HAPTIC_RT;

    /// k W_rr of each row.
    [[nodiscard]] double compliance() const HAPTIC_RT { return compliance_; }

    /// Forces per stiffness (m) for the depths (m), both per plane and proxy; 0 for planes that do not push. Depths
    /// that are not finite make no sense of the forces of their proxy.
    void solve(const std::array<ProxyValues, kMaxPlanes>& depth,
               std::array<ProxyValues, kMaxPlanes>& force) const HAPTIC_RT;

  private:
    std::size_t proxies_ = 0;
    std::size_t plane_count_ = 0;
    double compliance_ = 1.0;
    // c_rs, and 1 / (1 - c_rs^2): of planes 0 and 1, 0 and 2, 1 and 2.
    std::array<ProxyValues, kMaxPlanes> coupling_{};
    std::array<ProxyValues, kMaxPlanes> inverse_pivot_{};
    // Of all three: element (2, 1) of L, and the inverse of the last element of D.
    ProxyValues lower_{};
    ProxyValues inverse_last_pivot_{};
};

}  // namespace haptic
