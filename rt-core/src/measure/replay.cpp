#include "measure/replay.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "haptic/denormals.hpp"
#include "measure/recording.hpp"
#include "process/device_protocol.hpp"

namespace haptic::rt {
namespace {

constexpr const char* kInputs[] = {"tick",         "now_ns",  "deadline_ns", "missed",     "requests", "exchange_in",
                                   "exchange_out", "buttons", "rotary",      "frame_read", "cut"};

// Those of an overlay, which older recordings do not have.
constexpr const char* kOverlayInputs[] = {"overlay_read", "overlay_time_ns", "overlay_fx_n",  "overlay_fy_n",
                                          "overlay_fz_n", "overlay_tx_nm",   "overlay_ty_nm", "overlay_tz_nm"};

// That of an answer which a later tick collects; older recordings do not have it.
constexpr const char* kCollected = "exchange_collected";

constexpr auto kLastStatus = static_cast<std::int64_t>(device::ExchangeStatus::Failed);

double as_double(const CsvCell& cell) {
    return std::visit([](auto value) { return static_cast<double>(value); }, cell);
}

}  // namespace

device::ExchangeStatus ReplayBoard::exchange(const device::MotorCommand& /*command*/, device::BoardReading& reading,
                                             std::int64_t /*now_ns*/) HAPTIC_RT {
    // First or second exchange of the tick, with its recorded outcome.
    const std::int8_t recorded = exchanges_ == 0 ? answers_.in : answers_.out;
    ++exchanges_;
    const device::ExchangeStatus status =
        recorded == kNoExchange ? device::ExchangeStatus::Ok : static_cast<device::ExchangeStatus>(recorded);
    // As on the device, a failed exchange leaves the reading unchanged.
    if (status == device::ExchangeStatus::Ok) {
        reading = answers_.reading;
    }
    return status;
}

const std::pair<const std::string, ColumnDifference>& ReplayResult::first() const {
    const std::vector<std::string>& order = record_columns();
    const auto column = [&order](const std::string& name) { return std::find(order.begin(), order.end(), name); };
    return *std::min_element(columns.begin(), columns.end(), [&column](const auto& a, const auto& b) {
        return a.second.line != b.second.line ? a.second.line < b.second.line : column(a.first) < column(b.first);
    });
}

/// Recorded inputs of one tick.
struct Replay::Inputs {
    std::uint64_t number = 0;
    TickTime time;
    std::uint64_t requests = 0;
    std::int64_t frame_read = kNoFrame;
    std::uint32_t cut = 0;
    ReplayBoard::Answers answers;
};

Replay::Replay(const std::filesystem::path& recording, const TickSettings& settings, RingWriter<DeviceState>& states,
               StageClock clock)
    : recording_(recording),
      frame_reader_((static_cast<void>(required("counter0")), frames_file(recording))),
      settings_(settings),
      states_(&states),
      clock_(clock) {
    // Columns that feed the tick.
    for (const char* name : kInputs) {
        inputs_[name] = required(name);
    }
    for (std::size_t i = 0; i < kStrings; ++i) {
        for (const char* name : {"counter", "analog"}) {
            const std::string numbered = name + std::to_string(i);
            inputs_[numbered] = required(numbered.c_str());
        }
    }
    if (recording_.find(kOverlayInputs[0])) {
        for (const char* name : kOverlayInputs) {
            inputs_[name] = required(name);
        }
    }
    if (recording_.find(kCollected)) {
        inputs_[kCollected] = required(kCollected);
    }
    // Columns to compare: all that the recording has, except measured durations.
    for (std::size_t i = 0; i < record_columns().size(); ++i) {
        compared_columns_.push_back(nondeterministic_columns()[i] ? std::nullopt
                                                                  : recording_.find(record_columns()[i]));
        result_.compared_columns += compared_columns_.back() ? 1u : 0u;
    }
}

std::size_t Replay::required(const char* column) const {
    if (const auto found = recording_.find(column)) {
        return *found;
    }
    throw CsvError(recording_.name() + ":1: there is no column " + column +
                   ": a replay needs the board's data as written by `rt-core run --record`; "
                   "an older recording can only be used with --hand");
}

Replay::Inputs Replay::read_inputs() const {
    // Cells as integers. A value out of range is an error with the file, line and column.
    const auto integer = [this](const std::string& name) { return recording_.integer(inputs_.at(name)); };
    const auto bounded = [&](const std::string& name, std::int64_t min, std::int64_t max) {
        const std::int64_t value = integer(name);
        if (value < min || value > max) {
            recording_.fail("column " + name + ": " + std::to_string(value) + " is not between " + std::to_string(min) +
                            " and " + std::to_string(max));
        }
        return value;
    };
    // Time and requests of the tick.
    Inputs inputs;
    inputs.number = recording_.natural(inputs_.at("tick"));
    inputs.time = {integer("deadline_ns"), integer("now_ns"), integer("missed")};
    inputs.requests = recording_.natural(inputs_.at("requests"));
    inputs.frame_read = integer("frame_read");
    inputs.cut = static_cast<std::uint32_t>(bounded("cut", 0, UINT32_MAX));
    // Answers of the board.
    inputs.answers.in = static_cast<std::int8_t>(bounded("exchange_in", kNoExchange, kLastStatus));
    inputs.answers.out = static_cast<std::int8_t>(bounded("exchange_out", kNoExchange, kLastStatus));
    if (inputs_.contains(kCollected)) {
        inputs.answers.collected = static_cast<std::int8_t>(bounded(kCollected, kNoExchange, kLastStatus));
    }
    device::BoardReading& reading = inputs.answers.reading;
    reading.buttons = static_cast<std::uint32_t>(bounded("buttons", 0, UINT32_MAX));
    reading.rotary = static_cast<std::uint8_t>(bounded("rotary", 0, UINT8_MAX));
    // Counters and analog inputs.
    for (std::size_t i = 0; i < kStrings; ++i) {
        const std::string number = std::to_string(i);
        reading.counters[i] = static_cast<std::uint32_t>(bounded("counter" + number, 0, UINT32_MAX));
        reading.analog[i] = static_cast<std::uint16_t>(bounded("analog" + number, 0, UINT16_MAX));
    }
    return inputs;
}

void Replay::check_order(const Inputs& inputs) {
    const bool begins = (inputs.requests & kRequestNew) != 0;
    // The first row must be the first tick of a run, or the tick's state would be unknown.
    if (!begins && last_number_ == 0) {
        recording_.fail("begins at tick " + std::to_string(inputs.number) +
                        " of a run: a replay needs the run from its first tick");
    }
    // Within a run the tick numbers are consecutive.
    if (!begins && inputs.number != last_number_ + 1) {
        recording_.fail("tick " + std::to_string(last_number_ + 1) +
                        " is missing: the recorder's queue overflowed; raise recording.queue_ticks");
    }
    last_number_ = inputs.number;
}

void Replay::load_frame(const Inputs& inputs) {
    if (inputs.frame_read == kNoFrame) {
        frames_.load(nullptr);
        return;
    }
    // Frames are in the order of their ticks; each belongs to the tick with the same time.
    if (!frame_reader_.next(frame_) || frame_.now_ns != inputs.time.now_ns) {
        recording_.fail("the contact frame of this tick is not in " + frame_reader_.name() +
                        ": the recorder's queue overflowed; raise recording.queue_frames");
    }
    ++result_.frames;
    frames_.load(&frame_.frame);
}

void Replay::load_overlay() {
    overlays_.load(nullptr);
    const auto read = inputs_.find("overlay_read");
    if (read == inputs_.end() || recording_.integer(read->second) == kNoOverlay) {
        return;
    }
    const auto number = [this](const char* name) { return recording_.number(inputs_.at(name)); };
    overlay_.arrival_time_ns = recording_.integer(inputs_.at("overlay_time_ns"));
    store({number("overlay_fx_n"), number("overlay_fy_n"), number("overlay_fz_n")}, overlay_.force);
    store({number("overlay_tx_nm"), number("overlay_ty_nm"), number("overlay_tz_nm")}, overlay_.torque);
    // What was refused was not recorded: make it invalid again.
    if (recording_.integer(read->second) == kOverlayRefused) {
        overlay_.force[0] = std::numeric_limits<double>::quiet_NaN();
    }
    overlays_.load(&overlay_);
}

bool Replay::step(Recorder* recorder) {
    // Next recorded tick.
    if (!recording_.next()) {
        return false;
    }
    const FlushDenormals flush;  // like the real-time thread
    const Inputs inputs = read_inputs();
    check_order(inputs);
    // Apply the recorded requests, which in the run came from other threads.
    if ((inputs.requests & kRequestNew) != 0) {
        // Whether a person had signed for the device is no setting: the recording says it.
        const std::optional<std::size_t> flags = recording_.find("flags");
        const bool limited = flags && (recording_.natural(*flags) & HAPTIC_TICK_COMMISSIONING) != 0;
        tick_ =
            std::make_unique<Tick>(limited ? commissioning(settings_) : settings_, board_, frames_, *states_, clock_);
    }
    tick_->record_to(recorder);
    tick_->overlay_from(&overlays_);
    if ((inputs.requests & kRequestAwait) != 0) {
        tick_->await_person();
    }
    if ((inputs.requests & kRequestArm) != 0) {
        tick_->arm();
    }
    if ((inputs.requests & kRequestStop) != 0) {
        tick_->stop();
    }
    if (inputs.cut != 0) {
        tick_->cut(inputs.cut);
    }
    // Load the inputs, run the tick, and compare.
    board_.load(inputs.answers);
    load_frame(inputs);
    load_overlay();
    tick_->run(inputs.time);
    // Times of this tick and of the first.
    now_ns_ = inputs.time.now_ns;
    start_ns_ = result_.ticks == 0 ? now_ns_ : start_ns_;
    ++result_.ticks;
    compare();
    return true;
}

void Replay::compare() {
    // Cells of this tick as the recording would have written them.
    record_row(tick_->last(), 0, row_);
    bool differs = false;
    for (std::size_t i = 0; i < row_.size(); ++i) {
        const std::optional<std::size_t> found = compared_columns_[i];
        if (!found) {
            continue;
        }
        const std::size_t column = *found;
        std::string replayed = haptic::text_of(row_[i]);
        if (replayed == recording_.cell(column)) {
            continue;
        }
        // The text may differ for the same number, for example after editing in a spreadsheet: compare the bits.
        const double now = as_double(row_[i]);
        const double then = recording_.number(column);
        if (std::bit_cast<std::uint64_t>(now) == std::bit_cast<std::uint64_t>(then)) {
            continue;
        }
        // Keep the first difference of each column, and the largest.
        differs = true;
        const auto [entry, is_new] = result_.columns.try_emplace(record_columns()[i]);
        ColumnDifference& difference = entry->second;
        if (is_new) {
            difference.first_tick = tick_->last().number;
            difference.line = recording_.line();
            difference.recorded = recording_.cell(column);
            difference.replayed = std::move(replayed);
        }
        difference.largest = std::max(difference.largest, std::fabs(now - then));
    }
    result_.differing_ticks += differs ? 1u : 0u;
}

}  // namespace haptic::rt
