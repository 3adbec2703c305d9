// Missed contacts: how many contacts the thesis' collision detection and ours miss on the same random motions.
//
// The motions are single triangles of about the sphere's size that travel several radii past it, and whole cloths that
// fly past it at 14 m/s. An oracle (touch_oracle.hpp) that shares no code with either method decides whether there was
// a contact.
#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <span>
#include <string>
#include <vector>

#include "haptic/sim/progress.hpp"

namespace haptic::sim::reproduce {

struct CcdMissesSettings {
    std::uint32_t triangles = 50'000;  // single triangles of each kind of motion; at least 1
    std::uint32_t frames = 4'000;      // cloth motions of each kind of attitude; at least 1
    std::uint64_t seed = 1;
};

/// Result of one method on one set of motions.
struct CcdScore {
    std::uint64_t missed = 0;    // contacts of the oracle that it does not report
    std::uint64_t spurious = 0;  // reports although the triangle stays farther away than 1.0001 radii
    double max_delay = 0.0;      // fraction of the step: largest delay after the oracle's contact, where both see one
    double mean_delay = 0.0;     // fraction of the step: the same, mean
};

/// Results for one kind of motion.
struct CcdMisses {
    std::string set;                // "triangle" or "cloth"
    std::string motion;             // "translating", ..., "edge-on", ...
    std::uint64_t drawn = 0;        // motions that start clear of the sphere
    std::uint64_t contacts = 0;     // of these, by the oracle
    std::uint64_t undecided = 0;    // by the oracle; in no other count
    CcdScore complete;              // ours
    CcdScore thesis;                // Algorithm 1, and overlap at the end of the step, which is left to the pop-out
    std::uint64_t algorithm_1 = 0;  // missed by Algorithm 1 alone
};

/// Draws the motions and runs both methods. The same settings give the same numbers on every machine, up to the
/// rounding of sin and cos.
[[nodiscard]] std::vector<CcdMisses> measure_ccd_misses(const CcdMissesSettings& settings,
                                                        const Progress& progress = {});

/// Writes the results as CSV, with a header line of columns and units.
void write_ccd_misses(std::ostream& out, std::span<const CcdMisses> table);

/// Prints the results as a table, with percentages.
void print_ccd_misses(std::ostream& out, std::span<const CcdMisses> table);

}  // namespace haptic::sim::reproduce
