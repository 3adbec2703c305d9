#include "app/replay.hpp"

#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "program/progress_bar.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim {
namespace {

bool is_of_workspace(const std::string& assignment) {
    return assignment.starts_with("workspace.");
}

}  // namespace

Replay::Replay(const Scene& scene, const RecordedRun& record, bool as_recorded, Simulation::ClockFunction clock)
    : record_(record),
      notes_(as_recorded && record.notes() ? &*record.notes() : nullptr),
      simulation_(with_progress_bar("building " + scene.name,
                                    [&](const Progress& progress) { return Simulation(scene, clock, progress); })) {}

void Replay::make_changes() {
    // Workspace keys are collected, since they change together; other changes are made one by one.
    const std::vector<LiveChange>& changes = notes_->changes;
    const std::uint64_t now = notes_->first_step + row_;
    Config workspace;
    bool moves = false;
    for (; changes_made_ < changes.size() && changes[changes_made_].step <= now; ++changes_made_) {
        const std::string& what = changes[changes_made_].what;
        if (what == kRecouple) {
            simulation_.recouple();
        } else if (is_of_workspace(what)) {
            workspace.set(what);
            moves = true;
        } else {
            simulation_.change_settings(view::assigned(simulation_.settings(), what));
        }
    }
    if (moves) {
        simulation_.change_workspace(read_workspace(workspace, simulation_.scene().workspace));
    }
}

bool Replay::step(StepResult& result) {
    if (notes_ != nullptr ? row_ >= record_.rows() : simulation_.time() >= record_.length()) {
        return false;
    }
    if (notes_ != nullptr) {
        make_changes();
    }
    // A bitwise comparison: a replay of the same scene is exact.
    result = simulation_.step(notes_ != nullptr ? record_.row(row_) : record_.at(simulation_.time()));
    if (notes_ != nullptr && !diverged_at_) {
        if (const std::optional<Vec3> was = record_.proxy(row_); was && *was != result.proxy) {
            diverged_at_ = row_;
        }
    }
    ++row_;
    return true;
}

}  // namespace haptic::sim
