#include "haptic/sim/fish.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// The surface is a stack of rings from the mouth to the tail. A ring has kAround points: the first at the back, the
// next down the +z side, kHalf at the belly, the others up the -z side. At the front, a point inside the mouth closes
// the first ring; at the rear, the two sides of the last ring meet in a line, the edge of the tail. Paired fins and
// eyes are patches of this surface, extruded. All lengths are fractions of the fish's length.
constexpr std::size_t kAround = 20;
constexpr std::size_t kHalf = kAround / 2;
constexpr std::uint32_t kMaxRefinements = 5;  // 1.7 million triangles

// Cosine and sine of k * 18 degrees, as constants, because the mathematical library differs between machines.
constexpr std::array<double, kHalf + 1> kCosine{
    1.0, 0.9510565162951535,  0.8090169943749475,  0.5877852522924731,  0.3090169943749474,
    0.0, -0.3090169943749474, -0.5877852522924731, -0.8090169943749475, -0.9510565162951535,
    -1.0};
constexpr std::array<double, kHalf + 1> kSine{
    0.0, 0.3090169943749474, 0.5877852522924731, 0.8090169943749475, 0.9510565162951535,
    1.0, 0.9510565162951535, 0.8090169943749475, 0.5877852522924731, 0.3090169943749474,
    0.0};

/// Half a ring, from back to belly on the +z side.
using Section = std::array<Vec3, kHalf + 1>;

/// Cross-section of the body at x.
struct Girth {
    double x;
    double top;
    double bottom;
    double half_width;
};

constexpr std::array<Girth, 13> kBody{{
    {0.490, 0.008, -0.024, 0.016},
    {0.470, 0.028, -0.038, 0.026},
    {0.430, 0.056, -0.056, 0.040},
    {0.380, 0.083, -0.076, 0.052},
    {0.300, 0.112, -0.101, 0.064},
    {0.200, 0.131, -0.121, 0.071},
    {0.100, 0.133, -0.126, 0.070},
    {0.000, 0.121, -0.116, 0.062},
    {-0.100, 0.095, -0.091, 0.048},
    {-0.200, 0.062, -0.060, 0.030},
    {-0.260, 0.044, -0.044, 0.019},
    {-0.300, 0.038, -0.039, 0.013},
    {-0.320, 0.038, -0.039, 0.011},
}};

/// Height of an unpaired fin above the body.
struct Height {
    double x;
    double height;
};

constexpr std::array<Height, 7> kDorsalFin{{
    {0.170, 0.000},
    {0.130, 0.050},
    {0.090, 0.088},
    {0.030, 0.070},
    {-0.040, 0.050},
    {-0.110, 0.036},
    {-0.145, 0.000},
}};

constexpr std::array<Height, 5> kAnalFin{{
    {-0.080, 0.000},
    {-0.110, 0.034},
    {-0.140, 0.050},
    {-0.200, 0.026},
    {-0.225, 0.000},
}};

// x of the body's rings.
constexpr std::array kRings{0.478,  0.455,  0.430,  0.405,  0.380,  0.352,  0.324,  0.296, 0.268,  0.240,
                            0.210,  0.180,  0.150,  0.120,  0.090,  0.060,  0.030,  0.000, -0.030, -0.060,
                            -0.090, -0.120, -0.150, -0.180, -0.210, -0.240, -0.270, -0.300};

// Backward displacement of the sides of the first rings, at the corners of the mouth.
constexpr std::array kMouthCorner{0.022, 0.012, 0.004};

constexpr std::size_t kMouthRings = 2;
constexpr std::size_t kTailRings = 7;
constexpr std::size_t kAllRings = kMouthRings + kRings.size() + kTailRings;

/// Layer of an extruded patch: the patch scaled about its middle, then shifted.
struct Layer {
    Vec3 shift;
    double along;   // in x
    double around;  // in y and z
};

/// Patch of the surface that is extruded, together with its mirror image.
struct Patch {
    std::size_t ring;     // the first of its quads
    std::size_t rings;    // quads along the fish
    std::size_t sector;   // the first of its quads
    std::size_t sectors;  // quads around it
    std::span<const Layer> layers;
    double bulge;  // shift of the patch's inner points, as a multiple of the last layer's
};

constexpr std::array<Layer, 3> kPectoralFin{{
    {{-0.014, -0.006, 0.020}, 0.90, 0.30},
    {{-0.050, -0.020, 0.052}, 1.10, 0.14},
    {{-0.096, -0.036, 0.082}, 0.62, 0.08},
}};
constexpr std::array<Layer, 3> kPelvicFin{{
    {{-0.010, -0.016, 0.006}, 0.90, 0.40},
    {{-0.036, -0.042, 0.018}, 1.05, 0.20},
    {{-0.066, -0.062, 0.026}, 0.55, 0.12},
}};
constexpr std::array<Layer, 1> kEye{{
    {{0.0, 0.002, 0.008}, 0.62, 0.62},
}};

constexpr std::array<Patch, 3> kPatches{{
    {kMouthRings + 8, 3, 6, 1, kPectoralFin, 1.0},
    {kMouthRings + 15, 2, 8, 1, kPelvicFin, 1.0},
    {kMouthRings + 2, 2, 3, 2, kEye, 1.7},
}};

constexpr std::size_t perimeter(const Patch& patch) {
    return 2 * (patch.rings + patch.sectors);
}

constexpr std::size_t count_triangles() {
    std::size_t count = kAround + 2 * kAround * kAllRings;
    for (const Patch& patch : kPatches) {
        count += std::size_t{4} * perimeter(patch) * patch.layers.size();
    }
    return count;
}
static_assert(count_triangles() == kFishTriangles);

/// Cubic Hermite interpolation of (x, value) with Catmull-Rom slopes, 0 at the ends. The table's x descends.
template <typename Table, typename Value>
double interpolated(const Table& table, double x, Value value) {
    // Constant beyond the ends.
    if (x >= table.front().x) {
        return value(table.front());
    }
    if (x <= table.back().x) {
        return value(table.back());
    }
    // Interval [i - 1, i] that contains x.
    std::size_t i = 1;
    while (table[i].x > x) {
        ++i;
    }
    // Catmull-Rom: central differences; level at both ends.
    const auto slope = [&](std::size_t j) {
        return j == 0 || j + 1 == table.size()
                   ? 0.0
                   : (value(table[j + 1]) - value(table[j - 1])) / (table[j + 1].x - table[j - 1].x);
    };
    // Hermite basis on the interval [i - 1, i], s in 0..1.
    const double step = table[i].x - table[i - 1].x;
    const double s = (x - table[i - 1].x) / step;
    const double from_start = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s);
    return from_start * value(table[i - 1]) + (1.0 - from_start) * value(table[i]) +
           step * s * (1.0 - s) * ((1.0 - s) * slope(i - 1) - s * slope(i));
}

Girth girth_at(double x) {
    return {x, interpolated(kBody, x, [](const Girth& g) { return g.top; }),
            interpolated(kBody, x, [](const Girth& g) { return g.bottom; }),
            interpolated(kBody, x, [](const Girth& g) { return g.half_width; })};
}

/// Elliptical section whose sides are displaced backward by `corner`.
Section ellipse(const Girth& girth, double corner) {
    Section section;
    // Points at multiples of 18 degrees from back to belly, the sides drawn back by corner sin^2.
    const double middle = 0.5 * (girth.top + girth.bottom);
    const double half_height = 0.5 * (girth.top - girth.bottom);
    for (std::size_t k = 0; k <= kHalf; ++k) {
        section[k] = {girth.x - corner * kSine[k] * kSine[k], middle + half_height * kCosine[k],
                      girth.half_width * kSine[k]};
    }
    return section;
}

// Fins of back and belly.
constexpr double kFinSweep = 0.45;     // backward displacement of the edge, in heights
constexpr double kFinMiddle = 0.0035;  // half thickness
constexpr double kFinFoot = 0.010;
constexpr double kFinFull = 0.03;  // a fin of this height has its full shape

/// Raises the three points nearest to back (edge 0) or belly to a fin: its edge, middle and foot.
void raise_fin(Section& section, std::size_t edge, double height) {
    if (!(height > 0.0)) {
        return;
    }
    // A low fin is blended from the body's section, so that it starts and ends smoothly.
    const double shape = std::min(1.0, height / kFinFull);
    const double up = edge == 0 ? 1.0 : -1.0;
    const std::size_t middle = edge == 0 ? 1 : edge - 1;
    const std::size_t foot = edge == 0 ? 2 : edge - 2;
    const Vec3 root = section[edge];
    // The edge rises and leans backward; middle and foot draw in to the fin's thickness.
    section[edge] += Vec3(-kFinSweep * height, up * height, 0.0);
    section[middle] =
        glm::mix(section[middle], root + Vec3(-0.4 * kFinSweep * height, 0.45 * up * height, kFinMiddle), shape);
    section[foot] = glm::mix(section[foot], root + Vec3(0.0, -0.006 * up, kFinFoot), shape);
}

// The tail.
constexpr double kTailRoot = kRings.back();
constexpr double kTailNotch = -0.395;  // x of the edge between its tips
constexpr double kTailTip = -0.5;
constexpr double kTailSpan = 0.155;  // half the height of the tail

/// Section of the tail at the fraction u from the end of the body; u = 1 is the tail's edge.
Section tail(double u) {
    const Girth root = girth_at(kTailRoot);
    const double middle = 0.5 * (root.top + root.bottom);
    const double half_height = 0.5 * (root.top - root.bottom);
    // Thins quadratically to a blade, and to 0 at the edge.
    const double thickness = (1.0 - u) * (1.0 - u) * root.half_width + (u < 1.0 ? 0.0045 : 0.0) * u;
    Section section;
    for (std::size_t k = 0; k <= kHalf; ++k) {
        const double ray = 1.0 - 2.0 * static_cast<double>(k) / kHalf;  // 1 at the upper tip, -1 at the lower
        // Blend from the elliptical section to rays at equal spacing, then open them to the span of the tail.
        const double even = std::min(1.0, 2.0 * u);
        const double at_root = (1.0 - even) * kCosine[k] + even * ray;
        // The edge is notched: its tips reach farther back than its middle.
        const double end = kTailNotch + (kTailTip - kTailNotch) * ray * ray;
        const double opened = u * (1.5 - 0.5 * u);
        section[k] = {kTailRoot + u * (end - kTailRoot),
                      (1.0 - opened) * (middle + half_height * at_root) + opened * kTailSpan * ray,
                      thickness * kSine[k]};
    }
    return section;
}

std::vector<Section> make_sections() {
    std::vector<Section> sections;
    sections.reserve(kAllRings + 1);
    sections.push_back(ellipse({0.478, -0.002, -0.014, 0.009}, 0.026));  // inside the mouth
    sections.push_back(ellipse({0.500, 0.002, -0.019, 0.013}, 0.034));   // the lips
    // Body, with dorsal and anal fin.
    for (std::size_t i = 0; i < kRings.size(); ++i) {
        const double x = kRings[i];
        Section section = ellipse(girth_at(x), i < kMouthCorner.size() ? kMouthCorner[i] : 0.0);
        raise_fin(section, 0, interpolated(kDorsalFin, x, [](const Height& h) { return h.height; }));
        raise_fin(section, kHalf, interpolated(kAnalFin, x, [](const Height& h) { return h.height; }));
        sections.push_back(section);
    }
    // Tail, up to its edge.
    for (std::size_t i = 1; i <= kTailRings + 1; ++i) {
        sections.push_back(tail(static_cast<double>(i) / (kTailRings + 1)));
    }
    return sections;
}

Vec3 mirrored(const Vec3& v, bool mirror) {
    return {v.x, v.y, mirror ? -v.z : v.z};
}

class FishBuilder {
  public:
    TriangleMesh build() {
        add_rings();
        // Patches on both sides, before the quads of the rings, which leave them out.
        for (const Patch& patch : kPatches) {
            extrude(patch, false);
            extrude(patch, true);
        }
        add_ring_quads();
        mesh_.closed = true;
        return std::move(mesh_);
    }

  private:
    using Grid = std::vector<std::uint32_t>;  // of a patch: (rings + 1) * (sectors + 1), rings outermost

    /// Ring kAllRings is the edge of the tail, where both sides share their vertices.
    [[nodiscard]] static std::uint32_t index(std::size_t ring, std::size_t k) {
        k %= kAround;
        const std::size_t slot = ring == kAllRings && k > kHalf ? kAround - k : k;
        return static_cast<std::uint32_t>(1 + ring * kAround + slot);
    }

    std::uint32_t add(const Vec3& where) {
        mesh_.vertices.push_back(where);
        return static_cast<std::uint32_t>(mesh_.vertices.size() - 1);
    }

    void add_rings() {
        add({0.440, -0.008, 0.0});  // the end of the mouth
        const std::vector<Section> sections = make_sections();
        // Full rings: the section, then its mirror image in reverse order.
        for (std::size_t i = 0; i < kAllRings; ++i) {
            for (std::size_t k = 0; k < kAround; ++k) {
                add(mirrored(sections[i][k > kHalf ? kAround - k : k], k > kHalf));
            }
        }
        // Edge of the tail: thickness 0, so both sides share one row of vertices.
        for (const Vec3& point : sections.back()) {
            add(point);
        }
        is_extruded_.assign((kAllRings)*kAround, false);
    }

    /// Two triangles with the corners (ring, k), (ring + 1, k), (ring + 1, k + 1), (ring, k + 1).
    void add_quad(const std::array<std::uint32_t, 4>& corner, bool first_diagonal) {
        const auto& [a, b, c, d] = corner;
        if (first_diagonal) {
            mesh_.triangles.push_back({a, b, c});
            mesh_.triangles.push_back({a, c, d});
        } else {
            mesh_.triangles.push_back({a, b, d});
            mesh_.triangles.push_back({b, c, d});
        }
    }

    /// Diagonals alternate and are mirrored on the other side. At the edge of the tail no diagonal may join a tip to a
    /// shared vertex: the mirrored triangles would share that edge too.
    static bool first_diagonal(std::size_t ring, std::size_t sector) {
        const bool other_side = sector >= kHalf;
        const std::size_t counted = other_side ? kAround - 1 - sector : sector;
        return ((ring + counted) % 2 == 1) != other_side;
    }

    void add_ring_quads() {
        // Close the mouth with a fan about its end.
        for (std::size_t k = 0; k < kAround; ++k) {
            mesh_.triangles.push_back({0, index(0, k), index(0, k + 1)});
        }
        // Quads between neighbouring rings, except where a patch is extruded.
        for (std::size_t i = 0; i < kAllRings; ++i) {
            for (std::size_t k = 0; k < kAround; ++k) {
                if (!is_extruded_[i * kAround + k]) {
                    add_quad({index(i, k), index(i + 1, k), index(i + 1, k + 1), index(i, k + 1)},
                             first_diagonal(i, k));
                }
            }
        }
    }

    void extrude(const Patch& patch, bool mirror) {
        // Vertices of the patch in the surface, and their middle.
        const std::size_t sector = mirror ? kAround - patch.sector - patch.sectors : patch.sector;
        const std::size_t columns = patch.sectors + 1;
        Grid base((patch.rings + 1) * columns);
        for (std::size_t i = 0; i <= patch.rings; ++i) {
            for (std::size_t j = 0; j < columns; ++j) {
                base[i * columns + j] = index(patch.ring + i, sector + j);
            }
        }
        // The patch is scaled about the mean of its four corners.
        const Vec3 middle = 0.25 * (mesh_.vertices[base.front()] + mesh_.vertices[base[columns - 1]] +
                                    (mesh_.vertices[base.back()] + mesh_.vertices[base[base.size() - columns]]));
        const auto is_inside = [&](std::size_t i, std::size_t j) {
            return i > 0 && i < patch.rings && j > 0 && j < patch.sectors;
        };
        // Add the layers one by one. Only border vertices are new; the inner ones move with the last layer.
        Grid below = base;
        for (const Layer& layer : patch.layers) {
            const bool last = &layer == &patch.layers.back();
            Grid above = base;
            for (std::size_t i = 0; i <= patch.rings; ++i) {
                for (std::size_t j = 0; j < columns; ++j) {
                    const std::size_t at = i * columns + j;
                    // Scaled about the middle and shifted; inner points by `bulge` times as much.
                    const Vec3 out = mesh_.vertices[base[at]] - middle;
                    const Vec3 placed = middle + mirrored(layer.shift, mirror) * (is_inside(i, j) ? patch.bulge : 1.0) +
                                        Vec3(layer.along * out.x, layer.around * out.y, layer.around * out.z);
                    // Border vertices form the wall of the layer.
                    if (!is_inside(i, j)) {
                        above[at] = add(placed);
                    } else if (last) {
                        mesh_.vertices[base[at]] = placed;
                    }
                }
            }
            add_wall(patch, below, above, mirror);
            below = above;
        }
        // Close the last layer, in place of the quads of the surface.
        for (std::size_t i = 0; i < patch.rings; ++i) {
            for (std::size_t j = 0; j < patch.sectors; ++j) {
                const std::size_t at = i * columns + j;
                is_extruded_[(patch.ring + i) * kAround + sector + j] = true;
                add_quad({below[at], below[at + columns], below[at + columns + 1], below[at + 1]},
                         first_diagonal(patch.ring + i, sector + j));
            }
        }
    }

    /// Side wall between two layers, around the whole patch.
    void add_wall(const Patch& patch, const Grid& below, const Grid& above, bool mirror) {
        // Border: down the first column, along the last ring, up the last column, back along the first ring.
        const std::size_t columns = patch.sectors + 1;
        std::vector<std::size_t> border;  // counter-clockwise seen from outside
        border.reserve(perimeter(patch));
        for (std::size_t i = 0; i < patch.rings; ++i) {
            border.push_back(i * columns);
        }
        for (std::size_t j = 0; j < patch.sectors; ++j) {
            border.push_back(patch.rings * columns + j);
        }
        for (std::size_t i = patch.rings; i > 0; --i) {
            border.push_back(i * columns + patch.sectors);
        }
        for (std::size_t j = patch.sectors; j > 0; --j) {
            border.push_back(j);
        }
        // One quad per border edge. A mirrored patch has the opposite orientation.
        for (std::size_t s = 0; s < border.size(); ++s) {
            const std::size_t here = border[s];
            const std::size_t next = border[(s + 1) % border.size()];
            add_quad({below[here], below[next], above[next], above[here]}, !mirror);
        }
    }

    TriangleMesh mesh_;
    std::vector<bool> is_extruded_;  // per quad of the rings: replaced by a patch
};

/// Splits each triangle into four. Edge midpoints follow the vertices, in the order in which triangles use them.
TriangleMesh refined(const TriangleMesh& mesh) {
    TriangleMesh fine;
    fine.closed = mesh.closed;
    fine.vertices = mesh.vertices;
    // A closed mesh has 3/2 edges per triangle.
    fine.vertices.reserve(mesh.vertices.size() + mesh.triangles.size() * 3 / 2);
    fine.triangles.reserve(4 * mesh.triangles.size());
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    // Both triangles of an edge share its midpoint.
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
        const auto [found, is_new] =
            middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(fine.vertices.size()));
        if (is_new) {
            fine.vertices.push_back(0.5 * (mesh.vertices[a] + mesh.vertices[b]));
        }
        return found->second;
    };
    // Three corner triangles and the middle one, all with the orientation of the original.
    for (const auto& [a, b, c] : mesh.triangles) {
        const std::uint32_t ab = middle(a, b);
        const std::uint32_t bc = middle(b, c);
        const std::uint32_t ca = middle(c, a);
        fine.triangles.push_back({a, ab, ca});
        fine.triangles.push_back({ab, b, bc});
        fine.triangles.push_back({ca, bc, c});
        fine.triangles.push_back({ab, bc, ca});
    }
    return fine;
}

}  // namespace

void FishShape::check() const {
    if (!(length > 0.0) || !std::isfinite(length)) {
        throw std::invalid_argument("fish: length must be positive");
    }
    if (refinements > kMaxRefinements) {
        throw std::invalid_argument("fish: refinements must be 0 to " + std::to_string(kMaxRefinements));
    }
}

TriangleMesh make_fish_mesh(const FishShape& shape) {
    shape.check();
    // Unit fish, refined, then scaled, rotated and placed.
    TriangleMesh mesh = FishBuilder().build();
    for (std::uint32_t i = 0; i < shape.refinements; ++i) {
        mesh = refined(mesh);
    }
    const Mat3 scene_from_fish = to_matrix(shape.orientation);
    for (Vec3& vertex : mesh.vertices) {
        vertex = shape.centre + scene_from_fish * (shape.length * vertex);
    }
    return mesh;
}

}  // namespace haptic::sim
