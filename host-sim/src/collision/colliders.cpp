#include "collision/colliders.hpp"

#include <algorithm>

#include "dynamics/one_lane.hpp"

namespace haptic::sim {

Colliders::Colliders(const ParticleModel& model, const std::vector<ParticleRange>& bodies)
    : length_(model.size() + kMaxLanes), number_(collider_row::kCount * length_) {
    using namespace collider_row;
    collider_.reserve(model.size());
    for (std::uint32_t b = 0; b < bodies.size(); ++b) {
        for (std::size_t i = bodies[b].begin; i < bodies[b].end; ++i) {
            const Vec3& axes = model.semi_axes[i];
            const Quat& q = model.axes[i];
            const double size = (axes.x + axes.y + axes.z) / 3.0;
            const double reach = std::max({axes.x, axes.y, axes.z});
            collider_.push_back({size, reach, inverse_mass(model, i), b});
            set(kSemiAxes, i, {axes.x, axes.y, axes.z});
            set(kAxes, i, {q.w, q.x, q.y, q.z});
            set(kSize, i, {size, reach, reach - std::min({axes.x, axes.y, axes.z})});
        }
    }
}

void Colliders::set(std::size_t row, std::size_t particle, std::initializer_list<double> numbers) {
    for (const double number : numbers) {
        number_[row++ * length_ + particle] = number;
    }
}

LaneSymmetric<double> Colliders::shape(std::size_t particle) const noexcept {
    const auto number = [&](std::size_t k) { return at(collider_row::kShape + k, particle); };
    return {number(0), number(1), number(2), number(3), number(4), number(5)};
}

SeparatingPlane Colliders::fit_plane(std::uint32_t first, std::uint32_t second, const Vec3& from, const Vec3& to,
                                     const PushOut& push_out) const noexcept {
    const LaneSymmetric<double> of_first = shape(first);
    const LaneSymmetric<double> of_second = shape(second);
    const LaneVec<double> start = lane(from);
    // Normal of M where the path enters it (ellipsoids.hpp).
    const LaneVec<double> normal = lane_separating_normal(
        LaneSweep<double>{of_first, of_second, collider_[second].size / collider_[first].size, start, lane(to)});
    // Of an initial overlap as much is kept as `push_out` does not take.
    const double reach = lane_reach(of_first, normal) + lane_reach(of_second, normal);
    return {{normal.x, normal.y, normal.z}, reach + push_out.least_gap(dot(normal, start) - reach)};
}

Vec3 Colliders::farthest(std::uint32_t particle, const Vec3& normal) const noexcept {
    const LaneSymmetric<double> of = shape(particle);
    const LaneVec<double> along = lane(normal);
    const double reach = lane_reach(of, along);
    return reach > 0.0 ? plain(product(of, along) / reach) : Vec3(0.0);
}

}  // namespace haptic::sim
