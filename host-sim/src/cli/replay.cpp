#include "cli/replay.hpp"

#include <string>
#include <vector>

#include "haptic/config.hpp"
#include "view/live_parameters.hpp"

namespace haptic::sim {
namespace {

bool is_of_workspace(const std::string& assignment) {
    return assignment.starts_with("workspace.");
}

}  // namespace

Replay::Replay(const Scene& scene, const RecordedRun& record, bool as_recorded)
    : record_(record), as_recorded_(as_recorded && record.notes()), simulation_(scene) {}

void Replay::make_changes() {
    const RecordNotes& notes = *record_.notes();
    const std::uint64_t now = notes.first_step + row_;
    Config workspace;
    bool moves = false;
    for (; changes_made_ < notes.changes.size() && notes.changes[changes_made_].step <= now; ++changes_made_) {
        const std::string& what = notes.changes[changes_made_].what;
        if (what == kCoupleAnew) {
            simulation_.couple_anew();
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
    if (as_recorded_ ? row_ >= record_.rows() : simulation_.time() >= record_.length()) {
        return false;
    }
    if (as_recorded_) {
        make_changes();
    }
    result = simulation_.step(as_recorded_ ? record_.row(row_) : record_.at(simulation_.time()));
    if (as_recorded_ && !diverged_at_) {
        if (const std::optional<Vec3> was = record_.proxy(row_); was && *was != result.proxy) {
            diverged_at_ = row_;
        }
    }
    ++row_;
    return true;
}

}  // namespace haptic::sim
