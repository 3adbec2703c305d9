#include "reproduce/ccd_misses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <iomanip>
#include <ostream>
#include <random>

#include "contact/secure_position.hpp"
#include "contact/swept_tree.hpp"
#include "contact/thesis/thesis_ccd.hpp"
#include "contact/triangle_ccd.hpp"
#include "haptic/sim/mesh.hpp"
#include "reproduce/touch_oracle.hpp"

namespace haptic::sim::reproduce {

namespace {

constexpr double kInvented = 1.0001;  // of the radius: further than this nothing may be reported
constexpr double kClear = 1.0025;     // of the radius: nearer than this counts as touched when the step begins
constexpr double kRadius = 0.03;      // m, as in the thesis
constexpr double kTravel = 0.14;      // m a step: 14 m/s at 10 ms
constexpr double kPi = 3.14159265358979323846;

/// Random numbers that are the same with every standard library: std:: distributions are not.
class Random {
  public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1.0p-53;
    }
    Vec3 in_cube(double half) {
        const double x = uniform(-half, half);
        const double y = uniform(-half, half);
        return {x, y, uniform(-half, half)};
    }
    Vec3 direction() {
        for (;;) {
            const Vec3 v = in_cube(1.0);
            const double l = glm::length(v);
            if (l > 0.1 && l < 1.0) {
                return v / l;
            }
        }
    }

  private:
    std::mt19937_64 engine_;
};

/// Rodrigues' rotation.
Vec3 turned(const Vec3& x, const Vec3& axis, double angle) {
    const double c = std::cos(angle);
    return x * c + glm::cross(axis, x) * std::sin(angle) + axis * (glm::dot(axis, x) * (1.0 - c));
}

/// Counts what one method says of each motion.
class Tally {
  public:
    void add(const OracleTouch& truth, bool far_off, bool reported, double time) {
        if (truth.verdict == Verdict::Touches) {
            if (!reported) {
                ++score_.missed;
                return;
            }
            const double late = time - truth.time;
            score_.latest = seen_ == 0 ? late : std::max(score_.latest, late);
            sum_ += late;
            ++seen_;
        } else if (reported && far_off) {
            ++score_.invented;
        }
    }
    [[nodiscard]] CcdScore score() const {
        CcdScore score = score_;
        score.mean_late = seen_ > 0 ? sum_ / static_cast<double>(seen_) : 0.0;
        return score;
    }

  private:
    CcdScore score_;
    std::uint64_t seen_ = 0;
    double sum_ = 0.0;
};

enum class Motion { Translating, Deforming, Rotating, Slow };

/// About a sphere of radius 1 at the origin: a triangle of about its size that is aimed to pass nearby and goes as far
/// in the step as the cloth of the thesis does, or, where slow, less than a radius.
LinearTriangle draw_triangle(Random& random, Motion motion) {
    for (;;) {
        const Vec3 aim = random.in_cube(1.5);
        const double length = motion == Motion::Slow ? random.uniform(0.0, 1.0) : kTravel / kRadius;
        const Vec3 travel = random.direction() * length;
        const double ahead = random.uniform(0.0, 1.0);
        const Vec3 axis = random.direction();
        const double angle = random.uniform(-1.5, 1.5);
        LinearTriangle t;
        for (std::size_t k = 0; k < t.start.size(); ++k) {
            const Vec3 x = random.in_cube(1.5);
            const Vec3 change = random.in_cube(1.5);
            t.start[k] = aim - travel * ahead + x;
            t.end[k] = t.start[k] + travel;
            if (motion == Motion::Deforming) {
                t.end[k] += change;
            } else if (motion == Motion::Rotating) {
                t.end[k] += turned(x, axis, angle) - x;
            }
        }
        if (point_triangle_distance(Vec3(0.0), t.start) > kClear) {
            return t;
        }
    }
}

/// With the radius 1 about the origin.
CcdMisses measure_triangles(Motion motion, const char* name, const CcdMissesSettings& settings) {
    CcdMisses row;
    row.set = "triangle";
    row.motion = name;
    Random random(settings.seed * 16 + static_cast<std::uint64_t>(motion));
    Tally complete;
    Tally thesis;
    for (std::uint32_t k = 0; k < settings.triangles; ++k) {
        const LinearTriangle t = draw_triangle(random, motion);
        ++row.drawn;
        const OracleTouch truth = first_time_within(Vec3(0.0), 1.0, t);
        if (truth.verdict == Verdict::Undecided) {
            ++row.undecided;
            continue;
        }
        const bool touches = truth.verdict == Verdict::Touches;
        const bool far_off = !touches && first_time_within(Vec3(0.0), kInvented, t).verdict == Verdict::Clear;
        row.contacts += touches ? 1 : 0;
        const MovingTriangle moving{{t.start[0], t.start[1], t.start[2]}, {t.end[0], t.end[1], t.end[2]}};
        const TriangleTouch ours = sphere_triangle_ccd(Vec3(0.0), 1.0, moving);
        complete.add(truth, far_off, ours.touches, ours.time);
        const ThesisContact theirs = thesis_triangle_ccd(Vec3(0.0), 1.0, moving);
        const bool found = theirs.feature != Feature::None;
        const bool overlaps = point_triangle_distance(Vec3(0.0), t.end) < 1.0;
        thesis.add(truth, far_off, found || overlaps, found ? theirs.time : 1.0);
        row.algorithm_1 += touches && !found ? 1 : 0;
    }
    row.complete = complete.score();
    row.thesis = thesis.score();
    return row;
}

enum class Attitude { Random, EdgeOn, Tumbling };

constexpr double kSide = 0.25;         // m, of the cloth
constexpr std::uint32_t kCells = 8;    // a side: the triangles of the thesis' cloth
constexpr double kHighestWave = 0.02;  // m
constexpr double kAim = 0.15;          // m: up to here from the sphere the middle of the cloth may pass

/// A cloth in flight, double-faced as the thesis' is.
class FlyingCloth {
  public:
    FlyingCloth() : start_(vertex_count()), end_(vertex_count()) {
        for (std::uint32_t i = 0; i <= kCells; ++i) {
            for (std::uint32_t j = 0; j <= kCells; ++j) {
                rest_.emplace_back(kSide * (i / static_cast<double>(kCells) - 0.5), 0.0,
                                   kSide * (j / static_cast<double>(kCells) - 0.5));
            }
        }
        for (std::uint32_t i = 0; i < kCells; ++i) {
            for (std::uint32_t j = 0; j < kCells; ++j) {
                const std::uint32_t a = i * (kCells + 1) + j;
                const std::uint32_t b = a + kCells + 1;
                for (const Triangle& t : {Triangle{a, a + 1, b + 1}, Triangle{a, b + 1, b}}) {
                    triangles_.push_back(t);
                    triangles_.push_back({t[0], t[2], t[1]});
                }
            }
        }
        tree_.emplace_back(rest_, triangles_);
    }

    /// A step in which the cloth passes near the origin. Its middle aims at a point from which its rim may clip the
    /// sphere, and is anywhere on its way when the step begins.
    void draw(Random& random, Attitude attitude) {
        const Vec3 axis = random.direction();
        const double angle = random.uniform(-kPi, kPi);
        const Vec3 normal = turned(Vec3(0.0, 1.0, 0.0), axis, angle);
        Vec3 travel = random.direction();
        if (attitude == Attitude::EdgeOn) {
            // Nearly so: the thesis' cloth is never quite flat either.
            travel -= normal * (glm::dot(travel, normal) - random.uniform(-0.1, 0.1));
        }
        travel *= kTravel / glm::length(travel);
        const Vec3 spin = random.direction();
        const double by = attitude == Attitude::Tumbling ? random.uniform(-1.0, 1.0) : 0.0;
        const Vec3 aim = random.in_cube(kAim);
        const Vec3 from = aim - travel * random.uniform(0.0, 1.0);
        const double height = random.uniform(0.0, kHighestWave);
        const double along = random.uniform(0.0, 2.0 * kPi);
        const double across = random.uniform(0.0, 2.0 * kPi);
        for (std::size_t v = 0; v < rest_.size(); ++v) {
            Vec3 p = rest_[v];
            p.y = height * std::sin(25.0 * p.x + along) * std::sin(31.0 * p.z + across);
            const Vec3 placed = turned(p, axis, angle);
            start_[v] = from + placed;
            end_[v] = from + travel + turned(placed, spin, by);
        }
    }

    [[nodiscard]] MovingSurface surface() {
        const SurfaceMotion motion{start_, end_, triangles_};
        tree_[0].refit(motion);
        return {motion, tree_.data()};
    }
    [[nodiscard]] std::size_t triangle_count() const { return triangles_.size(); }
    [[nodiscard]] LinearTriangle triangle(std::size_t k) const {
        const Triangle& t = triangles_[k];
        return {{start_[t[0]], start_[t[1]], start_[t[2]]}, {end_[t[0]], end_[t[1]], end_[t[2]]}};
    }

  private:
    static constexpr std::size_t vertex_count() { return std::size_t{kCells + 1} * (kCells + 1); }
    std::vector<Vec3> rest_;
    std::vector<Vec3> start_;
    std::vector<Vec3> end_;
    std::vector<Triangle> triangles_;
    std::vector<SweptTree> tree_;  // one
};

/// The first touch of any triangle. Every second one is the other face of the one before.
OracleTouch first_of_cloth(const FlyingCloth& cloth, double radius) {
    OracleTouch first{Verdict::Clear, 2.0};
    for (std::size_t k = 0; k < cloth.triangle_count(); k += 2) {
        const OracleTouch touch = first_time_within(Vec3(0.0), radius, cloth.triangle(k));
        if (touch.verdict == Verdict::Undecided) {
            return touch;
        }
        if (touch.time < first.time) {
            first = touch;
        }
    }
    return first;
}

double least_distance(const FlyingCloth& cloth, double time) {
    double least = HUGE_VAL;
    for (std::size_t k = 0; k < cloth.triangle_count(); k += 2) {
        least = std::min(least, point_triangle_distance(Vec3(0.0), corners_at_time(cloth.triangle(k), time)));
    }
    return least;
}

CcdMisses measure_cloth(Attitude attitude, const char* name, const CcdMissesSettings& settings) {
    CcdMisses row;
    row.set = "cloth";
    row.motion = name;
    Random random(settings.seed * 16 + 8 + static_cast<std::uint64_t>(attitude));
    FlyingCloth cloth;
    ContactSettings method;
    // Both find contacts with the radius less the shrink, so that is the radius in question.
    const double radius = kRadius * method.shrink;
    Tally complete;
    Tally thesis;
    while (row.drawn < settings.frames) {
        cloth.draw(random, attitude);
        if (least_distance(cloth, 0.0) <= kRadius * kClear) {
            continue;
        }
        ++row.drawn;
        const OracleTouch truth = first_of_cloth(cloth, radius);
        if (truth.verdict == Verdict::Undecided) {
            ++row.undecided;
            continue;
        }
        const bool touches = truth.verdict == Verdict::Touches;
        const bool far_off = !touches && first_of_cloth(cloth, radius * kInvented).verdict == Verdict::Clear;
        row.contacts += touches ? 1 : 0;
        const std::array<MovingSurface, 1> surfaces{cloth.surface()};
        method.method = CcdMethod::Complete;
        const SecurePosition ours = secure_position(surfaces, Vec3(0.0), kRadius, method);
        complete.add(truth, far_off, ours.touched, ours.first_time);
        method.method = CcdMethod::Thesis;
        const SecurePosition theirs = secure_position(surfaces, Vec3(0.0), kRadius, method);
        const bool overlaps = least_distance(cloth, 1.0) < radius;
        thesis.add(truth, far_off, theirs.touched || overlaps, theirs.touched ? theirs.first_time : 1.0);
        row.algorithm_1 += touches && !theirs.touched ? 1 : 0;
    }
    row.complete = complete.score();
    row.thesis = thesis.score();
    return row;
}

double percent(std::uint64_t part, std::uint64_t whole) {
    return whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

}  // namespace

std::vector<CcdMisses> measure_ccd_misses(const CcdMissesSettings& settings) {
    std::vector<CcdMisses> table;
    table.push_back(measure_triangles(Motion::Translating, "translating", settings));
    table.push_back(measure_triangles(Motion::Deforming, "deforming", settings));
    table.push_back(measure_triangles(Motion::Rotating, "rotating", settings));
    table.push_back(measure_triangles(Motion::Slow, "slower than a radius a step", settings));
    table.push_back(measure_cloth(Attitude::Random, "random attitude", settings));
    table.push_back(measure_cloth(Attitude::EdgeOn, "edge-on", settings));
    table.push_back(measure_cloth(Attitude::Tumbling, "tumbling", settings));
    return table;
}

void write_ccd_misses(std::ostream& out, std::span<const CcdMisses> table) {
    out << "set,motion,drawn,contacts,undecided,complete_missed,complete_invented,complete_latest_step,thesis_missed,"
           "thesis_missed_percent,thesis_invented,thesis_latest_step,thesis_mean_late_step,algorithm_1_missed,"
           "algorithm_1_missed_percent\n";
    for (const CcdMisses& row : table) {
        out << std::defaultfloat << std::setprecision(6) << row.set << ',' << row.motion << ',' << row.drawn << ','
            << row.contacts << ',' << row.undecided << ',' << row.complete.missed << ',' << row.complete.invented << ','
            << row.complete.latest << ',' << row.thesis.missed << ',' << percent(row.thesis.missed, row.contacts) << ','
            << row.thesis.invented << ',' << row.thesis.latest << ',' << row.thesis.mean_late << ',' << row.algorithm_1
            << ',' << percent(row.algorithm_1, row.contacts) << '\n';
    }
}

void print_ccd_misses(std::ostream& out, std::span<const CcdMisses> table) {
    const std::ios_base::fmtflags flags = out.flags();
    out << std::left << std::setw(10) << "set" << std::setw(30) << "motion" << std::right << std::setw(10) << "contacts"
        << std::setw(14) << "ours missed" << std::setw(16) << "thesis missed" << std::setw(22) << "Algorithm 1 alone"
        << std::setw(16) << "thesis late" << '\n';
    for (const CcdMisses& row : table) {
        out << std::left << std::setw(10) << row.set << std::setw(30) << row.motion << std::right << std::setw(10)
            << row.contacts << std::setw(14) << row.complete.missed << std::fixed << std::setprecision(1)
            << std::setw(14) << percent(row.thesis.missed, row.contacts) << " %" << std::setw(20)
            << percent(row.algorithm_1, row.contacts) << " %" << std::setw(11) << 100.0 * row.thesis.mean_late
            << " % step" << '\n';
    }
    out.flags(flags);
}

}  // namespace haptic::sim::reproduce
