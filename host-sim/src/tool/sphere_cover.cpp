#include "tool/sphere_cover.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <unordered_set>

#include "contact/verification.hpp"
#include "generators/triangle_grid.hpp"
#include "haptic/sim/closest_point.hpp"
#include "mesh/mesh_measures.hpp"
#include "model/sample_graph.hpp"
#include "simd/aabb.hpp"
#include "tool/uncovered_depth.hpp"

namespace haptic::sim {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kSamples = 2500.0;  // approximate number of surface samples
constexpr std::size_t kMaxCandidates = 1000;
constexpr double kMaxCuts = 64.0;  // subdivisions of a triangle's side for sampling
constexpr double kOnPlane = 1e-9;  // part of the mesh's size
constexpr int kMaxShrinkings = 30;
constexpr double kConverged =
    1.0 - 1e-3;  // shrinking stops when no sample is nearer to the ball's centre than this part of its radius
constexpr int kHalvings = 14;
constexpr int kRelaxations = 40;
constexpr int kMaxGrowthRounds = 24;
constexpr double kBalanced = 1.03;  // ratio of uncovered depth to protrusion at which growing stops
constexpr int kSwaps = 12;
constexpr int kRefinements = 4;
constexpr int kMaxMoves = 40;
constexpr double kMinGain = 0.02;  // smallest worthwhile gain of a move, as a part of the move
constexpr int kStepHalvings = 5;   // from the samples' pitch

[[noreturn]] void refuse_cover(const std::string& why) {
    throw std::invalid_argument("sphere cover: " + why);
}

struct Sample {
    Vec3 position{0.0};
    Vec3 normal{0.0};  // outward
};

/// Grid cell of a sample and the dominant axis of its normal. One sample per key is kept.
struct SampleKey {
    std::array<std::int64_t, 4> part{};
    bool operator==(const SampleKey&) const = default;
};

struct SampleKeyHash {
    std::size_t operator()(const SampleKey& key) const noexcept {
        std::uint64_t hash = 0;
        for (const std::int64_t part : key.part) {
            hash = (hash ^ static_cast<std::uint64_t>(part)) * 0x9E3779B97F4A7C15U;
            hash ^= hash >> 29U;
        }
        return static_cast<std::size_t>(hash);
    }
};

/// Dominant axis and sign of a normal, 0 to 5.
std::int64_t side_of(const Vec3& normal) {
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
        if (std::abs(normal[k]) > std::abs(normal[axis])) {
            axis = k;
        }
    }
    return 2 * axis + (normal[axis] < 0.0 ? 1 : 0);
}

/// Surface samples about `pitch` apart: several per large triangle, one for many small ones.
std::vector<Sample> sample(const TriangleMesh& mesh, double pitch) {
    std::vector<Sample> samples;
    std::unordered_set<SampleKey, SampleKeyHash> taken;
    // The back faces of a double-faced mesh would repeat every sample.
    const std::size_t count = mesh.double_faced ? mesh.triangles.size() / 2 : mesh.triangles.size();
    for (std::size_t t = 0; t < count; ++t) {
        // Sides and normal; a degenerate triangle has no normal and gives no samples.
        const auto& [i, j, k] = mesh.triangles[t];
        const Vec3& a = mesh.vertices[i];
        const Vec3 u = mesh.vertices[j] - a;
        const Vec3 v = mesh.vertices[k] - a;
        const Vec3 normal = glm::cross(u, v);
        const double twice_area = glm::length(normal);
        if (!(twice_area > 0.0)) {
            continue;
        }
        // Subdivide into pieces of at most 1.4 pitches, whose centroids are about a pitch apart.
        const double longest = std::sqrt(std::max({glm::dot(u, u), glm::dot(v, v), glm::dot(u - v, u - v)}));
        const int cuts = static_cast<int>(std::clamp(std::ceil(longest / (1.4 * pitch)), 1.0, kMaxCuts));
        for (int row = 0; row < cuts; ++row) {
            for (int at = 0; at < 2 * (cuts - row) - 1; ++at) {
                // Centroids of the pieces: upright ones at even `at`, inverted ones in between.
                const double third = at % 2 == 0 ? 1.0 / 3.0 : 2.0 / 3.0;
                const int quad = at / 2;
                const double along = (quad + third) / cuts;
                const double across = (row + third) / cuts;
                const Sample found{a + along * u + across * v, normal / twice_area};
                // One sample per cell and side, so that both faces of a thin wall keep theirs.
                const Vec3 cell = glm::floor(found.position / pitch);
                const SampleKey key{{static_cast<std::int64_t>(cell.x), static_cast<std::int64_t>(cell.y),
                                     static_cast<std::int64_t>(cell.z), side_of(found.normal)}};
                if (taken.insert(key).second) {
                    samples.push_back(found);
                }
            }
        }
    }
    return samples;
}

/// Medial ball by shrinking (Ma, Bae, Choi 2012): touches the surface from inside at a sample and at one more place,
/// unless `max_radius` limits it. `thickness`, m: distance through the body along the inward normal.
Ball inner_ball(const std::vector<Sample>& samples, const Sample& touched, double max_radius, double thickness) {
    // Start with the largest ball that fits between the sample and the opposite wall.
    const double widest = std::min(max_radius, 0.5 * thickness);
    Ball ball{touched.position - widest * touched.normal, widest};
    for (int k = 0; k < kMaxShrinkings; ++k) {
        // The sample deepest inside the ball is the next place to touch.
        double nearest = kInfinite;
        const Sample* other = nullptr;
        for (const Sample& sample : samples) {
            const Vec3 arm = sample.position - ball.centre;
            const double squared = glm::dot(arm, arm);
            if (squared < nearest) {
                nearest = squared;
                other = &sample;
            }
        }
        // Ball through both samples, tangent at the touched one: r = |chord|^2 / (2 chord . n).
        const Vec3 chord = touched.position - other->position;
        const double depth = glm::dot(chord, touched.normal);
        if (nearest >= kConverged * kConverged * ball.radius * ball.radius || !(depth > 0.0)) {
            break;
        }
        ball.radius = std::min(ball.radius, glm::dot(chord, chord) / (2.0 * depth));
        ball.centre = touched.position - ball.radius * touched.normal;
    }
    return ball;
}

/// Exact distance from a mesh's surface; bounding balls prune triangles.
class Surface {
  public:
    explicit Surface(const TriangleMesh& mesh) : mesh_(mesh) {
        for (const auto& [i, j, k] : mesh.triangles) {
            const Vec3 middle = (mesh.vertices[i] + mesh.vertices[j] + mesh.vertices[k]) / 3.0;
            const double reach =
                std::max({glm::length(mesh.vertices[i] - middle), glm::length(mesh.vertices[j] - middle),
                          glm::length(mesh.vertices[k] - middle)});
            bounds_.push_back({middle, reach});
        }
    }

    /// m, unsigned.
    [[nodiscard]] double distance(const Vec3& p) const {
        double min_distance = kInfinite;
        for (std::size_t t = 0; t < bounds_.size(); ++t) {
            // Skip a triangle whose bounding ball is farther away than the nearest triangle so far.
            const Vec3 arm = p - bounds_[t].centre;
            const double within = min_distance + bounds_[t].radius;
            if (glm::dot(arm, arm) >= within * within) {
                continue;
            }
            // Exact distance from the triangle.
            const auto& [i, j, k] = mesh_.triangles[t];
            const TriangleCorners corners{mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k]};
            min_distance = std::min(min_distance, std::sqrt(closest_point_on_triangle(p, corners).squared_distance));
        }
        return min_distance;
    }

  private:
    const TriangleMesh& mesh_;
    std::vector<Ball> bounds_;
};

/// Candidate positions of spheres. A candidate's radius is that of the inscribed ball there; 0 for an open mesh.
class Candidates {
  public:
    Candidates(const TriangleMesh& mesh, double fixed_radius) : fixed_(fixed_radius), closed_(mesh.closed) {
        // Samples, and a limited number of candidates from them.
        pitch_ = std::sqrt(surface_area(mesh) / (mesh.double_faced ? 2.0 : 1.0) / kSamples);
        samples_ = sample(mesh, pitch_);
        const Aabb box = aabb_of(mesh.vertices);
        const double size = glm::length(box.size());
        size_ = size;
        const double max_radius = fixed_ > 0.0 ? fixed_ : size;
        // Every n-th sample becomes a candidate, so that their number is limited.
        const std::size_t every = (samples_.size() + kMaxCandidates - 1) / kMaxCandidates;
        const TriangleGrid grid(mesh.vertices, mesh.triangles, 2.0 * pitch_);
        const Surface surface(mesh);
        for (std::size_t i = 0; i < samples_.size(); i += every) {
            const Sample& s = samples_[i];
            // An open mesh has no inside: candidates are on the surface itself.
            if (!mesh.closed) {
                balls_.push_back({s.position, 0.0});
                continue;
            }
            // Thickness of the body along the inward normal.
            const double crossing = grid.first_crossing(s.position, s.position - size * s.normal, kOnPlane * size);
            if (crossing > 1.0) {
                continue;  // the ray hits an edge, or the mesh intersects itself
            }
            // Shrinking tests samples only; the exact distance keeps the ball inside.
            Ball ball = inner_ball(samples_, s, max_radius, crossing * size);
            ball.radius = std::min(surface.distance(ball.centre), max_radius);
            if (ball.radius > kOnPlane * size) {
                balls_.push_back(ball);
            }
        }
    }

    [[nodiscard]] std::size_t size() const noexcept { return balls_.size(); }
    [[nodiscard]] std::size_t samples() const noexcept { return samples_.size(); }
    [[nodiscard]] const Ball& operator[](std::size_t candidate) const { return balls_[candidate]; }
    [[nodiscard]] double pitch() const noexcept { return pitch_; }  // m, of the samples

    /// m, from the ball's centre to a sample.
    [[nodiscard]] double distance(const Ball& ball, std::size_t sample) const {
        return glm::length(samples_[sample].position - ball.centre);
    }

    /// m: up to this distance from a ball's centre, samples have an error of at most `allowance`. Negative: the error
    /// of all is larger.
    [[nodiscard]] double reach(const Ball& ball, double allowance) const {
        if (weighted_) {
            return ball.radius + allowance * std::sqrt(size_ * ball.radius);
        }
        if (!(fixed_ > 0.0)) {
            return ball.radius + allowance;
        }
        return closed_ && fixed_ - ball.radius > allowance ? -1.0 : fixed_ + allowance;
    }

    /// m^2, from the ball's centre to a sample.
    [[nodiscard]] double squared_distance(const Ball& ball, std::size_t sample) const {
        const Vec3 arm = samples_[sample].position - ball.centre;
        return glm::dot(arm, arm);
    }

    /// An allowance at which a single candidate covers all samples.
    [[nodiscard]] double sufficient_allowance() const {
        double largest = 0.0;
        for (const Ball& ball : balls_) {
            largest = std::max(largest, ball.radius);
        }
        return weighted_ ? std::sqrt(size_ / largest) : size_;
    }

    /// From now on divides sample errors by the square root of the ball's radius, so that thin parts are covered more
    /// closely. No effect for an open mesh or a fixed radius.
    void weight_by_radius() noexcept { weighted_ = closed_ && !(fixed_ > 0.0); }

    /// Error of a sample that one ball has to cover: its distance from the ball's surface, m; weighted if
    /// weight_by_radius() was called. At a fixed radius, at least the ball's protrusion.
    [[nodiscard]] double sample_error(const Ball& ball, std::size_t sample) const {
        const double distance = this->distance(ball, sample);
        if (weighted_) {
            return (distance - ball.radius) / std::sqrt(size_ * ball.radius);
        }
        if (!(fixed_ > 0.0)) {
            return distance - ball.radius;
        }
        return closed_ ? std::max(distance - fixed_, fixed_ - ball.radius) : distance - fixed_;
    }

  private:
    std::vector<Sample> samples_;
    std::vector<Ball> balls_;
    double fixed_;
    double pitch_ = 0.0;
    double size_ = 0.0;  // m, of the mesh
    bool closed_ = false;
    bool weighted_ = false;
};

using Choice = std::vector<std::uint32_t>;  // indices of candidates
using Bits = std::vector<std::uint64_t>;

/// Greedy set cover: candidates that leave no sample an error above `allowance`; empty if more than `max_count` are
/// needed.
Choice choose(const Candidates& candidates, double allowance, std::size_t max_count) {
    // Bit s of row c: candidate c covers sample s.
    const std::size_t words = (candidates.samples() + 63) / 64;
    Bits within(candidates.size() * words, 0);
    for (std::size_t c = 0; c < candidates.size(); ++c) {
        const Ball& ball = candidates[c];
        const double reach = candidates.reach(ball, allowance);
        const double squared = reach < 0.0 ? -1.0 : reach * reach;
        for (std::size_t s = 0; s < candidates.samples(); ++s) {
            const bool taken = candidates.squared_distance(ball, s) <= squared;
            within[c * words + s / 64] |= static_cast<std::uint64_t>(taken) << (s % 64);
        }
    }
    // Samples that are not covered yet, and how many of them a candidate covers.
    Bits uncovered(words, 0);
    for (std::size_t s = 0; s < candidates.samples(); ++s) {
        uncovered[s / 64] |= std::uint64_t{1} << (s % 64);
    }
    const auto gain_of = [&](std::uint32_t c) {
        int gain = 0;
        for (std::size_t w = 0; w < words; ++w) {
            gain += std::popcount(within[c * words + w] & uncovered[w]);
        }
        return gain;
    };
    // Lazy greedy (Minoux 1978): gains only shrink, so an outdated gain is an upper bound. Ties go to the lower index,
    // for the same result on every machine.
    std::vector<int> gains(candidates.size(), static_cast<int>(candidates.samples()));
    Choice chosen;
    std::size_t left = candidates.samples();
    while (left > 0) {
        // The candidate with the greatest gain; recompute only those whose bound could beat it.
        auto winner = static_cast<std::uint32_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
        gains[winner] = gain_of(winner);
        int best = gains[winner];
        for (std::uint32_t c = 0; c < candidates.size(); ++c) {
            // Bound too small, or equal with a higher index: cannot win.
            if (gains[c] < best || (gains[c] == best && c >= winner)) {
                continue;
            }
            gains[c] = gain_of(c);
            if (gains[c] > best || (gains[c] == best && c < winner)) {
                best = gains[c];
                winner = c;
            }
        }
        // Some sample is out of reach of all candidates, or the count is used up.
        if (best == 0 || chosen.size() == max_count) {
            return {};
        }
        chosen.push_back(winner);
        left -= static_cast<std::size_t>(best);
        // Remove the samples that the winner covers.
        for (std::size_t w = 0; w < words; ++w) {
            uncovered[w] &= ~within[winner * words + w];
        }
    }
    return chosen;
}

/// Assignment of each sample to the ball with the smallest error, and the worst error.
struct Assignment {
    std::vector<std::uint32_t> owner;  // per sample: index of the ball
    double worst = -kInfinite;         // m, or weighted
    std::size_t worst_sample = 0;
};

Assignment assign(const Candidates& candidates, std::span<const Ball> chosen) {
    Assignment result;
    result.owner.resize(candidates.samples());
    for (std::size_t s = 0; s < candidates.samples(); ++s) {
        // Owner of the sample: the ball with the smallest error.
        double min_error = kInfinite;
        for (std::uint32_t k = 0; k < chosen.size(); ++k) {
            const double error = candidates.sample_error(chosen[k], s);
            if (error < min_error) {
                min_error = error;
                result.owner[s] = k;
            }
        }
        // The worst-covered sample is the error of the cover.
        if (min_error > result.worst) {
            result.worst = min_error;
            result.worst_sample = s;
        }
    }
    return result;
}

std::vector<Ball> balls_of(const Candidates& candidates, const Choice& chosen) {
    std::vector<Ball> balls;
    for (const std::uint32_t c : chosen) {
        balls.push_back(candidates[c]);
    }
    return balls;
}

/// The samples that each ball owns.
std::vector<std::vector<std::uint32_t>> owned_by(const Assignment& assignment, std::size_t count) {
    std::vector<std::vector<std::uint32_t>> owned(count);
    for (std::uint32_t s = 0; s < assignment.owner.size(); ++s) {
        owned[assignment.owner[s]].push_back(s);
    }
    return owned;
}

/// Lloyd relaxation with the worst error in place of the mean square: moves each ball to the candidate with the
/// smallest worst error over the ball's own samples, and reassigns, while the worst error shrinks.
Choice relaxed(const Candidates& candidates, Choice chosen) {
    Assignment current = assign(candidates, balls_of(candidates, chosen));
    for (int round = 0; round < kRelaxations; ++round) {
        const std::vector<std::vector<std::uint32_t>> owned = owned_by(current, chosen.size());
        Choice moved = chosen;
        for (std::size_t k = 0; k < chosen.size(); ++k) {
            // Worst error of a candidate over the samples of ball k; ends early once it reaches `enough`.
            const auto worst_of = [&](std::uint32_t candidate, double enough) {
                double worst = -kInfinite;
                for (const std::uint32_t s : owned[k]) {
                    worst = std::max(worst, candidates.sample_error(candidates[candidate], s));
                    if (worst >= enough) {
                        break;
                    }
                }
                return worst;
            };
            // A candidate is abandoned as soon as it is no better than the best so far.
            double min_error = worst_of(chosen[k], kInfinite);
            for (std::uint32_t c = 0; c < candidates.size(); ++c) {
                const double worst = worst_of(c, min_error);
                if (worst < min_error) {
                    min_error = worst;
                    moved[k] = c;
                }
            }
        }
        // Owners change with the balls: reassign, and stop when the cover is no better.
        Assignment next = assign(candidates, balls_of(candidates, moved));
        if (!(next.worst < current.worst)) {
            break;
        }
        chosen = std::move(moved);
        current = std::move(next);
    }
    return chosen;
}

/// The largest unused candidate that at least halves the worst error.
std::uint32_t worst_sample_candidate(const Candidates& candidates, const Choice& chosen) {
    const Assignment current = assign(candidates, balls_of(candidates, chosen));
    std::uint32_t winner = 0;
    double largest = -1.0;
    for (std::uint32_t c = 0; c < candidates.size(); ++c) {
        // Large balls are preferred, because they also cover more of the samples around.
        const bool halves =
            candidates.sample_error(candidates[c], current.worst_sample) <= 0.5 * std::max(0.0, current.worst);
        if (halves && candidates[c].radius > largest && std::find(chosen.begin(), chosen.end(), c) == chosen.end()) {
            largest = candidates[c].radius;
            winner = c;
        }
    }
    return winner;
}

/// The ball whose removal leaves the smallest worst error: its samples' second smallest errors decide.
std::size_t most_redundant(const Candidates& candidates, const std::vector<Ball>& balls) {
    std::vector<double> without(balls.size(), -kInfinite);
    for (std::size_t s = 0; s < candidates.samples(); ++s) {
        // Smallest and second smallest error of the sample.
        double first = kInfinite;
        double second = kInfinite;
        std::size_t owner = 0;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            const double error = candidates.sample_error(balls[k], s);
            if (error < first) {
                second = first;
                first = error;
                owner = k;
            } else {
                second = std::min(second, error);
            }
        }
        // Without its owner, the sample falls to the second.
        without[owner] = std::max(without[owner], second);
    }
    return static_cast<std::size_t>(std::min_element(without.begin(), without.end()) - without.begin());
}

/// `count` candidates with a small worst error: bisection of the allowance, then relaxation and swaps.
Choice choose_count(const Candidates& candidates, std::size_t count) {
    count = std::min(count, candidates.size());
    // Bisect for the smallest allowance that `count` candidates can meet.
    const double max_allowance = candidates.sufficient_allowance();
    double allowance = max_allowance;
    double too_small = 0.0;
    Choice best = choose(candidates, allowance, count);
    for (int k = 0; k < kHalvings && allowance - too_small > kCoverResolution * max_allowance; ++k) {
        // Greedy cover at the middle: too small an allowance if it needs more than `count`.
        const double middle = 0.5 * (allowance + too_small);
        Choice chosen = choose(candidates, middle, count);
        if (chosen.empty()) {
            too_small = middle;
        } else {
            allowance = middle;
            best = std::move(chosen);
        }
    }
    // Use up the count where it helps most, then relax.
    while (best.size() < count) {
        best.push_back(worst_sample_candidate(candidates, best));
    }
    best = relaxed(candidates, std::move(best));
    // Swap the most redundant ball for one at the worst sample while that improves the cover.
    double worst = assign(candidates, balls_of(candidates, best)).worst;
    for (int swap = 0; swap < kSwaps; ++swap) {
        // Remove the ball whose loss costs least, and cover the worst sample instead.
        Choice tried = best;
        tried.erase(tried.begin() +
                    static_cast<std::ptrdiff_t>(most_redundant(candidates, balls_of(candidates, best))));
        tried.push_back(worst_sample_candidate(candidates, tried));
        tried = relaxed(candidates, std::move(tried));
        const double tried_worst = assign(candidates, balls_of(candidates, tried)).worst;
        if (!(tried_worst < worst)) {
            break;
        }
        worst = tried_worst;
        best = std::move(tried);
    }
    return best;
}

/// Pattern search: moves each ball along the axes, in steps that halve, to where the worst error of its own samples is
/// smaller. A step is shorter than the distance to the surface, so the ball stays inside.
std::vector<Ball> refined(const TriangleMesh& mesh, const Candidates& candidates, std::vector<Ball> balls,
                          double max_radius) {
    const Surface surface(mesh);
    Assignment current = assign(candidates, balls);
    for (int round = 0; round < kRefinements; ++round) {
        // Each ball is optimised for its own samples, with the assignment fixed.
        const std::vector<std::vector<std::uint32_t>> owned = owned_by(current, balls.size());
        std::vector<Ball> moved = balls;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            const auto worst_of = [&](const Ball& ball) {
                double worst = -kInfinite;
                for (const std::uint32_t s : owned[k]) {
                    worst = std::max(worst, candidates.sample_error(ball, s));
                }
                return worst;
            };
            // Steps start at the pitch of the samples and halve when none of the six directions gains.
            double min_error = worst_of(moved[k]);
            double step = candidates.pitch();
            int halvings = 0;
            for (int moves = 0; moves < kMaxMoves && halvings < kStepHalvings; ++moves) {
                // Try a step in each of the six axis directions; halve the step when none is worth it.
                const Ball from = moved[k];
                const double step_length = std::min(step, 0.5 * from.radius);
                for (int direction = 0; direction < 6; ++direction) {
                    Ball tried = from;
                    tried.centre[direction / 2] += direction % 2 == 0 ? step_length : -step_length;
                    // At the new centre the ball is again as large as fits.
                    tried.radius = std::min(surface.distance(tried.centre), max_radius);
                    const double worst = worst_of(tried);
                    // Accept only gains that are worth a move.
                    if (worst < min_error - kMinGain * step_length) {
                        min_error = worst;
                        moved[k] = tried;
                    }
                }
                if (moved[k].centre == from.centre) {
                    step *= 0.5;
                    ++halvings;
                }
            }
        }
        // Keep the round only if the worst error over all samples shrinks.
        Assignment next = assign(candidates, moved);
        if (!(next.worst < current.worst)) {
            break;
        }
        balls = std::move(moved);
        current = std::move(next);
    }
    return balls;
}

UncoveredDepth uncovered_depth(const TriangleMesh& mesh, std::span<const Ball> balls) {
    const Aabb box = aabb_of(mesh.vertices);
    UncoveredDepth depth(balls, kCoverResolution * glm::length(box.size()));
    for (const auto& [i, j, k] : mesh.triangles) {
        depth.add({mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]});
    }
    return depth;
}

/// The spheres of a choice: refined positions, and radii that balance uncovered depth against protrusion.
std::vector<Ball> spheres_of(const TriangleMesh& mesh, const Candidates& candidates, const Choice& chosen,
                             double fixed_radius) {
    // Inscribed balls at refined positions.
    std::vector<Ball> balls = balls_of(candidates, chosen);
    if (mesh.closed) {
        balls = refined(mesh, candidates, std::move(balls), fixed_radius > 0.0 ? fixed_radius : kInfinite);
    }
    // A fixed radius leaves nothing to balance.
    if (fixed_radius > 0.0) {
        for (Ball& ball : balls) {
            ball.radius = fixed_radius;
        }
        return balls;
    }
    // An open mesh has no inside, so protrusion does not count: grow all balls until nothing is uncovered.
    if (!mesh.closed) {
        const double uncovered = std::max(0.0, uncovered_depth(mesh, balls).bound());
        for (Ball& ball : balls) {
            ball.radius += uncovered;
        }
        return balls;
    }
    // Each ball grows by half of the uncovered depth of its own samples, which then equals its protrusion there.
    const std::vector<Ball> inner = balls;
    const std::vector<std::vector<std::uint32_t>> owned = owned_by(assign(candidates, inner), inner.size());
    for (std::size_t k = 0; k < balls.size(); ++k) {
        double uncovered = 0.0;
        for (const std::uint32_t s : owned[k]) {
            uncovered = std::max(uncovered, candidates.distance(inner[k], s) - inner[k].radius);
        }
        balls[k].radius += 0.5 * uncovered;
    }
    // Points between samples are farther away. The ball nearest to the worst of them takes half of the difference.
    for (int round = 0; round < kMaxGrowthRounds; ++round) {
        // Protrusion: largest distance by which a grown ball stands out of the mesh.
        double protrusion = 0.0;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            protrusion = std::max(protrusion, balls[k].radius - inner[k].radius);
        }
        const UncoveredDepth uncovered = uncovered_depth(mesh, balls);
        // Balanced: uncovered depth exceeds protrusion by at most the factor kBalanced.
        if (uncovered.bound() <= kBalanced * protrusion) {
            break;
        }
        // Ball nearest to the point that is farthest from all balls.
        std::size_t nearest = 0;
        double min_distance = kInfinite;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            const double distance = glm::length(uncovered.farthest() - balls[k].centre) - balls[k].radius;
            if (distance < min_distance) {
                min_distance = distance;
                nearest = k;
            }
        }
        balls[nearest].radius += 0.5 * (uncovered.bound() - protrusion);
    }
    return balls;
}

}  // namespace

double depth_in(const TriangleMesh& mesh, const Vec3& p) {
    // Distance from the nearest triangle; the winding number gives the sign.
    double squared = kInfinite;
    for (const auto& [i, j, k] : mesh.triangles) {
        const TriangleCorners corners{mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]};
        squared = std::min(squared, closest_point_on_triangle(p, corners).squared_distance);
    }
    const bool inside = winding_number(mesh.vertices, mesh.triangles, p) > 0.5;
    return inside ? std::sqrt(squared) : -std::sqrt(squared);
}

CoverError measure_cover(const TriangleMesh& mesh, std::span<const Ball> balls) {
    if (balls.empty()) {
        refuse_cover("at least one sphere is needed");
    }
    // Uncovered: greatest distance of the surface from the balls. Protrusion: radius beyond the depth of the centre.
    CoverError error{std::max(0.0, uncovered_depth(mesh, balls).bound()), 0.0};
    for (const Ball& ball : balls) {
        error.protrusion = std::max(error.protrusion, ball.radius - (mesh.closed ? depth_in(mesh, ball.centre) : 0.0));
    }
    return error;
}

std::vector<Ball> cover_with_spheres(const TriangleMesh& mesh, const CoverSettings& settings) {
    // Refuse what no cover can satisfy.
    if (!(surface_area(mesh) > 0.0)) {
        refuse_cover("the mesh has no area");
    }
    if (!(settings.radius >= 0.0) || !std::isfinite(settings.radius)) {
        refuse_cover("the radius must be 0 or more");
    }
    if (settings.count == 0 && !(settings.error > 0.0)) {
        refuse_cover("give a number of spheres or a cover error");
    }
    if (settings.count > settings.max_count) {
        refuse_cover(std::to_string(settings.count) + " spheres exceed the maximum of " +
                     std::to_string(settings.max_count));
    }
    // Inscribed balls to choose from.
    Candidates candidates(mesh, settings.radius);
    if (candidates.size() == 0) {
        refuse_cover("no ball fits into the mesh; it must enclose a volume and be oriented outward");
    }
    // Given number: thin parts should be covered more closely than thick ones.
    if (settings.count > 0) {
        candidates.weight_by_radius();
        return spheres_of(mesh, candidates, choose_count(candidates, settings.count), settings.radius);
    }
    // Balls grow by half of their samples' errors, so the allowance is twice the error. Points between samples may be
    // farther away: retry with smaller allowances.
    const double allowance = settings.error * (mesh.closed && settings.radius == 0.0 ? 2.0 : 1.0);
    constexpr std::array slack{1.0, 0.9, 0.8, 0.65, 0.5};
    for (const double part : slack) {
        const Choice chosen = choose(candidates, part * allowance, settings.max_count);
        if (chosen.empty()) {
            break;
        }
        // Measure the finished cover against the mesh itself, not against the samples.
        std::vector<Ball> balls = spheres_of(mesh, candidates, relaxed(candidates, chosen), settings.radius);
        const CoverError error = measure_cover(mesh, balls);
        const bool only_uncovered = !mesh.closed && settings.radius > 0.0;
        if ((only_uncovered ? error.uncovered : std::max(error.uncovered, error.protrusion)) <= settings.error) {
            return balls;
        }
    }
    // Not possible: report the error that the greatest number of spheres leaves.
    const CoverError left = measure_cover(
        mesh, spheres_of(mesh, candidates, choose_count(candidates, settings.max_count), settings.radius));
    refuse_cover("an error of " + std::to_string(settings.error) + " m needs more than " +
                 std::to_string(settings.max_count) + " spheres; with that many, the mesh is up to " +
                 std::to_string(left.uncovered) + " m outside the spheres, and the spheres up to " +
                 std::to_string(left.protrusion) + " m outside the mesh. Allow a larger error" +
                 (settings.radius > 0.0 ? ", or change the radius" : ""));
}

}  // namespace haptic::sim
