// Where motors and knots really are, and how long a count really is, from counters of a grip that was moved about.
//
// Sample k has counts c_ik since the calibration, at a pose (p_k, R_k) that nobody knows. With motor a_i, knot b_i,
// metres a count m_i = m_i0 (1 + kappa_i) and length l_i at the calibration, string i says
//
//     | a_i - p_k - R_k b_i |  =  l_i + m_i (c_ik + noise)
//
// Each sample brings 8 equations and 6 unknowns, so that two of them say something of the 64 numbers that all samples
// share: 24 coordinates of motors, 24 of knots, 8 scales, 8 lengths. Some of these no wiggle can tell: to turn or move
// the frame or the grip, or to enlarge everything, changes no count. Each number therefore has a prior: its nominal
// value, with a standard deviation that says how well it is known. What is found is the most probable geometry, and its
// covariance says what the wiggle told and what is still the prior.
//
// Levenberg-Marquardt; the poses are eliminated sample by sample (Schur complement), so that work grows with the number
// of samples. Gross errors weigh less (Huber). The noise is that of the counts, or what the residuals say if that is
// more.
// @source Triggs, McLauchlan, Hartley and Fitzgibbon 2000, "Bundle adjustment - a modern synthesis", sections 4, 6, 9.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <haptic/device/variant.hpp>
#include <haptic/frames.hpp>
#include <haptic/types.hpp>

namespace haptic::rt {

/// Counts of all strings since the calibration, one entry a sample.
using StringCounts = std::array<std::int64_t, kStrings>;
using Wiggle = std::vector<StringCounts>;

/// The rows of a recording in which the loop ran, as counts since the first of them: that is where the grip was
/// calibrated. Counters are unwrapped. Throws CsvError for a file without counters, or without such rows.
[[nodiscard]] Wiggle load_wiggle(const std::filesystem::path& recording, const device::Variant& variant);

/// At most so many samples, taken where the strings moved: a grip that rests says the same thing over and over.
[[nodiscard]] Wiggle thinned(const Wiggle& wiggle, std::size_t most);

struct FitSettings {
    // Standard deviations of the nominal values.
    double motor = 1e-3;        // m, each coordinate
    double knot = 1e-3;         // m, each coordinate
    double scale = 0.005;       // 1, relative, of metres per count
    double rest_length = 3e-3;  // m, of a string at the calibration: how well the grip is centred
    std::size_t most_samples = 2000;
    int most_iterations = 60;
};

/// A number of the geometry after the fit.
struct FittedValue {
    std::string name;        // "string 3 motor y"
    double change = 0.0;     // from the nominal value, m; relative for a scale
    double deviation = 0.0;  // standard deviation, likewise
    double prior = 0.0;      // standard deviation before
    bool is_scale = false;

    /// The wiggle said something: it halved the uncertainty at least.
    [[nodiscard]] bool determined() const noexcept { return deviation < 0.5 * prior; }
};

struct GeometryFit {
    device::Variant variant;          // with the fitted geometry and scales
    std::vector<FittedValue> values;  // 56: motor x y z, knot x y z, scale of string 0, then of string 1, ...
    std::size_t samples = 0;          // used
    std::size_t outliers = 0;         // lengths that were out by more than 3 noises
    int iterations = 0;
    bool converged = false;
    double noise = 0.0;       // m, of a length, as used
    double rms_before = 0.0;  // m, of the redundant lengths, with the nominal geometry
    double rms_after = 0.0;   // m, with the fitted one
};

/// Throws std::invalid_argument if there are too few samples, or they do not differ.
[[nodiscard]] GeometryFit fit_geometry(const device::Variant& nominal, const Wiggle& wiggle,
                                       const FitSettings& settings = {});

/// A few lines of text: what was found, how sure, and what the wiggle did not tell.
[[nodiscard]] std::string describe(const GeometryFit& fit);

}  // namespace haptic::rt
