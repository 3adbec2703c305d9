// Deformation kernels of deformation.hpp for any number of lanes. Only the source file compiled for registers of that
// width may instantiate them (see lanes.hpp).
#pragma once

#include "simd/collider_lanes.hpp"
#include "simd/deformation.hpp"
#include "simd/lane_rows.hpp"
#include "simd/lanes.hpp"

namespace haptic::sim {

template <std::size_t Width>
class DeformationLanes {
  public:
    HAPTIC_LANES static void sum(const DeformationTask& task, const FloatRow* places, GroupPlaces* of_groups,
                                 DeformationSums& sums) noexcept {
        Real product[3][3][kParts] = {};
        Real place[3][kParts] = {};
        for (std::size_t g = 0; g < task.fitted_groups; ++g) {
            for (std::size_t p = 0; p < kParts; ++p) {
                const LaneVec<Real> from = reference(task.group[g], p);
                const LaneVec<Real> to = written(task.group[g], p, places, of_groups[g]);
                const Real number[3] = {to.x, to.y, to.z};
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    place[axis][p] += number[axis];
                    product[0][axis][p] += from.x * number[axis];
                    product[1][axis][p] += from.y * number[axis];
                    product[2][axis][p] += from.z * number[axis];
                }
            }
        }
        for (std::size_t g = task.fitted_groups; g < task.groups; ++g) {
            for (std::size_t p = 0; p < kParts; ++p) {
                written(task.group[g], p, places, of_groups[g]);
            }
        }
        const auto plus = [](auto a, auto b) __attribute__((always_inline)) { return a + b; };
        for (std::size_t axis = 0; axis < 3; ++axis) {
            sums.place[axis] = folded(place[axis], plus);
            for (std::size_t k = 0; k < 3; ++k) {
                sums.product[k][axis] = folded(product[k][axis], plus);
            }
        }
    }

    HAPTIC_LANES static ResidualExtremes find_residuals(const DeformationTask& task, const AffineMap& start_map,
                                                        const FloatRow* start, const AffineMap& end_map,
                                                        const GroupPlaces* end, float stretch, float limit,
                                                        float* residual) noexcept {
        const auto greater = [](auto a, auto b) __attribute__((always_inline)) { return max_of(a, b); };
        const auto smaller = [](auto a, auto b) __attribute__((always_inline)) { return min_of(a, b); };
        Real of_all[kParts] = {};
        Real of_near[kParts] = {};
        Real left[kParts];
        constexpr float none = std::numeric_limits<float>::infinity();
        for (Real& of_part : left) {
            of_part = broadcast<Real>(none);
        }
        ResidualExtremes extremes{};
        for (std::size_t g = 0; g < task.groups; ++g) {
            for (std::size_t p = 0; p < kParts; ++p) {
                const LaneVec<Real> from = reference(task.group[g], p);
                const float (&number)[3][kPointsInGroup] = end[g].number;
                const LaneVec<Real> to{load<Real>(number[0] + p * Width), load<Real>(number[1] + p * Width),
                                       load<Real>(number[2] + p * Width)};
                const Real before = square_off(start_map, from, gathered(task.group[g], p, start));
                const Real off = square_root(max_of(before, square_off(end_map, from, to)));
                store(off, residual + g * kPointsInGroup + p * Width);
                const Real distance = widened<Real>(task.group[g].distance + p * Width);
                of_all[p] = max_of(of_all[p], off);
                of_near[p] = max_of(of_near[p], select(distance <= limit, off, Real{}));
                left[p] = min_of(left[p], stretch * distance - off);
            }
            if (g + 1 == task.first_groups) {
                extremes.of_first = folded(of_all, greater);
            }
        }
        extremes.of_near = folded(of_near, greater);
        extremes.left = folded(left, smaller);
        return extremes;
    }

  private:
    using Real = typename LaneTypes<Width, float>::Real;
    static constexpr std::size_t kParts = kPointsInGroup / Width;

    template <class Lanes>
    HAPTIC_LANES static Lanes widened(const std::int16_t* from) noexcept {
        if constexpr (kLanes<Lanes> == 1) {
            return static_cast<float>(*from);
        } else {
            using Short [[gnu::vector_size(kLanes<Lanes> * sizeof(std::int16_t))]] = std::int16_t;
            Short numbers;
            __builtin_memcpy(&numbers, from, sizeof(numbers));
            return __builtin_convertvector(__builtin_convertvector(numbers, BitsOf<Lanes>), Lanes);
        }
    }

    HAPTIC_LANES static LaneVec<Real> reference(const PointGroup& group, std::size_t part) noexcept {
        const std::size_t at = part * Width;
        return {widened<Real>(group.number[0] + at), widened<Real>(group.number[1] + at),
                widened<Real>(group.number[2] + at)};
    }

    HAPTIC_LANES static LaneVec<Real> gathered(const PointGroup& group, std::size_t part,
                                               const FloatRow* places) noexcept {
        const std::uint32_t* const point = group.point + part * Width;
        return head(
            gather<Real>([&](std::size_t lane) __attribute__((always_inline)) { return places[point[lane]].number; }));
    }

    /// gathered(), and written where all points of its group are.
    HAPTIC_LANES static LaneVec<Real> written(const PointGroup& group, std::size_t part, const FloatRow* places,
                                              GroupPlaces& to) noexcept {
        const LaneVec<Real> at = gathered(group, part, places);
        store(at.x, to.number[0] + part * Width);
        store(at.y, to.number[1] + part * Width);
        store(at.z, to.number[2] + part * Width);
        return at;
    }

    /// m^2, of a point from where the map leads it.
    HAPTIC_LANES static Real square_off(const AffineMap& map, const LaneVec<Real>& from,
                                        const LaneVec<Real>& to) noexcept {
        const auto along = [&](std::size_t axis) __attribute__((always_inline)) {
            return map.origin[axis] + map.column[0][axis] * from.x + map.column[1][axis] * from.y +
                   map.column[2][axis] * from.z;
        };
        const LaneVec<Real> off = to - LaneVec<Real>{along(0), along(1), along(2)};
        return dot(off, off);
    }

    /// Sixteen numbers in one, the lower half with the upper, and so on.
    template <class Join>
    HAPTIC_LANES static float folded(const Real (&parts)[kParts], const Join& join) noexcept {
        Real joined[kParts];
        for (std::size_t p = 0; p < kParts; ++p) {
            joined[p] = parts[p];
        }
        for (std::size_t half = kParts / 2; half > 0; half /= 2) {
            for (std::size_t p = 0; p < half; ++p) {
                joined[p] = join(joined[p], joined[p + half]);
            }
        }
        return folded_lanes(joined[0], join);
    }
    template <class Lanes, class Join>
    HAPTIC_LANES static float folded_lanes(const Lanes& x, const Join& join) noexcept {
        if constexpr (kLanes<Lanes> == 1) {
            return x;
        } else {
            constexpr std::size_t half = kLanes<Lanes> / 2;
            if constexpr (half == 1) {
                return join(x[0], x[1]);
            } else {
                return [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline)) {
                    return folded_lanes(
                        join(__builtin_shufflevector(x, x, I...), __builtin_shufflevector(x, x, (I + half)...)), join);
                }(std::make_index_sequence<half>{});
            }
        }
    }
};

template <std::size_t Width>
void sum_deformation(const DeformationTask& task, const FloatRow* places, GroupPlaces* of_groups,
                     DeformationSums& sums) noexcept {
    DeformationLanes<Width>::sum(task, places, of_groups, sums);
}

template <std::size_t Width>
ResidualExtremes find_residuals(const DeformationTask& task, const AffineMap& start_map, const FloatRow* start,
                                const AffineMap& end_map, const GroupPlaces* end, float stretch, float limit,
                                float* residual) noexcept {
    return DeformationLanes<Width>::find_residuals(task, start_map, start, end_map, end, stretch, limit, residual);
}

/// Lanes of floats beside as many of doubles.
template <std::size_t Count>
inline constexpr std::size_t kFloatLanes = Count == 1 ? 1 : 2 * Count;

template <std::size_t Count>
inline constexpr DeformationKernels kDeformationKernels{Count, &sum_deformation<kFloatLanes<Count>>,
                                                        &find_residuals<kFloatLanes<Count>>};

}  // namespace haptic::sim
