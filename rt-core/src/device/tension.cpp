#include "device/tension.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "haptic/numeric.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kN = kStrings;
constexpr std::int8_t kLower = -1;
constexpr std::int8_t kFree = 0;
constexpr std::int8_t kUpper = +1;

// Relative to the largest term of the gradient: the sign of a multiplier counts only beyond the gradient's rounding.
constexpr double kMultiplierTolerance = 1e-12;

// In units of the maximum tension: a larger wrench is scaled down to this before it is used. Out of reach of any
// strings, and far from overflow.
constexpr double kMaxWrench = 1e4;

// Bound on the sum of |entry| of the wire matrix. Wires are unit vectors with moment arms of centimetres.
constexpr double kMaxWireSum = 1e6;

// Tolerances of TensionResult::reached.
constexpr double kRelativeError = 1e-3;
constexpr double kForceError = 1e-3;    // N
constexpr double kTorqueError = 50e-6;  // N*m

using Matrix = std::array<StringArray, kN>;
using ActiveSet = std::array<std::int8_t, kN>;

double length(const Vec3& v) HAPTIC_RT {
    return std::sqrt(glm::dot(v, v));
}

double dot(const Vec6& a, const Vec6& b) HAPTIC_RT {
    double sum = 0.0;
    for (std::size_t k = 0; k < 6; ++k) {
        sum += a[k] * b[k];
    }
    return sum;
}

/// Box-constrained quadratic programme: minimise 1/2 x^T hessian x - linear^T x  over  lower <= x <= upper.
struct BoxQp {
    Matrix hessian{};
    StringArray linear{};
    StringArray lower{};
    StringArray upper{};
    double tolerance = 0.0;  // of a multiplier's sign

    [[nodiscard]] double gradient(const StringArray& x, std::size_t i) const HAPTIC_RT {
        double sum = -linear[i];
        for (std::size_t k = 0; k < kN; ++k) {
            sum += hessian[i][k] * x[k];
        }
        return sum;
    }

    [[nodiscard]] double bound(std::int8_t side, std::size_t i) const HAPTIC_RT {
        return side == kLower ? lower[i] : upper[i];
    }

    /// True if the objective falls when a variable at a bound moves into the box (negative multiplier).
    [[nodiscard]] bool wants_release(std::int8_t side, double gradient) const HAPTIC_RT {
        return side == kLower ? gradient < -tolerance : gradient > tolerance;
    }
};

/// Newton step of the free variables to the minimum of their face, the others fixed: solves H_FF step = -g_F. False if
/// H_FF is not positive definite, which only rounding can cause.
bool newton_step(const BoxQp& qp, const ActiveSet& active, const StringArray& x, StringArray& step) HAPTIC_RT {
    // Indices of the free set F. Variables at a bound do not move.
    std::array<std::size_t, kN> index{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < kN; ++i) {
        step[i] = 0.0;
        if (active[i] == kFree) {
            index[count++] = i;
        }
    }
    // Cholesky H_FF = L L^T row by row, with the forward substitution L y = -g_F in the same pass.
    Matrix factor{};
    StringArray rhs{};
    for (std::size_t row = 0; row < count; ++row) {
        // Off-diagonal entries L_ij = (H_ij - sum L_ik L_jk) / L_jj with k < j, and their part of y.
        const StringArray& h = qp.hessian[index[row]];
        double value = -qp.gradient(x, index[row]);
        for (std::size_t column = 0; column < row; ++column) {
            double entry = h[index[column]];
            for (std::size_t k = 0; k < column; ++k) {
                entry -= factor[row][k] * factor[column][k];
            }
            entry *= factor[column][column];  // the diagonal holds reciprocals
            factor[row][column] = entry;
            value -= entry * rhs[column];
        }
        // Diagonal entry L_ii = sqrt(H_ii - sum L_ik^2), stored as its reciprocal.
        double pivot = h[index[row]];
        for (std::size_t k = 0; k < row; ++k) {
            pivot -= factor[row][k] * factor[row][k];
        }
        if (!(pivot > 0.0)) {
            return false;
        }
        factor[row][row] = 1.0 / std::sqrt(pivot);
        rhs[row] = value * factor[row][row];
    }
    // Back substitution L^T step = y.
    for (std::size_t row = count; row-- > 0;) {
        double value = rhs[row];
        for (std::size_t k = row + 1; k < count; ++k) {
            value -= factor[k][row] * rhs[k];
        }
        rhs[row] = value * factor[row][row];
        step[index[row]] = rhs[row];
    }
    return true;
}

/// Puts every variable of the active set on its bound, and clamps the free ones to the box.
void project_onto_face(const BoxQp& qp, const ActiveSet& active, StringArray& x) HAPTIC_RT {
    for (std::size_t i = 0; i < kN; ++i) {
        x[i] = active[i] == kFree ? std::clamp(x[i], qp.lower[i], qp.upper[i]) : qp.bound(active[i], i);
    }
}

/// One round of block principal pivoting. x moves to the minimum of the face, inside the box or not; then every
/// variable that violates an optimality condition changes sides at once. Returns their number; 0: x is the minimum.
int exchange_block(const BoxQp& qp, ActiveSet& active, StringArray& x) HAPTIC_RT {
    // Minimum over the free variables.
    StringArray step{};
    project_onto_face(qp, active, x);
    if (!newton_step(qp, active, x, step)) {
        return static_cast<int>(kN);
    }
    for (std::size_t i = 0; i < kN; ++i) {
        // No clamp: the exchange has to see which variables leave the box.
        x[i] += step[i];
    }
    // Exchange: a bound with a negative multiplier is released, a free variable outside the box goes to its bound.
    int exchanged = 0;
    for (std::size_t i = 0; i < kN; ++i) {
        if (active[i] != kFree) {
            if (qp.wants_release(active[i], qp.gradient(x, i))) {
                active[i] = kFree;
                ++exchanged;
            }
        } else if (x[i] < qp.lower[i] || x[i] > qp.upper[i]) {
            active[i] = x[i] < qp.lower[i] ? kLower : kUpper;
            ++exchanged;
        }
    }
    return exchanged;
}

/// One round of the primal active-set method; x stays within the box. Returns true if x is the minimum. `stalled`: the
/// last step had zero length.
bool active_set_step(const BoxQp& qp, ActiveSet& active, StringArray& x, bool& stalled) HAPTIC_RT {
    // Step towards the minimum of the current face.
    StringArray step{};
    if (!newton_step(qp, active, x, step)) {
        return false;
    }
    // Ratio test: the largest fraction of the step that keeps every free variable in the box.
    double fraction = 1.0;
    std::size_t blocking = kN;
    for (std::size_t i = 0; i < kN; ++i) {
        // Only a variable that the full step takes out of the box can limit the fraction.
        const double goal = x[i] + step[i];
        if (active[i] == kFree && (goal < qp.lower[i] || goal > qp.upper[i])) {
            const double allowed = ((goal < qp.lower[i] ? qp.lower[i] : qp.upper[i]) - x[i]) / step[i];
            if (allowed < fraction) {
                fraction = allowed;
                blocking = i;
            }
        }
    }
    for (std::size_t i = 0; i < kN; ++i) {
        // The clamp corrects only the rounding of the product.
        x[i] = std::clamp(x[i] + fraction * step[i], qp.lower[i], qp.upper[i]);
    }
    // The step was cut: the blocking variable joins the active set.
    if (blocking < kN) {
        active[blocking] = step[blocking] < 0.0 ? kLower : kUpper;
        x[blocking] = qp.bound(active[blocking], blocking);
        stalled = !(fraction > 0.0);
        return false;
    }
    // The face's minimum was reached: release the bound with the most negative multiplier. After a step of zero length
    // the objective did not fall; then release the first one (Bland's rule), which excludes cycling.
    std::size_t released = kN;
    double strongest = 0.0;
    for (std::size_t i = 0; i < kN; ++i) {
        if (active[i] == kFree) {
            continue;
        }
        // Steepest descent among the bounds; the first one found is enough after a stall.
        const double gradient = qp.gradient(x, i);
        if (qp.wants_release(active[i], gradient) && std::abs(gradient) > strongest) {
            released = i;
            strongest = std::abs(gradient);
            if (stalled) {
                break;
            }
        }
    }
    // No bound wants release: the optimality conditions hold, and x is the minimum.
    if (released == kN) {
        return true;
    }
    active[released] = kFree;
    return false;
}

/// Block pivoting first, then the active-set method. Returns false if both used up their rounds.
bool minimise(const BoxQp& qp, ActiveSet& active, StringArray& x, int& rounds) HAPTIC_RT {
    // Block pivoting usually ends within its rounds, but may cycle.
    for (int round = 0; round < TensionSolver::kBlockRounds; ++round) {
        ++rounds;
        if (exchange_block(qp, active, x) == 0) {
            return true;
        }
    }
    // The active-set method needs a feasible start. From there every step lowers the objective, or Bland's rule
    // applies.
    project_onto_face(qp, active, x);
    bool stalled = false;
    for (int round = 0; round < TensionSolver::kDescentRounds; ++round) {
        ++rounds;
        if (active_set_step(qp, active, x, stalled)) {
            return true;
        }
    }
    return false;
}

bool is_usable(const WireMatrix& wires) HAPTIC_RT {
    double sum = 0.0;
    for (const Vec6& row : wires) {
        for (const double entry : row) {
            sum += std::abs(entry);
        }
    }
    return sum < kMaxWireSum;  // false for NaN
}

/// Factor, at most 1, that brings every component of the wrench within the force of `strings` strings at maximum
/// tension.
double scale_to_pull(const Wrench& goal, double strings, const TensionSettings& settings) HAPTIC_RT {
    // Largest component, with torques converted to forces at the grip's radius.
    double size = 0.0;
    for (Vec3::length_type k = 0; k < 3; ++k) {
        size = std::max({size, std::abs(goal.force[k]), std::abs(goal.torque[k]) * settings.torque_scale});
    }
    const double max_force = strings * settings.maximum;
    return size > max_force ? max_force / size : 1.0;
}

Wrench scaled(const Wrench& wrench, double factor) HAPTIC_RT {
    return {wrench.force * factor, wrench.torque * factor};
}

/// The programme of the file header in standard form, with B = A W^T:
/// hessian = B B^T + (effort + continuity) I,  linear = B W w + effort t_min + continuity t_previous.
BoxQp build_qp(const WireMatrix& wires, const Wrench& goal, const StringArray& previous, const StringArray& maxima,
               const TensionSettings& settings) HAPTIC_RT {
    // W w and B: torques scaled to forces at the grip's radius.
    const double scale = settings.torque_scale;
    const Vec6 weighted_goal{goal.force.x,          goal.force.y,          goal.force.z,
                             goal.torque.x * scale, goal.torque.y * scale, goal.torque.z * scale};
    WireMatrix weighted = wires;
    for (Vec6& row : weighted) {
        for (std::size_t k = 3; k < 6; ++k) {
            row[k] *= scale;
        }
    }
    BoxQp qp;
    double largest_term = 0.0;
    for (std::size_t i = 0; i < kN; ++i) {
        // Box: tension bounds, intersected with the slew around the previous tension.
        qp.lower[i] = std::max(settings.minimum, previous[i] - settings.slew);
        const double maximum = std::clamp(maxima[i], settings.minimum, settings.maximum);
        qp.upper[i] = std::max(qp.lower[i], std::min(maximum, previous[i] + settings.slew));
        // Hessian and linear term.
        for (std::size_t j = 0; j <= i; ++j) {
            const double entry = dot(weighted[i], weighted[j]);
            qp.hessian[i][j] = entry;
            qp.hessian[j][i] = entry;
        }
        qp.hessian[i][i] += settings.effort + settings.continuity;
        qp.linear[i] =
            dot(weighted[i], weighted_goal) + settings.effort * settings.minimum + settings.continuity * previous[i];
        largest_term = std::max({largest_term, std::abs(qp.linear[i]), qp.hessian[i][i] * settings.maximum});
    }
    // Tolerance relative to the largest term that the gradient sums up.
    qp.tolerance = kMultiplierTolerance * largest_term;
    return qp;
}

/// True if the made wrench falls short of the goal along it, so that a smaller multiple of the goal is met better: the
/// sign of the derivative of the squared error by the multiple. The error is convex in it. A multiple can also be too
/// small to be feasible, zero included.
bool falls_short(const Wrench& made, const Wrench& goal, const TensionSettings& settings) HAPTIC_RT {
    const double squared_scale = settings.torque_scale * settings.torque_scale;
    return glm::dot(goal.force - made.force, goal.force) +
               squared_scale * glm::dot(goal.torque - made.torque, goal.torque) >
           0.0;
}

bool is_met(const Wrench& made, const Wrench& goal) HAPTIC_RT {
    return length(made.force - goal.force) <= std::max(kForceError, kRelativeError * length(goal.force)) &&
           length(made.torque - goal.torque) <= std::max(kTorqueError, kRelativeError * length(goal.torque));
}

void require(bool condition, const char* what) {
    if (!condition) {
        throw std::invalid_argument(std::string("tension solver: ") + what);
    }
}

}  // namespace

TensionSolver::TensionSolver(const TensionSettings& settings) : settings_(settings) {
    require(std::isfinite(settings.minimum) && settings.minimum >= 0.0, "the minimum tension must be 0 N or more");
    require(std::isfinite(settings.maximum) && settings.maximum > settings.minimum,
            "the maximum tension must be above the minimum");
    require(std::isfinite(settings.torque_scale) && settings.torque_scale > 0.0, "the torque scale must be positive");
    require(std::isfinite(settings.effort) && std::isfinite(settings.continuity) && settings.effort >= 0.0 &&
                settings.continuity >= 0.0 && settings.effort + settings.continuity >= 1e-9,
            "effort and continuity must not be negative and must sum to at least 1e-9; otherwise the tensions are not "
            "unique");
    require(settings.slew > 0.0, "the slew must be positive");
    maxima_.fill(settings.maximum);
    reset();
}

void TensionSolver::reset() HAPTIC_RT {
    previous_.fill(settings_.minimum);
    active_.fill(kLower);
}

TensionResult TensionSolver::solve(const WireMatrix& wires, const Wrench& wanted) HAPTIC_RT {
    TensionResult result;
    result.tensions.fill(settings_.minimum);
    // Unusable input: minimum tensions, and a zero wrench in place of one that is not finite.
    if (!is_usable(wires)) {
        reset();
        result.reached = false;
        result.exact = false;
        return result;
    }
    const Wrench goal = is_finite(wanted.force) && is_finite(wanted.torque) ? wanted : Wrench{};
    // Scale an absurdly large wrench down to avoid overflow, then solve; infeasible wrenches may be scaled further.
    const double scale = scale_to_pull(goal, kMaxWrench, settings_);
    solve_for(wires, scaled(goal, scale), active_, result);
    result.reached = result.reached && scale == 1.0;
    if (!result.reached && settings_.infeasible == Infeasible::Direction) {
        scale_to_feasible(wires, goal, active_, result);
    }
    previous_ = result.tensions;
    return result;
}

void TensionSolver::solve_for(const WireMatrix& wires, const Wrench& goal, ActiveSet& active,
                              TensionResult& result) const HAPTIC_RT {
    // The last tick's tensions and active set are a near-optimal start.
    const BoxQp qp = build_qp(wires, goal, previous_, maxima_, settings_);
    StringArray x = previous_;
    result.exact = minimise(qp, active, x, result.rounds);
    // The clamp holds on every path, also if the rounds were used up or rounding broke the factorisation.
    for (std::size_t i = 0; i < kN; ++i) {
        result.tensions[i] = std::isfinite(x[i]) ? std::clamp(x[i], qp.lower[i], qp.upper[i]) : previous_[i];
    }
    // The wrench really made, and whether it matches the goal.
    result.wrench = wrench_of_tensions(wires, result.tensions);
    result.reached = is_met(result.wrench, goal);
}

void TensionSolver::scale_to_feasible(const WireMatrix& wires, const Wrench& goal, ActiveSet& active,
                                      TensionResult& result) const HAPTIC_RT {
    // Upper end of the bisection: no multiple beyond eight strings at maximum tension can be feasible.
    const double max_scale = scale_to_pull(goal, static_cast<double>(kN), settings_);
    double low = 0.0;
    double high = 1.0;
    ActiveSet tried_active = active;
    TensionResult tried = result;
    // Bisection for the largest feasible multiple. A multiple can also be too small to be feasible, so the derivative
    // of the error decides which half to keep. The last multiple that was met is the result.
    for (int k = 0; k < kHalvings; ++k) {
        // Solve for the middle of the interval, starting from the last active set.
        const double fraction_of_max = 0.5 * (low + high);
        const Wrench scaled_goal = scaled(goal, fraction_of_max * max_scale);
        solve_for(wires, scaled_goal, tried_active, tried);
        // Feasible: keep this multiple and try a larger one. Otherwise follow the derivative of the error.
        if (tried.reached) {
            low = fraction_of_max;
            active = tried_active;
            result = tried;
            result.scale = fraction_of_max * max_scale;
        } else if (falls_short(tried.wrench, scaled_goal, settings_)) {
            high = fraction_of_max;
        } else {
            low = fraction_of_max;
        }
    }
    // Rounds of all multiples together; the wanted wrench itself stays unreached.
    result.rounds = tried.rounds;
    result.reached = false;
}

}  // namespace haptic::rt
