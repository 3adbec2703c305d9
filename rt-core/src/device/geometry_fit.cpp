#include "device/geometry_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <stdexcept>

#include "device/kinematics.hpp"

namespace haptic::rt {
namespace {

// Of one string: motor x y z, knot x y z, scale, length at the calibration.
constexpr int kOfString = 8;
constexpr int kShared = kOfString * static_cast<int>(kStrings);
constexpr int kScale = 6;
constexpr int kLength = 7;
constexpr int kGeometry = 7;  // of the eight, what is kept
constexpr int kPose = 6;
constexpr std::size_t kLeastSamples = 50;
constexpr double kLeastMovement = 2e-3;  // m, of some string
constexpr double kHuber = 3.0;           // noises; counts that are only rounded are never out by two
constexpr double kDone = 1e-10;          // relative change of the cost

using Shared = Eigen::Matrix<double, kShared, 1>;
using SharedMatrix = Eigen::Matrix<double, kShared, kShared>;
using PoseVector = Eigen::Matrix<double, kPose, 1>;
using PoseMatrix = Eigen::Matrix<double, kPose, kPose>;
using Crossing = Eigen::Matrix<double, kPose, kShared>;

Quat turned(const Quat& orientation, const Vec3& rotation) {
    const double angle = glm::length(rotation);
    const Quat turn = angle > 1e-12 ? glm::angleAxis(angle, rotation / angle) : Quat(1.0, 0.0, 0.0, 0.0);
    return glm::normalize(turn * orientation);
}

/// One string at one sample: residual, m, and its derivatives.
struct Equation {
    double residual = 0.0;
    std::array<double, kPose> by_pose{};
    std::array<double, kOfString> by_shared{};
};

/// The unknowns, and what is made of them.
class Problem {
  public:
    Problem(const device::Variant& nominal, const Wiggle& wiggle, const FitSettings& settings)
        : nominal_(nominal), wiggle_(wiggle), poses_(wiggle.size()) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            double* const deviation = deviations_.data() + kOfString * i;
            std::fill_n(deviation, 3, settings.motor);
            std::fill_n(deviation + 3, 3, settings.knot);
            deviation[kScale] = settings.scale;
            deviation[kLength] = settings.rest_length;
        }
        quantisation_ = 0.0;
        for (const device::StringFacts& string : nominal.strings) {
            quantisation_ = std::max(quantisation_, std::fabs(string.metres_per_count) / std::sqrt(12.0));
        }
        noise_ = quantisation_;
    }

    /// Poses of the nominal geometry, by the solver that the tick uses; sample after sample, as the grip moved.
    void start() {
        PoseSolver solver(nominal_);
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            StringArray lengths{};
            for (std::size_t i = 0; i < kStrings; ++i) {
                lengths[i] =
                    nominal_.rest_length(i) + nominal_.strings[i].metres_per_count * static_cast<double>(wiggle_[k][i]);
            }
            for (int repeat = 0; repeat < 4; ++repeat) {
                poses_[k] = solver.solve(lengths).pose;
            }
        }
    }

    [[nodiscard]] Equation equation(std::size_t sample, std::size_t string) const {
        const device::StringFacts& facts = nominal_.strings[string];
        const double* const x = shared_.data() + kOfString * string;
        const Pose& pose = poses_[sample];
        const Vec3 knot = facts.grip + Vec3(x[3], x[4], x[5]);
        const Vec3 lever = pose.orientation * knot;
        const Vec3 span = facts.motor + Vec3(x[0], x[1], x[2]) - pose.position - lever;
        const double length = std::max(glm::length(span), 1e-9);
        const Vec3 u = span / length;
        const Vec3 m = glm::cross(lever, u);
        const Vec3 u_of_grip = glm::conjugate(pose.orientation) * u;
        // In nominal metres, so that the noise is one of counts: otherwise a smaller world would fit better.
        const double shrunk = 1.0 / (1.0 + x[kScale]);
        const double paid_out = shrunk * (length - nominal_.rest_length(string) - x[kLength]);
        Equation result;
        result.residual = paid_out - facts.metres_per_count * static_cast<double>(wiggle_[sample][string]);
        result.by_pose = {-u.x, -u.y, -u.z, -m.x, -m.y, -m.z};
        result.by_shared = {u.x, u.y, u.z, -u_of_grip.x, -u_of_grip.y, -u_of_grip.z, -paid_out, -1.0};
        for (double& derivative : result.by_pose) {
            derivative *= shrunk;
        }
        for (double& derivative : result.by_shared) {
            derivative *= shrunk;
        }
        return result;
    }

    /// Huber: squares near zero, and lines beyond.
    [[nodiscard]] double cost() const {
        double sum = prior_cost();
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            for (std::size_t i = 0; i < kStrings; ++i) {
                const double e = std::fabs(equation(k, i).residual) / noise_;
                sum += e <= kHuber ? e * e : kHuber * (2.0 * e - kHuber);
            }
        }
        return sum;
    }
    [[nodiscard]] double prior_cost() const { return (shared_.array() / deviations_.array()).square().sum(); }

    /// m, what the two redundant lengths of each sample say; lengths that are far out count as kHuber noises.
    [[nodiscard]] double rms(double bound) const {
        double sum = 0.0;
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            for (std::size_t i = 0; i < kStrings; ++i) {
                const double e = std::min(std::fabs(equation(k, i).residual), bound);
                sum += e * e;
            }
        }
        return std::sqrt(sum / (2.0 * static_cast<double>(wiggle_.size())));
    }

    /// A step of all unknowns, damped by lambda. With `shared` false the geometry is kept, and only the poses move.
    void step(double lambda, bool shared) {
        SharedMatrix reduced = SharedMatrix::Zero();
        Shared right = Shared::Zero();
        std::vector<Sample> samples(wiggle_.size());
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            samples[k] = linearise(k, lambda, shared, reduced, right);
        }
        Shared change = Shared::Zero();
        if (shared) {
            const Shared precision = deviations_.array().square().inverse();
            reduced.diagonal() += (1.0 + lambda) * precision;
            right -= precision.cwiseProduct(shared_);
            change = reduced.selfadjointView<Eigen::Lower>().ldlt().solve(right);
            shared_ += change;
        }
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            const PoseVector d = samples[k].own - samples[k].by_shared * change;
            poses_[k].position += Vec3(d[0], d[1], d[2]);
            poses_[k].orientation = turned(poses_[k].orientation, Vec3(d[3], d[4], d[5]));
        }
    }

    /// Of the shared unknowns, with the poses unknown too.
    [[nodiscard]] SharedMatrix covariance() const {
        SharedMatrix reduced = SharedMatrix::Zero();
        Shared right = Shared::Zero();
        for (std::size_t k = 0; k < wiggle_.size(); ++k) {
            static_cast<void>(linearise(k, 0.0, true, reduced, right));
        }
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
    /// A pose's step: own - by_shared * (the step of the shared unknowns).
    struct Sample {
        PoseVector own = PoseVector::Zero();
        Crossing by_shared = Crossing::Zero();
    };

    /// Adds what a sample says of the shared unknowns, its pose eliminated; lower triangle only.
    Sample linearise(std::size_t k, double lambda, bool shared, SharedMatrix& reduced, Shared& right) const {
        PoseMatrix of_pose = PoseMatrix::Zero();
        PoseVector pose_right = PoseVector::Zero();
        Crossing crossing = Crossing::Zero();
        for (std::size_t i = 0; i < kStrings; ++i) {
            const Equation e = equation(k, i);
            const double size = std::fabs(e.residual) / noise_;
            const double weight = (size <= kHuber ? 1.0 : kHuber / size) / (noise_ * noise_);
            const Eigen::Map<const PoseVector> a(e.by_pose.data());
            const Eigen::Map<const Eigen::Matrix<double, kOfString, 1>> b(e.by_shared.data());
            const auto at = kOfString * static_cast<Eigen::Index>(i);
            of_pose += weight * a * a.transpose();
            pose_right -= weight * e.residual * a;
            if (shared) {
                crossing.middleCols<kOfString>(at) += weight * a * b.transpose();
                reduced.block<kOfString, kOfString>(at, at) += weight * b * b.transpose();
                right.segment<kOfString>(at) -= weight * e.residual * b;
            }
        }
        of_pose.diagonal() *= 1.0 + lambda;
        const Eigen::LDLT<PoseMatrix> solver(of_pose);
        Sample sample;
        sample.own = solver.solve(pose_right);
        if (shared) {
            sample.by_shared = solver.solve(crossing);
            reduced.triangularView<Eigen::Lower>() -= crossing.transpose() * sample.by_shared;
            right -= crossing.transpose() * sample.own;
        }
        return sample;
    }

    const device::Variant& nominal_;
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

/// Levenberg-Marquardt until the cost stands still.
Progress minimise(Problem& problem, int most_iterations, bool shared) {
    Progress progress;
    double lambda = 1e-6;
    double cost = problem.cost();
    while (progress.iterations < most_iterations) {
        ++progress.iterations;
        Problem::State before = problem.state();
        problem.step(lambda, shared);
        const double now = problem.cost();
        if (!(now <= cost)) {
            problem.restore(std::move(before));
            lambda *= 10.0;
            if (lambda > 1e8) {
                progress.converged = true;  // no step is better: rounding
                return progress;
            }
            continue;
        }
        const bool done = cost - now <= kDone * cost;
        cost = now;
        lambda = std::max(lambda * 0.1, 1e-9);
        if (done) {
            progress.converged = true;
            return progress;
        }
    }
    return progress;
}

device::Variant apply(const device::Variant& nominal, const Shared& shared) {
    device::Variant variant = nominal;
    for (std::size_t i = 0; i < kStrings; ++i) {
        const double* const x = shared.data() + kOfString * i;
        device::StringFacts& string = variant.strings[i];
        string.motor += Vec3(x[0], x[1], x[2]);
        string.grip += Vec3(x[3], x[4], x[5]);
        string.metres_per_count *= 1.0 + x[kScale];
    }
    return variant;
}

void check(const device::Variant& nominal, const Wiggle& wiggle) {
    if (wiggle.size() < kLeastSamples) {
        throw std::invalid_argument("a fit needs " + std::to_string(kLeastSamples) + " samples at least, there are " +
                                    std::to_string(wiggle.size()) +
                                    ": move the grip to and fro and turn it about all three axes");
    }
    double most = 0.0;
    for (const StringCounts& counts : wiggle) {
        for (std::size_t i = 0; i < kStrings; ++i) {
            most = std::max(most, std::fabs(static_cast<double>(counts[i] - wiggle.front()[i]) *
                                            nominal.strings[i].metres_per_count));
        }
    }
    if (most < kLeastMovement) {
        throw std::invalid_argument("the strings moved by " + std::to_string(most * 1e3) +
                                    " mm at most, which says nothing of the geometry: move the grip to and fro by "
                                    "centimetres and turn it about all three axes");
    }
}

constexpr std::array<const char*, kGeometry> kNames = {"motor x", "motor y", "motor z", "knot x",
                                                       "knot y",  "knot z",  "scale"};

void fill_values(const Problem& problem, GeometryFit& fit) {
    const SharedMatrix covariance = problem.covariance();
    for (int i = 0; i < static_cast<int>(kStrings); ++i) {
        for (int j = 0; j < kGeometry; ++j) {
            const int at = kOfString * i + j;
            fit.values.push_back({"string " + std::to_string(i) + " " + kNames[static_cast<std::size_t>(j)],
                                  problem.shared()[at], std::sqrt(covariance(at, at)), problem.deviations()[at],
                                  j == kScale});
        }
    }
}

}  // namespace

GeometryFit fit_geometry(const device::Variant& nominal, const Wiggle& wiggle, const FitSettings& settings) {
    const Wiggle samples = thinned(wiggle, settings.most_samples);
    check(nominal, samples);
    Problem problem(nominal, samples, settings);
    problem.start();
    GeometryFit fit;
    fit.samples = samples.size();
    problem.set_noise(1.0);  // m: plain least squares, no length is an outlier
    minimise(problem, settings.most_iterations, false);
    fit.rms_before = problem.rms(std::numeric_limits<double>::max());

    // How noisy a length is shows only once the geometry is right: begin with what the nominal one leaves.
    problem.set_noise(fit.rms_before);
    for (int round = 0; round < 6; ++round) {
        const Progress progress = minimise(problem, settings.most_iterations, true);
        fit.iterations += progress.iterations;
        fit.converged = progress.converged;
        const double found = std::max(problem.rms(kHuber * problem.noise()), problem.quantisation());
        if (std::fabs(found - problem.noise()) < 0.02 * problem.noise()) {
            break;
        }
        problem.set_noise(found);
    }
    fit.noise = problem.noise();
    fit.outliers = problem.outliers();
    fit.rms_after = problem.rms(std::numeric_limits<double>::max());
    fit.variant = apply(nominal, problem.shared());
    fill_values(problem, fit);
    return fit;
}

}  // namespace haptic::rt
