// A recording as the input of a simulation: each row a step where host-sim wrote it, else a hand over time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "app/step_record.hpp"
#include <haptic/sim/simulation.hpp>
#include <haptic/types.hpp>

namespace haptic::sim {

class RecordedRun {
  public:
    /// Columns time_s, x_m, y_m, z_m, and of the others those that are there. Throws CsvError.
    [[nodiscard]] static RecordedRun load(const std::filesystem::path& file);

    /// None: it is not a record of host-sim's, or one of before it said where it came from.
    [[nodiscard]] const std::optional<RecordNotes>& notes() const noexcept { return notes_; }
    /// s, of the first row.
    [[nodiscard]] double begin() const noexcept { return time_s_.front(); }
    /// s, from the first row to the end of the step of the last one.
    [[nodiscard]] double length() const noexcept;
    [[nodiscard]] std::size_t rows() const noexcept { return time_s_.size(); }

    /// The input of a step by its row, to the bit as it was.
    [[nodiscard]] StepInput row(std::size_t row) const;
    /// The input at a time since the first row, s: pose and curl between rows, buttons of the row before. A row's own
    /// where the time is a row's.
    [[nodiscard]] StepInput at(double time_s) const;
    /// m, scene: where the proxy was then, if it was recorded.
    [[nodiscard]] std::optional<Vec3> proxy(std::size_t row) const;

  private:
    std::optional<RecordNotes> notes_;
    std::vector<double> time_s_;
    std::vector<Pose> device_;
    std::vector<double> curl_;     // empty: not recorded
    std::vector<double> buttons_;  // likewise
    std::vector<Vec3> proxy_;      // likewise
};

}  // namespace haptic::sim
