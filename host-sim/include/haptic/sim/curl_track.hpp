// How far a hand is closed over time: what a scene's script says of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace haptic::sim {

class CurlTrack {
  public:
    /// Says nothing: `known()` is false, and the curl is 0.
    CurlTrack() = default;
    /// Times in seconds, strictly increasing, with a curl of 0..1 each. Throws std::invalid_argument.
    CurlTrack(std::vector<double> times_s, std::vector<double> curls);

    /// The columns time_s and curl of a recording; says nothing where there is no such column. Throws CsvError.
    [[nodiscard]] static CurlTrack load(const std::filesystem::path& file);

    [[nodiscard]] bool known() const noexcept { return !times_s_.empty(); }
    /// Between two times linear; before the first and after the last as there.
    [[nodiscard]] double at(std::int64_t time_ns) const noexcept;

  private:
    std::vector<double> times_s_;
    std::vector<double> curls_;
};

}  // namespace haptic::sim
