// Recorded run: a recording as input of a simulation. Each row is a step if host-sim wrote it; otherwise a hand over
// time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "app/step_record.hpp"
#include "haptic/sim/simulation.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {

class RecordedRun {
  public:
    /// Requires the columns time_s, x_m, y_m and z_m. Throws CsvError.
    [[nodiscard]] static RecordedRun load(const std::filesystem::path& file);

    /// nullopt: not a record of host-sim, or one of a version without notes.
    [[nodiscard]] const std::optional<RecordNotes>& notes() const noexcept { return notes_; }
    /// s, time of the first row.
    [[nodiscard]] double begin() const noexcept { return time_s_.front(); }
    /// s, from the first row to the end of the last row's step.
    [[nodiscard]] double length() const noexcept;
    [[nodiscard]] std::size_t rows() const noexcept { return time_s_.size(); }

    /// The input of a step by its row, to the bit as it was.
    [[nodiscard]] StepInput row(std::size_t row) const;
    /// Input at a time since the first row, s: pose and curl interpolated, buttons of the row before; exactly a row's
    /// input at its time.
    [[nodiscard]] StepInput at(double time_s) const;
    /// m, scene: recorded position of the proxy, if any.
    [[nodiscard]] std::optional<Vec3> proxy(std::size_t row) const;

  private:
    std::optional<RecordNotes> notes_;
    std::vector<double> time_s_;
    std::vector<Pose> device_;
    std::vector<double> curl_;                             // empty: not recorded
    std::vector<double> buttons_;                          // empty: not recorded
    std::vector<std::optional<DeviceFeedback>> feedback_;  // per row; empty if not recorded
    std::vector<Vec3> proxy_;                              // empty: not recorded
};

}  // namespace haptic::sim
