// Recordings of a run: for the file of --record, and for download by viewers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <future>
#include <optional>
#include <string>

#include "app/step_record.hpp"
#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

class Recordings {
  public:
    /// Maximum number of steps in a viewer's record; it then ends by itself. About 40 MB, half an hour at 100 steps/s.
    static constexpr std::size_t kMaxOffered = 200'000;

    /// `to_file`: keep every step for write(), with memory reserved for `room` steps.
    Recordings(bool to_file, std::size_t room);

    /// To be called for each new simulation: drops the steps kept so far, and finishes a viewer's record.
    void begin(RecordNotes origin);
    void add(const StepInput& input, const StepResult& result);
    /// Notes a change made before that step. Of several changes of one key before a step, the last counts.
    void note(std::uint64_t step, const std::string& what);

    /// Starts a viewer's record at that step. No effect if one is being recorded.
    void start_offer(std::uint64_t step);
    /// Ends it and converts it to CSV on a background thread, which takes longer than a step.
    void finish_offer();
    /// Returns the oldest finished CSV and forgets it.
    [[nodiscard]] std::optional<std::string> take_offer();
    [[nodiscard]] bool offering() const noexcept { return offered_.has_value(); }
    /// Number of steps in the viewer's current record.
    [[nodiscard]] std::size_t offered_steps() const noexcept { return offered_ ? offered_->rows() : 0; }

    /// Throws CsvError.
    void write(const std::filesystem::path& file) const;

  private:
    std::size_t room_;
    RecordNotes notes_;  // with all changes since the start of the scene
    std::optional<StepRecord> kept_;
    std::optional<StepRecord> offered_;
    std::uint64_t offered_from_ = 0;
    std::deque<std::future<std::string>> finished_;  // in the order of their end
};

}  // namespace haptic::sim
