// Progress: how far a long piece of work has come. The library does not draw; it tells its caller.
#pragma once

#include <functional>

namespace haptic::sim {

/// Receives the share of the work that is done, 0 to 1. Called by the thread that works, up to some thousand times a
/// second. Empty: nobody asked.
using Progress = std::function<void(double share)>;

/// Does nothing for an empty progress.
inline void report(const Progress& progress, double share) {
    if (progress) {
        progress(share);
    }
}

/// Progress of the part of a work that begins and ends at these shares of the whole. Valid as long as `whole`.
[[nodiscard]] inline Progress part_of(const Progress& whole, double begin, double end) {
    if (!whole) {
        return {};
    }
    return [&whole, begin, end](double share) { whole(begin + share * (end - begin)); };
}

}  // namespace haptic::sim
