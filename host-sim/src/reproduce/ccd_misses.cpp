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

constexpr double kSpuriousFactor = 1.0001;  // of the radius: a report beyond this distance is spurious
constexpr double kClearFactor = 1.0025;     // of the radius: a motion that starts nearer than this is discarded
constexpr double kRadius = 0.03;            // m, as in the thesis
constexpr double kTravel = 0.14;            // m per step: 14 m/s at 10 ms
constexpr double kPi = 3.14159265358979323846;
constexpr double kTriangleShare = 0.3;  // of the time, roughly

/// Random numbers that do not depend on the standard library, as std:: distributions do.
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

/// Rotation by Rodrigues' formula.
Vec3 rotate(const Vec3& x, const Vec3& axis, double angle) {
    const double c = std::cos(angle);
    return x * c + glm::cross(axis, x) * std::sin(angle) + axis * (glm::dot(axis, x) * (1.0 - c));
}

/// Compares the reports of one method with the oracle.
class Tally {
  public:
    void add(const OracleTouch& truth, bool beyond, bool reported, double time) {
        // A contact is either missed or detected with some delay; a report without one counts only beyond the margin.
        if (truth.verdict == Verdict::Touches) {
            if (!reported) {
                ++score_.missed;
                return;
            }
            const double delay = time - truth.time;
            score_.max_delay = detected_ == 0 ? delay : std::max(score_.max_delay, delay);
            sum_ += delay;
            ++detected_;
        } else if (reported && beyond) {
            ++score_.spurious;
        }
    }
    [[nodiscard]] CcdScore score() const {
        CcdScore score = score_;
        score.mean_delay = detected_ > 0 ? sum_ / static_cast<double>(detected_) : 0.0;
        return score;
    }

  private:
    CcdScore score_;
    std::uint64_t detected_ = 0;
    double sum_ = 0.0;
};

enum class Motion { Translating, Deforming, Rotating, Slow };

/// Draws a triangle of about the size of the unit sphere at the origin, aimed to pass near it. It travels as far in the
/// step as the thesis' cloth does, or less than a radius if slow.
LinearTriangle draw_triangle(Random& random, Motion motion) {
    for (;;) {
        // The triangle passes its aim at a random time of the step.
        const Vec3 aim = random.in_cube(1.5);
        const double length = motion == Motion::Slow ? random.uniform(0.0, 1.0) : kTravel / kRadius;
        const Vec3 travel = random.direction() * length;
        const double ahead = random.uniform(0.0, 1.0);
        const Vec3 axis = random.direction();
        const double angle = random.uniform(-1.5, 1.5);
        // Corners at both ends of the step; each kind of motion adds its own change of shape or attitude.
        LinearTriangle t;
        for (std::size_t k = 0; k < t.start.size(); ++k) {
            const Vec3 x = random.in_cube(1.5);
            const Vec3 change = random.in_cube(1.5);
            t.start[k] = aim - travel * ahead + x;
            t.end[k] = t.start[k] + travel;
            if (motion == Motion::Deforming) {
                t.end[k] += change;
            } else if (motion == Motion::Rotating) {
                t.end[k] += rotate(x, axis, angle) - x;
            }
        }
        if (point_triangle_distance(Vec3(0.0), t.start) > kClearFactor) {
            return t;
        }
    }
}

/// Runs both methods on single triangles and the unit sphere at the origin.
CcdMisses measure_triangles(Motion motion, const char* name, const CcdMissesSettings& settings,
                            const Progress& progress) {
    CcdMisses row;
    row.set = "triangle";
    row.motion = name;
    Random random(settings.seed * 16 + static_cast<std::uint64_t>(motion));
    Tally complete;
    Tally thesis;
    for (std::uint32_t k = 0; k < settings.triangles; ++k) {
        report(progress, static_cast<double>(k) / static_cast<double>(settings.triangles));
        const LinearTriangle t = draw_triangle(random, motion);
        ++row.drawn;
        // The oracle's verdict; only a triangle that stays clearly outside can be reported spuriously.
        const OracleTouch truth = first_time_within(Vec3(0.0), 1.0, t);
        if (truth.verdict == Verdict::Undecided) {
            ++row.undecided;
            continue;
        }
        const bool touches = truth.verdict == Verdict::Touches;
        const bool beyond = !touches && first_time_within(Vec3(0.0), kSpuriousFactor, t).verdict == Verdict::Clear;
        row.contacts += touches ? 1 : 0;
        // Our continuous collision detection.
        const MovingTriangle moving{{t.start[0], t.start[1], t.start[2]}, {t.end[0], t.end[1], t.end[2]}};
        const TriangleTouch complete_result = sphere_triangle_ccd(Vec3(0.0), 1.0, moving);
        complete.add(truth, beyond, complete_result.touches, complete_result.time);
        // The thesis: Algorithm 1, then overlap at the end of the step, left to the pop-out.
        const ThesisContact thesis_result = thesis_triangle_ccd(Vec3(0.0), 1.0, moving);
        const bool found = thesis_result.feature != Feature::None;
        const bool overlaps = point_triangle_distance(Vec3(0.0), t.end) < 1.0;
        thesis.add(truth, beyond, found || overlaps, found ? thesis_result.time : 1.0);
        row.algorithm_1 += touches && !found ? 1 : 0;
    }
    row.complete = complete.score();
    row.thesis = thesis.score();
    return row;
}

enum class Attitude { Random, EdgeOn, Tumbling };

constexpr double kSide = 0.25;           // m, of the cloth
constexpr std::uint32_t kCells = 8;      // per side: the triangles of the thesis' cloth
constexpr double kMaxWaveHeight = 0.02;  // m
constexpr double kAimRange = 0.15;       // m: largest coordinate of the point that the centre of the cloth aims at

/// A flying cloth, double-faced as in the thesis.
class FlyingCloth {
  public:
    FlyingCloth() : start_(vertex_count()), end_(vertex_count()) {
        for (std::uint32_t i = 0; i <= kCells; ++i) {
            for (std::uint32_t j = 0; j <= kCells; ++j) {
                rest_.emplace_back(kSide * (i / static_cast<double>(kCells) - 0.5), 0.0,
                                   kSide * (j / static_cast<double>(kCells) - 0.5));
            }
        }
        // Two triangles per cell, each with its back face.
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
        tree_.emplace_back(rest_, triangles_, Faces::All);
    }

    /// Draws a step in which the cloth passes near the origin. Its centre aims at a point from which its edge may touch
    /// the sphere, and starts anywhere on its path.
    void draw(Random& random, Attitude attitude) {
        const Vec3 axis = random.direction();
        const double angle = random.uniform(-kPi, kPi);
        const Vec3 normal = rotate(Vec3(0.0, 1.0, 0.0), axis, angle);
        Vec3 travel = random.direction();
        if (attitude == Attitude::EdgeOn) {
            // Nearly edge-on: the thesis' cloth is never quite flat either.
            travel -= normal * (glm::dot(travel, normal) - random.uniform(-0.1, 0.1));
        }
        travel *= kTravel / glm::length(travel);
        // Rotation during the step, path and shape of the waves.
        const Vec3 spin = random.direction();
        const double spin_angle = attitude == Attitude::Tumbling ? random.uniform(-1.0, 1.0) : 0.0;
        const Vec3 aim = random.in_cube(kAimRange);
        const Vec3 from = aim - travel * random.uniform(0.0, 1.0);
        const double height = random.uniform(0.0, kMaxWaveHeight);
        const double along = random.uniform(0.0, 2.0 * kPi);
        const double across = random.uniform(0.0, 2.0 * kPi);
        for (std::size_t v = 0; v < rest_.size(); ++v) {
            // Waves, attitude at the start, and motion during the step.
            Vec3 p = rest_[v];
            p.y = height * std::sin(25.0 * p.x + along) * std::sin(31.0 * p.z + across);
            const Vec3 rotated = rotate(p, axis, angle);
            start_[v] = from + rotated;
            end_[v] = from + travel + rotate(rotated, spin, spin_angle);
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

/// The first contact of any triangle. Every second triangle is the back face of the one before it.
OracleTouch first_cloth_contact(const FlyingCloth& cloth, double radius) {
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

double min_distance(const FlyingCloth& cloth, double time) {
    double min = HUGE_VAL;
    for (std::size_t k = 0; k < cloth.triangle_count(); k += 2) {
        min = std::min(min, point_triangle_distance(Vec3(0.0), corners_at_time(cloth.triangle(k), time)));
    }
    return min;
}

CcdMisses measure_cloth(Attitude attitude, const char* name, const CcdMissesSettings& settings,
                        const Progress& progress) {
    CcdMisses row;
    row.set = "cloth";
    row.motion = name;
    Random random(settings.seed * 16 + 8 + static_cast<std::uint64_t>(attitude));
    FlyingCloth cloth;
    ContactSettings method;
    // Both methods look for contacts with the shrunk radius.
    const double radius = kRadius * method.shrink;
    Tally complete;
    Tally thesis;
    while (row.drawn < settings.frames) {
        report(progress, static_cast<double>(row.drawn) / static_cast<double>(settings.frames));
        cloth.draw(random, attitude);
        // Only motions that start clear of the sphere count.
        if (min_distance(cloth, 0.0) <= kRadius * kClearFactor) {
            continue;
        }
        ++row.drawn;
        const OracleTouch truth = first_cloth_contact(cloth, radius);
        if (truth.verdict == Verdict::Undecided) {
            ++row.undecided;
            continue;
        }
        const bool touches = truth.verdict == Verdict::Touches;
        const bool beyond = !touches && first_cloth_contact(cloth, radius * kSpuriousFactor).verdict == Verdict::Clear;
        row.contacts += touches ? 1 : 0;
        // Both methods on the same swept tree.
        const std::array<MovingSurface, 1> surfaces{cloth.surface()};
        method.method = CcdMethod::Complete;
        const SecurePosition complete_result = secure_position(surfaces, Vec3(0.0), kRadius, method);
        complete.add(truth, beyond, complete_result.touched, complete_result.first_time);
        method.method = CcdMethod::Thesis;
        const SecurePosition thesis_result = secure_position(surfaces, Vec3(0.0), kRadius, method);
        const bool overlaps = min_distance(cloth, 1.0) < radius;
        thesis.add(truth, beyond, thesis_result.touched || overlaps,
                   thesis_result.touched ? thesis_result.first_time : 1.0);
        row.algorithm_1 += touches && !thesis_result.touched ? 1 : 0;
    }
    row.complete = complete.score();
    row.thesis = thesis.score();
    return row;
}

double percent(std::uint64_t part, std::uint64_t whole) {
    return whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

}  // namespace

std::vector<CcdMisses> measure_ccd_misses(const CcdMissesSettings& settings, const Progress& progress) {
    std::vector<CcdMisses> table;
    // Single triangles by kind of motion, then cloths by attitude.
    const Progress triangles = part_of(progress, 0.0, kTriangleShare);
    table.push_back(measure_triangles(Motion::Translating, "translating", settings, part_of(triangles, 0.0, 0.25)));
    table.push_back(measure_triangles(Motion::Deforming, "deforming", settings, part_of(triangles, 0.25, 0.5)));
    table.push_back(measure_triangles(Motion::Rotating, "rotating", settings, part_of(triangles, 0.5, 0.75)));
    table.push_back(
        measure_triangles(Motion::Slow, "slower than a radius a step", settings, part_of(triangles, 0.75, 1.0)));
    const Progress cloths = part_of(progress, kTriangleShare, 1.0);
    table.push_back(measure_cloth(Attitude::Random, "random attitude", settings, part_of(cloths, 0.0, 1.0 / 3.0)));
    table.push_back(measure_cloth(Attitude::EdgeOn, "edge-on", settings, part_of(cloths, 1.0 / 3.0, 2.0 / 3.0)));
    table.push_back(measure_cloth(Attitude::Tumbling, "tumbling", settings, part_of(cloths, 2.0 / 3.0, 1.0)));
    return table;
}

void write_ccd_misses(std::ostream& out, std::span<const CcdMisses> table) {
    out << "set,motion,drawn,contacts,undecided,complete_missed,complete_invented,complete_latest_step,thesis_missed,"
           "thesis_missed_percent,thesis_invented,thesis_latest_step,thesis_mean_late_step,algorithm_1_missed,"
           "algorithm_1_missed_percent\n";
    for (const CcdMisses& row : table) {
        out << std::defaultfloat << std::setprecision(6) << row.set << ',' << row.motion << ',' << row.drawn << ','
            << row.contacts << ',' << row.undecided << ',' << row.complete.missed << ',' << row.complete.spurious << ','
            << row.complete.max_delay << ',' << row.thesis.missed << ',' << percent(row.thesis.missed, row.contacts)
            << ',' << row.thesis.spurious << ',' << row.thesis.max_delay << ',' << row.thesis.mean_delay << ','
            << row.algorithm_1 << ',' << percent(row.algorithm_1, row.contacts) << '\n';
    }
}

void print_ccd_misses(std::ostream& out, std::span<const CcdMisses> table) {
    const std::ios_base::fmtflags flags = out.flags();
    out << std::left << std::setw(10) << "set" << std::setw(30) << "motion" << std::right << std::setw(10) << "contacts"
        << std::setw(14) << "ours missed" << std::setw(16) << "thesis missed" << std::setw(22) << "Algorithm 1 alone"
        << std::setw(16) << "thesis delay" << '\n';
    for (const CcdMisses& row : table) {
        out << std::left << std::setw(10) << row.set << std::setw(30) << row.motion << std::right << std::setw(10)
            << row.contacts << std::setw(14) << row.complete.missed << std::fixed << std::setprecision(1)
            << std::setw(14) << percent(row.thesis.missed, row.contacts) << " %" << std::setw(20)
            << percent(row.algorithm_1, row.contacts) << " %" << std::setw(11) << 100.0 * row.thesis.mean_delay
            << " % step" << '\n';
    }
    out.flags(flags);
}

}  // namespace haptic::sim::reproduce
