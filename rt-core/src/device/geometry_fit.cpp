#include "device/geometry_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>

#include "device/kinematics.hpp"

namespace haptic::rt {
namespace {

// Parameters of one string: motor x y z, knot x y z, scale, length at the calibration.
constexpr int kPerString = 8;
constexpr int kShared = kPerString * static_cast<int>(kStrings);
constexpr int kScale = 6;
constexpr int kLength = 7;
constexpr int kReported = 7;  // parameters of a string that are reported: all but the length
constexpr int kPose = 6;
constexpr std::size_t kMinSamples = 50;
constexpr double kMinMovement = 2e-3;  // m, of at least one string
constexpr double kHuber = 3.0;         // standard deviations; rounding alone never exceeds two
constexpr double kConverged = 1e-10;   // relative change of the cost

constexpr double kMillimetres = 1e3;
constexpr double kPercent = 1e2;

using Shared = Eigen::Matrix<double, kShared, 1>;
using SharedMatrix = Eigen::Matrix<double, kShared, kShared>;
using PoseVector = Eigen::Matrix<double, kPose, 1>;
using PoseMatrix = Eigen::Matrix<double, kPose, kPose>;
using CrossMatrix = Eigen::Matrix<double, kPose, kShared>;  // pose by shared parameters

Quat rotated_exactly(const Quat& orientation, const Vec3& rotation) {
    const double angle = glm::length(rotation);
    const Quat step = angle > 1e-12 ? glm::angleAxis(angle, rotation / angle) : Quat(1.0, 0.0, 0.0, 0.0);
    return glm::normalize(step * orientation);
}

/// Equation of one string at one sample: residual, m, and its derivatives.
struct Equation {
    double residual = 0.0;
    std::array<double, kPose> by_pose{};
    std::array<double, kPerString> by_shared{};
};

/// The least-squares problem: all unknowns, its cost, and the steps of the minimiser.
class Problem {
  public:
    Problem(const device::DeviceGeometry& nominal, const Wiggle& wiggle, const FitSettings& settings)
        : nominal_(nominal), wiggle_(wiggle), poses_(wiggle.size()) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            // Prior standard deviations: how far each parameter may be from its nominal value.
            double* const deviation = deviations_.data() + kPerString * i;
            std::fill_n(deviation, 3, settings.motor);
            std::fill_n(deviation + 3, 3, settings.knot);
            deviation[kScale] = settings.scale;
            deviation[kLength] = settings.rest_length;
        }
        // Standard deviation of a value rounded to counts: count / sqrt(12).
        quantisation_ = 0.0;
        for (const device::StringFacts& string : nominal.strings) {
            quantisation_ = std::max(quantisation_, std::fabs(string.metres_per_count) / std::sqrt(12.0));
        }
        noise_ = quantisation_;
    }

    /// Initial poses: those of the nominal geometry, by the tick's solver, each started at the pose of the sample
    /// before.
    void initialise_poses() {
        PoseSolver solver(nominal_);
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            // Nominal lengths of the sample's counts.
            StringArray lengths{};
            for (std::size_t i = 0; i < kStrings; ++i) {
                lengths[i] =
                    nominal_.rest_length(i) + nominal_.strings[i].metres_per_count * static_cast<double>(wiggle_[k][i]);
            }
            // A few calls let the solver converge from the pose of the sample before.
            for (int repeat = 0; repeat < 4; ++repeat) {
                poses_[k] = solver.solve(lengths).pose;
            }
        }
    }

    /// Residual of string i at sample k, and its derivatives, with x the changes from the nominal parameters.
    [[nodiscard]] Equation equation(std::size_t sample, std::size_t string) const {
        const device::StringFacts& facts = nominal_.strings[string];
        const double* const x = shared_.data() + kPerString * string;
        const Pose& pose = poses_[sample];
        const Vec3 knot = facts.grip + Vec3(x[3], x[4], x[5]);
        const Vec3 moment_arm = pose.orientation * knot;
        const Vec3 span = facts.motor + Vec3(x[0], x[1], x[2]) - pose.position - moment_arm;
        // Length |a + x_a - p - R (b + x_b)|; u from knot to motor, m = R b x u.
        const double length = std::max(glm::length(span), 1e-9);
        const Vec3 u = span / length;
        const Vec3 m = glm::cross(moment_arm, u);
        const Vec3 u_of_grip = glm::conjugate(pose.orientation) * u;
        // Residual in counts times the nominal scale: the noise is in counts, and in true metres a smaller scale would
        // always fit better.
        const double inverse_scale = 1.0 / (1.0 + x[kScale]);
        const double paid_out = inverse_scale * (length - nominal_.rest_length(string) - x[kLength]);
        // Paid-out length minus measured length.
        Equation result;
        result.residual = paid_out - facts.metres_per_count * static_cast<double>(wiggle_[sample][string]);
        // d length = u . da - u . dp - (R b x u) . dtheta - (R^T u) . db.
        result.by_pose = {-u.x, -u.y, -u.z, -m.x, -m.y, -m.z};
        result.by_shared = {u.x, u.y, u.z, -u_of_grip.x, -u_of_grip.y, -u_of_grip.z, -paid_out, -1.0};
        // The paid-out length has the factor 1 / (1 + x_scale), so all derivatives have it too.
        for (double& derivative : result.by_pose) {
            derivative *= inverse_scale;
        }
        for (double& derivative : result.by_shared) {
            derivative *= inverse_scale;
        }
        return result;
    }

    /// Huber cost, dimensionless: quadratic up to kHuber standard deviations, linear beyond; plus the prior.
    [[nodiscard]] double cost() const {
        double sum = prior_cost();
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            for (std::size_t i = 0; i < kStrings; ++i) {
                // Residual in standard deviations; both branches meet with the same slope at kHuber.
                const double e = std::fabs(equation(k, i).residual) / noise_;
                sum += e <= kHuber ? e * e : kHuber * (2.0 * e - kHuber);
            }
        }
        return sum;
    }
    [[nodiscard]] double prior_cost() const { return (shared_.array() / deviations_.array()).square().sum(); }

    /// m, rms of the residuals, each cut to `bound`, per redundant length (two a sample).
    [[nodiscard]] double rms(double bound) const {
        double sum = 0.0;
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            for (std::size_t i = 0; i < kStrings; ++i) {
                // Cut residuals, so that outliers do not inflate the noise estimate.
                const double e = std::min(std::fabs(equation(k, i).residual), bound);
                sum += e * e;
            }
        }
        // Eight lengths less six pose unknowns leave two degrees of freedom a sample.
        return std::sqrt(sum / (2.0 * static_cast<double>(wiggle_.size())));
    }

    /// Levenberg-Marquardt step of all unknowns with damping lambda; if `shared` is false, of the poses only.
    void step(double lambda, bool shared) {
        // Normal equations of the shared parameters, with every pose eliminated.
        SharedMatrix reduced = SharedMatrix::Zero();
        Shared rhs = Shared::Zero();
        std::vector<Sample> samples(wiggle_.size());
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            samples[k] = linearise(k, lambda, shared, reduced, rhs);
        }
        // Step of the shared parameters from the reduced system. Only the prior's part of its diagonal is damped.
        Shared change = Shared::Zero();
        if (shared) {
            // The prior pulls each parameter to its nominal value (zero change).
            const Shared precision = deviations_.array().square().inverse();
            reduced.diagonal() += (1.0 + lambda) * precision;
            rhs -= precision.cwiseProduct(shared_);
            change = reduced.selfadjointView<Eigen::Lower>().ldlt().solve(rhs);
            shared_ += change;
        }
        // Back substitution: the step of each pose.
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            const PoseVector d = samples[k].pose_step - samples[k].by_shared * change;
            poses_[k].position += Vec3(d[0], d[1], d[2]);
            poses_[k].orientation = rotated_exactly(poses_[k].orientation, Vec3(d[3], d[4], d[5]));
        }
    }

    /// Covariance of the shared parameters, marginalised over the poses.
    [[nodiscard]] SharedMatrix covariance() const {
        SharedMatrix reduced = SharedMatrix::Zero();
        Shared rhs = Shared::Zero();
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            // Undamped: the Schur complement is then the information matrix of the shared parameters.
            static_cast<void>(linearise(k, 0.0, true, reduced, rhs));
        }
        // Add the prior's information and invert.
        reduced.diagonal() += Shared(deviations_.array().square().inverse());
        return SharedMatrix(reduced.selfadjointView<Eigen::Lower>()).llt().solve(SharedMatrix::Identity());
    }

    [[nodiscard]] std::size_t outliers() const {
        std::size_t count = 0;
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            for (std::size_t i = 0; i < kStrings; ++i) {
                count += std::fabs(equation(k, i).residual) > kHuber * noise_ ? 1u : 0u;
            }
        }
        return count;
    }

    /// The unknowns, to undo a step.
    struct State {
        Shared shared;
        std::vector<Pose> poses;
    };
    [[nodiscard]] State state() const { return {shared_, poses_}; }
    void restore(State state) {
        shared_ = state.shared;
        poses_ = std::move(state.poses);
    }

    [[nodiscard]] const Shared& shared() const { return shared_; }
    [[nodiscard]] const Shared& deviations() const { return deviations_; }
    [[nodiscard]] double noise() const { return noise_; }
    [[nodiscard]] double quantisation() const { return quantisation_; }
    void set_noise(double noise) { noise_ = std::max(noise, quantisation_); }

  private:
    /// Step of a pose: pose_step - by_shared * (step of the shared parameters).
    struct Sample {
        PoseVector pose_step = PoseVector::Zero();
        CrossMatrix by_shared = CrossMatrix::Zero();
    };

    /// Adds sample k to the normal equations of the shared parameters, with its pose eliminated by the Schur complement
    /// S = C - B^T A^-1 B. Fills the lower triangle only.
    Sample linearise(std::size_t k, double lambda, bool shared, SharedMatrix& reduced, Shared& rhs) const {
        // Weighted blocks A (pose), B (cross), C (shared) of the sample's normal equations.
        PoseMatrix pose_block = PoseMatrix::Zero();
        PoseVector pose_rhs = PoseVector::Zero();
        CrossMatrix cross_block = CrossMatrix::Zero();
        for (std::size_t i = 0; i < kStrings; ++i) {
            const Equation e = equation(k, i);
            // Huber weight over variance.
            const double size = std::fabs(e.residual) / noise_;
            const double weight = (size <= kHuber ? 1.0 : kHuber / size) / (noise_ * noise_);
            // The residual depends on its own string's eight parameters only: a and b are its two gradients.
            const Eigen::Map<const PoseVector> a(e.by_pose.data());
            const Eigen::Map<const Eigen::Matrix<double, kPerString, 1>> b(e.by_shared.data());
            const auto at = kPerString * static_cast<Eigen::Index>(i);
            // A += w a a^T, B += w a b^T, C += w b b^T, and the right-hand sides -w e a and -w e b.
            pose_block += weight * a * a.transpose();
            pose_rhs -= weight * e.residual * a;
            if (shared) {
                cross_block.middleCols<kPerString>(at) += weight * a * b.transpose();
                reduced.block<kPerString, kPerString>(at, at) += weight * b * b.transpose();
                rhs.segment<kPerString>(at) -= weight * e.residual * b;
            }
        }
        // Marquardt damping, then elimination of the pose.
        pose_block.diagonal() *= 1.0 + lambda;
        const Eigen::LDLT<PoseMatrix> solver(pose_block);
        // Pose step for fixed shared parameters: A^-1 pose_rhs.
        Sample sample;
        sample.pose_step = solver.solve(pose_rhs);
        if (shared) {
            // A^-1 B, then S = C - B^T A^-1 B and its right-hand side.
            sample.by_shared = solver.solve(cross_block);
            reduced.triangularView<Eigen::Lower>() -= cross_block.transpose() * sample.by_shared;
            rhs -= cross_block.transpose() * sample.pose_step;
        }
        return sample;
    }

    const device::DeviceGeometry& nominal_;
    const Wiggle& wiggle_;
    std::vector<Pose> poses_;
    Shared shared_ = Shared::Zero();  // differences from the nominal values
    Shared deviations_ = Shared::Zero();
    double quantisation_ = 0.0;  // m
    double noise_ = 0.0;         // m
};

struct Progress {
    int iterations = 0;
    bool converged = false;
};

/// Levenberg-Marquardt until the relative change of the cost is below kConverged.
Progress minimise(Problem& problem, int max_iterations, bool shared) {
    Progress progress;
    // Close to Gauss-Newton at first: the nominal geometry is a good start.
    double lambda = 1e-6;
    double cost = problem.cost();
    while (progress.iterations < max_iterations) {
        ++progress.iterations;
        // Try a step.
        Problem::State before = problem.state();
        problem.step(lambda, shared);
        const double now = problem.cost();
        // Worse (or NaN): undo the step and raise the damping.
        if (!(now <= cost)) {
            problem.restore(std::move(before));
            lambda *= 10.0;
            if (lambda > 1e8) {
                progress.converged = true;  // no step improves the cost: rounding
                return progress;
            }
            continue;
        }
        // Better: keep the step and lower the damping.
        const bool done = cost - now <= kConverged * cost;
        cost = now;
        lambda = std::max(lambda * 0.1, 1e-9);
        if (done) {
            progress.converged = true;
            return progress;
        }
    }
    return progress;
}

/// The nominal geometry with the fitted changes.
device::DeviceGeometry apply(const device::DeviceGeometry& nominal, const Shared& shared) {
    device::DeviceGeometry geometry = nominal;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double* const x = shared.data() + kPerString * i;
        device::StringFacts& string = geometry.strings[i];
        // Positions add, scales multiply. The length at the calibration is not part of the geometry.
        string.motor += Vec3(x[0], x[1], x[2]);
        string.grip += Vec3(x[3], x[4], x[5]);
        string.metres_per_count *= 1.0 + x[kScale];
    }
    return geometry;
}

void check(const device::DeviceGeometry& nominal, const Wiggle& wiggle) {
    // Enough samples to average the noise.
    if (wiggle.size() < kMinSamples) {
        throw std::invalid_argument("the fit needs at least " + std::to_string(kMinSamples) +
                                    " samples, but there are " + std::to_string(wiggle.size()) +
                                    ": move the grip back and forth and rotate it about all three axes");
    }
    // Enough movement: the largest change of any string's length since the first sample.
    double max_movement = 0.0;
    for (const StringCounts& counts : wiggle) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            max_movement = std::max(max_movement, std::fabs(static_cast<double>(counts[i] - wiggle.front()[i]) *
                                                            nominal.strings[i].metres_per_count));
        }
    }
    if (max_movement < kMinMovement) {
        throw std::invalid_argument("the strings moved by at most " + std::to_string(max_movement * 1e3) +
                                    " mm, too little to fit the geometry: move the grip back and forth by centimetres "
                                    "and rotate it about all three axes");
    }
}

constexpr std::array<const char*, kReported> kNames = {"motor x", "motor y", "motor z", "knot x",
                                                       "knot y",  "knot z",  "scale"};

void fill_values(const Problem& problem, GeometryFit& fit) {
    // Each parameter's standard deviation is the root of its diagonal entry.
    const SharedMatrix covariance = problem.covariance();
    for (int i = 0; i < static_cast<int>(kStrings); ++i) {
        for (int j = 0; j < kReported; ++j) {
            const int at = kPerString * i + j;
            fit.values.push_back({"string " + std::to_string(i) + " " + kNames[static_cast<std::size_t>(j)],
                                  problem.shared()[at], std::sqrt(covariance(at, at)), problem.deviations()[at],
                                  j == kScale});
        }
    }
}

std::string line_of(const FittedValue& value) {
    char text[120];
    const double unit = value.is_scale ? kPercent : kMillimetres;
    std::snprintf(text, sizeof text, "  %-18s %+9.4f +- %7.4f %s%s\n", value.name.c_str(), unit * value.change,
                  unit * value.deviation, value.is_scale ? "%" : "mm",
                  value.determined() ? "" : "   not determined by the wiggle");
    return text;
}

}  // namespace

GeometryFit fit_geometry(const device::DeviceGeometry& nominal, const Wiggle& wiggle, const FitSettings& settings) {
    // Normal equations grow with the samples: thin them out first.
    const Wiggle samples = thinned(wiggle, settings.max_samples);
    check(nominal, samples);
    Problem problem(nominal, samples, settings);
    problem.initialise_poses();
    GeometryFit fit;
    fit.samples = samples.size();
    // Poses only, nominal geometry. A noise of 1 m makes it plain least squares without outliers.
    problem.set_noise(1.0);
    minimise(problem, settings.max_iterations, false);
    fit.rms_before = problem.rms(std::numeric_limits<double>::max());

    // Alternate between fit and noise estimate: the true noise appears only once the geometry is right. Start with the
    // rms that the nominal geometry leaves.
    problem.set_noise(fit.rms_before);
    for (int round = 0; round < 6; ++round) {
        // Fit all unknowns, with outliers judged by the present noise.
        const Progress progress = minimise(problem, settings.max_iterations, true);
        fit.iterations += progress.iterations;
        fit.converged = progress.converged;
        // Noise estimate of this fit; stop once it agrees with the assumed one within 2 %.
        const double found = std::max(problem.rms(kHuber * problem.noise()), problem.quantisation());
        if (std::fabs(found - problem.noise()) < 0.02 * problem.noise()) {
            break;
        }
        problem.set_noise(found);
    }
    // Fitted geometry, and the quality of the fit.
    fit.noise = problem.noise();
    fit.outliers = problem.outliers();
    fit.rms_after = problem.rms(std::numeric_limits<double>::max());
    fit.geometry = apply(nominal, problem.shared());
    fill_values(problem, fit);
    return fit;
}

std::string describe(const GeometryFit& fit) {
    char text[320];
    std::snprintf(text, sizeof text,
                  "%zu samples, %d iterations, %s\n"
                  "rms of the redundant lengths: %.1f um before, %.1f um after; noise of a length %.1f um\n"
                  "%zu lengths are off by more than 3 standard deviations and are down-weighted\n",
                  fit.samples, fit.iterations, fit.converged ? "converged" : "NOT converged", fit.rms_before * 1e6,
                  fit.rms_after * 1e6, fit.noise * 1e6, fit.outliers);
    // One line per parameter.
    std::string lines = text;
    lines += "change from the nominal value +- standard deviation:\n";
    for (const FittedValue& value : fit.values) {
        lines += line_of(value);
    }
    // Count the parameters that the wiggle determined.
    const auto determined = std::count_if(fit.values.begin(), fit.values.end(),
                                          [](const FittedValue& value) { return value.determined(); });
    std::snprintf(text, sizeof text, "%td of %zu values are known at least twice as well as before\n", determined,
                  fit.values.size());
    return lines + text;
}

}  // namespace haptic::rt
