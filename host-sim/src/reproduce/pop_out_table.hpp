// Timing of Algorithm 2 (thesis, figure 4.15) for given numbers of triangles in range and iterations.
//
// As in the thesis, the search for triangles in range is excluded, each figure is the mean of ten repetitions, and all
// branches of the algorithm are taken about equally often: a proxy in a slit that it cannot leave meets faces, edges
// and vertices on both sides in turn, and triangles in range that it does not penetrate. The thesis labels its times
// microseconds; 30,000 pops in 2.2 us would be 0.07 ns each, so they are read as milliseconds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "contact/thesis/thesis_pop_out.hpp"

namespace haptic::sim {

struct PopOutTiming {
    int triangles = 0;       // in range
    int iterations = 0;      // passes over the triangles; none was skipped
    double ms = 0.0;         // mean of the repetitions
    double thesis_ms = 0.0;  // on an Intel Core i5-4210U
};

/// Radius of the measured proxy, which is at the origin: that of the thesis' scene.
inline constexpr double kPopOutTableRadius = 0.03;  // m

/// `count` triangles around the proxy that it can never get clear of. Of each eight, two are met on a face, two on an
/// edge, two on a vertex, and two are in range but not penetrated.
[[nodiscard]] std::vector<InRangeTriangle> pop_out_table_triangles(int count);

/// Measures all nine figures of the table, row by row. `clock` returns monotonic nanoseconds.
[[nodiscard]] std::vector<PopOutTiming> measure_pop_out_table(std::int64_t (*clock)());

}  // namespace haptic::sim
