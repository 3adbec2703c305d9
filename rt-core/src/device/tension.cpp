#include "device/tension.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace haptic::rt {
namespace {

constexpr std::size_t kN = kStrings;
constexpr std::int8_t kLower = -1;
constexpr std::int8_t kFree = 0;
constexpr std::int8_t kUpper = +1;

// A multiplier is wrong only beyond this, relative to the largest term of the gradient: rounding of the gradient.
constexpr double kMultiplierTolerance = 1e-12;

// A wrench is shortened to this before anything is formed from it, in tensions at full pull: out of reach of any
// strings, and far from overflow.
constexpr double kLargestWrench = 1e4;

// Sum of all entries' sizes: wires are of unit length, and their levers of centimetres.
constexpr double kLargestWires = 1e6;

// `reached`.
constexpr double kRelativeError = 1e-3;
constexpr double kForceError = 1e-3;    // N
constexpr double kTorqueError = 50e-6;  // N*m

using Matrix = std::array<StringArray, kN>;
using Set = std::array<std::int8_t, kN>;

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

bool is_finite(const Vec3& v) HAPTIC_RT {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// minimise 1/2 x^T hessian x - linear^T x  over  lower <= x <= upper.
struct BoxProgramme {
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

    /// Whether the gradient pushes a string at a bound back into the box.
    [[nodiscard]] bool wants_release(std::int8_t side, double slope) const HAPTIC_RT {
        return side == kLower ? slope < -tolerance : slope > tolerance;
    }
};

/// Moves x's free components to the minimum of their face, the others staying where they are: step solves
/// H_FF step = -g_F. False if the face's Hessian is not positive definite, which only rounding can cause.
bool newton_step(const BoxProgramme& programme, const Set& set, const StringArray& x, StringArray& step) HAPTIC_RT {
    std::array<std::size_t, kN> index{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < kN; ++i) {
        step[i] = 0.0;
        if (set[i] == kFree) {
            index[count++] = i;
        }
    }
    Matrix factor{};
    StringArray rhs{};
    for (std::size_t row = 0; row < count; ++row) {
        const StringArray& h = programme.hessian[index[row]];
        double value = -programme.gradient(x, index[row]);
        for (std::size_t column = 0; column < row; ++column) {
            double entry = h[index[column]];
            for (std::size_t k = 0; k < column; ++k) {
                entry -= factor[row][k] * factor[column][k];
            }
            entry *= factor[column][column];  // the diagonal holds reciprocals
            factor[row][column] = entry;
            value -= entry * rhs[column];
        }
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

void clamp_to_set(const BoxProgramme& programme, const Set& set, StringArray& x) HAPTIC_RT {
    for (std::size_t i = 0; i < kN; ++i) {
        x[i] = set[i] == kFree ? std::clamp(x[i], programme.lower[i], programme.upper[i]) : programme.bound(set[i], i);
    }
}

/// One round of block principal pivoting: x goes to the minimum of the face, whether the box allows it or not, and
/// every component that then breaks a condition changes sides at once. Returns how many did; 0: x is the minimum.
int exchange_block(const BoxProgramme& programme, Set& set, StringArray& x) HAPTIC_RT {
    StringArray step{};
    clamp_to_set(programme, set, x);
    if (!newton_step(programme, set, x, step)) {
        return static_cast<int>(kN);
    }
    for (std::size_t i = 0; i < kN; ++i) {
        x[i] += step[i];
    }
    int exchanged = 0;
    for (std::size_t i = 0; i < kN; ++i) {
        if (set[i] != kFree) {
            if (programme.wants_release(set[i], programme.gradient(x, i))) {
                set[i] = kFree;
                ++exchanged;
            }
        } else if (x[i] < programme.lower[i] || x[i] > programme.upper[i]) {
            set[i] = x[i] < programme.lower[i] ? kLower : kUpper;
            ++exchanged;
        }
    }
    return exchanged;
}

/// One round of the primal active-set method, x within the box before and after. True: x is the minimum. `stalled` says
/// that the last step had no length.
bool descend(const BoxProgramme& programme, Set& set, StringArray& x, bool& stalled) HAPTIC_RT {
    StringArray step{};
    if (!newton_step(programme, set, x, step)) {
        return false;
    }
    double fraction = 1.0;
    std::size_t blocking = kN;
    for (std::size_t i = 0; i < kN; ++i) {
        const double goal = x[i] + step[i];
        if (set[i] == kFree && (goal < programme.lower[i] || goal > programme.upper[i])) {
            const double allowed =
                ((goal < programme.lower[i] ? programme.lower[i] : programme.upper[i]) - x[i]) / step[i];
            if (allowed < fraction) {
                fraction = allowed;
                blocking = i;
            }
        }
    }
    for (std::size_t i = 0; i < kN; ++i) {
        x[i] = std::clamp(x[i] + fraction * step[i], programme.lower[i], programme.upper[i]);
    }
    if (blocking < kN) {
        set[blocking] = step[blocking] < 0.0 ? kLower : kUpper;
        x[blocking] = programme.bound(set[blocking], blocking);
        stalled = !(fraction > 0.0);
        return false;
    }
    // The one that wants it most, as long as steps have a length and so the objective falls; after one without, the
    // first one (Bland's rule), so that no series of such steps comes back to its start.
    std::size_t released = kN;
    double strongest = 0.0;
    for (std::size_t i = 0; i < kN; ++i) {
        if (set[i] == kFree) {
            continue;
        }
        const double slope = programme.gradient(x, i);
        if (programme.wants_release(set[i], slope) && std::abs(slope) > strongest) {
            released = i;
            strongest = std::abs(slope);
            if (stalled) {
                break;
            }
        }
    }
    if (released == kN) {
        return true;
    }
    set[released] = kFree;
    return false;
}

bool minimise(const BoxProgramme& programme, Set& set, StringArray& x, int& rounds) HAPTIC_RT {
    for (int round = 0; round < TensionSolver::kBlockRounds; ++round) {
        ++rounds;
        if (exchange_block(programme, set, x) == 0) {
            return true;
        }
    }
    clamp_to_set(programme, set, x);
    bool stalled = false;
    for (int round = 0; round < TensionSolver::kDescentRounds; ++round) {
        ++rounds;
        if (descend(programme, set, x, stalled)) {
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
    return sum < kLargestWires;  // not if it is not a number
}

/// What a wrench must be multiplied by so that no component is above so many tensions at full pull.
double shortening_of(const Wrench& goal, double strings, const TensionSettings& settings) HAPTIC_RT {
    double size = 0.0;
    for (Vec3::length_type k = 0; k < 3; ++k) {
        size = std::max({size, std::abs(goal.force[k]), std::abs(goal.torque[k]) * settings.torque_scale});
    }
    const double largest = strings * settings.maximum;
    return size > largest ? largest / size : 1.0;
}

Wrench scaled(const Wrench& wrench, double factor) HAPTIC_RT {
    return {wrench.force * factor, wrench.torque * factor};
}

BoxProgramme programme_of(const WireMatrix& wires, const Wrench& goal, const StringArray& previous,
                          const StringArray& maxima, const TensionSettings& settings) HAPTIC_RT {
    const double scale = settings.torque_scale;
    const Vec6 weighted_goal{goal.force.x,          goal.force.y,          goal.force.z,
                             goal.torque.x * scale, goal.torque.y * scale, goal.torque.z * scale};
    WireMatrix weighted = wires;
    for (Vec6& row : weighted) {
        for (std::size_t k = 3; k < 6; ++k) {
            row[k] *= scale;
        }
    }
    BoxProgramme programme;
    double largest_term = 0.0;
    for (std::size_t i = 0; i < kN; ++i) {
        programme.lower[i] = std::max(settings.minimum, previous[i] - settings.slew);
        const double maximum = std::clamp(maxima[i], settings.minimum, settings.maximum);
        programme.upper[i] = std::max(programme.lower[i], std::min(maximum, previous[i] + settings.slew));
        for (std::size_t j = 0; j <= i; ++j) {
            const double entry = dot(weighted[i], weighted[j]);
            programme.hessian[i][j] = entry;
            programme.hessian[j][i] = entry;
        }
        programme.hessian[i][i] += settings.effort + settings.continuity;
        programme.linear[i] =
            dot(weighted[i], weighted_goal) + settings.effort * settings.minimum + settings.continuity * previous[i];
        largest_term =
            std::max({largest_term, std::abs(programme.linear[i]), programme.hessian[i][i] * settings.maximum});
    }
    programme.tolerance = kMultiplierTolerance * largest_term;
    return programme;
}

/// Whether what is made falls short of the goal along it, so that a smaller share of it is met better: the sign of the
/// derivative of the squared error by the share, which is convex in it. Strings may also be unable to make a share that
/// is too small, zero included.
bool lacks(const Wrench& made, const Wrench& goal, const TensionSettings& settings) HAPTIC_RT {
    const double squared_scale = settings.torque_scale * settings.torque_scale;
    return glm::dot(goal.force - made.force, goal.force) +
               squared_scale * glm::dot(goal.torque - made.torque, goal.torque) >
           0.0;
}

bool is_met(const Wrench& made, const Wrench& goal) HAPTIC_RT {
    return length(made.force - goal.force) <= std::max(kForceError, kRelativeError * length(goal.force)) &&
           length(made.torque - goal.torque) <= std::max(kTorqueError, kRelativeError * length(goal.torque));
}

void require(bool held, const char* what) {
    if (!held) {
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
            "effort and continuity must not be negative, and must sum to 1e-9 or more, or the tensions are not unique");
    require(settings.slew > 0.0, "the slew must be positive");
    maxima_.fill(settings.maximum);
    reset();
}

void TensionSolver::reset() HAPTIC_RT {
    previous_.fill(settings_.minimum);
    at_bound_.fill(kLower);
}

TensionResult TensionSolver::solve(const WireMatrix& wires, const Wrench& wanted) HAPTIC_RT {
    TensionResult result;
    result.tensions.fill(settings_.minimum);
    if (!is_usable(wires)) {
        reset();
        result.reached = false;
        result.exact = false;
        return result;
    }
    const Wrench goal = is_finite(wanted.force) && is_finite(wanted.torque) ? wanted : Wrench{};
    const double shortening = shortening_of(goal, kLargestWrench, settings_);
    aim(wires, scaled(goal, shortening), at_bound_, result);
    result.reached = result.reached && shortening == 1.0;
    if (!result.reached && settings_.infeasible == Infeasible::Direction) {
        keep_direction(wires, goal, at_bound_, result);
    }
    previous_ = result.tensions;
    return result;
}

void TensionSolver::aim(const WireMatrix& wires, const Wrench& goal, Set& set, TensionResult& result) const HAPTIC_RT {
    const BoxProgramme programme = programme_of(wires, goal, previous_, maxima_, settings_);
    StringArray x = previous_;
    result.exact = minimise(programme, set, x, result.rounds);
    for (std::size_t i = 0; i < kN; ++i) {
        result.tensions[i] =
            std::isfinite(x[i]) ? std::clamp(x[i], programme.lower[i], programme.upper[i]) : previous_[i];
    }
    result.wrench = wrench_of_tensions(wires, result.tensions);
    result.reached = is_met(result.wrench, goal);
}

void TensionSolver::keep_direction(const WireMatrix& wires, const Wrench& goal, Set& set,
                                   TensionResult& result) const HAPTIC_RT {
    // No more than eight strings at full pull make, so that the halvings are spent on what can be.
    const double most = shortening_of(goal, static_cast<double>(kN), settings_);
    double low = 0.0;
    double high = 1.0;
    Set tried_set = set;
    TensionResult tried = result;
    for (int k = 0; k < kHalvings; ++k) {
        const double share = 0.5 * (low + high);
        const Wrench shared = scaled(goal, share * most);
        aim(wires, shared, tried_set, tried);
        if (tried.reached) {
            low = share;
            set = tried_set;
            result = tried;
            result.scale = share * most;
        } else if (lacks(tried.wrench, shared, settings_)) {
            high = share;
        } else {
            low = share;
        }
    }
    result.rounds = tried.rounds;
    result.reached = false;
}

}  // namespace haptic::rt
