// Curl track: scripted curl of a closing hand over time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace haptic::sim {

class CurlTrack {
  public:
    /// Empty: known() is false and the curl is 0.
    CurlTrack() = default;
    /// Times in s, strictly increasing; curls in 0..1, one per time. Throws std::invalid_argument.
    CurlTrack(std::vector<double> times_s, std::vector<double> curls);

    /// Reads the columns time_s and curl of a recording; empty without a column curl. Throws CsvError.
    [[nodiscard]] static CurlTrack load(const std::filesystem::path& file);

    [[nodiscard]] bool known() const noexcept { return !times_s_.empty(); }
    /// Linear interpolation; constant before the first time and after the last.
    [[nodiscard]] double at(std::int64_t time_ns) const noexcept;

  private:
    std::vector<double> times_s_;
    std::vector<double> curls_;
};

}  // namespace haptic::sim
