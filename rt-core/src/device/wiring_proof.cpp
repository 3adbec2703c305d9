#include "device/wiring_proof.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace haptic::rt {
namespace {

// Hand of the template: equally soft in all directions, with this ratio of translational to rotational compliance.
constexpr double kRotationPerTranslation = 400.0;  // rad^2/m^2: 400 N/m and 1 N m/rad
// Share of the median answer below which a motor counts as dead.
constexpr double kSilent = 0.3;
// Share of an answer's square in one length from which on the string moves alone, and the part that no motion explains.
constexpr double kAlone = 0.8;
constexpr double kNotRigid = 0.35;
// Least correlation of a row or column with its template, and the lead that another one needs.
constexpr double kResembles = 0.4;
constexpr double kLead = 0.1;
// Correlation of all answers with those of a single error from which on it is named.
constexpr double kExplains = 0.75;
// Another gain must explain the answers this much better, and the right gains must leave at least this much.
constexpr double kBetterGain = 0.8;
constexpr double kExplained = 0.12;
// Misfit that no friction and no hand explains.
constexpr double kUnexplained = 0.3;
// Weight of a hand that is softer in one direction than in another, as a misfit.
constexpr double kAnisotropyWeight = 0.15;
// m, movement below which friction does not act fully.
constexpr double kSliding = 30e-6;
// N, of each string, both ways: twice the friction of a motor.
constexpr std::array<double, 5> kFrictions{0.0, 0.015, 0.03, 0.045, 0.06};
// Smallest pivot of an elimination, of the pull.
constexpr double kSmallestPivotOfPull = 0.05;

using Square = std::array<StringArray, kStrings>;

Square product(const Square& a, const Square& b) HAPTIC_RT {
    Square result{};
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t k = 0; k < kStrings; ++k) {
            for (std::size_t j = 0; j < kStrings; ++j) {
                result[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    return result;
}

/// Solves X Q = D for X by elimination of columns with pivoting; false if Q is nearly singular.
bool divide(const Square& d, Square q, double least_pivot, Square& x) HAPTIC_RT {
    // Gauss-Jordan on the columns: the same operations take Q to 1 and D to X.
    x = d;
    for (std::size_t k = 0; k < kStrings; ++k) {
        std::size_t pivot = k;
        for (std::size_t j = k + 1; j < kStrings; ++j) {
            pivot = std::fabs(q[k][j]) > std::fabs(q[k][pivot]) ? j : pivot;
        }
        if (!(std::fabs(q[k][pivot]) > least_pivot)) {
            return false;
        }
        for (std::size_t i = 0; i < kStrings; ++i) {
            std::swap(q[i][k], q[i][pivot]);
            std::swap(x[i][k], x[i][pivot]);
        }
        const double inverse = 1.0 / q[k][k];
        for (std::size_t i = 0; i < kStrings; ++i) {
            q[i][k] *= inverse;
            x[i][k] *= inverse;
        }
        for (std::size_t j = 0; j < kStrings; ++j) {
            const double factor = j == k ? 0.0 : q[k][j];
            for (std::size_t i = 0; i < kStrings && factor != 0.0; ++i) {
                q[i][j] -= factor * q[i][k];
                x[i][j] -= factor * x[i][k];
            }
        }
    }
    return true;
}

/// -1..1: how fully friction acts against a movement, m. Smooth, and free of library calls.
double sliding(double movement) HAPTIC_RT {
    const double ratio = movement / kSliding;
    return ratio / std::sqrt(1.0 + ratio * ratio);
}

double squares_of(const Square& a) HAPTIC_RT {
    double sum = 0.0;
    for (const StringArray& row : a) {
        for (const double value : row) {
            sum += value * value;
        }
    }
    return sum;
}

/// Correlation of two rows, or columns, of 8 numbers: the cosine of their angle; 0 if one is zero.
template <typename A, typename B>
double correlation(const A& a, const B& b) HAPTIC_RT {
    double ab = 0.0;
    double aa = 0.0;
    double bb = 0.0;
    for (std::size_t k = 0; k < kStrings; ++k) {
        ab += a(k) * b(k);
        aa += a(k) * a(k);
        bb += b(k) * b(k);
    }
    return aa > 0.0 && bb > 0.0 ? ab / std::sqrt(aa * bb) : 0.0;
}

}  // namespace

const char* describe(StringFinding finding) noexcept {
    switch (finding) {
        case StringFinding::Right:
            return "right";
        case StringFinding::Silent:
            return "its motor moves nothing: no current, or the string is off its pulley";
        case StringFinding::Alone:
            return "its motor moves this string only: it is slack or broken";
        case StringFinding::OtherMotor:
            return "its motor pulls another string";
        case StringFinding::OtherString:
            return "its encoder counts another string";
        case StringFinding::Exchanged:
            return "its motor and encoder belong to another string";
        case StringFinding::Backwards:
            return "its encoder counts the wrong way";
        case StringFinding::Strong:
            return "its motor pulls about twice what was asked";
        case StringFinding::Unclear:
            break;
    }
    return "its answers fit no string";
}

WiringProof::WiringProof(const device::DeviceGeometry& geometry, const WiringProofSettings& settings)
    : settings_(settings) {
    if (!(settings.rest > 0.0) || !(settings.pull > 0.0) || !(settings.pull < settings.rest)) {
        throw std::invalid_argument("wiring proof: the pull must be positive and less than the rest tension");
    }
    if (settings.settle_ns < 0 || settings.half_ns <= settings.settle_ns || settings.rounds < 1 ||
        !(settings.certainty > 0.0)) {
        throw std::invalid_argument("wiring proof: times, rounds and certainty must be positive");
    }
    // T = -W C_0 W^T, the projection onto motions of the grip, and the motion of measured changes.
    const WireMatrix wires = wire_matrix(geometry, Pose{});
    Eigen::Matrix<double, kStrings, 6> w;
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (std::size_t k = 0; k < 6; ++k) {
            w(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = wires[i][k];
        }
    }
    Eigen::Matrix<double, 6, 1> compliance;
    compliance << 1.0, 1.0, 1.0, kRotationPerTranslation, kRotationPerTranslation, kRotationPerTranslation;
    const Eigen::Matrix<double, 6, kStrings> inverse = (w.transpose() * w).ldlt().solve(w.transpose());
    const Eigen::Matrix<double, kStrings, kStrings> expected = -w * compliance.asDiagonal() * w.transpose();
    const Eigen::Matrix<double, kStrings, kStrings> onto = w * inverse;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        for (std::size_t j = 0; j < kStrings; ++j) {
            const auto column = static_cast<Eigen::Index>(j);
            template_[i][j] = expected(row, column);
            projection_[i][j] = onto(row, column);
        }
        for (std::size_t k = 0; k < 3; ++k) {
            to_translation_[k][i] = inverse(static_cast<Eigen::Index>(k), row);
        }
    }
    reset();
}

void WiringProof::reset() HAPTIC_RT {
    verdict_ = Verdict::Pending;
    findings_ = {};
    others_ = {};
    answers_ = {};
    rounds_ = 0;
    time_ns_ = 0;
    motor_ = 0;
    half_ = 0;
    sum_ = {};
    summed_ = 0;
    noise_squares_ = 0.0;
    noise_count_ = 0;
    judging_gains_ = false;
    misfit_ = 0.0;
    other_misfit_ = 0.0;
}

StringArray WiringProof::tensions() const HAPTIC_RT {
    StringArray result{};
    result.fill(settings_.rest);
    if (verdict_ == Verdict::Pending && !judging_gains_) {
        // From the half before to this one along a smooth step within a third of the settling time.
        const double edge_ns = static_cast<double>(std::max<std::int64_t>(settings_.settle_ns / 3, 1));
        const double part = std::min(1.0, static_cast<double>(time_ns_) / edge_ns);
        const double smooth = part * part * (3.0 - 2.0 * part);
        const double now = half_ % 2 == 1 ? 1.0 : -1.0;
        const double before = half_ == 0 ? 0.0 : -now;
        result[motor_] += settings_.pull * (before + (now - before) * smooth);
    }
    return result;
}

WiringProof::Verdict WiringProof::update(const StringArray& lengths, std::int64_t elapsed_ns) HAPTIC_RT {
    if (verdict_ != Verdict::Pending) {
        return verdict_;
    }
    if (judging_gains_) {
        judge_next_gain();
        return verdict_;
    }
    // Mean of each half without its beginning.
    time_ns_ += elapsed_ns;
    if (time_ns_ > settings_.settle_ns) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            sum_[i] += lengths[i];
        }
        ++summed_;
    }
    if (time_ns_ < settings_.half_ns) {
        return verdict_;
    }
    StringArray& mean = means_[static_cast<std::size_t>(half_)];
    for (std::size_t i = 0; i < kStrings; ++i) {
        mean[i] = sum_[i] / std::max(summed_, 1);
    }
    sum_ = {};
    summed_ = 0;
    time_ns_ = 0;
    if (++half_ < kHalves) {
        return verdict_;
    }
    // One motor is done, or the whole round.
    half_ = 0;
    add_motor();
    if (++motor_ == kStrings) {
        motor_ = 0;
        finish_round();
    }
    return verdict_;
}

void WiringProof::add_motor() HAPTIC_RT {
    const double weight = 1.0 / (rounds_ + 1);
    for (std::size_t i = 0; i < kStrings; ++i) {
        // More minus the mean of less before and after, which cancels a steady drift.
        const double first = means_[1][i] - 0.5 * (means_[0][i] + means_[2][i]);
        const double second = means_[3][i] - 0.5 * (means_[2][i] + means_[4][i]);
        answers_[i][motor_] += weight * (0.5 * (first + second) - answers_[i][motor_]);
        noise_squares_ += 0.25 * (first - second) * (first - second);
        ++noise_count_;
    }
}

bool WiringProof::answers_are_certain() const HAPTIC_RT {
    const double noise = noise_squares_ / static_cast<double>(noise_count_) / rounds_;
    const double answer = squares_of(answers_) / static_cast<double>(kStrings * kStrings);
    return answer > settings_.certainty * settings_.certainty * noise;
}

void WiringProof::finish_round() HAPTIC_RT {
    ++rounds_;
    if (answers_are_certain()) {
        judge_strings();
        if (suspects() != 0) {
            verdict_ = Verdict::Refused;
        } else {
            begin_gains();
        }
    } else if (rounds_ >= settings_.rounds) {
        reset();
    }
}

std::uint8_t WiringProof::suspects() const HAPTIC_RT {
    unsigned bits = 0;
    for (std::size_t i = 0; i < kStrings; ++i) {
        bits |= findings_[i] == StringFinding::Right ? 0U : 1U << i;
    }
    return static_cast<std::uint8_t>(bits);
}

void WiringProof::find(std::size_t string, StringFinding finding, std::size_t other) HAPTIC_RT {
    // The first finding about a string stays: the later ones may follow from it.
    if (findings_[string] == StringFinding::Right) {
        findings_[string] = finding;
        others_[string] = static_cast<std::uint8_t>(other);
    }
}

void WiringProof::judge_strings() HAPTIC_RT {
    findings_ = {};
    judge_silent_motors();
    if (suspects() == 0) {
        judge_channels();
        if (suspects() != 0) {
            name_single_error();
        }
    }
}

void WiringProof::judge_silent_motors() HAPTIC_RT {
    // Size of the answer to each motor, and the part that no motion of the grip explains.
    StringArray size{};
    for (std::size_t motor = 0; motor < kStrings; ++motor) {
        double square = 0.0;
        double unexplained = 0.0;
        for (std::size_t i = 0; i < kStrings; ++i) {
            double explained = 0.0;
            for (std::size_t k = 0; k < kStrings; ++k) {
                explained += projection_[i][k] * answers_[k][motor];
            }
            square += answers_[i][motor] * answers_[i][motor];
            unexplained += (answers_[i][motor] - explained) * (answers_[i][motor] - explained);
        }
        size[motor] = std::sqrt(square);
        const double own = answers_[motor][motor] * answers_[motor][motor];
        if (own > kAlone * square && unexplained > kNotRigid * kNotRigid * square) {
            find(motor, StringFinding::Alone, motor);
        }
    }
    StringArray sorted = size;
    std::sort(sorted.begin(), sorted.end());
    const double median = 0.5 * (sorted[kStrings / 2 - 1] + sorted[kStrings / 2]);
    for (std::size_t motor = 0; motor < kStrings; ++motor) {
        if (size[motor] < kSilent * median) {
            find(motor, StringFinding::Silent, motor);
        }
    }
}

void WiringProof::judge_channels() HAPTIC_RT {
    for (std::size_t i = 0; i < kStrings; ++i) {
        // Row i against all rows of the template, column i against all columns.
        std::size_t best_row = i;
        std::size_t best_column = i;
        StringArray rows{};
        StringArray columns{};
        for (std::size_t j = 0; j < kStrings; ++j) {
            rows[j] = correlation([&](std::size_t k) HAPTIC_RT { return answers_[i][k]; },
                                  [&](std::size_t k) HAPTIC_RT { return template_[j][k]; });
            columns[j] = correlation([&](std::size_t k) HAPTIC_RT { return answers_[k][i]; },
                                     [&](std::size_t k) HAPTIC_RT { return template_[k][j]; });
            best_row = std::fabs(rows[j]) > std::fabs(rows[best_row]) ? j : best_row;
            best_column = columns[j] > columns[best_column] ? j : best_column;
        }
        if (rows[i] < -kResembles) {
            find(i, StringFinding::Backwards, i);
        } else if (std::fabs(rows[best_row]) > std::fabs(rows[i]) + kLead) {
            find(i, StringFinding::OtherString, best_row);
        } else if (columns[best_column] > columns[i] + kLead) {
            find(i, StringFinding::OtherMotor, best_column);
        } else if (rows[i] < kResembles || columns[i] < kResembles) {
            find(i, StringFinding::Unclear, i);
        }
    }
}

double WiringProof::resemblance(std::size_t i, std::size_t j, bool rows, bool columns) const HAPTIC_RT {
    const auto other = [i, j](std::size_t k) HAPTIC_RT { return k == i ? j : k == j ? i : k; };
    double product = 0.0;
    double squares = 0.0;
    for (std::size_t row = 0; row < kStrings; ++row) {
        const double sign = i == j && row == i ? -1.0 : 1.0;
        for (std::size_t column = 0; column < kStrings; ++column) {
            const double expected = template_[rows ? other(row) : row][columns ? other(column) : column];
            product += sign * expected * answers_[row][column];
            squares += expected * expected;
        }
    }
    return product / std::sqrt(squares * squares_of(answers_));
}

void WiringProof::name_single_error() HAPTIC_RT {
    struct Candidate {
        StringFinding finding = StringFinding::Right;
        std::size_t first = 0;
        std::size_t second = 0;
    };
    Candidate best;
    double best_resemblance = kExplains;
    const auto consider = [&](const Candidate& candidate, bool rows, bool columns) HAPTIC_RT {
        const double now = resemblance(candidate.first, candidate.second, rows, columns);
        if (now > best_resemblance) {
            best_resemblance = now;
            best = candidate;
        }
    };
    for (std::size_t i = 0; i < kStrings; ++i) {
        consider({StringFinding::Backwards, i, i}, false, false);
        for (std::size_t j = i + 1; j < kStrings; ++j) {
            consider({StringFinding::OtherMotor, i, j}, false, true);
            consider({StringFinding::OtherString, i, j}, true, false);
            consider({StringFinding::Exchanged, i, j}, true, true);
        }
    }
    if (best.finding != StringFinding::Right) {
        findings_ = {};
        find(best.first, best.finding, best.second);
        find(best.second, best.finding, best.first);
    }
}

void WiringProof::begin_gains() HAPTIC_RT {
    judging_gains_ = true;
    hypothesis_ = 0;
    best_hypothesis_ = 0;
    other_misfit_ = std::numeric_limits<double>::max();
}

StringArray WiringProof::gains_of(std::size_t hypothesis) const HAPTIC_RT {
    StringArray gains{};
    gains.fill(1.0);
    if (hypothesis == 0) {
        return gains;
    }
    std::size_t rest = hypothesis - 1;
    if (rest < 2 * kStrings) {
        gains[rest / 2] = rest % 2 == 0 ? 2.0 : 0.5;
        return gains;
    }
    // Pairs (i, j), i < j, in order.
    rest -= 2 * kStrings;
    std::size_t i = 0;
    while (rest >= kStrings - 1 - i) {
        rest -= kStrings - 1 - i;
        ++i;
    }
    gains[i] = 2.0;
    gains[i + 1 + rest] = 2.0;
    return gains;
}

double WiringProof::misfit_of(const StringArray& gains) const HAPTIC_RT {
    const double pull = 2.0 * settings_.pull;
    const double whole = squares_of(answers_);
    double best = std::numeric_limits<double>::max();
    for (const double friction : kFrictions) {
        // Effective tensions E = a G + f S (a string that shortens loses pull, one that lengthens gains).
        Square tensions{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            for (std::size_t j = 0; j < kStrings; ++j) {
                tensions[i][j] = friction * sliding(answers_[i][j]) + (i == j ? pull * gains[i] : 0.0);
            }
        }
        Square stiff{};
        if (!divide(answers_, tensions, kSmallestPivotOfPull * pull, stiff)) {
            continue;
        }
        // K must be symmetric and a motion of the grip: K <- P (K + K^T) / 2 P.
        Square symmetric{};
        for (std::size_t i = 0; i < kStrings; ++i) {
            for (std::size_t j = 0; j < kStrings; ++j) {
                symmetric[i][j] = -0.5 * (stiff[i][j] + stiff[j][i]);
            }
        }
        const Square k = product(product(projection_, symmetric), projection_);
        Square left = product(k, tensions);
        for (std::size_t i = 0; i < kStrings; ++i) {
            for (std::size_t j = 0; j < kStrings; ++j) {
                left[i][j] += answers_[i][j];
            }
        }
        // Translational compliance: how much it differs between directions.
        double trace = 0.0;
        double squares = 0.0;
        for (std::size_t a = 0; a < 3; ++a) {
            for (std::size_t b = 0; b < 3; ++b) {
                double element = 0.0;
                for (std::size_t i = 0; i < kStrings; ++i) {
                    for (std::size_t j = 0; j < kStrings; ++j) {
                        element += to_translation_[a][i] * k[i][j] * to_translation_[b][j];
                    }
                }
                squares += element * element;
                trace += a == b ? element : 0.0;
            }
        }
        const double anisotropy = squares > 0.0 ? std::sqrt(std::max(0.0, 1.0 - trace * trace / (3.0 * squares))) : 1.0;
        best = std::min(best, std::sqrt(squares_of(left) / whole) + kAnisotropyWeight * anisotropy);
    }
    return best;
}

void WiringProof::judge_next_gain() HAPTIC_RT {
    // One hypothesis a tick.
    const double misfit = misfit_of(gains_of(hypothesis_));
    if (hypothesis_ == 0) {
        misfit_ = misfit;
    } else if (misfit < other_misfit_) {
        other_misfit_ = misfit;
        best_hypothesis_ = hypothesis_;
    }
    if (++hypothesis_ < kGainHypotheses) {
        return;
    }
    judging_gains_ = false;
    if (misfit_ > kExplained && other_misfit_ < kBetterGain * misfit_) {
        const StringArray gains = gains_of(best_hypothesis_);
        for (std::size_t i = 0; i < kStrings; ++i) {
            if (gains[i] != 1.0) {
                find(i, gains[i] > 1.0 ? StringFinding::Strong : StringFinding::Unclear, i);
            }
        }
        verdict_ = Verdict::Refused;
    } else if (misfit_ > kUnexplained) {
        findings_.fill(StringFinding::Unclear);
        verdict_ = Verdict::Refused;
    } else {
        verdict_ = Verdict::Passed;
    }
}

}  // namespace haptic::rt
