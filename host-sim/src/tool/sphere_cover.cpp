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

#include "tool/bare_depth.hpp"
#include <haptic/sim/closest_point.hpp>
#include "contact/verification.hpp"
#include "model/sample_graph.hpp"
#include "generators/triangle_grid.hpp"

namespace haptic::sim {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kSamples = 2500.0;  // about; of the surface
constexpr std::size_t kMostCandidates = 1000;
constexpr double kMostCuts = 64.0;  // of a triangle's side, by samples
constexpr double kOnPlane = 1e-9;   // of the mesh's size
constexpr int kMostShrinkings = 30;
constexpr double kShrunken = 1.0 - 1e-3;  // a ball this near to touching nothing inside is not shrunk on
constexpr int kHalvings = 14;
constexpr int kRelaxations = 40;
constexpr int kGrowings = 24;
constexpr double kAlike = 1.03;  // bare over proud
constexpr int kSwaps = 12;
constexpr int kPolishings = 4;
constexpr int kMostMoves = 40;
constexpr double kWorthwhile = 0.02;  // gain of a step, in steps
constexpr int kStepHalvings = 5;      // of the samples' pitch
constexpr double kFinest = 1e-4;      // of the mesh's size

[[noreturn]] void refuse(const std::string& why) {
    throw std::invalid_argument("sphere cover: " + why);
}

struct Box {
    Vec3 low{kInfinite};
    Vec3 high{-kInfinite};
};

Box box_of(const TriangleMesh& mesh) {
    Box box;
    for (const Vec3& p : mesh.vertices) {
        box.low = glm::min(box.low, p);
        box.high = glm::max(box.high, p);
    }
    return box;
}

struct Sample {
    Vec3 place{0.0};
    Vec3 normal{0.0};  // outward
};

/// Where a sample falls, and to which of six sides it looks: of those with the same key one is enough.
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

std::int64_t side_of(const Vec3& normal) {
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
        if (std::abs(normal[k]) > std::abs(normal[axis])) {
            axis = k;
        }
    }
    return 2 * axis + (normal[axis] < 0.0 ? 1 : 0);
}

/// Points of the surface about `pitch` apart, evenly over large triangles, one of many small ones.
std::vector<Sample> sample(const TriangleMesh& mesh, double pitch) {
    std::vector<Sample> samples;
    std::unordered_set<SampleKey, SampleKeyHash> taken;
    const std::size_t count = mesh.double_faced ? mesh.triangles.size() / 2 : mesh.triangles.size();
    for (std::size_t t = 0; t < count; ++t) {
        const auto& [i, j, k] = mesh.triangles[t];
        const Vec3& a = mesh.vertices[i];
        const Vec3 u = mesh.vertices[j] - a;
        const Vec3 v = mesh.vertices[k] - a;
        const Vec3 normal = glm::cross(u, v);
        const double twice_area = glm::length(normal);
        if (!(twice_area > 0.0)) {
            continue;
        }
        const double longest = std::sqrt(std::max({glm::dot(u, u), glm::dot(v, v), glm::dot(u - v, u - v)}));
        const int cuts = static_cast<int>(std::clamp(std::ceil(longest / (1.4 * pitch)), 1.0, kMostCuts));
        for (int row = 0; row < cuts; ++row) {
            for (int at = 0; at < 2 * (cuts - row) - 1; ++at) {
                // Centroids of the small triangles: those that stand, and those that hang between them.
                const double third = at % 2 == 0 ? 1.0 / 3.0 : 2.0 / 3.0;
                const int quad = at / 2;
                const double along = (quad + third) / cuts;
                const double across = (row + third) / cuts;
                const Sample found{a + along * u + across * v, normal / twice_area};
                const Vec3 cell = glm::floor(found.place / pitch);
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

/// The ball inside that touches at the sample and somewhere else, or has the radius `most`. `thickness` is how far it
/// is from the sample straight through the body.
Ball inner_ball(const std::vector<Sample>& samples, const Sample& touched, double most, double thickness) {
    const double widest = std::min(most, 0.5 * thickness);
    Ball ball{touched.place - widest * touched.normal, widest};
    for (int k = 0; k < kMostShrinkings; ++k) {
        double nearest = kInfinite;
        const Sample* other = nullptr;
        for (const Sample& sample : samples) {
            const Vec3 arm = sample.place - ball.centre;
            const double squared = glm::dot(arm, arm);
            if (squared < nearest) {
                nearest = squared;
                other = &sample;
            }
        }
        const Vec3 chord = touched.place - other->place;
        const double depth = glm::dot(chord, touched.normal);
        if (nearest >= kShrunken * kShrunken * ball.radius * ball.radius || !(depth > 0.0)) {
            break;
        }
        ball.radius = std::min(ball.radius, glm::dot(chord, chord) / (2.0 * depth));
        ball.centre = touched.place - ball.radius * touched.normal;
    }
    return ball;
}

/// Distances from the surface, each from all triangles that may be nearest.
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

    /// m
    [[nodiscard]] double distance(const Vec3& p) const {
        double least = kInfinite;
        for (std::size_t t = 0; t < bounds_.size(); ++t) {
            const Vec3 arm = p - bounds_[t].centre;
            const double within = least + bounds_[t].radius;
            if (glm::dot(arm, arm) >= within * within) {
                continue;
            }
            const auto& [i, j, k] = mesh_.triangles[t];
            const TriangleCorners corners{mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k]};
            least = std::min(least, std::sqrt(closest_point_on_triangle(p, corners).squared_distance));
        }
        return least;
    }

  private:
    const TriangleMesh& mesh_;
    std::vector<Ball> bounds_;
};

/// Where spheres may be; `radius` of a candidate is that of the ball that fits inside.
class Candidates {
  public:
    Candidates(const TriangleMesh& mesh, double fixed_radius) : fixed_(fixed_radius), closed_(mesh.closed) {
        pitch_ = std::sqrt(surface_area(mesh) / (mesh.double_faced ? 2.0 : 1.0) / kSamples);
        samples_ = sample(mesh, pitch_);
        const Box box = box_of(mesh);
        const double size = glm::length(box.high - box.low);
        size_ = size;
        const double most = fixed_ > 0.0 ? fixed_ : size;
        const std::size_t every = (samples_.size() + kMostCandidates - 1) / kMostCandidates;
        const TriangleGrid grid(mesh.vertices, mesh.triangles, 2.0 * pitch_);
        const Surface surface(mesh);
        for (std::size_t i = 0; i < samples_.size(); i += every) {
            const Sample& s = samples_[i];
            if (!mesh.closed) {
                balls_.push_back({s.place, 0.0});
                continue;
            }
            const double crossing = grid.first_crossing(s.place, s.place - size * s.normal, kOnPlane * size);
            if (crossing > 1.0) {
                continue;  // through an edge, or the skin passes through itself
            }
            Ball ball = inner_ball(samples_, s, most, crossing * size);
            ball.radius = std::min(surface.distance(ball.centre), most);
            if (ball.radius > kOnPlane * size) {
                balls_.push_back(ball);
            }
        }
    }

    [[nodiscard]] std::size_t size() const noexcept { return balls_.size(); }
    [[nodiscard]] std::size_t samples() const noexcept { return samples_.size(); }
    [[nodiscard]] const Ball& operator[](std::size_t candidate) const { return balls_[candidate]; }
    [[nodiscard]] double pitch() const noexcept { return pitch_; }  // m, of the samples

    /// m, of a sample from the centre.
    [[nodiscard]] double distance(const Ball& ball, std::size_t sample) const {
        return glm::length(samples_[sample].place - ball.centre);
    }

    /// m, the distance of the samples that a candidate misses by no more than `allowance`; negative if it does so with
    /// all.
    [[nodiscard]] double reach(const Ball& ball, double allowance) const {
        if (relative_) {
            return ball.radius + allowance * std::sqrt(size_ * ball.radius);
        }
        if (!(fixed_ > 0.0)) {
            return ball.radius + allowance;
        }
        return closed_ && fixed_ - ball.radius > allowance ? -1.0 : fixed_ + allowance;
    }

    /// Of a sample from the centre, m^2.
    [[nodiscard]] double squared_distance(const Ball& ball, std::size_t sample) const {
        const Vec3 arm = samples_[sample].place - ball.centre;
        return glm::dot(arm, arm);
    }

    /// Some candidate misses no sample by more.
    [[nodiscard]] double enough() const {
        double largest = 0.0;
        for (const Ball& ball : balls_) {
            largest = std::max(largest, ball.radius);
        }
        return relative_ ? std::sqrt(size_ / largest) : size_;
    }

    /// Misses count from now on by the root of the radius of the ball that has them, instead of m.
    void count_relative() noexcept { relative_ = closed_ && !(fixed_ > 0.0); }

    /// By how much a ball misses a sample, m or, if that is how misses count, in parts of its radius; at a fixed
    /// radius, also what it stands proud.
    [[nodiscard]] double miss(const Ball& ball, std::size_t sample) const {
        const double distance = this->distance(ball, sample);
        if (relative_) {
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
    bool relative_ = false;
};

using Choice = std::vector<std::uint32_t>;  // of candidates
using Bits = std::vector<std::uint64_t>;

/// Candidates that miss no sample by more than `allowance`; empty if it takes more than `most`.
Choice choose(const Candidates& candidates, double allowance, std::size_t most) {
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
    Bits open(words, 0);
    for (std::size_t s = 0; s < candidates.samples(); ++s) {
        open[s / 64] |= std::uint64_t{1} << (s % 64);
    }
    const auto gain_of = [&](std::uint32_t c) {
        int gain = 0;
        for (std::size_t w = 0; w < words; ++w) {
            gain += std::popcount(within[c * words + w] & open[w]);
        }
        return gain;
    };
    // What a candidate would gain only ever gets less, so an old gain bounds it (Minoux 1978).
    std::vector<int> gains(candidates.size(), static_cast<int>(candidates.samples()));
    Choice chosen;
    std::size_t left = candidates.samples();
    while (left > 0) {
        auto winner = static_cast<std::uint32_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
        gains[winner] = gain_of(winner);
        int best = gains[winner];
        for (std::uint32_t c = 0; c < candidates.size(); ++c) {
            if (gains[c] < best || (gains[c] == best && c >= winner)) {
                continue;
            }
            gains[c] = gain_of(c);
            if (gains[c] > best || (gains[c] == best && c < winner)) {
                best = gains[c];
                winner = c;
            }
        }
        if (best == 0 || chosen.size() == most) {
            return {};
        }
        chosen.push_back(winner);
        left -= static_cast<std::size_t>(best);
        for (std::size_t w = 0; w < words; ++w) {
            open[w] &= ~within[winner * words + w];
        }
    }
    return chosen;
}

/// The chosen one that misses each sample least, and by how much.
struct Assignment {
    std::vector<std::uint32_t> owner;  // per sample, into the choice
    double worst = -kInfinite;         // m
    std::size_t worst_sample = 0;
};

Assignment assign(const Candidates& candidates, std::span<const Ball> chosen) {
    Assignment result;
    result.owner.resize(candidates.samples());
    for (std::size_t s = 0; s < candidates.samples(); ++s) {
        double least = kInfinite;
        for (std::uint32_t k = 0; k < chosen.size(); ++k) {
            const double miss = candidates.miss(chosen[k], s);
            if (miss < least) {
                least = miss;
                result.owner[s] = k;
            }
        }
        if (least > result.worst) {
            result.worst = least;
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

/// Of those that own samples: which ones.
std::vector<std::vector<std::uint32_t>> owned_by(const Assignment& assignment, std::size_t count) {
    std::vector<std::vector<std::uint32_t>> owned(count);
    for (std::uint32_t s = 0; s < assignment.owner.size(); ++s) {
        owned[assignment.owner[s]].push_back(s);
    }
    return owned;
}

/// Moves each chosen one to the candidate that misses what it owns least, as long as the whole gains by it.
Choice relaxed(const Candidates& candidates, Choice chosen) {
    Assignment now = assign(candidates, balls_of(candidates, chosen));
    for (int round = 0; round < kRelaxations; ++round) {
        const std::vector<std::vector<std::uint32_t>> owned = owned_by(now, chosen.size());
        Choice moved = chosen;
        for (std::size_t k = 0; k < chosen.size(); ++k) {
            const auto worst_of = [&](std::uint32_t candidate, double enough) {
                double worst = -kInfinite;
                for (const std::uint32_t s : owned[k]) {
                    worst = std::max(worst, candidates.miss(candidates[candidate], s));
                    if (worst >= enough) {
                        break;
                    }
                }
                return worst;
            };
            double least = worst_of(chosen[k], kInfinite);
            for (std::uint32_t c = 0; c < candidates.size(); ++c) {
                const double worst = worst_of(c, least);
                if (worst < least) {
                    least = worst;
                    moved[k] = c;
                }
            }
        }
        Assignment then = assign(candidates, balls_of(candidates, moved));
        if (!(then.worst < now.worst)) {
            break;
        }
        chosen = std::move(moved);
        now = std::move(then);
    }
    return chosen;
}

/// A candidate where most is missed: the largest that halves it.
std::uint32_t helper(const Candidates& candidates, const Choice& chosen) {
    const Assignment now = assign(candidates, balls_of(candidates, chosen));
    std::uint32_t winner = 0;
    double largest = -1.0;
    for (std::uint32_t c = 0; c < candidates.size(); ++c) {
        const bool halves = candidates.miss(candidates[c], now.worst_sample) <= 0.5 * std::max(0.0, now.worst);
        if (halves && candidates[c].radius > largest && std::find(chosen.begin(), chosen.end(), c) == chosen.end()) {
            largest = candidates[c].radius;
            winner = c;
        }
    }
    return winner;
}

/// Of some balls the one without which the others miss least.
std::size_t least_missed(const Candidates& candidates, const std::vector<Ball>& balls) {
    std::vector<double> without(balls.size(), -kInfinite);
    for (std::size_t s = 0; s < candidates.samples(); ++s) {
        double first = kInfinite;
        double second = kInfinite;
        std::size_t owner = 0;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            const double miss = candidates.miss(balls[k], s);
            if (miss < first) {
                second = first;
                first = miss;
                owner = k;
            } else {
                second = std::min(second, miss);
            }
        }
        without[owner] = std::max(without[owner], second);
    }
    return static_cast<std::size_t>(std::min_element(without.begin(), without.end()) - without.begin());
}

/// As many as asked for, with the least allowance found.
Choice choose_count(const Candidates& candidates, std::size_t count) {
    count = std::min(count, candidates.size());
    const double most = candidates.enough();
    double enough = most;
    double too_little = 0.0;
    Choice best = choose(candidates, enough, count);
    for (int k = 0; k < kHalvings && enough - too_little > kFinest * most; ++k) {
        const double middle = 0.5 * (enough + too_little);
        Choice chosen = choose(candidates, middle, count);
        if (chosen.empty()) {
            too_little = middle;
        } else {
            enough = middle;
            best = std::move(chosen);
        }
    }
    while (best.size() < count) {
        best.push_back(helper(candidates, best));
    }
    best = relaxed(candidates, std::move(best));
    double worst = assign(candidates, balls_of(candidates, best)).worst;
    for (int swap = 0; swap < kSwaps; ++swap) {
        Choice tried = best;
        tried.erase(tried.begin() + static_cast<std::ptrdiff_t>(least_missed(candidates, balls_of(candidates, best))));
        tried.push_back(helper(candidates, tried));
        tried = relaxed(candidates, std::move(tried));
        const double then = assign(candidates, balls_of(candidates, tried)).worst;
        if (!(then < worst)) {
            break;
        }
        worst = then;
        best = std::move(tried);
    }
    return best;
}

/// Moves balls in small steps to where they miss less of what they own. A step is shorter than the way to the surface,
/// so they stay inside.
std::vector<Ball> polished(const TriangleMesh& mesh, const Candidates& candidates, std::vector<Ball> balls,
                           double most) {
    const Surface surface(mesh);
    Assignment now = assign(candidates, balls);
    for (int round = 0; round < kPolishings; ++round) {
        const std::vector<std::vector<std::uint32_t>> owned = owned_by(now, balls.size());
        std::vector<Ball> moved = balls;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            const auto worst_of = [&](const Ball& ball) {
                double worst = -kInfinite;
                for (const std::uint32_t s : owned[k]) {
                    worst = std::max(worst, candidates.miss(ball, s));
                }
                return worst;
            };
            double least = worst_of(moved[k]);
            double step = candidates.pitch();
            int halvings = 0;
            for (int moves = 0; moves < kMostMoves && halvings < kStepHalvings; ++moves) {
                const Ball from = moved[k];
                const double way = std::min(step, 0.5 * from.radius);
                for (int direction = 0; direction < 6; ++direction) {
                    Ball tried = from;
                    tried.centre[direction / 2] += direction % 2 == 0 ? way : -way;
                    tried.radius = std::min(surface.distance(tried.centre), most);
                    const double worst = worst_of(tried);
                    if (worst < least - kWorthwhile * way) {
                        least = worst;
                        moved[k] = tried;
                    }
                }
                if (moved[k].centre == from.centre) {
                    step *= 0.5;
                    ++halvings;
                }
            }
        }
        Assignment then = assign(candidates, moved);
        if (!(then.worst < now.worst)) {
            break;
        }
        balls = std::move(moved);
        now = std::move(then);
    }
    return balls;
}

BareDepth bare_depth(const TriangleMesh& mesh, std::span<const Ball> balls) {
    const Box box = box_of(mesh);
    BareDepth bare(balls, kFinest * glm::length(box.high - box.low));
    for (const auto& [i, j, k] : mesh.triangles) {
        bare.take({mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]});
    }
    return bare;
}

/// The spheres of a choice, as large as is best.
std::vector<Ball> spheres_of(const TriangleMesh& mesh, const Candidates& candidates, const Choice& chosen,
                             double fixed_radius) {
    std::vector<Ball> balls = balls_of(candidates, chosen);
    if (mesh.closed) {
        balls = polished(mesh, candidates, std::move(balls), fixed_radius > 0.0 ? fixed_radius : kInfinite);
    }
    if (fixed_radius > 0.0) {
        for (Ball& ball : balls) {
            ball.radius = fixed_radius;
        }
        return balls;
    }
    if (!mesh.closed) {
        const double missed = std::max(0.0, bare_depth(mesh, balls).bound());
        for (Ball& ball : balls) {
            ball.radius += missed;
        }
        return balls;
    }
    const std::vector<Ball> inner = balls;
    const std::vector<std::vector<std::uint32_t>> owned = owned_by(assign(candidates, inner), inner.size());
    for (std::size_t k = 0; k < balls.size(); ++k) {
        double missed = 0.0;
        for (const std::uint32_t s : owned[k]) {
            missed = std::max(missed, candidates.distance(inner[k], s) - inner[k].radius);
        }
        balls[k].radius += 0.5 * missed;
    }
    // What lies between the samples is missed by more: the ball nearest to the worst of it takes half of the rest.
    for (int round = 0; round < kGrowings; ++round) {
        double proud = 0.0;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            proud = std::max(proud, balls[k].radius - inner[k].radius);
        }
        const BareDepth bare = bare_depth(mesh, balls);
        if (bare.bound() <= kAlike * proud) {
            break;
        }
        std::size_t nearest = 0;
        double least = kInfinite;
        for (std::size_t k = 0; k < balls.size(); ++k) {
            const double miss = glm::length(bare.farthest() - balls[k].centre) - balls[k].radius;
            if (miss < least) {
                least = miss;
                nearest = k;
            }
        }
        balls[nearest].radius += 0.5 * (bare.bound() - proud);
    }
    return balls;
}

}  // namespace

double depth_in(const TriangleMesh& mesh, const Vec3& p) {
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
        refuse("there is no sphere");
    }
    CoverError error{std::max(0.0, bare_depth(mesh, balls).bound()), 0.0};
    for (const Ball& ball : balls) {
        error.proud = std::max(error.proud, ball.radius - (mesh.closed ? depth_in(mesh, ball.centre) : 0.0));
    }
    return error;
}

std::vector<Ball> cover_with_spheres(const TriangleMesh& mesh, const CoverSettings& settings) {
    if (!(surface_area(mesh) > 0.0)) {
        refuse("the mesh has no area");
    }
    if (!(settings.radius >= 0.0) || !std::isfinite(settings.radius)) {
        refuse("the radius must be 0 or more");
    }
    if (settings.count == 0 && !(settings.error > 0.0)) {
        refuse("say how many spheres, or the error that they may leave");
    }
    if (settings.count > settings.most_count) {
        refuse(std::to_string(settings.count) + " spheres are more than the " + std::to_string(settings.most_count) +
               " that are possible");
    }
    Candidates candidates(mesh, settings.radius);
    if (candidates.size() == 0) {
        refuse("no ball fits into the mesh: does it enclose a volume, outward oriented?");
    }
    if (settings.count > 0) {
        candidates.count_relative();
        return spheres_of(mesh, candidates, choose_count(candidates, settings.count), settings.radius);
    }
    // Balls grow by half of what they miss. What lies between samples may ask for a little more.
    const double asked = settings.error * (mesh.closed && settings.radius == 0.0 ? 2.0 : 1.0);
    constexpr std::array slack{1.0, 0.9, 0.8, 0.65, 0.5};
    for (const double part : slack) {
        const Choice chosen = choose(candidates, part * asked, settings.most_count);
        if (chosen.empty()) {
            break;
        }
        std::vector<Ball> balls = spheres_of(mesh, candidates, relaxed(candidates, chosen), settings.radius);
        const CoverError error = measure_cover(mesh, balls);
        const bool only_bare = !mesh.closed && settings.radius > 0.0;
        if ((only_bare ? error.bare : std::max(error.bare, error.proud)) <= settings.error) {
            return balls;
        }
    }
    const CoverError left = measure_cover(
        mesh, spheres_of(mesh, candidates, choose_count(candidates, settings.most_count), settings.radius));
    refuse("an error of " + std::to_string(settings.error) + " m takes more than " +
           std::to_string(settings.most_count) + " spheres, which leave " + std::to_string(left.bare) +
           " m bare and stand " + std::to_string(left.proud) + " m proud; allow more error" +
           (settings.radius > 0.0 ? ", or spheres of another radius" : ""));
}

}  // namespace haptic::sim
