#include "haptic/contact_problem.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "contact_kernels.hpp"
#include "vector_kernels.hpp"

namespace haptic {
namespace {

// m/N: a row with less compliance than this cannot be pushed.
constexpr double kMinCompliance = 1e-30;
// What remains of a dependent row is raised to twice this part of its own, or rounding would decide which of two such
// rows pushes.
constexpr double kMinPivot = RowFactor::kMinPivot;
// A violation below this part of the largest depth, or of the displacement of a row by its own force, is rounding.
constexpr double kTolerance = 1e-12;
// The sweep that moves nothing by more than this part of the largest depth is the last.
constexpr double kSweepTolerance = 1e-6;
// A change that grows by this factor shows that rows have begun or ceased to push or slide: extrapolation restarts.
constexpr double kMaxGrowth = 2.0;
// A force that would displace its row by more than this many times the largest depth is none: rows contradict one
// another without any compliance. The compliance of a surface limits it to about a thousand times.
constexpr double kMaxDisplacement = 1e4;
// Sweeps at the end that are not extrapolated, so that a bad extrapolation is never the last word.
constexpr int kPlainSweeps = 2;
// N per newton on the new row: an active row that loses less does not limit the step.
constexpr double kMinShare = 1e-14;
// The unbounded minimum is at least this many radii of the cone away: the squares of Newton's method could underflow.
// The minimum on the edge then has the direction of the gradient to rounding.
constexpr double kFarOutside = 1e100;
// Steps of Newton's method to the edge of a cone. It converges in one where the pair is isotropic, and in a few else.
constexpr int kMaxNewtonSteps = 10;

// Rows that leave a factor before it is built again: each adds a rounding.
constexpr int kMaxRemovals = 100;
// Rows that may begin to push together, and how often, before they are taken one by one.
constexpr std::size_t kTogether = 8;
constexpr int kMaxRounds = 4;

constexpr std::size_t kNone = static_cast<std::size_t>(-1);

struct Disc {
    std::array<double, 2> point;
    bool on_edge;
};

/// Minimum of 1/2 x^T B x - g^T x over |x| <= radius, with B = (a c; c d) positive definite.
/// @source J. More, D. Sorensen, "Computing a trust region step", 1983
Disc minimum_in_disc(double a, double c, double d, const std::array<double, 2>& g, double radius) HAPTIC_RT {
    if (!(radius > 0.0)) {
        return {{0.0, 0.0}, true};
    }
    // (B + shift I) x = g has |x| = radius at the solution, and |x| >= |g| / (largest eigenvalue + shift).
    const double half_difference = 0.5 * (a - d);
    const double largest = 0.5 * (a + d) + std::sqrt(half_difference * half_difference + c * c);
    const double length = std::sqrt(g[0] * g[0] + g[1] * g[1]);
    // A few roundings inside the edge, so that the cone holds exactly.
    const double edge = radius * (1.0 - 4.0 * std::numeric_limits<double>::epsilon());
    if (length > kFarOutside * radius * largest) {
        return {{edge * (g[0] / length), edge * (g[1] / length)}, true};
    }
    const double lower_bound = length / radius - largest;
    std::array<double, 2> x{};
    double size = 0.0;
    double shift = 0.0;
    for (int i = 0; i < kMaxNewtonSteps; ++i) {
        const double determinant = (a + shift) * (d + shift) - c * c;
        x = {((d + shift) * g[0] - c * g[1]) / determinant, ((a + shift) * g[1] - c * g[0]) / determinant};
        size = std::sqrt(x[0] * x[0] + x[1] * x[1]);
        if (i == 0 && size <= radius) {
            return {x, false};
        }
        if (size <= radius * (1.0 + 1e-14)) {
            break;
        }
        // Newton's method on 1 / |x| - 1 / radius, which is nearly linear in the shift and converges from below.
        const double curvature =
            ((d + shift) * x[0] * x[0] - 2.0 * c * x[0] * x[1] + (a + shift) * x[1] * x[1]) / determinant;
        shift = std::max(shift + (size / radius - 1.0) * size * size / curvature, lower_bound);
    }
    const double factor = edge / size;
    return {{factor * x[0], factor * x[1]}, true};
}

}  // namespace

std::array<Vec3, 2> contact_tangents(const Vec3& n) HAPTIC_RT {
    // 1 / (1 + n_z), without cancellation near the pole n = (0, 0, -1).
    const double squares = n.x * n.x + n.y * n.y;
    if (n.z < 0.0 && !(squares > 0.0)) {
        return {Vec3(0.0, -1.0, 0.0), Vec3(-1.0, 0.0, 0.0)};
    }
    const double a = n.z < 0.0 ? (1.0 - n.z) / squares : 1.0 / (1.0 + n.z);
    const double b = -n.x * n.y * a;
    return {Vec3(1.0 - n.x * n.x * a, b, -n.x), Vec3(b, 1.0 - n.y * n.y * a, -n.y)};
}

void ComplianceMatrix::mirror() HAPTIC_RT {
    // Tile by tile: both triangles of a tile stay in the cache, and compilers unroll the loops of a whole one.
    constexpr std::size_t tile = 8;
    for (std::size_t top = 0; top < rows_; top += tile) {
        const std::size_t bottom = std::min(top + tile, rows_);
        for (std::size_t left = 0; left < top && bottom == top + tile; left += tile) {
            for (std::size_t s = left; s < left + tile; ++s) {
                for (std::size_t r = top; r < top + tile; ++r) {
                    elements_[s * kMaxContactRows + r] = elements_[r * kMaxContactRows + s];
                }
            }
        }
        // The last rows, if they fill no tile, and the tile on the diagonal.
        for (std::size_t s = bottom == top + tile ? top : 0; s < bottom; ++s) {
            for (std::size_t r = std::max(top, s + 1); r < bottom; ++r) {
                elements_[s * kMaxContactRows + r] = elements_[r * kMaxContactRows + s];
            }
        }
    }
}

RowFactor::RowFactor()
    : cholesky_(kMaxContactRows),
      rows_(kMaxContactRows, 0),
      reduced_(kMaxContactRows, 0.0),
      reduced_together_(kMaxContactRows) {}

void RowFactor::clear() HAPTIC_RT {
    cholesky_.clear();
    removals_ = 0;
    padded_ = false;
}

void RowFactor::make(const ComplianceMatrix& compliance, const RowSet& rows) HAPTIC_RT {
    clear();
    std::array<std::uint16_t, kMaxContactRows> list;  // NOLINT(*-member-init)
    std::size_t count = 0;
    for (std::size_t word = 0; word < rows.words().size(); ++word) {
        for (std::uint64_t rest = rows.words()[word]; rest != 0; rest &= rest - 1) {
            const std::size_t row = 64 * word + static_cast<std::size_t>(std::countr_zero(rest));
            if (row < compliance.rows() && compliance.diagonal(row) > kMinCompliance) {
                list[count++] = static_cast<std::uint16_t>(row);
            }
        }
    }
    append_independent(compliance, std::span(list).first(count), nullptr);
}

void RowFactor::append_independent(const ComplianceMatrix& compliance, std::span<const std::uint16_t> rows,
                                   const double* right_side) HAPTIC_RT {
    constexpr std::size_t together = CholeskyFactor::kTogether;
    const auto append_reduced = [&](std::size_t row, double pivot) HAPTIC_RT {
        const bool independent = pivot > kMinPivot * compliance.diagonal(row);
        if (independent) {
            append(row, pivot, right_side != nullptr ? right_side[row] : 0.0);
        }
        return independent;
    };
    for (std::size_t first = 0; first < rows.size(); first += together) {
        const std::size_t count = std::min(together, rows.size() - first);
        const std::span<const std::uint16_t> group = rows.subspan(first, count);
        if (count == 1) {
            append_reduced(group[0], reduce(compliance, group[0]));
            continue;
        }
        // U^-T W_Sq of all rows q of the group; the last group is filled up with its first row.
        for (std::size_t k = 0; k < together; ++k) {
            const double* const elements = compliance.row(group[k < count ? k : 0]);
            for (std::size_t i = 0; i < size(); ++i) {
                reduced_together_[i][k] = elements[rows_[i]];
            }
        }
        cholesky_.solve_transposed(reduced_together_.data());
        for (std::size_t k = 0; k < count; ++k) {
            for (std::size_t i = 0; i < size(); ++i) {
                reduced_[i] = reduced_together_[i][k];
            }
            const std::size_t row = group[k];
            const double pivot = compliance.diagonal(row) - cholesky_.squared_length(reduced_.data());
            if (append_reduced(row, pivot)) {
                // One more element of the rows that follow.
                CholeskyFactor::Elements& added = reduced_together_[size() - 1];
                for (std::size_t other = 0; other < together; ++other) {
                    added[other] = compliance(row, group[other < count ? other : 0]);
                }
                cholesky_.solve_transposed_last(reduced_together_.data());
            }
        }
    }
}

double RowFactor::reduce(const ComplianceMatrix& compliance, std::size_t row) HAPTIC_RT {
    const double* elements = compliance.row(row);
    for (std::size_t i = 0; i < size(); ++i) {
        reduced_[i] = elements[rows_[i]];
    }
    cholesky_.solve_transposed(reduced_.data());
    return compliance.diagonal(row) - cholesky_.squared_length(reduced_.data());
}

void RowFactor::append(std::size_t row, double pivot, double right_side) HAPTIC_RT {
    rows_[size()] = static_cast<std::uint16_t>(row);
    cholesky_.append(reduced_.data(), pivot, right_side);
}

void RowFactor::remove(std::size_t position) HAPTIC_RT {
    const auto leaving = rows_.begin() + static_cast<std::ptrdiff_t>(position);
    std::copy(leaving + 1, rows_.begin() + static_cast<std::ptrdiff_t>(size()), leaving);
    cholesky_.remove(position);
    ++removals_;
}

void RowFactor::set_right_side(const double* b) HAPTIC_RT {
    for (std::size_t i = 0; i < size(); ++i) {
        reduced_[i] = b[rows_[i]];
    }
    cholesky_.set_right_side(reduced_.data());
}

ContactSolver::ContactSolver(int max_sweeps)
    : kernels_(&widest_contact_kernels()),
      max_sweeps_(max_sweeps),
      force_(kMaxContactRows, 0.0),
      free_(kMaxContactRows, 0.0),
      deficit_(kMaxContactRows, 0.0),
      own_(kMaxContactRows, 0.0),
      state_(kMaxContactRows, RowState::Idle),
      acceleration_(kMaxContactRows),
      pair_(kMaxContactRows, 0),
      weight_(kMaxContactRows, 0.0),
      held_(kMaxContactRows, 0.0),
      share_(kMaxContactRows, 0.0),
      terms_(kMaxContactRows, nullptr),
      found_(kMaxContactRows, 0) {}

ContactSolver::Result ContactSolver::solve(const ComplianceMatrix& compliance, std::span<const double> depth,
                                           std::span<FrictionRows> friction, Elements elements) HAPTIC_RT {
    const std::size_t rows = std::min({depth.size(), compliance.rows(), kMaxContactRows});
    const bool same_rows = rows == rows_;
    const bool same_elements = same_rows && elements == Elements::Unchanged;
    rows_ = rows;
    Result result;
    read_rows(compliance, depth, friction);
    warm_start(compliance, depth, same_rows, same_elements);
    result.steps = solve_normals(compliance, kMaxSteps);
    if (!friction.empty()) {
        only_active_push_ = false;
        solve_friction(compliance, friction, result);
        bound_energy(depth);
    }
    result.residual = std::max(result.residual, normal_residual());

    // V = l^T b - 1/2 l^T W l = 1/2 l^T (b + (b - W l)).
    result.stored = 0.5 * (dot(force_.data(), depth.data(), rows_) + dot(force_.data(), deficit_.data(), rows_));
    if (!std::isfinite(result.stored) || !std::isfinite(result.residual)) {
        // Overflow: no force is better than one that is not a number.
        std::fill_n(force_.begin(), rows_, 0.0);
        std::copy_n(depth.begin(), rows_, deficit_.begin());
        only_active_push_ = false;
        result.stored = 0.0;
        result.residual = std::numeric_limits<double>::max();
    }
    return result;
}

void ContactSolver::read_rows(const ComplianceMatrix& compliance, std::span<const double> depth,
                              std::span<FrictionRows> friction) HAPTIC_RT {
    // The largest depth is the scale of the tolerances.
    scale_ = largest_magnitude(depth.data(), rows_);
    tolerance_ = kTolerance * scale_;
    diagonal_ = compliance.diagonal();
    std::fill_n(state_.begin(), rows_, RowState::Idle);
    const bool excludes = !(smallest(diagonal_, rows_) > kMinCompliance);
    for (std::size_t r = 0; r < rows_ && excludes; ++r) {
        state_[r] = diagonal_[r] > kMinCompliance ? RowState::Idle : RowState::Excluded;
    }
    has_tangents_ = false;
    // Tangential rows. A pair without normal rows, beyond the last row or overlapping another has no friction.
    const auto is_tangential = [this](std::size_t r)
                                   HAPTIC_RT { return r < rows_ && state_[r] == RowState::Tangential; };
    for (std::size_t i = 0; i < friction.size(); ++i) {
        friction[i].slides = true;
        const std::size_t first = std::size_t{friction[i].first_normal} + friction[i].normals;
        const bool overlaps = friction[i].normals == 0 || is_tangential(first - 1) || is_tangential(first) ||
                              is_tangential(first + 1) || is_tangential(first + 2);
        if (!overlaps && first + 2 <= rows_) {
            state_[first] = state_[first + 1] = RowState::Tangential;
            pair_[first] = static_cast<std::uint16_t>(i);
            has_tangents_ = true;
        }
    }
    for (std::size_t r = 0; !friction.empty() && r < rows_; ++r) {
        weight_[r] = std::sqrt(std::max(diagonal_[r], 0.0));
    }
}

/// The factor is that of the active rows, to few roundings, and each of them pushes.
bool ContactSolver::can_keep_factor() HAPTIC_RT {
    bool all_push = true;
    for (const std::uint16_t r : factor().rows()) {
        all_push = all_push && r < rows_ && state_[r] == RowState::Idle && force_[r] > 0.0;
    }
    return all_push && !factor().is_padded() && factor().removals() <= kMaxRemovals;
}

void ContactSolver::start(std::size_t rows, const RowSet& pushing) HAPTIC_RT {
    rows_ = std::min(rows, kMaxContactRows);
    std::fill_n(state_.begin(), rows_, RowState::Idle);
    only_active_push_ = false;
    // Which rows push is all that matters: their forces are computed again.
    for (std::size_t r = 0; r < rows_; ++r) {
        force_[r] = pushing.contains(r) ? 1.0 : 0.0;
    }
    if (pushing == RowSet{}) {
        restart();
    }
}

RowSet ContactSolver::pushing() const HAPTIC_RT {
    RowSet rows;
    if (only_active_push_) {
        for (const std::uint16_t r : lent_ != nullptr ? lent_->rows() : own_factor_.rows()) {
            rows.insert(r);
        }
        return rows;
    }
    for (std::size_t first = 0; first < rows_; first += 64) {
        std::uint64_t word = 0;
        for (std::size_t r = first; r < std::min(first + 64, rows_); ++r) {
            const bool pushes = force_[r] > 0.0 && state_[r] != RowState::Tangential;
            word |= std::uint64_t{pushes} << (r - first);
        }
        rows.set_word(first / 64, word);
    }
    return rows;
}

void ContactSolver::warm_start(const ComplianceMatrix& compliance, std::span<const double> depth, bool same_rows,
                               bool same_elements) HAPTIC_RT {
    // Start from the last forces of the tangential rows, and from the normal rows that pushed and are independent.
    warm_ = same_elements && can_keep_factor();
    if (warm_) {
        for (const std::uint16_t r : factor().rows()) {
            state_[r] = RowState::Pushes;
            force_[r] = 0.0;
        }
    } else {
        factor().clear();
    }
    const std::size_t count = warm_ && only_active_push_ ? 0 : keep_forces(same_rows);
    only_active_push_ = !has_tangents_;
    compute_free_deficit(compliance, depth);
    factor().set_right_side(free_.data());
    append(compliance, std::span(found_).first(count));
}

/// Keeps the forces of tangential rows. Those of normal rows are computed again: lists the rows that pushed, and
/// returns their number.
std::size_t ContactSolver::keep_forces(bool same_rows) HAPTIC_RT {
    std::size_t count = 0;
    for (std::size_t r = 0; r < rows_; ++r) {
        if (same_rows && state_[r] == RowState::Idle && force_[r] > 0.0) {
            found_[count++] = static_cast<std::uint16_t>(r);
        }
        force_[r] = same_rows && state_[r] == RowState::Tangential ? force_[r] : 0.0;
    }
    return count;
}

/// b - W l of the tangential forces.
void ContactSolver::compute_free_deficit(const ComplianceMatrix& compliance, std::span<const double> depth) HAPTIC_RT {
    std::copy_n(depth.begin(), rows_, free_.begin());
    std::size_t count = 0;
    for (std::size_t r = 0; r < rows_ && has_tangents_; ++r) {
        if (force_[r] != 0.0) {
            share_[count] = force_[r];
            terms_[count++] = compliance.row(r);
        }
    }
    kernels_->subtract_rows(free_.data(), share_.data(), terms_.data(), count, rows_);
}

int ContactSolver::solve_normals(const ComplianceMatrix& compliance, int max_steps) HAPTIC_RT {
    // Exact forces of the active rows, then one violated row after another. The final settle() removes what rounding
    // has accumulated; rows that it releases are looked at again.
    int steps = settle(compliance);
    if (warm_) {
        steps += activate_together(compliance);
    }
    bool settled = true;
    while (steps < max_steps) {
        const std::size_t row = most_violated();
        if (row == kNone && settled) {
            break;
        }
        settled = row == kNone;
        steps += settled ? settle(compliance) : activate(compliance, row, max_steps - steps);
    }
    // The deficits are those of W itself again: own compliances are 0 outside of this function.
    for (std::size_t r = 0; factor().is_padded() && r < rows_; ++r) {
        set_own_compliance(r, 0.0);
    }
    return steps;
}

/// Makes every active row exact. Rows that would pull leave, and the others are solved again: at most one step for each
/// row, and one.
int ContactSolver::settle(const ComplianceMatrix& compliance) HAPTIC_RT {
    int steps = 0;
    for (std::size_t before = factor().size() + 1; factor().size() > 0 && factor().size() < before; ++steps) {
        before = factor().size();
        factor().solve(share_.data());
        for (std::size_t i = before; i-- > 0;) {
            if (!(share_[i] > 0.0)) {
                release(i);
            }
        }
    }
    set_active_forces(compliance);
    return steps;
}

/// Rows that have come to be violated since the last solution: several of them are made exact together, and those that
/// would pull then leave. This takes one step where activate() would take one for each and another one to settle.
int ContactSolver::activate_together(const ComplianceMatrix& compliance) HAPTIC_RT {
    int steps = 0;
    for (int round = 0; round < kMaxRounds; ++round) {
        // All of them; where they are many, those that are violated the most hold most of the others off.
        std::span<std::uint16_t> rows = find_violated();
        if (rows.size() > kTogether) {
            const auto deficit = [this](std::uint16_t r) HAPTIC_RT { return deficit_[r]; };
            double worst = 0.0;
            for (const std::uint16_t r : rows) {
                worst = std::max(worst, deficit(r));
            }
            const auto least = std::remove_if(rows.begin(), rows.end(),
                                              [&](std::uint16_t r) HAPTIC_RT { return deficit(r) <= 0.5 * worst; });
            rows = rows.first(std::min(kTogether, static_cast<std::size_t>(least - rows.begin())));
        }
        const std::size_t before = factor().size();
        append(compliance, rows);
        if (factor().size() == before) {
            break;
        }
        steps += settle(compliance);
        for (const std::uint16_t r : factor().rows()) {
            tolerance_ = std::max(tolerance_, kTolerance * force_[r] * diagonal_[r]);
        }
    }
    return steps;
}

/// Idle rows that are violated, in ascending order.
std::span<std::uint16_t> ContactSolver::find_violated() HAPTIC_RT {
    // Eight rows at a time: most have none.
    std::size_t count = 0;
    for (std::size_t first = 0; first < rows_; first += 8) {
        if (!one_of_eight_exceeds(&deficit_[first], tolerance_)) {
            continue;
        }
        for (std::size_t r = first; r < std::min(first + 8, rows_); ++r) {
            found_[count] = static_cast<std::uint16_t>(r);
            count += state_[r] == RowState::Idle && deficit_[r] > tolerance_ ? 1U : 0U;
        }
    }
    return std::span(found_).first(count);
}

int ContactSolver::activate(const ComplianceMatrix& compliance, std::size_t row, int max_steps) HAPTIC_RT {
    for (int steps = 1; steps <= max_steps; ++steps) {
        // Remaining compliance of the row while the active rows stay exact, and what each of them loses per newton.
        const std::span<const std::uint16_t> active = factor().rows();
        const std::size_t count = active.size();
        set_own_compliance(row, 0.0);
        double pivot = factor().reduce(compliance, row);
        std::copy_n(factor().reduced().begin(), count, share_.begin());
        factor().cholesky().solve_upper(share_.data());
        // Longest step: an active row loses all of its force, or the row becomes exact.
        double force = std::numeric_limits<double>::max();
        std::size_t leaving = kNone;
        for (std::size_t i = 0; i < count; ++i) {
            if (share_[i] > kMinShare && force_[active[i]] < force * share_[i]) {
                force = force_[active[i]] / share_[i];
                leaving = i;
            }
        }
        if (!(pivot > kMinPivot * diagonal_[row])) {
            if (!(force * diagonal_[row] <= kMaxDisplacement * scale_)) {
                // No force makes the row exact: it contradicts the active rows. It keeps the force that it has.
                state_[row] = RowState::Excluded;
                only_active_push_ = false;
                add_scaled(free_.data(), -force_[row], compliance.row(row), rows_);
                factor().set_right_side(free_.data());
                return steps;
            }
            set_own_compliance(row, 2.0 * kMinPivot * diagonal_[row] - pivot);
            pivot += own_[row];
        }
        if (deficit_[row] <= force * pivot) {
            force = deficit_[row] / pivot;
            leaving = kNone;
        }
        // Take the step; rounding must not make a force negative.
        for (std::size_t i = 0; i < count; ++i) {
            share_[i] = -std::min(force * share_[i], force_[active[i]]);
        }
        change_active_forces(compliance);
        set_force(compliance, row, force_[row] + force);
        tolerance_ = std::max(tolerance_, kTolerance * force_[row] * diagonal_[row]);
        if (leaving == kNone) {
            factor().append(row, pivot, free_[row]);
            state_[row] = RowState::Pushes;
            return steps;
        }
        set_force(compliance, active[leaving], 0.0);
        release(leaving);
    }
    only_active_push_ = false;  // the row has taken a part of its force
    return max_steps;
}

void ContactSolver::solve_friction(const ComplianceMatrix& compliance, std::span<FrictionRows> friction,
                                   Result& result) HAPTIC_RT {
    // Iterate from the exact normal forces. The last operation is a sweep, so that the cones hold exactly.
    acceleration_.restart();
    double smallest = std::numeric_limits<double>::max();
    bool extrapolated = false;
    bool converged = false;
    while (!converged && result.sweeps < max_sweeps_) {
        std::copy_n(force_.begin(), rows_, held_.begin());
        const double change = sweep(compliance, friction);
        ++result.sweeps;
        // An extrapolation from which a row moves farther than the largest depth is undone: along directions with
        // little compliance it was off by many times the forces, and the sweeps that are left would not return.
        if (extrapolated && change > scale_) {
            acceleration_.undo(std::span(force_).first(rows_), std::span(deficit_).first(rows_));
            acceleration_.restart();
            extrapolated = false;
            continue;
        }
        result.residual = change;
        converged = change <= kSweepTolerance * scale_;
        // Extrapolate from the sweeps since the last change of mode.
        extrapolated = !converged && result.sweeps < max_sweeps_ - kPlainSweeps;
        if (extrapolated) {
            if (change > kMaxGrowth * smallest) {
                acceleration_.restart();
                smallest = change;
            }
            smallest = std::min(smallest, change);
            extrapolate();
        }
    }
}

void ContactSolver::bound_energy(std::span<const double> depth) HAPTIC_RT {
    // l^T b, and l^T W l: twice the energy that the forces put into the springs.
    double offered = 0.0;
    double taken = 0.0;
    for (std::size_t r = 0; r < rows_; ++r) {
        offered += force_[r] * depth[r];
        taken += force_[r] * (depth[r] - deficit_[r]);
    }
    if (!(offered < taken)) {
        return;
    }
    // The minimum along the ray of these forces, which stays in the cones.
    const double factor = std::max(0.0, offered / taken);
    for (std::size_t r = 0; r < rows_; ++r) {
        force_[r] *= factor;
        deficit_[r] = depth[r] - factor * (depth[r] - deficit_[r]);
    }
}

double ContactSolver::sweep(const ComplianceMatrix& compliance, std::span<FrictionRows> friction) HAPTIC_RT {
    double largest = 0.0;
    for (std::size_t r = 0; r < rows_; ++r) {
        if (state_[r] == RowState::Tangential) {
            // The pair, whose last normal row is the row before.
            largest = std::max(largest, solve_pair(compliance, friction[pair_[r]], r));
            ++r;
        } else if (r + 1 == rows_ || state_[r + 1] != RowState::Tangential) {
            const double force = exact_force(r);
            largest = std::max(largest, std::abs(force - force_[r]) * diagonal_[r]);
            set_force(compliance, r, force);
        }
    }
    return largest;
}

void ContactSolver::extrapolate() HAPTIC_RT {
    // Change of the last sweep, in units that make the rows comparable.
    for (std::size_t r = 0; r < rows_; ++r) {
        held_[r] = weight_[r] * (force_[r] - held_[r]);
    }
    const std::span force = std::span(force_).first(rows_);
    const std::span deficit = std::span(deficit_).first(rows_);
    acceleration_.extrapolate(std::span(held_).first(rows_), force, deficit);
    bool bounded = true;
    for (std::size_t r = 0; r < rows_; ++r) {
        bounded = bounded && std::abs(force_[r]) * diagonal_[r] <= kMaxDisplacement * scale_;
    }
    if (!bounded) {
        acceleration_.undo(force, deficit);
        acceleration_.restart();
    }
}

double ContactSolver::exact_force(std::size_t row) const HAPTIC_RT {
    return state_[row] == RowState::Excluded ? force_[row]
                                             : std::max(0.0, force_[row] + deficit_[row] / diagonal_[row]);
}

double ContactSolver::solve_pair(const ComplianceMatrix& compliance, FrictionRows& friction,
                                 std::size_t first) HAPTIC_RT {
    const std::size_t second = first + 1;
    const std::size_t normal = first - 1;
    // Last normal row of the proxy, exact with all other forces held. What it changes is applied below, together with
    // the pair.
    const double normal_force = exact_force(normal);
    const double normal_change = normal_force - force_[normal];
    // Radius of the cone at the normal forces of the proxy.
    double sum = normal_force;
    for (std::size_t r = friction.first_normal; r < normal; ++r) {
        sum += force_[r];
    }
    const bool compliant = diagonal_[first] > kMinCompliance && diagonal_[second] > kMinCompliance;
    const double radius = compliant ? friction.coefficient * sum : 0.0;
    // The pair's block of W, made definite where it was rounded. A fixed point of the sweeps does not depend on it.
    const double margin = kMinPivot * (diagonal_[first] + diagonal_[second]);
    const double a = diagonal_[first] + margin;
    const double d = diagonal_[second] + margin;
    const double limit = std::sqrt(std::max(diagonal_[first] * diagonal_[second], 0.0));
    const double c = std::clamp(compliance(first, second), -limit, limit);
    // Exact minimum over both tangential forces with all others held.
    const std::array<double, 2> held = {force_[first], force_[second]};
    const std::array<double, 2> g = {
        deficit_[first] - compliance(normal, first) * normal_change + a * held[0] + c * held[1],
        deficit_[second] - compliance(normal, second) * normal_change + c * held[0] + d * held[1]};
    const Disc minimum = minimum_in_disc(a, c, d, g, radius);
    friction.slides = minimum.on_edge;
    // Apply the three changes.
    const std::array<double, 3> change = {normal_change, minimum.point[0] - held[0], minimum.point[1] - held[1]};
    force_[normal] = normal_force;
    force_[first] = minimum.point[0];
    force_[second] = minimum.point[1];
    if (change[0] != 0.0 || change[1] != 0.0 || change[2] != 0.0) {
        subtract_combination(deficit_.data(), change,
                             {compliance.row(normal), compliance.row(first), compliance.row(second)}, rows_);
    }
    return std::max({std::abs(change[0]) * diagonal_[normal], std::abs(change[1]) * diagonal_[first],
                     std::abs(change[2]) * diagonal_[second]});
}

void ContactSolver::set_own_compliance(std::size_t row, double own) HAPTIC_RT {
    deficit_[row] -= (own - own_[row]) * force_[row];
    own_[row] = own;
    if (own != 0.0) {
        factor().pad();
    }
}

/// Adds those of the rows to the active ones that are independent of them.
void ContactSolver::append(const ComplianceMatrix& compliance, std::span<const std::uint16_t> rows) HAPTIC_RT {
    const std::size_t before = factor().size();
    factor().append_independent(compliance, rows, free_.data());
    for (const std::uint16_t r : factor().rows().subspan(before)) {
        state_[r] = RowState::Pushes;
    }
}

/// An active row ceases to push.
void ContactSolver::release(std::size_t position) HAPTIC_RT {
    const std::size_t row = factor().rows()[position];
    force_[row] = 0.0;
    state_[row] = RowState::Idle;
    factor().remove(position);
}

/// Gives the active rows the forces share_. No other normal row has one but those whose displacements are in free_.
void ContactSolver::set_active_forces(const ComplianceMatrix& compliance) HAPTIC_RT {
    const std::span<const std::uint16_t> active = factor().rows();
    for (std::size_t i = 0; i < active.size(); ++i) {
        force_[active[i]] = share_[i];
    }
    std::copy_n(free_.begin(), rows_, deficit_.begin());
    subtract_displacements(compliance);
}

void ContactSolver::change_active_forces(const ComplianceMatrix& compliance) HAPTIC_RT {
    const std::span<const std::uint16_t> active = factor().rows();
    for (std::size_t i = 0; i < active.size(); ++i) {
        force_[active[i]] += share_[i];
    }
    subtract_displacements(compliance);
}

/// deficit -= (W + own) share.
void ContactSolver::subtract_displacements(const ComplianceMatrix& compliance) HAPTIC_RT {
    const std::span<const std::uint16_t> active = factor().rows();
    for (std::size_t i = 0; i < active.size(); ++i) {
        terms_[i] = compliance.row(active[i]);
    }
    kernels_->subtract_rows(deficit_.data(), share_.data(), terms_.data(), active.size(), rows_);
    for (std::size_t i = 0; i < active.size(); ++i) {
        deficit_[active[i]] -= share_[i] * own_[active[i]];
    }
}

void ContactSolver::set_force(const ComplianceMatrix& compliance, std::size_t row, double force) HAPTIC_RT {
    if (force != force_[row]) {
        add_scaled(deficit_.data(), force_[row] - force, compliance.row(row), rows_);
        deficit_[row] += (force_[row] - force) * own_[row];
        force_[row] = force;
    }
}

std::size_t ContactSolver::most_violated() const HAPTIC_RT {
    if (!(largest(deficit_.data(), rows_) > tolerance_)) {
        return kNone;
    }
    std::size_t row = kNone;
    double worst = tolerance_;
    for (std::size_t r = 0; r < rows_; ++r) {
        if (state_[r] == RowState::Idle && deficit_[r] > worst) {
            worst = deficit_[r];
            row = r;
        }
    }
    return row;
}

double ContactSolver::normal_residual() HAPTIC_RT {
    double residual = 0.0;
    if (!has_tangents_) {
        residual = std::max(residual, largest(deficit_.data(), rows_));
        for (const std::uint16_t r : factor().rows()) {
            residual = std::max(residual, std::abs(deficit_[r]));
        }
        return residual;
    }
    for (std::size_t r = 0; r < rows_; ++r) {
        // A row that pushes must be exact; any other normal row must not be behind its plane.
        if (state_[r] != RowState::Tangential) {
            residual = std::max(residual, force_[r] > 0.0 ? std::abs(deficit_[r]) : deficit_[r]);
        }
    }
    return residual;
}

}  // namespace haptic
