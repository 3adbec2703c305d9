// Geometry fit: positions of motors and knots and lengths per count, from the counters of a grip that was moved about.
//
// Sample k has counts c_ik since the calibration, at an unknown pose (p_k, R_k). With motor a_i, knot b_i, metres per
// count m_i = m_i0 (1 + kappa_i) and length l_i at the calibration, string i gives the equation
//
//     | a_i - p_k - R_k b_i |  =  l_i + m_i (c_ik + noise)
//
// Each sample adds 8 equations and 6 unknowns, so two equations per sample constrain the 64 parameters that all samples
// share: 24 coordinates of motors, 24 of knots, 8 scales, 8 lengths. Some combinations are unobservable: rotating or
// moving the coordinate frame or the grip, or scaling everything, changes no count. Each parameter therefore has a
// prior: its nominal value with a standard deviation. The result is the maximum a posteriori estimate, and its
// covariance tells which parameters the wiggle determined and which are still at the prior.
//
// The minimiser is Levenberg-Marquardt. The poses are eliminated sample by sample (Schur complement), so the work is
// linear in the number of samples. Outliers are down-weighted (Huber). The noise is the quantisation of the counts, or
// the rms of the residuals if that is larger.
// @source Triggs, McLauchlan, Hartley and Fitzgibbon 2000, "Bundle adjustment - a modern synthesis", sections 4, 6, 9.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "device/wiggle.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::rt {

struct FitSettings {
    // Standard deviations of the nominal values.
    double motor = 1e-3;        // m, each coordinate
    double knot = 1e-3;         // m, each coordinate
    double scale = 0.005;       // 1, relative, of metres per count
    double rest_length = 3e-3;  // m, of a string's length at the calibration: how well the grip was centred
    std::size_t max_samples = 2000;
    int max_iterations = 60;
};

/// One parameter of the geometry after the fit.
struct FittedValue {
    std::string name;        // "string 3 motor y"
    double change = 0.0;     // from the nominal value, m; relative for a scale
    double deviation = 0.0;  // standard deviation after the fit, m; relative for a scale
    double prior = 0.0;      // standard deviation before the fit
    bool is_scale = false;

    /// True if the wiggle at least halved the standard deviation.
    [[nodiscard]] bool determined() const noexcept { return deviation < 0.5 * prior; }
};

struct GeometryFit {
    device::DeviceGeometry geometry;  // the nominal one with the fitted positions and scales
    std::vector<FittedValue> values;  // 56: motor x y z, knot x y z, scale of string 0, then of string 1, ...
    std::size_t samples = 0;          // samples used
    std::size_t outliers = 0;         // lengths with a residual above 3 standard deviations of the noise
    int iterations = 0;
    bool converged = false;
    double noise = 0.0;       // m, standard deviation of a length, as used
    double rms_before = 0.0;  // m, of the redundant lengths, with the nominal geometry
    double rms_after = 0.0;   // m, the same with the fitted geometry
};

/// Fits the geometry to a wiggle. Throws std::invalid_argument for too few samples, or samples that hardly differ.
[[nodiscard]] GeometryFit fit_geometry(const device::DeviceGeometry& nominal, const Wiggle& wiggle,
                                       const FitSettings& settings = {});

/// Summary in a few lines: every change with its standard deviation, and the parameters that stayed undetermined.
[[nodiscard]] std::string describe(const GeometryFit& fit);

}  // namespace haptic::rt
