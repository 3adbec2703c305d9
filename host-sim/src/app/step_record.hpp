// Step record: CSV of every step of a run. It is valid input to --input and contains everything needed to repeat the
// run bit for bit, as notes before the header:
//
//     # host-sim record 1
//     # scene cloth-drop                         built-in scene or scene file
//     # set solver.iterations=5                  as --set, in this order
//     # first-step 0                             step of the scene that the first row belongs to
//     # change 120 coupling.stiffness=20         live change before that step; workspace.* with all its keys
//     # change 130 couple-anew                   Simulation::recouple()
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
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

class StepRecord {
  public:
    /// Reserves memory for `room` rows, so that add() does not allocate; more rows are allowed.
    explicit StepRecord(std::size_t room) { rows_.reserve(room); }

    void add(const StepInput& input, const StepResult& result);

    [[nodiscard]] std::size_t rows() const noexcept { return rows_.size(); }
    /// Contents of the file.
    [[nodiscard]] std::string csv(const RecordNotes& notes) const;
    /// Throws CsvError.
    void write(const std::filesystem::path& file, const RecordNotes& notes) const;

  private:
    struct Row {
        std::int64_t time_ns;
        Pose device;
        Vec3 proxy, hip, hand_force;
        bool in_contact;
        double step_us;
        Vec3 hand_torque;
        double curl;
        std::uint32_t buttons;
        std::optional<DeviceFeedback> feedback;
    };
    static constexpr std::size_t kColumns = 29;
    [[nodiscard]] std::array<double, kColumns> numbers_of(const Row& row) const;

    std::vector<Row> rows_;
};

}  // namespace haptic::sim
