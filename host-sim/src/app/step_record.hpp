// Step record: CSV of every step of a run. It is valid input to --input and contains everything needed to repeat the
// run bit for bit. Notes before the header say where it begins; a live change stands before the step it was made for:
//
//     # host-sim record 2
//     # scene cloth-drop                         built-in scene or scene file
//     # set solver.iterations=5                  as --set, in this order
//     # first-step 0                             step of the scene that the first row belongs to
//     # change 120 coupling.stiffness=20         live change before that step; workspace.* with all its keys
//     # change 130 couple-anew                   Simulation::recouple()
//     # time-zero-ns 51000000000                 time_s 0 by the clock of rt-core's now_ns; not in lockstep
//
// Records of version 1 have all changes before the header.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

/// Live change: an assignment as in --set, or kRecouple.
struct LiveChange {
    std::uint64_t step = 0;  // made before this step
    std::string what;
};

inline constexpr std::string_view kRecouple = "couple-anew";

struct RecordNotes {
    std::string scene;                     // as in `host-sim run`
    std::vector<std::string> assignments;  // as --set
    std::uint64_t first_step = 0;
    std::vector<LiveChange> changes;
};

/// Notes as lines, without the leading "# ".
[[nodiscard]] std::vector<std::string> lines_of(const RecordNotes& notes);
/// Parses notes; nullopt if the first line is not that of a record. Throws std::invalid_argument for an invalid line.
[[nodiscard]] std::optional<RecordNotes> read_notes(std::span<const std::string> lines);

/// Assignments of all keys of a workspace.
[[nodiscard]] std::vector<std::string> assignments_of(const WorkspaceSettings& workspace);

/// The text of a record, step by step.
class StepRecord {
  public:
    /// Notes and header. `clocked`: times of steps are those of rt-core's clock, which the first one then notes.
    explicit StepRecord(const RecordNotes& origin, bool clocked = false);

    /// A change before the next row.
    void add(const LiveChange& change);
    void add(const StepInput& input, const StepResult& result);

    [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
    /// Text since the last call of clear().
    [[nodiscard]] const std::string& text() const noexcept { return text_; }
    /// Forgets the text, which somebody has written.
    void clear() noexcept { text_.clear(); }
    [[nodiscard]] std::string take() noexcept { return std::exchange(text_, {}); }
    /// Memory for this many bytes of text, so that it does not move while steps are made.
    void reserve(std::size_t bytes) { text_.reserve(bytes); }

  private:
    std::string text_;
    bool clocked_;
    std::size_t rows_ = 0;
    std::int64_t first_ns_ = 0;  // time of the first row
};

}  // namespace haptic::sim
