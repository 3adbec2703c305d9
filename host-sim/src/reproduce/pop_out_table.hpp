// The thesis' figure 4.15 again: how long Algorithm 2 takes for so many triangles in range and so many iterations.
//
// As there, the search for triangles in range is left out, each figure is the mean of ten repetitions, and all branches
// of the algorithm are taken about equally often: a proxy in a slit that it cannot leave meets faces, edges and
// vertices on both sides by turns, and triangles that are in range but not penetrated. The thesis prints its times as
// microseconds; 30,000 pops in 2.2 us would be 0.07 ns each, so they are read as milliseconds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "contact/thesis/thesis_pop_out.hpp"

namespace haptic::sim {

struct PopOutTiming {
    int triangles = 0;       // in range
    int iterations = 0;      // passes over them, all of which were made
    double ms = 0.0;         // mean of the repetitions
    double thesis_ms = 0.0;  // on an Intel Core i5-4210U
};

/// The proxy of the measurement: at the origin, with the radius of the thesis' scene.
inline constexpr double kPopOutTableRadius = 0.03;  // m

/// `count` triangles about it that it is never clear of: of each eight, two are met on a face, two on an edge, two on a
/// vertex, and two are in range but too far away.
[[nodiscard]] std::vector<InRangeTriangle> pop_out_table_triangles(int count);

/// All nine figures of the table, row by row. `clock` gives monotonic nanoseconds.
[[nodiscard]] std::vector<PopOutTiming> measure_pop_out_table(std::int64_t (*clock)());

}  // namespace haptic::sim
