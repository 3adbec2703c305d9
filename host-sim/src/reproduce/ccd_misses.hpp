// How many contacts the thesis' collision detection misses, and how many ours does, on the same random motions.
//
// The set: single triangles of about the sphere's size that travel some radii past it, and whole cloths that fly past
// it at 14 m/s. Whether there was a contact at all is said by the oracle (touch_oracle.hpp), which shares no code with
// either method.
#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <span>
#include <string>
#include <vector>

namespace haptic::sim::reproduce {

struct CcdMissesSettings {
    std::uint32_t triangles = 50'000;  // single triangles of each kind of motion; 1 ..
    std::uint32_t frames = 4'000;      // cloth frames of each kind of attitude; 1 ..
    std::uint64_t seed = 1;
};

/// What one method made of one set.
struct CcdScore {
    std::uint64_t missed = 0;    // contacts of the oracle that it does not report
    std::uint64_t invented = 0;  // reports although the triangle stays further than 1.0001 of the radius
    double latest = 0.0;         // of the step: how much later than the oracle at worst, where both see a contact
    double mean_late = 0.0;      // of the step: the same, mean
};

/// One kind of motion.
struct CcdMisses {
    std::string set;                // "triangle" or "cloth"
    std::string motion;             // "translating", ..., "edge-on", ...
    std::uint64_t drawn = 0;        // motions that begin clear of the sphere
    std::uint64_t contacts = 0;     // of those, by the oracle
    std::uint64_t undecided = 0;    // by the oracle; in no other count
    CcdScore complete;              // ours
    CcdScore thesis;                // Algorithm 1, and overlap at the end of the step, which is left to the pop-out
    std::uint64_t algorithm_1 = 0;  // missed by Algorithm 1 alone
};

/// Draws, asks and counts; the same numbers for the same settings, everywhere but for rounding of sin and cos.
[[nodiscard]] std::vector<CcdMisses> measure_ccd_misses(const CcdMissesSettings& settings);

/// The same as CSV, with a header line that names columns and units.
void write_ccd_misses(std::ostream& out, std::span<const CcdMisses> table);

/// For people: a table with shares in percent.
void print_ccd_misses(std::ostream& out, std::span<const CcdMisses> table);

}  // namespace haptic::sim::reproduce
