#include "reproduce/pop_out_table.hpp"

#include <array>
#include <cstddef>
#include <stdexcept>

namespace haptic::sim {

namespace {

constexpr std::array<int, 3> kTriangles{10, 20, 30};
constexpr std::array<int, 3> kIterations{10, 100, 1000};
constexpr std::array<std::array<double, 3>, 3> kThesis{{// ms
                                                        {0.01, 0.134, 0.989},
                                                        {0.018, 0.166, 1.533},
                                                        {0.028, 0.269, 2.234}}};
constexpr int kRepetitions = 10;
constexpr double kHalfSlitWidth = 0.9;    // of the radius
constexpr double kInRangeDistance = 1.6;  // of the radius: in range, not penetrated

}  // namespace

std::vector<InRangeTriangle> pop_out_table_triangles(int count) {
    constexpr double r = kPopOutTableRadius;
    std::vector<InRangeTriangle> triangles;
    for (int k = 0; k < count; ++k) {
        // Alternate between the two sides of the slit; `kind` selects face, edge, vertex or out of reach.
        const double side = k % 2 == 0 ? -1.0 : 1.0;
        const int kind = k / 2 % 4;
        const double x = side * (kind == 3 ? kInRangeDistance : kHalfSlitWidth) * r;
        const double beyond = x + side * r;
        TriangleCorners t;
        if (kind == 1) {
            t = {{x, 0.0, -r}, {x, 0.0, r}, {beyond, 0.0, 0.0}};  // edge first
        } else if (kind == 2) {
            t = {{x, 0.0, 0.0}, {beyond, 0.0, -r}, {beyond, 0.0, r}};  // corner first
        } else {
            t = {{x, -r, -r}, {x, -r, 2.0 * r}, {x, 2.0 * r, -r}};
        }
        triangles.push_back(in_range_triangle(t));
    }
    return triangles;
}

std::vector<PopOutTiming> measure_pop_out_table(std::int64_t (*clock)()) {
    std::vector<PopOutTiming> table;
    for (std::size_t row = 0; row < kTriangles.size(); ++row) {
        // Same triangles for all iteration limits of a row.
        const std::vector<InRangeTriangle> triangles = pop_out_table_triangles(kTriangles[row]);
        for (std::size_t column = 0; column < kIterations.size(); ++column) {
            ContactSettings settings;
            settings.pop_out_limit = kIterations[column];
            // One untimed run first, so that the first figure does not include cold caches.
            bool exhausted = !pop_out_of_list(triangles, Vec3(0.0), kPopOutTableRadius, settings).clear;
            const std::int64_t begin = clock();
            for (int k = 0; k < kRepetitions; ++k) {
                exhausted = exhausted && !pop_out_of_list(triangles, Vec3(0.0), kPopOutTableRadius, settings).clear;
            }
            const std::int64_t end = clock();
            if (!exhausted) {
                throw std::logic_error("pop-out table: the proxy got clear before the iteration limit");
            }
            table.push_back({kTriangles[row], kIterations[column],
                             1e-6 * static_cast<double>(end - begin) / kRepetitions, kThesis[row][column]});
        }
    }
    return table;
}

}  // namespace haptic::sim
