// Refit loop of refit.hpp with registers of `Width` numbers. Only one source file may instantiate each width (see
// lanes.hpp).
#pragma once

#include "simd/lanes.hpp"
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
