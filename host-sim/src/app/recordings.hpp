// Recordings of a run: for the file of --record, and for download by viewers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/record_file.hpp"
#include "app/step_record.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

class Recordings {
  public:
    /// Maximum number of steps in a viewer's record; it then ends by itself. About 60 MB, half an hour at 100 steps/s.
    static constexpr std::size_t kMaxOffered = 200'000;

    /// Every step is written to `file` while the run goes on; empty: to none. `clocked`: see StepRecord.
    explicit Recordings(std::filesystem::path file, bool clocked = false) : file_(std::move(file)), clocked_(clocked) {}

    /// To be called for each new simulation: finishes a viewer's record and the file. The file of the nth simulation is
    /// F-n.csv for F.csv. Throws std::runtime_error.
    void begin(RecordNotes origin);
    void add(const StepInput& input, const StepResult& result);
    /// Notes a change made before that step. Of several changes of one key before a step, the last counts.
    void note(std::uint64_t step, const std::string& what);

    /// Starts a viewer's record at that step. No effect if one is being recorded.
    void start_offer(std::uint64_t step);
    void finish_offer();
    /// Returns the oldest finished CSV and forgets it.
    [[nodiscard]] std::optional<std::string> take_offer();
    [[nodiscard]] bool offering() const noexcept { return offered_.has_value(); }
    /// Number of steps in the viewer's current record.
    [[nodiscard]] std::size_t offered_steps() const noexcept { return offered_ ? offered_->rows() : 0; }

    /// Finishes the file. Throws std::runtime_error if a file of this run is incomplete.
    void close();

  private:
    void finish_file();

    std::filesystem::path file_;
    bool clocked_;
    std::size_t simulations_ = 0;
    RecordNotes notes_;                // with all changes before the last step
    std::vector<LiveChange> pending_;  // since the last step
    std::optional<StepRecord> kept_;   // on its way to writer_
    std::optional<RecordFile> writer_;
    std::string problem_;  // of an earlier file
    std::optional<StepRecord> offered_;
    std::deque<std::string> finished_;  // in the order of their end
};

}  // namespace haptic::sim
