#include "app/recordings.hpp"

#include <chrono>
#include <utility>

#include "app/background.hpp"

namespace haptic::sim {

Recordings::Recordings(bool to_file, std::size_t room) : room_(room) {
    if (to_file) {
        kept_.emplace(room_);
    }
}

void Recordings::begin(RecordNotes origin) {
    finish_offer();
    notes_ = std::move(origin);
    if (kept_) {
        kept_.emplace(room_);
    }
}

void Recordings::add(const StepInput& input, const StepResult& result) {
    if (kept_) {
        kept_->add(input, result);
    }
    if (offered_) {
        offered_->add(input, result);
        if (offered_->rows() >= kMaxOffered) {
            finish_offer();
        }
    }
}

void Recordings::note(std::uint64_t step, const std::string& what) {
    // A slider may change a key several times between two steps.
    const auto key_of = [](const std::string& text) { return text.substr(0, text.find('=')); };
    for (auto last = notes_.changes.rbegin(); last != notes_.changes.rend() && last->step == step; ++last) {
        if (key_of(last->what) == key_of(what)) {
            last->what = what;
            return;
        }
    }
    notes_.changes.push_back({step, what});
}

void Recordings::start_offer(std::uint64_t step) {
    if (!offered_) {
        offered_.emplace(kMaxOffered);
        offered_from_ = step;
    }
}

void Recordings::finish_offer() {
    if (!offered_) {
        return;
    }
    RecordNotes notes = notes_;
    notes.first_step = offered_from_;
    finished_.push_back(
        in_background([record = std::move(*offered_), notes = std::move(notes)] { return record.csv(notes); }));
    offered_.reset();
}

std::optional<std::string> Recordings::take_offer() {
    if (finished_.empty() || finished_.front().wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
        return std::nullopt;
    }
    std::string csv = finished_.front().get();
    finished_.pop_front();
    return csv;
}

void Recordings::write(const std::filesystem::path& file) const {
    if (kept_) {
        kept_->write(file, notes_);
    }
}

}  // namespace haptic::sim
