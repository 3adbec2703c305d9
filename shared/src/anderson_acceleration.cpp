#include "haptic/anderson_acceleration.hpp"

#include <algorithm>
#include <cmath>

#include "vector_kernels.hpp"

namespace haptic {
namespace {

// Relative diagonal term that keeps the least squares solvable where differences are almost dependent.
constexpr double kRegularisation = 1e-10;
// Coefficients beyond this extrapolate from rounding.
constexpr double kMaxCoefficient = 1e4;

using Coefficients = std::array<double, AndersonAcceleration::kDepth>;

/// Solves P x = right in place for the first `count` unknowns; P symmetric, lower triangle used. False if P is
/// singular.
bool solve_regularised(std::array<Coefficients, AndersonAcceleration::kDepth> p, Coefficients& right,
                       std::size_t count) HAPTIC_RT {
    // P = L L^T in place.
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
            double sum = i == j ? p[i][i] * (1.0 + kRegularisation) : p[i][j];
            for (std::size_t k = 0; k < j; ++k) {
                sum -= p[i][k] * p[j][k];
            }
            if (i == j && !(sum > 0.0)) {
                return false;
            }
            p[i][j] = i == j ? std::sqrt(sum) : sum / p[j][j];
        }
    }
    // L y = right, then L^T x = y.
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t k = 0; k < i; ++k) {
            right[i] -= p[i][k] * right[k];
        }
        right[i] /= p[i][i];
    }
    for (std::size_t i = count; i-- > 0;) {
        for (std::size_t k = i + 1; k < count; ++k) {
            right[i] -= p[k][i] * right[k];
        }
        right[i] /= p[i][i];
    }
    return true;
}

}  // namespace

AndersonAcceleration::AndersonAcceleration(std::size_t capacity) {
    for (Vectors& difference : differences_) {
        difference = {std::vector<double>(capacity), std::vector<double>(capacity), std::vector<double>(capacity)};
    }
    last_ = differences_[0];
}

void AndersonAcceleration::extrapolate(std::span<const double> change, std::span<double> result,
                                       std::span<double> image) HAPTIC_RT {
    const std::size_t size = result.size();
    const std::size_t count = std::min(iterates_, kDepth);
    if (iterates_ > 0) {
        // The newest difference replaces the oldest.
        const std::size_t newest = (iterates_ - 1) % kDepth;
        Vectors& difference = differences_[newest];
        subtract(difference.change.data(), change.data(), last_.change.data(), size);
        subtract(difference.result.data(), result.data(), last_.result.data(), size);
        subtract(difference.image.data(), image.data(), last_.image.data(), size);
        for (std::size_t j = 0; j < count; ++j) {
            products_[newest][j] = products_[j][newest] =
                dot(difference.change.data(), differences_[j].change.data(), size);
        }
    }
    std::copy_n(change.begin(), size, last_.change.begin());
    std::copy_n(result.begin(), size, last_.result.begin());
    std::copy_n(image.begin(), size, last_.image.begin());
    ++iterates_;

    // Least squares: the combination of differences that cancels most of the change.
    Coefficients coefficients{};
    for (std::size_t j = 0; j < count; ++j) {
        coefficients[j] = dot(differences_[j].change.data(), change.data(), size);
    }
    bool usable = solve_regularised(products_, coefficients, count);
    for (std::size_t j = 0; j < count; ++j) {
        usable = usable && std::abs(coefficients[j]) < kMaxCoefficient;
    }
    for (std::size_t j = 0; usable && j < count; ++j) {
        add_scaled(result.data(), -coefficients[j], differences_[j].result.data(), size);
        add_scaled(image.data(), -coefficients[j], differences_[j].image.data(), size);
    }
}

void AndersonAcceleration::undo(std::span<double> result, std::span<double> image) const HAPTIC_RT {
    std::copy_n(last_.result.begin(), result.size(), result.begin());
    std::copy_n(last_.image.begin(), image.size(), image.begin());
}

}  // namespace haptic
