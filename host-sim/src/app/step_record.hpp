// A record of every step: CSV that is valid input to --input, and that says all it takes to make the run again, bit for
// bit: before the header, as notes,
//
//     # host-sim record 1
//     # scene cloth-drop                         a built-in scene or a scene file
//     # set solver.iterations=5                  as --set, in this order
//     # first-step 0                             the step of the scene that is the first row's
//     # change 120 coupling.stiffness=20         live, before the step with that number; of workspace.* all keys
//     together # change 130 couple-anew                   Simulation::couple_anew()
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

#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

/// What was changed while a scene ran: an assignment as that of --set, or kCoupleAnew.
struct LiveChange {
    std::uint64_t step = 0;  // before which it was made
    std::string what;
};

inline constexpr std::string_view kCoupleAnew = "couple-anew";

struct RecordNotes {
    std::string scene;                     // as `host-sim run` takes it
    std::vector<std::string> assignments;  // as --set
    std::uint64_t first_step = 0;
    std::vector<LiveChange> changes;
};

[[nodiscard]] std::vector<std::string> lines_of(const RecordNotes& notes);
/// None, if these are not the notes of such a record. Throws std::invalid_argument for a line that is wrong.
[[nodiscard]] std::optional<RecordNotes> read_notes(std::span<const std::string> lines);

/// A mapping as assignments of all its keys.
[[nodiscard]] std::vector<std::string> assignments_of(const WorkspaceSettings& workspace);

class StepRecord {
  public:
    /// `room` is what to reserve, so that adding does not allocate; more rows are no error.
    explicit StepRecord(std::size_t room) { rows_.reserve(room); }

    void add(const StepInput& input, const StepResult& result);

    [[nodiscard]] std::size_t rows() const noexcept { return rows_.size(); }
    /// The whole file.
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
    };
    static constexpr std::size_t kColumns = 24;
    [[nodiscard]] std::array<double, kColumns> numbers_of(const Row& row) const;

    std::vector<Row> rows_;
};

}  // namespace haptic::sim
