#include "contact/leaf_boxes.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

namespace haptic::sim {

namespace {

using Lanes = PackedBox::Lanes;

// Relative margins. Single precision rounds by 6e-8 of a number; the double-precision tests of the contact code err by
// about a billionth of that. The test of the sphere subtracts, squares and adds.
constexpr double kMargin = 1e-6;
constexpr double kSphereMargin = 1e-5;
constexpr float kInfiniteFloat = std::numeric_limits<float>::infinity();

Lanes lanes_of(const Vec3& x, float fourth) noexcept {
    using Doubles = double __attribute__((vector_size(32)));
    const Doubles numbers{x.x, x.y, x.z, static_cast<double>(fourth)};
    return __builtin_convertvector(numbers, Lanes);
}

Lanes min_of(const Lanes& x, const Lanes& y) noexcept {
    return x < y ? x : y;
}

Lanes max_of(const Lanes& x, const Lanes& y) noexcept {
    return x > y ? x : y;
}

PackedBox union_of(const PackedBox& x, const PackedBox& y) noexcept {
    return {min_of(x.low, y.low), max_of(x.high, y.high)};
}

/// Boxes of a leaf's triangles at one end of the step.
void fit_boxes(const SweptTree& tree, std::uint32_t leaf, std::span<const Vec3> positions,
               Scratch<PackedBox, SweptTree::kMaxInLeaf>& boxes) noexcept {
    // Each vertex once, in single precision.
    Scratch<Lanes, 3 * SweptTree::kMaxInLeaf> vertex;
    const std::span<const std::uint32_t> vertices = tree.vertices_of(leaf);
    for (std::size_t k = 0; k < vertices.size(); ++k) {
        vertex[k] = lanes_of(positions[vertices[k]], 0.0f);
    }
    // Each triangle from its corners.
    const std::span<const SweptTree::LocalCorners> triangles = tree.corners_of(leaf);
    for (std::size_t k = 0; k < triangles.size(); ++k) {
        const Lanes a = vertex[triangles[k][0]];
        const Lanes b = vertex[triangles[k][1]];
        const Lanes c = vertex[triangles[k][2]];
        boxes[k] = {min_of(a, min_of(b, c)), max_of(a, max_of(b, c))};
    }
}

}  // namespace

SweptSphere::SweptSphere(const Vec3& from, const Vec3& to, double radius) noexcept
    : box(aabb_of_segment(from, to, radius)), center(0.5 * (from + to)) {
    const Vec3 half = to - center;
    bounding_radius = radius + std::sqrt(glm::dot(half, half));
}

BoxLimits::BoxLimits(const Aabb& box) noexcept {
    // The margin follows the coordinates, which bound the rounding errors. The unused lane always compares true.
    const Vec3 margin = glm::max(glm::abs(box.min), glm::abs(box.max)) * kMargin;
    low_ = lanes_of(box.min - margin, -kInfiniteFloat);
    high_ = lanes_of(box.max + margin, kInfiniteFloat);
}

SphereLimits::SphereLimits(const Aabb& box, const Aabb& centers, double radius) noexcept
    : box_(box), centers_{lanes_of(centers.min, 0.0f), lanes_of(centers.max, 0.0f)} {
    // Rounding errs by a share of the coordinates, squaring by a share of the radius.
    const Vec3 coordinates = glm::max(glm::abs(centers.min), glm::abs(centers.max));
    const double rounded = radius * (1.0 + kSphereMargin) + (coordinates.x + coordinates.y + coordinates.z) * kMargin;
    squared_radius_ = static_cast<float>(rounded * rounded);
}

SphereLimits::SphereLimits(const SweptSphere& sphere) noexcept
    : SphereLimits(sphere.box, {sphere.center, sphere.center}, sphere.bounding_radius) {}

SphereLimits::SphereLimits(const Aabb& centers, double radius) noexcept
    : SphereLimits({centers.min - Vec3(radius), centers.max + Vec3(radius)}, centers, radius) {}

LeafBoxes::LeafBoxes(const MovingSurface& surface, std::uint32_t leaf, QueryTime when) noexcept {
    const SweptTree& tree = *surface.tree;
    fit_boxes(tree, leaf, surface.motion.end, end_);
    if (when == QueryTime::WholeStep) {
        // Motion is linear: a box around both ends holds the triangle at every time between.
        fit_boxes(tree, leaf, surface.motion.start, whole_);
        for (std::size_t k = 0; k < tree.triangles_of(leaf).size(); ++k) {
            whole_[k] = union_of(whole_[k], end_[k]);
        }
    }
}

}  // namespace haptic::sim
