#include "app/recordings.hpp"

#include <algorithm>
#include <exception>
#include <stdexcept>

#include "haptic/config.hpp"

namespace haptic::sim {
namespace {

// About the longest row.
constexpr std::size_t kBytesPerRow = 500;

/// F-n.csv for F.csv; F.csv itself for the first.
std::filesystem::path numbered(const std::filesystem::path& file, std::size_t nth) {
    std::filesystem::path name = file.stem();
    name += nth > 1 ? "-" + std::to_string(nth) : "";
    name += file.extension();
    return file.parent_path() / name;
}

}  // namespace

void Recordings::begin(RecordNotes origin) {
    finish_offer();
    finish_file();
    notes_ = std::move(origin);
    pending_.clear();
    if (!file_.empty()) {
        writer_.emplace(numbered(file_, ++simulations_));
        kept_.emplace(notes_, clocked_);
    }
}

void Recordings::add(const StepInput& input, const StepResult& result) {
    for (StepRecord* const record : {kept_ ? &*kept_ : nullptr, offered_ ? &*offered_ : nullptr}) {
        if (record == nullptr) {
            continue;
        }
        for (const LiveChange& change : pending_) {
            record->add(change);
        }
        record->add(input, result);
    }
    notes_.changes.insert(notes_.changes.end(), pending_.begin(), pending_.end());
    pending_.clear();
    if (kept_ && writer_) {
        writer_->append(kept_->text());
        kept_->clear();
    }
    if (offered_ && offered_->rows() >= kMaxOffered) {
        finish_offer();
    }
}

void Recordings::note(std::uint64_t step, const std::string& what) {
    // A slider may change a key several times between two steps.
    const auto same = std::find_if(pending_.begin(), pending_.end(), [&](const LiveChange& change) {
        return change.step == step && assigned_key(change.what) == assigned_key(what);
    });
    if (same != pending_.end()) {
        same->what = what;
    } else {
        pending_.push_back({step, what});
    }
}

void Recordings::start_offer(std::uint64_t step) {
    if (!offered_) {
        RecordNotes notes = notes_;
        notes.first_step = step;
        offered_.emplace(notes, clocked_);
        offered_->reserve(kMaxOffered * kBytesPerRow);
    }
}

void Recordings::finish_offer() {
    if (offered_) {
        finished_.push_back(offered_->take());
        offered_.reset();
    }
}

std::optional<std::string> Recordings::take_offer() {
    if (finished_.empty()) {
        return std::nullopt;
    }
    std::string csv = std::move(finished_.front());
    finished_.pop_front();
    return csv;
}

void Recordings::finish_file() {
    if (!writer_) {
        return;
    }
    try {
        writer_->close();
    } catch (const std::exception& error) {
        problem_ = error.what();
    }
    writer_.reset();
}

void Recordings::close() {
    finish_file();
    if (!problem_.empty()) {
        throw std::runtime_error(problem_);
    }
}

}  // namespace haptic::sim
