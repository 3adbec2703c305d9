#include "measure/kernel_watch.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <utility>

#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

constexpr std::size_t kRecent = 16;        // windows whose events may still arrive
constexpr std::size_t kMaxKept = 4096;     // far more than the log has ticks
constexpr std::uint64_t kMinUnusual = 20;  // interrupts in a window, below which their rate is not unusual
constexpr int kSteal = 7;                  // field of /proc/stat: user nice system idle iowait irq softirq steal
constexpr int kQueued = 7;                 // field of /proc/schedstat: run-queue wait, ns

/// Name of an interrupt from the words after its counts. Device interrupts: the handler, "timer" in "0: 10 12 IO-APIC
/// 2-edge timer". Architecture interrupts: the description, "Local timer interrupts" in "LOC: 10 12 Local timer
/// interrupts".
std::string name_of_interrupt(const std::string& label, std::istringstream& rest) {
    std::vector<std::string> words;
    for (std::string word; rest >> word;) {
        words.push_back(word);
    }
    if (words.empty()) {
        return label;
    }
    if (label.find_first_not_of("0123456789") == std::string::npos) {
        return words.back();
    }
    std::string name;
    for (const std::string& word : words) {
        name += (name.empty() ? "" : " ") + word;
    }
    return name;
}

/// Column of a processor in the header of /proc/interrupts; -1 if it is offline.
int column_of(const std::string& header, int cpu) {
    std::istringstream words(header);
    const std::string wanted = "CPU" + std::to_string(cpu);
    int column = 0;
    for (std::string word; words >> word; ++column) {
        if (word == wanted) {
            return column;
        }
    }
    return -1;
}

/// Field of the line "cpuN a b c ..." of a processor; -1 if it is missing.
std::int64_t field_of_cpu(const std::string& text, int cpu, int field) {
    std::istringstream lines(text);
    const std::string wanted = "cpu" + std::to_string(cpu);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string name;
        if (!(words >> name) || name != wanted) {
            continue;
        }
        std::int64_t value = -1;
        for (int i = 0; i <= field; ++i) {
            if (!(words >> value)) {
                return -1;
            }
        }
        return value;
    }
    return -1;
}

std::int64_t difference(std::int64_t later, std::int64_t earlier) {
    return later < 0 || earlier < 0 ? -1 : later - earlier;
}

ProcessorCounts difference(const ProcessorCounts& later, const ProcessorCounts& earlier) {
    ProcessorCounts result;
    for (std::size_t i = 0; i < later.interrupts.size(); ++i) {
        const std::uint64_t before = i < earlier.interrupts.size() ? earlier.interrupts[i] : 0;
        result.interrupts.push_back(later.interrupts[i] - std::min(before, later.interrupts[i]));
    }
    result.stolen_ms = difference(later.stolen_ms, earlier.stolen_ms);
    result.queued_us = difference(later.queued_us, earlier.queued_us);
    return result;
}

void add(ProcessorCounts& sum, const ProcessorCounts& more) {
    sum.interrupts.resize(std::max(sum.interrupts.size(), more.interrupts.size()), 0);
    for (std::size_t i = 0; i < more.interrupts.size(); ++i) {
        sum.interrupts[i] += more.interrupts[i];
    }
    sum.stolen_ms = more.stolen_ms < 0 ? sum.stolen_ms : std::max<std::int64_t>(sum.stolen_ms, 0) + more.stolen_ms;
    sum.queued_us = more.queued_us < 0 ? sum.queued_us : std::max<std::int64_t>(sum.queued_us, 0) + more.queued_us;
}

}  // namespace

KernelFile::KernelFile(const std::filesystem::path& path) : descriptor_(open(path.c_str(), O_RDONLY | O_CLOEXEC)) {}

KernelFile::~KernelFile() {
    if (descriptor_ >= 0) {
        close(descriptor_);
    }
}

std::string KernelFile::read() const {
    std::string text;
    std::array<char, 8192> part{};
    for (ssize_t size = 0;
         (size = pread(descriptor_, part.data(), part.size(), static_cast<off_t>(text.size()))) > 0;) {
        text.append(part.data(), static_cast<std::size_t>(size));
    }
    return text;
}

KernelWatch::KernelWatch(int cpu, const std::filesystem::path& proc)
    : cpu_(cpu), interrupts_(proc / "interrupts"), stat_(proc / "stat"), schedstat_(proc / "schedstat") {}

void KernelWatch::read_interrupts(ProcessorCounts& counts) {
    std::istringstream lines(interrupts_.read());
    std::string line;
    if (!std::getline(lines, line)) {
        return;
    }
    const int column = column_of(line, cpu_);
    const auto columns = std::count(line.begin(), line.end(), 'U');  // the header is "CPU0 CPU1 ..."
    while (column >= 0 && std::getline(lines, line)) {
        std::istringstream words(line);
        std::string label;
        words >> label;
        label.erase(label.find_last_not_of(':') + 1);
        // One count per processor; pick ours.
        std::uint64_t count = 0;
        bool ours = false;
        for (int i = 0; i < columns; ++i) {
            std::uint64_t value = 0;
            if (!(words >> value)) {
                words.clear();  // ERR and MIS have a single number for all processors
                break;
            }
            count = i == column ? value : count;
            ours = ours || i == column;
        }
        if (!ours) {
            continue;
        }
        // Add it to the interrupt of this name; several lines may share one.
        const std::string name = name_of_interrupt(label, words);
        const auto known = std::find(names_.begin(), names_.end(), name);
        const auto index = static_cast<std::size_t>(known - names_.begin());
        if (known == names_.end()) {
            names_.push_back(name);
        }
        counts.interrupts.resize(names_.size(), 0);
        counts.interrupts[index] += count;
    }
}

ProcessorCounts KernelWatch::read() {
    ProcessorCounts counts;
    read_interrupts(counts);
    const std::int64_t jiffies = field_of_cpu(stat_.read(), cpu_, kSteal);
    counts.stolen_ms = jiffies < 0 ? -1 : jiffies * 1000 / sysconf(_SC_CLK_TCK);
    const std::int64_t queued_ns = field_of_cpu(schedstat_.read(), cpu_, kQueued);
    counts.queued_us = queued_ns < 0 ? -1 : queued_ns / 1000;
    return counts;
}

void KernelWatch::restart(std::int64_t now_ns) {
    last_ = read();
    begin_ns_ = now_ns;
}

void KernelWatch::poll(std::int64_t now_ns, TimingLog& log) {
    if (now_ns - begin_ns_ < kWindowNs) {
        return;
    }
    close_window(now_ns);
    take_events(log);
    retire_windows(kRecent);
}

void KernelWatch::finish(std::int64_t now_ns, TimingLog& log) {
    close_window(now_ns);
    take_events(log);
    retire_windows(0);
}

void KernelWatch::close_window(std::int64_t now_ns) {
    ProcessorCounts now = read();
    Candidate closed;
    closed.window = {begin_ns_, now_ns, difference(now, last_)};
    add(total_, closed.window.counts);
    watched_ns_ += now_ns - begin_ns_;
    last_ = std::move(now);
    begin_ns_ = now_ns;
    recent_.push_back(std::move(closed));
}

void KernelWatch::take_events(TimingLog& log) {
    std::int64_t at_ns = 0;
    while (log.take_event(at_ns)) {
        for (Candidate& one : recent_) {
            one.wanted = one.wanted || (at_ns >= one.window.begin_ns && at_ns < one.window.end_ns);
        }
    }
}

void KernelWatch::retire_windows(std::size_t still_open) {
    while (recent_.size() > still_open) {
        if (recent_.front().wanted && kept_.size() < kMaxKept) {
            kept_.push_back(std::move(recent_.front().window));
        }
        recent_.pop_front();
    }
}

const KernelWindow* KernelWatch::window_of(std::int64_t at_ns) const noexcept {
    for (const KernelWindow& window : kept_) {
        if (at_ns >= window.begin_ns && at_ns < window.end_ns) {
            return &window;
        }
    }
    return nullptr;
}

double KernelWatch::watched_s() const noexcept {
    return seconds(watched_ns_);
}

std::string unusual_interrupts(const KernelWindow& window, const KernelWatch& watch) {
    // Expected count of an interrupt in this window: its total times the window's share of the run.
    const double share = watch.watched_s() > 0.0 ? seconds(window.end_ns - window.begin_ns) / watch.watched_s() : 1.0;
    std::vector<std::pair<std::uint64_t, std::size_t>> unusual;
    for (std::size_t i = 0; i < window.counts.interrupts.size(); ++i) {
        const std::uint64_t count = window.counts.interrupts[i];
        const double usual = share * static_cast<double>(watch.total().interrupts[i]);
        if (count >= kMinUnusual && static_cast<double>(count) >= 2.0 * usual) {
            unusual.emplace_back(count, i);
        }
    }
    // The three most frequent, as text.
    std::sort(unusual.rbegin(), unusual.rend());
    unusual.resize(std::min<std::size_t>(unusual.size(), 3));
    std::string text;
    for (const auto& [count, index] : unusual) {
        text += (text.empty() ? "" : ", ") + watch.names()[index] + " " + std::to_string(count);
    }
    return text;
}

}  // namespace haptic::rt
