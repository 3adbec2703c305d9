#include "tool/hand_mesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <span>
#include <stdexcept>
#include <vector>

#include "dynamics/rotation.hpp"

namespace haptic::sim {
namespace {

// Unit of length here: about the distance from the wrist's crease to the tip of the middle finger.

/// Joint of a finger; the last one is the centre of the fingertip.
struct FingerJoint {
    Vec3 center;
    double radius;
};

using Finger = std::array<FingerJoint, 4>;

// Joint 0 is the fixed palm. Each finger has a joint at the start of each of its three bones; the thumb comes last.
constexpr std::uint32_t kPalmJoint = 0;
constexpr std::uint32_t kJointsOfFinger = 3;
constexpr std::uint32_t kThumbJoint = 1 + 4 * kJointsOfFinger;

struct Shape {
    std::array<Finger, 5> fingers{};
    std::array<ToolBone, 12> palm{};
};

Shape make_shape() {
    return {{{
                // index, middle, ring, little
                {{{{-0.158, 0.010, -0.170}, 0.054},
                  {{-0.209, -0.011, -0.360}, 0.047},
                  {{-0.240, -0.055, -0.477}, 0.043},
                  {{-0.263, -0.106, -0.563}, 0.039}}},
                {{{{-0.053, 0.020, -0.190}, 0.054},
                  {{-0.065, 0.001, -0.410}, 0.048},
                  {{-0.072, -0.046, -0.546}, 0.044},
                  {{-0.077, -0.102, -0.646}, 0.040}}},
                {{{{0.054, 0.012, -0.172}, 0.053},
                  {{0.085, -0.013, -0.370}, 0.046},
                  {{0.104, -0.064, -0.490}, 0.042},
                  {{0.118, -0.125, -0.576}, 0.038}}},
                {{{{0.146, -0.008, -0.130}, 0.048},
                  {{0.207, -0.033, -0.274}, 0.041},
                  {{0.243, -0.080, -0.359}, 0.037},
                  {{0.268, -0.132, -0.418}, 0.034}}},
                // thumb
                {{{{-0.115, -0.045, 0.150}, 0.075},
                  {{-0.240, -0.085, 0.020}, 0.057},
                  {{-0.330, -0.106, -0.100}, 0.050},
                  {{-0.382, -0.116, -0.200}, 0.043}}},
            }},
            {{
                // from the wrist to the knuckles
                {kPalmJoint, {-0.060, 0.000, 0.230}, 0.070, {-0.154, 0.006, -0.165}, 0.058},
                {kPalmJoint, {-0.025, 0.004, 0.230}, 0.072, {-0.050, 0.016, -0.185}, 0.062},
                {kPalmJoint, {0.020, 0.002, 0.230}, 0.072, {0.048, 0.008, -0.165}, 0.060},
                {kPalmJoint, {0.060, -0.006, 0.230}, 0.068, {0.142, -0.010, -0.120}, 0.054},
                // balls of the thumb and of the little finger, pads below the fingers
                {kThumbJoint, {-0.090, -0.050, 0.165}, 0.072, {-0.190, -0.070, 0.040}, 0.066},
                {kPalmJoint, {0.070, -0.040, 0.170}, 0.066, {0.135, -0.034, -0.030}, 0.056},
                {kPalmJoint, {-0.140, -0.010, -0.185}, 0.050, {0.125, -0.020, -0.145}, 0.046},
                // the web of the thumb
                {kPalmJoint, {-0.120, -0.020, 0.060}, 0.052, {-0.150, -0.012, -0.080}, 0.050},
                {kPalmJoint, {-0.185, -0.052, 0.045}, 0.040, {-0.150, -0.020, -0.040}, 0.040},
                // the wrist and its end
                {kPalmJoint, {-0.052, -0.004, 0.200}, 0.070, {-0.058, -0.004, 0.330}, 0.068},
                {kPalmJoint, {0.000, -0.002, 0.200}, 0.074, {0.000, -0.002, 0.340}, 0.072},
                {kPalmJoint, {0.052, -0.006, 0.200}, 0.068, {0.058, -0.006, 0.330}, 0.066},
            }}};
}

/// Bone from one joint of a finger to the next.
ToolBone bone_between(const Finger& finger, std::size_t joint, std::uint32_t joint_index) {
    const FingerJoint& from = finger[joint];
    const FingerJoint& to = finger[joint + 1];
    return {joint_index, from.center, from.radius, to.center, to.radius};
}

/// Smooth minimum: rounds the transition where a and b differ by less than `width`; at most width / 4 below the
/// minimum.
double smooth_min(double a, double b, double width) {
    const double near = std::max(width - std::abs(a - b), 0.0) / width;
    return std::min(a, b) - 0.25 * width * near * near;
}

constexpr double kPalmFillet = 0.05;
constexpr double kRootFillet = 0.05;    // between finger and palm
constexpr double kJointFillet = 0.008;  // between the bones of a finger
constexpr double kFingerFillet = 0.01;  // between fingers

/// Approximate signed distance from the skin; negative inside. Smooth union of all bones.
double field(const Shape& shape, const Vec3& p) {
    // Palm: smooth union of its bones.
    double palm = distance(p, shape.palm.front());
    for (std::size_t i = 1; i < shape.palm.size(); ++i) {
        palm = smooth_min(palm, distance(p, shape.palm[i]), kPalmFillet);
    }
    // Each finger is joined to the palm first. Adjacent fingers then blend only slightly, so that they stay apart.
    double hand = palm;
    for (const Finger& joints : shape.fingers) {
        double finger = 1.0;
        for (std::size_t i = 1; i < joints.size(); ++i) {
            finger = smooth_min(finger, distance(p, bone_between(joints, i - 1, kPalmJoint)), kJointFillet);
        }
        hand = smooth_min(hand, smooth_min(palm, finger, kRootFillet), kFingerFillet);
    }
    return hand;
}

/// Gradient of the field by central differences.
Vec3 gradient(const Shape& shape, const Vec3& p) {
    constexpr double step = 1e-4;
    Vec3 result(0.0);
    for (int k = 0; k < 3; ++k) {
        Vec3 before = p;
        Vec3 after = p;
        before[k] -= step;
        after[k] += step;
        result[k] = (field(shape, after) - field(shape, before)) / (2.0 * step);
    }
    return result;
}

// Width of the grid cells, chosen to give kHandTriangles. No grid node is within 2e-5 of the skin, so rounding cannot
// change the count.
constexpr double kCellSize = 0.028989;

/// Surface net of the field's zero set.
class SurfaceNet {
  public:
    explicit SurfaceNet(const Shape& shape) : shape_(shape) {
        // Nodes of the grid over the bounding box.
        for (std::size_t k = 0; k < 3; ++k) {
            nodes_[k] = static_cast<std::size_t>((kHigh[k] - kLow[k]) / kCellSize) + 2;
        }
        // Sample the field at all nodes.
        value_.resize(nodes_[0] * nodes_[1] * nodes_[2]);
        for (std::size_t i = 0; i < nodes_[0]; ++i) {
            for (std::size_t j = 0; j < nodes_[1]; ++j) {
                for (std::size_t k = 0; k < nodes_[2]; ++k) {
                    value_[index(i, j, k)] = field(shape, node_position(i, j, k));
                }
            }
        }
    }

    TriangleMesh build() {
        // Surface net: vertices in crossed cells, quads around crossed edges, then smoothing on the skin.
        add_vertices();
        add_quads();
        for (int round = 0; round < kRounds; ++round) {
            smooth();
        }
        TriangleMesh mesh;
        mesh.closed = true;
        // Split each quad along its shorter diagonal.
        for (const auto& [a, b, c, d] : quads_) {
            const Vec3 ac = vertices_[c] - vertices_[a];
            const Vec3 bd = vertices_[d] - vertices_[b];
            if (glm::dot(ac, ac) <= glm::dot(bd, bd)) {
                mesh.triangles.push_back({a, b, c});
                mesh.triangles.push_back({a, c, d});
            } else {
                mesh.triangles.push_back({a, b, d});
                mesh.triangles.push_back({b, c, d});
            }
        }
        // Reach the exact number of triangles of the thesis' hand.
        mesh.vertices = std::move(vertices_);
        split_longest_edge(mesh);
        return mesh;
    }

  private:
    static constexpr std::array<double, 3> kLow{-0.47, -0.22, -0.74};
    static constexpr std::array<double, 3> kHigh{0.33, 0.14, 0.47};
    static constexpr int kRounds = 6;
    static constexpr std::uint32_t kNone = ~std::uint32_t{0};

    using Quad = std::array<std::uint32_t, 4>;  // counter-clockwise seen from outside

    [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const {
        return (i * nodes_[1] + j) * nodes_[2] + k;
    }
    [[nodiscard]] static Vec3 node_position(std::size_t i, std::size_t j, std::size_t k) {
        return {kLow[0] + kCellSize * static_cast<double>(i), kLow[1] + kCellSize * static_cast<double>(j),
                kLow[2] + kCellSize * static_cast<double>(k)};
    }

    /// One vertex in each cell that the skin crosses: the mean of its crossings of the cell's edges.
    void add_vertices() {
        vertex_of_.assign(value_.size(), kNone);
        for (std::size_t i = 0; i + 1 < nodes_[0]; ++i) {
            for (std::size_t j = 0; j + 1 < nodes_[1]; ++j) {
                for (std::size_t k = 0; k + 1 < nodes_[2]; ++k) {
                    add_vertex(i, j, k);
                }
            }
        }
    }

    void add_vertex(std::size_t i, std::size_t j, std::size_t k) {
        // All twelve edges of the cell: node a and its neighbour b with one more bit set.
        Vec3 sum(0.0);
        double crossings = 0.0;
        for (std::size_t a = 0; a < 8; ++a) {
            for (std::size_t axis = 1; axis < 8; axis *= 2) {
                const std::size_t b = a | axis;
                if (b == a) {
                    continue;
                }
                // Linear interpolation of the zero crossing on the edge from node a to node b.
                const double at_a = value_[index(i + (a & 1), j + (a >> 1 & 1), k + (a >> 2))];
                const double at_b = value_[index(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2))];
                if ((at_a < 0.0) == (at_b < 0.0)) {
                    continue;
                }
                sum += glm::mix(node_position(i + (a & 1), j + (a >> 1 & 1), k + (a >> 2)),
                                node_position(i + (b & 1), j + (b >> 1 & 1), k + (b >> 2)), at_a / (at_a - at_b));
                crossings += 1.0;
            }
        }
        // The mean of the crossings stays inside the cell.
        if (crossings > 0.0) {
            vertex_of_[index(i, j, k)] = static_cast<std::uint32_t>(vertices_.size());
            vertices_.push_back(sum / crossings);
        }
    }

    /// One quad for each grid edge that the skin crosses, joining the vertices of the four cells around that edge.
    void add_quads() {
        for (std::size_t i = 1; i + 1 < nodes_[0]; ++i) {
            for (std::size_t j = 1; j + 1 < nodes_[1]; ++j) {
                for (std::size_t k = 1; k + 1 < nodes_[2]; ++k) {
                    // The three edges from this node along x, y and z, each with its four cells in order around it.
                    const bool here = value_[index(i, j, k)] < 0.0;
                    add_quad(here, value_[index(i + 1, j, k)] < 0.0,
                             {index(i, j, k), index(i, j - 1, k), index(i, j - 1, k - 1), index(i, j, k - 1)});
                    add_quad(here, value_[index(i, j + 1, k)] < 0.0,
                             {index(i, j, k), index(i, j, k - 1), index(i - 1, j, k - 1), index(i - 1, j, k)});
                    add_quad(here, value_[index(i, j, k + 1)] < 0.0,
                             {index(i, j, k), index(i - 1, j, k), index(i - 1, j - 1, k), index(i, j - 1, k)});
                }
            }
        }
    }

    void add_quad(bool inside, bool next_inside, const std::array<std::size_t, 4>& cells) {
        // No crossing on this edge.
        if (inside == next_inside) {
            return;
        }
        Quad quad{vertex_of_[cells[0]], vertex_of_[cells[1]], vertex_of_[cells[2]], vertex_of_[cells[3]]};
        // Reverse the winding where the field decreases along the edge, so that the normal points outward.
        if (!inside) {
            std::swap(quad[1], quad[3]);
        }
        quads_.push_back(quad);
    }

    /// Newton steps along the gradient.
    void project_onto_skin(Vec3& p) const {
        for (int newton = 0; newton < 2; ++newton) {
            const Vec3 slope = gradient(shape_, p);
            p -= slope * (field(shape_, p) / glm::dot(slope, slope));
        }
    }

    /// Every grid line enters the body as often as it leaves it, so a net has a multiple of four triangles; the thesis'
    /// hand has two more. Splitting one edge adds two.
    void split_longest_edge(TriangleMesh& mesh) const {
        // The longest edge yields the best-shaped halves.
        double longest = 0.0;
        std::uint32_t from = 0;
        std::uint32_t to = 0;
        for (const Triangle& t : mesh.triangles) {
            for (std::size_t k = 0; k < 3; ++k) {
                const Vec3 edge = mesh.vertices[t[(k + 1) % 3]] - mesh.vertices[t[k]];
                if (glm::dot(edge, edge) > longest) {
                    longest = glm::dot(edge, edge);
                    from = t[k];
                    to = t[(k + 1) % 3];
                }
            }
        }
        // New vertex at the middle of the edge, on the skin; each of the two triangles at the edge is split in halves.
        const auto middle = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.push_back(0.5 * (mesh.vertices[from] + mesh.vertices[to]));
        project_onto_skin(mesh.vertices.back());
        const std::size_t count = mesh.triangles.size();
        for (std::size_t i = 0; i < count; ++i) {
            Triangle half = mesh.triangles[i];
            const auto a = std::find(half.begin(), half.end(), from);
            const auto b = std::find(half.begin(), half.end(), to);
            if (a == half.end() || b == half.end()) {
                continue;
            }
            // One half keeps the end `to`, the other the end `from`.
            *a = middle;
            *std::find(mesh.triangles[i].begin(), mesh.triangles[i].end(), to) = middle;
            mesh.triangles.push_back(half);
        }
    }

    /// Laplacian smoothing: moves each vertex 0.6 of the way to the mean of its edge neighbours, then projects it onto
    /// the skin.
    void smooth() {
        // Sum of the neighbours of each vertex, over the quads around it.
        std::vector<Vec3> sum(vertices_.size(), Vec3(0.0));
        std::vector<double> count(vertices_.size(), 0.0);
        for (const Quad& quad : quads_) {
            for (std::size_t k = 0; k < 4; ++k) {
                // Every edge is visited twice, once from each of its quads.
                sum[quad[k]] += vertices_[quad[(k + 1) % 4]] + vertices_[quad[(k + 3) % 4]];
                count[quad[k]] += 2.0;
            }
        }
        // Smoothing shrinks the mesh, so each vertex goes back to the zero set.
        for (std::size_t v = 0; v < vertices_.size(); ++v) {
            Vec3 p = glm::mix(vertices_[v], sum[v] / count[v], 0.6);
            project_onto_skin(p);
            vertices_[v] = p;
        }
    }

    const Shape& shape_;
    std::array<std::size_t, 3> nodes_{};
    std::vector<double> value_;             // per node: field
    std::vector<std::uint32_t> vertex_of_;  // per node: vertex of the cell whose lowest node it is, or kNone
    std::vector<Vec3> vertices_;
    std::vector<Quad> quads_;
};

// Rotations of a fist's finger joints, 2 tan(angle / 2): 75, 90 and 55 degrees.
constexpr std::array<double, kJointsOfFinger> kFingerBends{1.535, 2.0, 1.04};
// Of the thumb's joints: 53 and 70 degrees toward the fingers. Its first joint opposes it to them before it bends.
constexpr std::array<double, kJointsOfFinger> kThumbBends{0.0, 1.0, 1.4};
constexpr Vec3 kThumbOpposedDirection{0.02, -0.34, -0.13};
constexpr double kThumbOpposedCurl = 0.1;  // curl at which the opposition is complete
constexpr Vec3 kPalmDirection{0.0, -1.0, 0.0};
constexpr Vec3 kThumbBendDirection{0.1, 0.25, -1.0};  // after opposition

/// Unit axis of the rotation from one direction toward another.
Vec3 axis_of(const Vec3& direction, const Vec3& toward) {
    return glm::normalize(glm::cross(direction, toward));
}

/// Rotation from one direction to another as turned() takes it: 2 tan(angle / 2) about the axis, with
/// tan^2(angle / 2) = (1 - cos) / (1 + cos).
Vec3 rotation_between_directions(const Vec3& direction, const Vec3& to) {
    const double cosine = glm::dot(glm::normalize(direction), glm::normalize(to));
    return 2.0 * std::sqrt((1.0 - cosine) / (1.0 + cosine)) * axis_of(direction, to);
}

/// Length from the end of the wrist to the tip of the middle finger, in the unit above.
constexpr double kBoneExtent = 1.0982;

void require_length(double length) {
    if (!(length > 0.0) || !std::isfinite(length)) {
        throw std::invalid_argument("hand: length must be positive");
    }
}

}  // namespace

TriangleMesh make_hand_mesh(double length) {
    require_length(length);
    // Mesh in the unit above, then scaled to the length along the hand's axis z.
    const Shape shape = make_shape();
    TriangleMesh mesh = SurfaceNet(shape).build();
    const auto [low, high] = std::minmax_element(mesh.vertices.begin(), mesh.vertices.end(),
                                                 [](const Vec3& a, const Vec3& b) { return a.z < b.z; });
    const double scale = length / (high->z - low->z);
    for (Vec3& p : mesh.vertices) {
        p = scale * p;
    }
    return mesh;
}

ToolSkeleton make_hand_skeleton(double length) {
    require_length(length);
    const Shape shape = make_shape();
    ToolSkeleton hand{{{}}, {shape.palm.begin(), shape.palm.end()}};
    // The thumb bends in its opposed pose, but axes are given at curl 0: rotate the bending direction back.
    const Finger& thumb = shape.fingers.back();
    const Vec3 opposition =
        rotation_between_directions(thumb.back().center - thumb.front().center, kThumbOpposedDirection);
    const Mat3 opposed = to_matrix(turned(Quat(1.0, 0.0, 0.0, 0.0), opposition));
    for (const Finger& finger : shape.fingers) {
        const bool is_thumb = &finger == &thumb;
        const Vec3 bend_direction = is_thumb ? glm::transpose(opposed) * kThumbBendDirection : kPalmDirection;
        for (std::size_t k = 0; k < kJointsOfFinger; ++k) {
            const auto number = static_cast<std::uint32_t>(hand.joints.size());
            // The parent of a finger's first joint is the palm; that of the others is the joint before.
            ToolJoint joint{.parent = k == 0 ? kPalmJoint : number - 1, .position = finger[k].center};
            // The thumb opposes the fingers early, then bends with them.
            if (is_thumb && k == 0) {
                joint.rotation = opposition;
                joint.full_curl = kThumbOpposedCurl;
            } else {
                // Axis normal to the bone and the bending direction; angle of the closed fist.
                const Vec3 axis = axis_of(finger[k + 1].center - finger[k].center, bend_direction);
                joint.rotation = (is_thumb ? kThumbBends[k] : kFingerBends[k]) * axis;
            }
            hand.joints.push_back(joint);
            hand.bones.push_back(bone_between(finger, k, number));
        }
    }
    // Joints scale with the length; rotations do not.
    const double scale = length / kBoneExtent;
    for (ToolJoint& joint : hand.joints) {
        joint.position *= scale;
    }
    for (ToolBone& bone : hand.bones) {
        bone = {bone.joint, scale * bone.from, scale * bone.from_radius, scale * bone.to, scale * bone.to_radius};
    }
    return hand;
}

}  // namespace haptic::sim
