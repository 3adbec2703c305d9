#include "measure/recording.hpp"

#include <cstring>
#include <system_error>
#include <type_traits>

#include "haptic/text_file.hpp"
#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

constexpr double kMicrosecondsPerNanosecond = 1e-3;
constexpr double kMillisecondsPerNanosecond = 1e-6;
// Ticks held back until the time of arming is known; more than any warm-up has.
constexpr std::size_t kMaxBeforeArming = 200'000;
// Earlier black boxes that are kept beside the newest one.
constexpr int kEarlierBlackBoxes = 9;

struct Row {
    const TickRecord& tick;
    std::int64_t start_ns;
};

/// One column, or one column per letter, which replaces the '#' in the name.
struct Column {
    const char* name = "";
    const char* letters = "";
    CsvCell (*value)(const Row& row, int letter) = nullptr;
    bool nondeterministic = false;  // a duration measured by the clock
};

template <class Integer>
CsvCell whole(Integer value) {
    if constexpr (std::is_signed_v<Integer>) {
        return static_cast<std::int64_t>(value);
    } else {
        return static_cast<std::uint64_t>(value);
    }
}

double milliseconds_or_none(std::int64_t ns) {
    return ns < 0 ? -1.0 : static_cast<double>(ns) * kMillisecondsPerNanosecond;
}

double microseconds(std::int64_t ns) {
    return static_cast<double>(ns) * kMicrosecondsPerNanosecond;
}

double of_quaternion(const Quat& q, int letter) {
    return letter == 0 ? q.w : letter == 1 ? q.x : letter == 2 ? q.y : q.z;
}

using R = const Row&;
constexpr const char* kOne = "";
constexpr const char* kAxes = "xyz";
constexpr const char* kQuaternion = "wxyz";
constexpr const char* kEight = "01234567";
static_assert(kStrings == 8);

// The columns are a public interface: append new ones, and never change a name or meaning.
constexpr Column kColumns[] = {
    {"time_s", kOne, [](R r, int) -> CsvCell { return seconds(r.tick.now_ns - r.start_ns); }, true},  // since arming
    {"#_m", kAxes, [](R r, int i) -> CsvCell { return r.tick.pose.position[i]; }},
    {"q#", kQuaternion, [](R r, int i) -> CsvCell { return of_quaternion(r.tick.pose.orientation, i); }},
    {"f#_n", kAxes, [](R r, int i) -> CsvCell { return r.tick.rendered.force[i]; }},  // requested of the strings
    {"t#_nm", kAxes, [](R r, int i) -> CsvCell { return r.tick.rendered.torque[i]; }},
    {"proxy_#_m", kAxes, [](R r, int i) -> CsvCell { return r.tick.proxy[i]; }},  // of the first proxy
    {"t#_n", kEight, [](R r, int i) -> CsvCell { return r.tick.tensions[static_cast<std::size_t>(i)]; }},   // as sent
    {"frame_age_ms", kOne, [](R r, int) -> CsvCell { return milliseconds_or_none(r.tick.frame_age_ns); }},  // -1: none
    {"period_us", kOne, [](R r, int) -> CsvCell { return microseconds(r.tick.period_ns); }},
    {"compute_us", kOne, [](R r, int) -> CsvCell { return microseconds(r.tick.compute_ns); }, true},
    {"flags", kOne, [](R r, int) -> CsvCell { return whole(r.tick.flags); }},  // HAPTIC_TICK_*
    {"tick", kOne, [](R r, int) -> CsvCell { return whole(r.tick.number); }},
    {"now_ns", kOne, [](R r, int) -> CsvCell { return whole(r.tick.now_ns); }},  // CLOCK_MONOTONIC
    {"deadline_ns", kOne, [](R r, int) -> CsvCell { return whole(r.tick.deadline_ns); }},
    {"missed", kOne, [](R r, int) -> CsvCell { return whole(r.tick.missed); }},      // deadlines before this one
    {"requests", kOne, [](R r, int) -> CsvCell { return whole(r.tick.requests); }},  // kRequest*
    {"safety_state", kOne, [](R r, int) -> CsvCell { return whole(r.tick.safety_state); }},
    {"faults", kOne, [](R r, int) -> CsvCell { return whole(r.tick.faults); }},            // HAPTIC_FAULT_*
    {"exchange_in", kOne, [](R r, int) -> CsvCell { return whole(r.tick.exchange_in); }},  // ExchangeStatus; -1: none
    {"exchange_out", kOne, [](R r, int) -> CsvCell { return whole(r.tick.exchange_out); }},
    {"counter#", kEight, [](R r, int i) -> CsvCell { return whole(r.tick.counters[static_cast<std::size_t>(i)]); }},
    {"analog#", kEight, [](R r, int i) -> CsvCell { return whole(r.tick.analog[static_cast<std::size_t>(i)]); }},
    {"digit#", kEight,
     [](R r, int i) -> CsvCell { return whole(r.tick.command.dac_codes[static_cast<std::size_t>(i)]); }},  // as sent
    {"buttons", kOne, [](R r, int) -> CsvCell { return whole(r.tick.buttons); }},
    {"rotary", kOne, [](R r, int) -> CsvCell { return whole(r.tick.rotary); }},
    {"residual_m", kOne, [](R r, int) -> CsvCell { return r.tick.residual; }},
    {"v#_m_s", kAxes, [](R r, int i) -> CsvCell { return r.tick.velocity.linear[i]; }},
    {"w#_rad_s", kAxes, [](R r, int i) -> CsvCell { return r.tick.velocity.angular[i]; }},
    {"made_f#_n", kAxes, [](R r, int i) -> CsvCell { return r.tick.made.force[i]; }},  // produced by the strings
    {"made_t#_nm", kAxes, [](R r, int i) -> CsvCell { return r.tick.made.torque[i]; }},
    {"frame_read", kOne, [](R r, int) -> CsvCell { return whole(r.tick.frame_read); }},  // FrameDefect; -1: none taken
    {"frame_sequence", kOne, [](R r, int) -> CsvCell { return whole(r.tick.frame_sequence); }},
    {"in_contact", kOne, [](R r, int) -> CsvCell { return whole(r.tick.in_contact); }},  // number of proxies
    {"energy_j", kOne, [](R r, int) -> CsvCell { return r.tick.energy; }},               // of the passivity observer
    {"rotation_energy_j", kOne, [](R r, int) -> CsvCell { return r.tick.rotation_energy; }},
    {"passivity_scale", kOne,
     [](R r, int) -> CsvCell { return r.tick.passivity_scale; }},  // factor applied to the wrench
    {"stiffness_n_m", kOne, [](R r, int) -> CsvCell { return r.tick.stiffness; }},
    {"scale", kOne, [](R r, int) -> CsvCell { return r.tick.scale; }},
    {"cut", kOne, [](R r, int) -> CsvCell { return whole(r.tick.cut); }},  // HAPTIC_FAULT_*, cut by another thread
    {"overlay_read", kOne, [](R r, int) -> CsvCell { return whole(r.tick.overlay_read); }},  // -1: none; 1: refused
    {"overlay_time_ns", kOne, [](R r, int) -> CsvCell { return whole(r.tick.overlay_time_ns); }},
    {"overlay_f#_n", kAxes, [](R r, int i) -> CsvCell { return r.tick.overlay.force[i]; }},  // as received
    {"overlay_t#_nm", kAxes, [](R r, int i) -> CsvCell { return r.tick.overlay.torque[i]; }},
    {"exchange_collected", kOne, [](R r, int) -> CsvCell { return whole(r.tick.exchange_collected); }},  // -1: none
};

template <class Visit>
void visit_columns(Visit&& visit) {
    for (const Column& column : kColumns) {
        // One visit per letter, or one for a column without letters.
        const int letters = static_cast<int>(std::strlen(column.letters));
        for (int i = 0; i < letters || i == 0; ++i) {
            visit(column, i);
        }
    }
}

/// Renames an existing file to the first free name F.bak-1 to F.bak-9; leaves it if there is none.
void keep_earlier(const std::filesystem::path& file) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
        return;
    }
    if (const std::filesystem::path kept = free_backup_name(file, kEarlierBlackBoxes); !kept.empty()) {
        std::filesystem::rename(file, kept, error);
    }
}

}  // namespace

const std::vector<std::string>& record_columns() {
    static const std::vector<std::string> columns = [] {
        std::vector<std::string> names;
        visit_columns([&names](const Column& column, int letter) {
            // Replace the '#' by the letter.
            std::string name = column.name;
            if (const std::size_t mark = name.find('#'); mark != std::string::npos) {
                name[mark] = column.letters[letter];
            }
            names.push_back(std::move(name));
        });
        return names;
    }();
    return columns;
}

const std::vector<bool>& nondeterministic_columns() {
    static const std::vector<bool> columns = [] {
        std::vector<bool> flags;
        visit_columns([&flags](const Column& column, int) { flags.push_back(column.nondeterministic); });
        return flags;
    }();
    return columns;
}

void record_row(const TickRecord& record, std::int64_t start_ns, std::vector<CsvCell>& row) {
    row.clear();
    const Row source{record, start_ns};
    visit_columns([&](const Column& column, int letter) { row.push_back(column.value(source, letter)); });
}

RecordFile::RecordFile(const std::filesystem::path& file, Recorder& recorder)
    : ticks_(file, record_columns()), recorder_(&recorder) {
    // A pipe or a device takes only the ticks; frames need a file beside it.
    if (std::filesystem::is_regular_file(file)) {
        frames_.emplace(frames_file(file));
    }
}

void RecordFile::write(const TickRecord& record, std::int64_t start_ns) {
    record_row(record, start_ns, row_);
    ticks_.row(row_);
}

void RecordFile::start(std::int64_t start_ns) {
    start_ns_ = start_ns;
    for (const TickRecord& record : before_arming_) {
        write(record, start_ns);
    }
    before_arming_.clear();
}

void RecordFile::take_ticks() {
    TickRecord record;
    while (recorder_->pop(record)) {
        // Observers see every tick, those before arming too.
        if (observer_) {
            observer_(record);
        }
        if (failed_) {
            continue;
        }
        // Hold ticks back until the tick that arms, whose time is zero.
        if (!start_ns_ && (record.requests & kRequestArm) != 0) {
            start(record.now_ns);
        }
        // Known time of arming: write at once.
        if (start_ns_) {
            write(record, *start_ns_);
            continue;
        }
        // Otherwise hold back. A run that never arms counts time from its first tick.
        before_arming_.push_back(record);
        if (before_arming_.size() == kMaxBeforeArming) {
            start(before_arming_.front().now_ns);
        }
    }
}

void RecordFile::take_frames() {
    SpscQueue<RecordedFrame>& frames = recorder_->frames();
    while (const RecordedFrame* const frame = frames.front()) {
        if (frames_ && !failed_) {
            frames_->write(*frame);
        }
        frames.release();
    }
}

void RecordFile::flush() {
    // A tick is replayed with the frame it took, which therefore comes first.
    failed_ = failed_ || (frames_ && !frames_->flush()) || !ticks_.flush();
}

void RecordFile::drain() {
    // Ticks before frames: a frame is queued before the tick that took it.
    take_ticks();
    take_frames();
    flush();
}

void RecordFile::close() {
    // Last ticks, and those of a run that was never armed.
    take_ticks();
    take_frames();
    if (!start_ns_ && !before_arming_.empty()) {
        start(before_arming_.front().now_ns);
    }
    flush();
    if (frames_) {
        frames_->close();
    }
    ticks_.close();
}

void write_black_box(const std::filesystem::path& file, const BlackBox& box) {
    CsvWriter writer(file, record_columns());
    std::vector<CsvCell> row;
    for (std::size_t i = 0; i < box.size(); ++i) {
        record_row(box.at(i), box.start_ns(), row);
        writer.row(row);
    }
    keep_earlier(file);
    writer.close();
}

}  // namespace haptic::rt
