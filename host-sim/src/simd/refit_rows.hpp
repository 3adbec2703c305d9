// Refit loop of refit.hpp with registers of `Width` numbers. Only one source file may instantiate each width (see
// lanes.hpp).
#pragma once

#include "simd/lane_rows.hpp"
#include "simd/refit.hpp"

namespace haptic::sim {

template <std::size_t Width>
class RefitRows {
  public:
    HAPTIC_LANES static void run(const RefitTask& task) noexcept {
        // Four numbers cannot be read at the last vertex of the surface: leaves that contain it use a padded copy.
        const std::size_t last = task.vertices - 1;
        const double* start = task.start + 3 * last;
        const double* end = task.end + 3 * last;
        const double last_start[4] = {start[0], start[1], start[2], 0.0};
        const double last_end[4] = {end[0], end[1], end[2], 0.0};
        const auto any_vertex = [&](std::uint32_t v, const double*& s, const double*& e) {
            s = v == last ? last_start : task.start + 3 * std::size_t{v};
            e = v == last ? last_end : task.end + 3 * std::size_t{v};
        };
        const auto not_last = [&](std::uint32_t v, const double*& s, const double*& e) {
            s = task.start + 3 * std::size_t{v};
            e = task.end + 3 * std::size_t{v};
        };
        // Box of each leaf over both ends of the step, and the extremes of all displacements.
        Extremes displacement;
        for (std::size_t k = 0; k < task.leaves; ++k) {
            const LeafVertices& leaf = task.leaf[k];
            Extremes box;
            if (leaf.last != 0) {
                fit(task, leaf, any_vertex, box, displacement);
            } else {
                fit(task, leaf, not_last, box, displacement);
            }
            box.put(task.box[k]);
        }
        displacement.put(*task.displacement);
        // Bottom-up: a node's box is the union of its children.
        for (std::size_t index = task.nodes; index-- > 0;) {
            fit_node(task, task.node[index], task.node_box[index]);
        }
    }

  private:
    using Real = typename LaneTypes<Width>::Real;
    static constexpr std::size_t kParts = 4 / Width;  // registers per vertex

    struct Extremes {
        HAPTIC_LANES Extremes() noexcept {
            for (std::size_t p = 0; p < kParts; ++p) {
                low[p] = broadcast<Real>(__builtin_inf());
                high[p] = broadcast<Real>(-__builtin_inf());
            }
        }
        HAPTIC_LANES void add(std::size_t part, Real x, Real y) noexcept {
            const Real min = x < y ? x : y;
            const Real max = x > y ? x : y;
            low[part] = low[part] < min ? low[part] : min;
            high[part] = high[part] > max ? high[part] : max;
        }
        HAPTIC_LANES void put(PointExtremes& to) const noexcept {
            for (std::size_t p = 0; p < kParts; ++p) {
                store(low[p], to.low + p * Width);
                store(high[p], to.high + p * Width);
            }
        }
        Real low[kParts] = {};
        Real high[kParts] = {};
    };

    /// Writes the boxes of a node's children into it, and their union.
    HAPTIC_LANES static void fit_node(const RefitTask& task, SweptNode& node, PointExtremes& box) noexcept {
        Real low[kTreeWidth][kParts];
        Real high[kTreeWidth][kParts];
        Extremes all;
        for (std::size_t k = 0; k < kTreeWidth; ++k) {
            const std::uint32_t child = node.child[k];
            const PointExtremes* const of =
                (child & kLeafChild) != 0 ? task.box + (child & ~kLeafChild) : task.node_box + child;
            for (std::size_t p = 0; p < kParts; ++p) {
                // An empty slot holds nothing: its box begins after its end.
                low[k][p] = child == 0 ? broadcast<Real>(__builtin_inf()) : load<Real>(of->low + p * Width);
                high[k][p] = child == 0 ? broadcast<Real>(-__builtin_inf()) : load<Real>(of->high + p * Width);
                all.low[p] = all.low[p] < low[k][p] ? all.low[p] : low[k][p];
                all.high[p] = all.high[p] > high[k][p] ? all.high[p] : high[k][p];
            }
        }
        all.put(box);
        for (std::size_t k = 0; k < kTreeWidth; k += Width) {
            put_columns(low + k, node.low, k);
            for (std::size_t c = k; c < k + Width; ++c) {
                for (std::size_t p = 0; p < kParts; ++p) {
                    high[c][p] = -high[c][p];
                }
            }
            put_columns(high + k, node.minus_high, k);
        }
    }

    /// Writes x, y and z of as many boxes as a register has numbers, from slot `at` on.
    HAPTIC_LANES static void put_columns(const Real (*row)[kParts], double (&to)[3][kTreeWidth],
                                         std::size_t at) noexcept {
        if constexpr (Width == 4) {
            const LaneRow<Real> columns = transposed<Real>({row[0][0], row[1][0], row[2][0], row[3][0]});
            store(columns.a, to[0] + at);
            store(columns.b, to[1] + at);
            store(columns.c, to[2] + at);
        } else {
            store(__builtin_shufflevector(row[0][0], row[1][0], 0, 2), to[0] + at);
            store(__builtin_shufflevector(row[0][0], row[1][0], 1, 3), to[1] + at);
            store(__builtin_shufflevector(row[0][1], row[1][1], 0, 2), to[2] + at);
        }
    }

    template <class Find>
    HAPTIC_LANES static void fit(const RefitTask& task, const LeafVertices& leaf, const Find& find, Extremes& box,
                                 Extremes& displacement) noexcept {
        const double* s = nullptr;
        const double* e = nullptr;
        // Vertices that this leaf is the first to list also count for the displacement, so that each does once.
        for (std::uint32_t k = leaf.begin; k < leaf.shared; ++k) {
            find(task.order[k], s, e);
            for (std::size_t p = 0; p < kParts; ++p) {
                const Real from = load<Real>(s + p * Width);
                const Real to = load<Real>(e + p * Width);
                box.add(p, from, to);
                displacement.add(p, to - from, to - from);
            }
        }
        for (std::uint32_t k = leaf.shared; k < leaf.end; ++k) {
            find(task.order[k], s, e);
            for (std::size_t p = 0; p < kParts; ++p) {
                box.add(p, load<Real>(s + p * Width), load<Real>(e + p * Width));
            }
        }
    }
};

}  // namespace haptic::sim
