// Includes nothing of the code that keeps surfaces apart, so that the count cannot share its mistakes.
#include "verification/surface_crossings.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>

namespace haptic::sim {

namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kUnitsInTheLastPlace = 16.0;  // of the largest coordinate: rounding of a simulated state
constexpr double kVolumeRounding = 16.0;       // units in the last place of the product of three lengths
// Upper bound of the size below which a volume may be zero, over rounding and the square of the longest length from one
// corner: the doubled areas of four faces are at most 6 such squares, and the rounding of the volume less than 4.
constexpr double kCertainFactor = 10.0;
constexpr std::size_t kMostInFan = 64;  // faces: the time to order them grows with the square
constexpr double kFlat = 1e-12;         // of squares: below it directions count as opposed, and spokes as parallel
constexpr std::size_t kUsual = 256;     // crossings, of a skin that overlaps itself a little
constexpr double kCertainlyZero = 0.5;  // of the square below which Plane::side() is 0: the rest is for rounding

std::array<std::uint32_t, 3> sorted_corners(std::array<std::uint32_t, 3> corner) {
    std::sort(corner.begin(), corner.end());
    return corner;
}

bool shares_a_vertex(const std::array<std::uint32_t, 3>& corner, std::uint32_t p, std::uint32_t q) {
    return corner[0] == p || corner[1] == p || corner[2] == p || corner[0] == q || corner[1] == q || corner[2] == q;
}

int common_vertices(const std::array<std::uint32_t, 3>& a, const std::array<std::uint32_t, 3>& b) {
    int common = 0;
    for (const std::uint32_t vertex : a) {
        common += vertex == b[0] || vertex == b[1] || vertex == b[2] ? 1 : 0;
    }
    return common;
}

constexpr float kFar = std::numeric_limits<float>::max();
constexpr float kRoundingOfFloats = std::numeric_limits<float>::epsilon();  // more than rounding takes from one

float rounded_down(double x) {
    const auto y = static_cast<float>(std::clamp(x, -static_cast<double>(kFar), static_cast<double>(kFar)));
    return y - std::abs(y) * kRoundingOfFloats - std::numeric_limits<float>::min();
}
float rounded_up(double x) {
    return -rounded_down(-x);
}

struct Bounds {
    Vec3 low;
    Vec3 high;
};

/// Box of a triangle, widened by rounding.
Bounds bounds_of(const std::array<std::uint32_t, 3>& corner, std::span<const Vec3> vertices, double rounding) {
    const Vec3& a = vertices[corner[0]];
    const Vec3& b = vertices[corner[1]];
    const Vec3& c = vertices[corner[2]];
    return {glm::min(a, glm::min(b, c)) - rounding, glm::max(a, glm::max(b, c)) + rounding};
}

/// The bits of all four lanes together.
template <class Lanes>
std::uint32_t joined(const Lanes& lanes) {
    std::uint64_t halves[2];
    __builtin_memcpy(halves, &lanes, sizeof halves);
    const std::uint64_t both = halves[0] | halves[1];
    return static_cast<std::uint32_t>(both | both >> 32U);
}

/// One branch for all axes: each alone would be mispredicted often.
bool boxes_meet(const Bounds& a, const Bounds& b) {
    const bool along_x = (a.low.x <= b.high.x) & (a.high.x >= b.low.x);
    const bool along_y = (a.low.y <= b.high.y) & (a.high.y >= b.low.y);
    const bool along_z = (a.low.z <= b.high.z) & (a.high.z >= b.low.z);
    return along_x & along_y & along_z;
}

/// Plane through three points.
class Plane {
  public:
    Plane(const Vec3& a, const Vec3& b, const Vec3& c)
        : origin_(a), u_(b - a), v_(c - a), normal_(glm::cross(u_, v_)), u2_(glm::dot(u_, u_)), v2_(glm::dot(v_, v_)) {}

    /// Volume of the tetrahedron with x, times 6: normal . (x - a).
    [[nodiscard]] double volume(const Vec3& x) const { return glm::dot(normal_, x - origin_); }

    /// Sign of the volume; 0 if moving the four corners by `rounding` could change it: by as much times the doubled
    /// areas of the faces, plus the rounding of the volume itself.
    [[nodiscard]] int side(const Vec3& x, double rounding) const {
        const Vec3 w = x - origin_;
        const double w2 = glm::dot(w, w);
        const double volume = glm::dot(normal_, w);
        const int sign = volume > 0.0 ? 1 : -1;
        // Most are certain by an upper or a lower bound of the areas.
        if (std::abs(volume) > kCertainFactor * rounding * std::max({u2_, v2_, w2})) {
            return sign;
        }
        if (volume * volume <= rounding * rounding * glm::dot(normal_, normal_)) {
            return 0;
        }
        const double areas = glm::length(normal_) + glm::length(glm::cross(v_, w)) + glm::length(glm::cross(w, u_)) +
                             glm::length(glm::cross(v_ - u_, w - u_));
        const double zero = rounding * areas + kVolumeRounding * kEpsilon * std::sqrt(u2_ * v2_ * w2);
        return std::abs(volume) > zero ? sign : 0;
    }

  private:
    Vec3 origin_;
    Vec3 u_;
    Vec3 v_;
    Vec3 normal_;
    double u2_;
    double v2_;
};

}  // namespace

SurfaceCrossings::SurfaceCrossings(std::span<const CheckedSurface> surfaces, std::span<const Vec3> vertices) {
    for (std::uint32_t object = 0; object < surfaces.size(); ++object) {
        // Each set of corners once: the first triangle that has it.
        const CheckedSurface& surface = surfaces[object];
        const auto first_face = static_cast<std::uint32_t>(faces_.size());
        const auto offset = static_cast<std::uint32_t>(surface.first_vertex);
        first_vertex_.push_back(offset);
        for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
            const std::array<std::uint32_t, 3>& corner = surface.triangles[t];
            if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) {
                continue;
            }
            faces_.push_back({{offset + corner[0], offset + corner[1], offset + corner[2]}, object, t, 0});
        }
        const auto begin = faces_.begin() + first_face;
        std::sort(begin, faces_.end(), [](const Face& a, const Face& b) {
            return std::tuple(sorted_corners(a.corner), a.triangle) < std::tuple(sorted_corners(b.corner), b.triangle);
        });
        faces_.erase(std::unique(begin, faces_.end(),
                                 [](const Face& a, const Face& b) {
                                     return sorted_corners(a.corner) == sorted_corners(b.corner);
                                 }),
                     faces_.end());
        // The tree puts them into the order of its leaves.
        if (const auto count = static_cast<std::uint32_t>(faces_.size()) - first_face; count > 0) {
            roots_.push_back(build(vertices, first_face, count));
        }
    }
    give_edges_to_faces();
    order_fans(vertices.size());
    planes_.resize(faces_.size());
    // More allocate.
    make_room(kUsual);
}

/// Builds the tree of some faces by halving them along the longest extent of their centres. Returns its root.
std::uint32_t SurfaceCrossings::build(std::span<const Vec3> vertices, std::uint32_t first, std::uint32_t count) {
    const auto root = static_cast<std::uint32_t>(nodes_.size());
    nodes_.push_back(Node{.box = {}, .first = first, .count = count, .right = 0, .leaf = 0});
    if (is_leaf(nodes_[root])) {
        nodes_[root].leaf = static_cast<std::uint32_t>(leaves_.size());
        Leaf& leaf = leaves_.emplace_back();
        for (std::uint32_t f = 0; f < count; ++f) {
            for (std::size_t k = 0; k < 3; ++k) {
                leaf.corner[f / kLanes][k][f % kLanes] = faces_[first + f].corner[k];
            }
        }
        return root;
    }
    const auto centre = [&](const Face& face) {
        return vertices[face.corner[0]] + vertices[face.corner[1]] + vertices[face.corner[2]];
    };
    const auto begin = faces_.begin() + first;
    Vec3 low = centre(*begin);
    Vec3 high = low;
    for (auto face = begin; face != begin + count; ++face) {
        low = glm::min(low, centre(*face));
        high = glm::max(high, centre(*face));
    }
    const Vec3 extent = high - low;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : (extent.y >= extent.z ? 1 : 2);
    const std::uint32_t half = count / 2;
    std::nth_element(begin, begin + half, begin + count, [&](const Face& a, const Face& b) {
        return std::tuple(centre(a)[axis], a.triangle) < std::tuple(centre(b)[axis], b.triangle);
    });
    build(vertices, first, half);
    const std::uint32_t right = build(vertices, first + half, count - half);
    nodes_[root].right = right;
    return root;
}

/// Lets one face of each edge test it.
void SurfaceCrossings::give_edges_to_faces() {
    struct OwnedEdge {
        std::uint32_t low, high, face, k;
    };
    std::vector<OwnedEdge> edges;
    edges.reserve(3 * faces_.size());
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
        for (std::uint32_t k = 0; k < 3; ++k) {
            const auto [low, high] = std::minmax(faces_[f].corner[k], faces_[f].corner[(k + 1) % 3]);
            edges.push_back({low, high, f, k});
        }
    }
    std::sort(edges.begin(), edges.end(), [](const OwnedEdge& a, const OwnedEdge& b) {
        return std::tie(a.low, a.high, a.face) < std::tie(b.low, b.high, b.face);
    });
    for (std::size_t e = 0; e < edges.size(); ++e) {
        if (e == 0 || edges[e].low != edges[e - 1].low || edges[e].high != edges[e - 1].high) {
            faces_[edges[e].face].own_edges |= 1u << edges[e].k;
        }
    }
}

void SurfaceCrossings::order_fans(std::size_t vertices) {
    // The faces at each vertex, counted and then put in.
    first_around_.assign(vertices + 1, 0);
    for (const Face& face : faces_) {
        for (const std::uint32_t v : face.corner) {
            ++first_around_[v + 1];
        }
    }
    std::partial_sum(first_around_.begin(), first_around_.end(), first_around_.begin());
    around_.resize(first_around_.back());
    std::vector<std::uint32_t> next(first_around_.begin(), first_around_.end() - 1);
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
        for (const std::uint32_t v : faces_[f].corner) {
            around_[next[v]++] = f;
        }
    }
    fans_.resize(vertices);
    flat_.resize(vertices);
    for (std::uint32_t v = 0; v < vertices; ++v) {
        order_fan(v);
    }
}

std::span<const std::uint32_t> SurfaceCrossings::faces_around(std::uint32_t vertex) const {
    return std::span(around_).subspan(first_around_[vertex], first_around_[vertex + 1] - first_around_[vertex]);
}

/// Orders the faces around a vertex, from one border of the surface to the other one if there are two.
void SurfaceCrossings::order_fan(std::uint32_t vertex) {
    const std::span<const std::uint32_t> at_vertex = faces_around(vertex);
    if (at_vertex.size() > kMostInFan) {
        return;
    }
    std::vector<std::uint32_t> around(at_vertex.begin(), at_vertex.end());
    // The corner of a face after or before the vertex.
    const auto corner_of = [&](std::uint32_t face, std::size_t offset) {
        const auto& corner = faces_[face].corner;
        const auto at = static_cast<std::size_t>(std::ranges::find(corner, vertex) - corner.begin());
        return corner[(at + offset) % 3];
    };
    const auto has = [&](std::uint32_t face, std::uint32_t v) {
        return std::ranges::find(faces_[face].corner, v) != faces_[face].corner.end();
    };
    const auto faces_at = [&](std::uint32_t spoke) {
        return std::ranges::count_if(around, [&](std::uint32_t face) { return has(face, spoke); });
    };
    // Each spoke belongs to two faces, or to one at a border.
    std::uint32_t start = around.empty() ? vertex : corner_of(around[0], 1);
    for (const std::uint32_t face : around) {
        for (const std::size_t offset : {std::size_t{1}, std::size_t{2}}) {
            const std::uint32_t spoke = corner_of(face, offset);
            const auto faces = faces_at(spoke);
            if (faces > 2) {
                return;
            }
            start = faces == 1 ? spoke : start;
        }
    }
    Fan fan{.first = static_cast<std::uint32_t>(spokes_.size()), .count = 0, .closed = false};
    std::uint32_t spoke = start;
    while (!around.empty()) {
        const auto next = std::ranges::find_if(around, [&](std::uint32_t face) { return has(face, spoke); });
        if (next == around.end()) {  // several fans meet in the vertex
            spokes_.resize(fan.first);
            return;
        }
        const bool forward = corner_of(*next, 1) == spoke;
        spokes_.push_back({spoke, *next, forward ? 1.0 : -1.0});
        spoke = corner_of(*next, forward ? 2 : 1);
        around.erase(next);
    }
    spokes_.push_back({spoke, 0, 0.0});
    fan.closed = spoke == start;
    fan.count = static_cast<std::uint32_t>(spokes_.size()) - fan.first;
    fans_[vertex] = fan;
}

/// Whether the faces around a vertex all look to the side of their mean normal, and go around it once at most.
bool SurfaceCrossings::lies_flat(std::uint32_t vertex) const {
    const Fan& fan = fans_[vertex];
    if (fan.count < 2) {
        return false;
    }
    const std::span<const Spoke> spokes = std::span(spokes_).subspan(fan.first, fan.count);
    Vec3 normal(0.0);
    for (const Spoke& spoke : spokes.first(fan.count - 1)) {
        normal += spoke.sense * planes_[spoke.face].normal;
    }
    const double square = glm::dot(normal, normal);
    // Seen along it, spokes turn to one side, each by less than half a turn. They pass the first one when they come
    // from beyond it.
    const Vec3 middle = vertices_[vertex];
    const Vec3 first = vertices_[spokes[0].vertex] - middle;
    const Vec3 beside = glm::cross(normal, first);
    bool was_beyond = false;
    int turns = 0;
    Vec3 last = first;
    for (std::size_t k = 1; k < spokes.size(); ++k) {
        const Vec3& own = planes_[spokes[k - 1].face].normal;
        const double along = spokes[k - 1].sense * glm::dot(own, normal);
        const double own_square = glm::dot(own, own);
        const Vec3 next = vertices_[spokes[k].vertex] - middle;
        if (!(along > 0.0 && along * along > kFlat * own_square * square &&
              own_square > kFlat * glm::dot(last, last) * glm::dot(next, next))) {
            return false;
        }
        const bool back = fan.closed && k + 1 == spokes.size();
        const bool is_beyond = !back && glm::dot(next, beside) < 0.0;
        turns += was_beyond && !is_beyond ? 1 : 0;
        was_beyond = is_beyond;
        last = next;
    }
    return turns == (fan.closed ? 1 : 0);
}

void SurfaceCrossings::make_room(std::size_t crossings) {
    found_.reserve(crossings);
    touches_.reserve(crossings);
}

std::span<const SurfaceCrossing> SurfaceCrossings::find(std::span<const Vec3> vertices, double rounding,
                                                        std::uint64_t max_tests) {
    vertices_ = vertices;
    rounding_ = rounding;
    tests_left_ = max_tests;
    found_.clear();
    touches_.clear();
    fit();
    // Of what is not a number, no test says anything.
    if (!std::isfinite(sum_of_offsets_)) {
        tests_left_ = 0;
        return {};
    }
    // Faces that share a vertex, then the others of each surface, and of each two surfaces.
    for (std::uint32_t v = 0; v < fans_.size() && tests_left_ > 0; ++v) {
        if (flat_[v] == 0) {
            test_around(v);
        }
    }
    for (std::size_t a = 0; a < roots_.size() && tests_left_ > 0; ++a) {
        visit_within(roots_[a]);
        for (std::size_t b = a + 1; b < roots_.size(); ++b) {
            visit_between(roots_[a], roots_[b]);
        }
    }
    add_touches_that_cross();
    std::sort(found_.begin(), found_.end(), [](const SurfaceCrossing& a, const SurfaceCrossing& b) {
        return std::tie(a.edge_object, a.edge, a.object, a.triangle) <
               std::tie(b.edge_object, b.edge, b.object, b.triangle);
    });
    return found_;
}

/// Fits planes and boxes to the state, and looks where faces lie side by side.
void SurfaceCrossings::fit() {
    sum_of_offsets_ = 0.0;
    // Children come after their parents.
    for (std::size_t n = nodes_.size(); n-- > 0;) {
        Node& node = nodes_[n];
        if (is_leaf(node)) {
            fit_leaf(node);
        } else {
            const RoundBox& left = nodes_[n + 1].box;
            const RoundBox& right = nodes_[node.right].box;
            node.box = {left.low < right.low ? left.low : right.low, left.high > right.high ? left.high : right.high};
        }
    }
    for (std::uint32_t v = 0; v < fans_.size(); ++v) {
        flat_[v] = lies_flat(v) ? 1 : 0;
    }
}

/// The boxes of a leaf and of its faces, widened by rounding, and the planes of these.
void SurfaceCrossings::fit_leaf(Node& node) {
    Leaf& leaf = leaves_[node.leaf];
    node.box = {Four{} + kFar, Four{} - kFar};
    for (std::uint32_t f = 0; f < node.count; ++f) {
        const std::array<std::uint32_t, 3>& corner = faces_[node.first + f].corner;
        const Bounds bounds = bounds_of(corner, vertices_, rounding_);
        RoundBox box{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            box.low[axis] = rounded_down(bounds.low[static_cast<int>(axis)]);
            box.high[axis] = rounded_up(bounds.high[static_cast<int>(axis)]);
            leaf.low[f / kLanes][axis][f % kLanes] = box.low[axis];
            leaf.high[f / kLanes][axis][f % kLanes] = box.high[axis];
        }
        node.box.low = box.low < node.box.low ? box.low : node.box.low;
        node.box.high = box.high > node.box.high ? box.high : node.box.high;
        const Vec3& a = vertices_[corner[0]];
        const Vec3 normal = glm::cross(vertices_[corner[1]] - a, vertices_[corner[2]] - a);
        planes_[node.first + f] = {normal, glm::dot(normal, a), glm::length(bounds.high - bounds.low)};
        sum_of_offsets_ += planes_[node.first + f].offset;
    }
}

bool SurfaceCrossings::meet(const RoundBox& a, const RoundBox& b) {
    const auto in_order = (a.low <= b.high) & (b.low <= a.high);
    std::uint64_t bits[2];
    __builtin_memcpy(bits, &in_order, sizeof bits);
    return (bits[0] & bits[1]) == ~std::uint64_t{0};
}

SurfaceCrossings::RoundBox SurfaceCrossings::box_of(const Leaf& leaf, std::uint32_t face) {
    const auto& low = leaf.low[face / kLanes];
    const auto& high = leaf.high[face / kLanes];
    const std::uint32_t lane = face % kLanes;
    return {Four{low[0][lane], low[1][lane], low[2][lane], 0.0F},
            Four{high[0][lane], high[1][lane], high[2][lane], 0.0F}};
}

SurfaceCrossings::LeafMask SurfaceCrossings::faces_that_meet(const Leaf& leaf, const RoundBox& box) {
    FourPlaces bits{};
    for (std::uint32_t row = 0; row < kRows; ++row) {
        auto meet = (leaf.low[row][0] <= box.high[0]) & (leaf.high[row][0] >= box.low[0]);
        for (std::size_t axis = 1; axis < 3; ++axis) {
            meet &= (leaf.low[row][axis] <= box.high[axis]) & (leaf.high[row][axis] >= box.low[axis]);
        }
        bits |= __builtin_bit_cast(FourPlaces, meet) & (kLaneBits << (row * kLanes));
    }
    return joined(bits);
}

SurfaceCrossings::LeafMask SurfaceCrossings::faces_at_vertices_of(const Leaf& leaf, const Face& face) {
    FourPlaces bits{};
    for (std::uint32_t row = 0; row < kRows; ++row) {
        auto shares = leaf.corner[row][0] == face.corner[0];
        for (const FourPlaces& corner : leaf.corner[row]) {
            shares |= (corner == face.corner[0]) | (corner == face.corner[1]) | (corner == face.corner[2]);
        }
        bits |= __builtin_bit_cast(FourPlaces, shares) & (kLaneBits << (row * kLanes));
    }
    return joined(bits);
}

/// Tests the faces of a subtree with one another.
void SurfaceCrossings::visit_within(std::uint32_t index) {
    const Node& node = nodes_[index];
    if (is_leaf(node)) {
        visit_leaves(node, node);
        return;
    }
    visit_within(index + 1);
    visit_within(node.right);
    visit_between(index + 1, node.right);
}

/// Tests the faces of one subtree with those of another.
void SurfaceCrossings::visit_between(std::uint32_t a, std::uint32_t b) {
    const Node& one = nodes_[a];
    const Node& other = nodes_[b];
    if (tests_left_ == 0 || !meet(one.box, other.box)) {
        return;
    }
    --tests_left_;
    // Descend into the larger one.
    if (!is_leaf(one) && one.count >= other.count) {
        visit_between(a + 1, b);
        visit_between(one.right, b);
    } else if (!is_leaf(other)) {
        visit_between(a, b + 1);
        visit_between(a, other.right);
    } else {
        visit_leaves(one, other);
    }
}

/// Tests the faces of one leaf with those of another, or of the same one, that share no vertex with them.
void SurfaceCrossings::visit_leaves(const Node& one, const Node& other) {
    const Leaf& rows = leaves_[one.leaf];
    const Leaf& columns = leaves_[other.leaf];
    const auto faces_of = [](const Node& node) { return (LeafMask{1} << node.count) - 1; };
    for (LeafMask left = faces_that_meet(rows, other.box) & faces_of(one); left != 0; left &= left - 1) {
        const auto f = static_cast<std::uint32_t>(std::countr_zero(left));
        LeafMask pairs = faces_that_meet(columns, box_of(rows, f)) & faces_of(other);
        if (one.leaf == other.leaf) {
            pairs &= ~LeafMask{0} << (f + 1);  // each pair once
        }
        if (pairs == 0) {
            continue;
        }
        for (pairs &= ~faces_at_vertices_of(columns, faces_[one.first + f]); pairs != 0; pairs &= pairs - 1) {
            test_faces(one.first + f, other.first + static_cast<std::uint32_t>(std::countr_zero(pairs)));
        }
    }
}

/// Tests those faces with one another that have this vertex in common and no other one: neighbours at an edge have no
/// edges without a common vertex.
void SurfaceCrossings::test_around(std::uint32_t vertex) {
    const std::span<const std::uint32_t> around = faces_around(vertex);
    for (std::size_t a = 0; a < around.size() && tests_left_ > 0; ++a) {
        for (std::size_t b = a + 1; b < around.size() && tests_left_ > 0; ++b) {
            --tests_left_;
            if (common_vertices(faces_[around[a]].corner, faces_[around[b]].corner) == 1) {
                test_faces(around[a], around[b]);
            }
        }
    }
}

void SurfaceCrossings::test_faces(std::uint32_t a, std::uint32_t b) {
    if (tests_left_ == 0) {
        return;
    }
    --tests_left_;
    // A face on one side of the other's plane meets it at most in their common vertex; the edges of one in that plane
    // do not pierce it.
    const Face& one = faces_[a];
    const Face& other = faces_[b];
    const double extent = planes_[a].extent + planes_[b].extent;
    const PlaneSide side_of_one = side_of(one, other, planes_[b], extent);
    if (side_of_one == PlaneSide::Beyond) {
        return;
    }
    const PlaneSide side_of_other = side_of(other, one, planes_[a], extent);
    if (side_of_other == PlaneSide::Beyond) {
        return;
    }
    if (side_of_one != PlaneSide::Within) {
        test_edges(one, other);
    }
    if (side_of_other != PlaneSide::Within) {
        test_edges(other, one);
    }
}

/// Where the corners of a face certainly are with respect to the plane of another face, `of`; common ones do not count.
/// `extent`, m: of both faces together, whose boxes meet.
SurfaceCrossings::PlaneSide SurfaceCrossings::side_of(const Face& face, const Face& of, const FacePlane& plane,
                                                      double extent) const {
    const double not_zero = kCertainFactor * rounding_ * extent * extent;
    const double zero2 = kCertainlyZero * rounding_ * rounding_ * glm::dot(plane.normal, plane.normal);
    bool above = true;
    bool below = true;
    bool within = true;
    for (const std::uint32_t corner : face.corner) {
        if (corner == of.corner[0] || corner == of.corner[1] || corner == of.corner[2]) {
            continue;
        }
        const double volume = glm::dot(plane.normal, vertices_[corner]) - plane.offset;
        above &= volume > not_zero;
        below &= volume < -not_zero;
        within &= volume * volume <= zero2;
    }
    if (above || below) {
        return PlaneSide::Beyond;
    }
    return within ? PlaneSide::Within : PlaneSide::Unknown;
}

/// Tests the edges that `of` has to test with a face.
void SurfaceCrossings::test_edges(const Face& of, const Face& face) {
    const Bounds bounds = bounds_of(face.corner, vertices_, rounding_);
    for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t p = of.corner[k];
        const std::uint32_t q = of.corner[(k + 1) % 3];
        if ((of.own_edges >> k & 1u) == 0 || shares_a_vertex(face.corner, p, q)) {
            continue;
        }
        const Vec3& x = vertices_[p];
        const Vec3& y = vertices_[q];
        if (boxes_meet(Bounds{glm::min(x, y), glm::max(x, y)}, bounds)) {
            test_edge(std::min(p, q), std::max(p, q), of, face);
        }
    }
}

int SurfaceCrossings::side(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) const {
    return Plane(vertices_[a], vertices_[b], vertices_[c]).side(vertices_[d], rounding_);
}

/// Tests the edge from p to q, p < q, of the face `of` with another face without a common vertex.
void SurfaceCrossings::test_edge(std::uint32_t p, std::uint32_t q, const Face& of, const Face& face) {
    // Both ends on one side of the plane, or the whole edge in it: no crossing.
    const Plane plane(vertices_[face.corner[0]], vertices_[face.corner[1]], vertices_[face.corner[2]]);
    const int side_p = plane.side(vertices_[p], rounding_);
    const int side_q = plane.side(vertices_[q], rounding_);
    if (side_p == side_q) {
        return;
    }
    // Sides of the edge's line on which the face's edges pass. The sign of a pair of edges is that of the same four
    // corners in the same order for all faces, so that no edge slips between two faces.
    std::array<int, 3> passes{};
    int zeros = 0;
    int sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t from = face.corner[k];
        const std::uint32_t to = face.corner[(k + 1) % 3];
        passes[k] = from < to ? side(p, q, from, to) : -side(p, q, to, from);
        zeros += passes[k] == 0 ? 1 : 0;
        sum += passes[k];
    }
    // Beside the face, or through one of its corners.
    if (std::abs(sum) != 3 - zeros || zeros > 1) {
        return;
    }
    const double volume_p = plane.volume(vertices_[p]);
    const double share = std::clamp(volume_p / (volume_p - plane.volume(vertices_[q])), 0.0, 1.0);
    const Vec3 position = vertices_[p] + share * (vertices_[q] - vertices_[p]);
    if (side_p == 0 || side_q == 0) {
        // One end lies in the face: its other edges tell whether the surface passes there.
        if (zeros == 0) {
            const std::uint32_t end = side_p == 0 ? p : q;
            touches_.push_back({{end, end, face.object, face.triangle},
                                true,
                                side_p + side_q > 0,
                                crossing_at(end, end, of, face, vertices_[end])});
        }
    } else if (zeros == 1) {
        // Two edges meet: the other face at the edge tells whether its surface passes.
        const std::size_t k = passes[0] == 0 ? 0 : (passes[1] == 0 ? 1 : 2);
        const auto [low, high] = std::minmax(face.corner[k], face.corner[(k + 1) % 3]);
        if (const int apex = side(p, q, low, face.corner[(k + 2) % 3]); apex != 0) {
            touches_.push_back({{p, q, low, high}, false, apex > 0, crossing_at(p, q, of, face, position)});
        }
    } else {
        found_.push_back(crossing_at(p, q, of, face, position));
    }
}

SurfaceCrossing SurfaceCrossings::crossing_at(std::uint32_t p, std::uint32_t q, const Face& of, const Face& face,
                                              const Vec3& position) const {
    const std::uint32_t first = first_vertex_[of.object];
    return {of.object, {p - first, q - first}, face.object, face.triangle, position};
}

/// Adds one crossing for each place that was met from both sides.
void SurfaceCrossings::add_touches_that_cross() {
    const auto key = [](const Touch& t) { return std::tie(t.at_vertex, t.place); };
    std::sort(touches_.begin(), touches_.end(), [&](const Touch& a, const Touch& b) {
        return std::tuple(key(a), a.positive, a.crossing.triangle) <
               std::tuple(key(b), b.positive, b.crossing.triangle);
    });
    for (std::size_t first = 0; first < touches_.size();) {
        std::size_t end = first + 1;
        while (end < touches_.size() && key(touches_[end]) == key(touches_[first])) {
            ++end;
        }
        // Sorted: the negative side first.
        if (!touches_[first].positive && touches_[end - 1].positive) {
            found_.push_back(touches_[first].crossing);
        }
        first = end;
    }
}

GroundCrossings find_ground_crossings(std::span<const Vec3> vertices, double height, double rounding) {
    GroundCrossings found;
    for (const Vec3& vertex : vertices) {
        const double depth = height - vertex.y;
        if (!(depth <= rounding)) {
            ++found.vertices;
            found.depth = std::max(found.depth, depth);
        }
    }
    return found;
}

double rounding_of(std::span<const Vec3> vertices) {
    double largest = 0.0;
    for (const Vec3& vertex : vertices) {
        largest = std::max({largest, std::abs(vertex.x), std::abs(vertex.y), std::abs(vertex.z)});
    }
    return kUnitsInTheLastPlace * kEpsilon * largest;
}

}  // namespace haptic::sim
