// What is recorded of a run: into the file that --record names, and for viewers who ask for it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <future>
#include <optional>
#include <string>

#include "app/step_record.hpp"
#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

class Recordings {
  public:
    /// Steps that a viewer's record holds at most; then it ends by itself. Some 40 MB, half an hour at 100 steps/s.
    static constexpr std::size_t kMostOffered = 200'000;

    /// `to_file` keeps every step; `room` is the number of steps to reserve for that.
    Recordings(bool to_file, std::size_t room);

    /// A scene begins: what was recorded of the one before is dropped, but for what a viewer was recording, which ends.
    void begin(RecordNotes origin);
    void add(const StepInput& input, const StepResult& result);
    /// Of what a viewer or a file changed, before the step with that number.
    void note(std::uint64_t step, const std::string& what);

    /// For a viewer, from the step with that number on. Nothing, if one is recorded already.
    void start_offer(std::uint64_t step);
    /// Begins to make a file of it, on a thread of its own: that takes longer than a step.
    void finish_offer();
    /// The oldest that is finished, once.
    [[nodiscard]] std::optional<std::string> take_offer();
    [[nodiscard]] bool offering() const noexcept { return offered_.has_value(); }
    /// Steps of what is being recorded for a viewer.
    [[nodiscard]] std::size_t offered_steps() const noexcept { return offered_ ? offered_->rows() : 0; }

    /// Throws CsvError.
    void write(const std::filesystem::path& file) const;

  private:
    std::size_t room_;
    RecordNotes notes_;  // of the scene, with all changes since its start
    std::optional<StepRecord> kept_;
    std::optional<StepRecord> offered_;
    std::uint64_t offered_from_ = 0;
    std::deque<std::future<std::string>> finished_;  // in their order
};

}  // namespace haptic::sim
