// CCD queries: `host-sim query ccd` answers sphere-triangle queries, to check the method against independent data.
#pragma once

#include <cstddef>
#include <functional>
#include <iosfwd>

namespace haptic::sim {

/// Reads lines of 22 numbers `px,py,pz,r,a0x,a0y,a0z,b0...,c0...,a1...,b1...,c1...` (m): a static sphere, and a
/// triangle that moves linearly from index 0 at t = 0 to index 1 at t = 1. Blank lines and `#` comments are skipped.
/// Writes for each query `kind,t_touch,t_centre,nx,ny,nz,qx,qy,qz`; numbers in the shortest form that reads back to the
/// same bits, fields empty where they do not apply. A malformed line gives `line N: problem` on `errors` and no
/// answer; the rest is still answered.
/// `read` receives the bytes of the queries that have been answered so far.
/// @return exit status: 0, or 2 if a line was malformed
[[nodiscard]] int query_ccd(std::istream& queries, std::ostream& answers, std::ostream& errors,
                            const std::function<void(std::size_t bytes)>& read = {});

}  // namespace haptic::sim
