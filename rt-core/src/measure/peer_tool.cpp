#include "measure/peer_tool.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "parsed_number.hpp"

namespace haptic::rt {
namespace {

constexpr int kCyclictestKeptNs = 1'000'000;  // largest histogram that cyclictest accepts, one bucket per ns
constexpr int kTimerlatBucketNs = 100;
constexpr int kTimerlatBuckets = 100'000;  // up to 10 ms
// Of osnoise's thread, which does not sleep meanwhile: less than the kernel's limit of 95 % for real-time threads.
constexpr int kNoisePeriodUs = 1'000'000;
constexpr int kNoiseRuntimeUs = 900'000;

bool is_fifo(const RealtimeSetup& setup) {
    return setup.policy == "SCHED_FIFO";
}

[[noreturn]] void refuse(const char* tool, const std::string& problem) {
    throw std::runtime_error(std::string("cannot understand ") + tool + "'s result: " + problem);
}

void record(Histogram& histogram, std::int64_t duration_ns, std::uint64_t times) {
    for (std::uint64_t i = 0; i < times; ++i) {
        histogram.record(duration_ns);
    }
}

std::vector<std::string> cyclictest_arguments(const PeerTurn& turn) {
    const bool fifo = is_fifo(turn.setup);
    std::vector<std::string> words = {"--quiet",
                                      "--default-system",  // no tuning of its own: the same conditions as the loop
                                      "--nsecs",
                                      "--histogram=" + std::to_string(kCyclictestKeptNs),
                                      "--interval=" + std::to_string(turn.period_ns / 1000),
                                      "--duration=" + std::to_string(turn.duration_s),
                                      fifo ? "--policy=fifo" : "--policy=other",
                                      "--priority=" + std::to_string(fifo ? turn.setup.priority : 0)};
    if (turn.setup.cpu >= 0) {
        words.push_back("--affinity=" + std::to_string(turn.setup.cpu));
    }
    if (turn.setup.memory_locked) {
        words.emplace_back("--mlockall");
    }
    return words;
}

void add_cyclictest(const std::string& output, PeerResult& result) {
    try {
        const nlohmann::json report = nlohmann::json::parse(output);
        const nlohmann::json& thread = report.at("thread").at("0");
        // Histogram {"latency in ns": count} of the only thread.
        std::uint64_t kept = 0;
        for (const auto& [latency_ns, count] : thread.at("histogram").items()) {
            record(result.wakeup, std::stoll(latency_ns), count.get<std::uint64_t>());
            kept += count.get<std::uint64_t>();
        }
        // Cycles beyond the histogram have no latency of their own: record each with the maximum.
        const std::uint64_t cycles = std::max(kept, thread.at("cycles").get<std::uint64_t>());
        record(result.wakeup, thread.at("max").get<std::int64_t>(), cycles - kept);
        result.beyond += cycles - kept;
    } catch (const std::exception& error) {
        refuse("cyclictest", error.what());
    }
}

/// Processor and scheduling, as all of rtla's tools take them.
std::vector<std::string> rtla_arguments(const char* tool, const char* mode, const PeerTurn& turn) {
    return {tool,         mode,
            "--duration", std::to_string(turn.duration_s),
            "--cpus",     std::to_string(turn.setup.cpu),
            "--priority", is_fifo(turn.setup) ? "f:" + std::to_string(turn.setup.priority) : "o:0"};
}

std::vector<std::string> timerlat_arguments(const PeerTurn& turn) {
    std::vector<std::string> words = rtla_arguments("timerlat", "hist", turn);
    words.insert(words.end(), {"--period", std::to_string(turn.period_ns / 1000), "--nano", "--bucket-size",
                               std::to_string(kTimerlatBucketNs), "--entries", std::to_string(kTimerlatBuckets)});
    return words;
}

/// A column of timerlat's histogram: a processor's interrupt ("IRQ-001") or thread ("Thr-001"), or, in newer versions,
/// when that thread was back in user space ("Usr-001"), which nothing else here measures.
struct TimerlatColumn {
    std::string name;
    std::vector<std::pair<std::int64_t, std::uint64_t>> buckets;  // lower end in ns, count
    std::uint64_t over = 0;
    std::uint64_t count = 0;
    std::int64_t min_ns = 0;
    std::int64_t max_ns = 0;

    [[nodiscard]] bool is_thread() const { return name.starts_with("Thr-"); }
    [[nodiscard]] bool is_interrupt() const { return name.starts_with("IRQ-"); }
};

/// Reads the table that timerlat prints: an index and a number for each column in each line.
std::vector<TimerlatColumn> timerlat_table(const std::string& output) {
    std::vector<TimerlatColumn> columns;
    std::istringstream lines(output);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string index;
        words >> index;
        if (index == "Index") {
            for (std::string name; words >> name;) {
                columns.emplace_back().name = name;
            }
            continue;
        }
        // What follows is a sum over processors, in newer versions.
        if (index == "ALL:") {
            break;
        }
        for (TimerlatColumn& column : columns) {
            std::string cell;
            words >> cell;
            const std::int64_t number = detail::parsed_number<std::int64_t>(cell).value_or(-1);
            if (number < 0) {
                continue;  // such as '-', a minimum of nothing
            }
            if (index == "over:") {
                column.over = static_cast<std::uint64_t>(number);
            } else if (index == "count:") {
                column.count = static_cast<std::uint64_t>(number);
            } else if (index == "min:") {
                column.min_ns = number;
            } else if (index == "max:") {
                column.max_ns = number;
            } else if (!index.empty() && index.find_first_not_of("0123456789") == index.npos && number > 0) {
                column.buckets.emplace_back(std::stoll(index), number);
            }
        }
    }
    return columns;
}

void add_timerlat(const std::string& output, PeerResult& result) {
    if (output.find("nanoseconds") == output.npos) {
        refuse("timerlat", "its histogram is not in nanoseconds");
    }
    bool measured = false;
    for (const TimerlatColumn& column : timerlat_table(output)) {
        if (!column.is_thread() && !column.is_interrupt()) {
            continue;
        }
        std::uint64_t total = column.over;
        for (const auto& [lower_ns, count] : column.buckets) {
            total += count;
        }
        if (total != column.count) {
            refuse("timerlat", "its histogram has " + std::to_string(total) + " values, its summary " +
                                   std::to_string(column.count));
        }
        // Each at the middle of its bucket, at most 50 ns off, but the largest, and all beyond the last bucket, at the
        // maximum.
        Histogram& histogram = column.is_thread() ? result.wakeup : result.interrupt;
        std::uint64_t seen = 0;
        for (const auto& [lower_ns, count] : column.buckets) {
            seen += count;
            const std::uint64_t largest = seen == column.count ? 1 : 0;
            const std::int64_t middle_ns = lower_ns + kTimerlatBucketNs / 2;
            record(histogram, std::clamp(middle_ns, column.min_ns, column.max_ns), count - largest);
            record(histogram, column.max_ns, largest);
        }
        record(histogram, column.max_ns, column.over);
        result.beyond += column.is_thread() ? column.over : 0;
        measured = measured || (column.is_thread() && column.count > 0);
    }
    if (!measured) {
        refuse("timerlat", "it has no wake-ups of a thread");
    }
}

std::vector<std::string> osnoise_arguments(const PeerTurn& turn) {
    std::vector<std::string> words = rtla_arguments("osnoise", "top", turn);
    words.insert(words.end(),
                 {"--quiet", "--period", std::to_string(kNoisePeriodUs), "--runtime", std::to_string(kNoiseRuntimeUs)});
    return words;
}

void add_osnoise(const std::string& output, PeerResult& result) {
    // A line a processor: "  1 #3  2700000  5  99.99981  5  5  0  0  677  0  1", below a heading in colour.
    std::istringstream lines(output);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        int cpu = -1;
        char hash = ' ';
        int periods = 0;
        if (!(words >> cpu >> hash >> periods) || hash != '#') {
            continue;
        }
        ProcessorNoise noise;
        if (!(words >> noise.runtime_us >> noise.noise_us >> noise.available_percent >> noise.max_period_us >>
              noise.max_single_us >> noise.hardware >> noise.nmi >> noise.interrupts >> noise.softirqs >>
              noise.threads)) {
            refuse("osnoise", "this is not a line of its table: " + line);
        }
        result.noise = noise;
    }
    if (!result.noise) {
        refuse("osnoise", "it has no line of a processor");
    }
}

constexpr std::array<PeerTool, 3> kPeerTools = {{
    {.name = "cyclictest",
     .program = "cyclictest",
     .package = "rt-tests",
     .tracer = "",
     .colour = "cyclictest",
     .once = false,
     .least_s = 1,
     .own_thread = true,
     .result_option = "--json=",
     .arguments = cyclictest_arguments,
     .parse = add_cyclictest},
    {.name = "timerlat",
     .program = "rtla",
     .package = "rtla",
     .tracer = "timerlat",
     .colour = "timerlat",
     .once = false,
     .least_s = 1,
     .own_thread = false,
     .result_option = "",
     .arguments = timerlat_arguments,
     .parse = add_timerlat},
    {.name = "osnoise",
     .program = "rtla",
     .package = "rtla",
     .tracer = "osnoise",
     .colour = "",
     .once = true,
     .least_s = 3,  // it prints what it found after each period of a second
     .own_thread = false,
     .result_option = "",
     .arguments = osnoise_arguments,
     .parse = add_osnoise},
}};

}  // namespace

std::span<const PeerTool> peer_tools() noexcept {
    return kPeerTools;
}

std::string missing_tracer(std::string_view tracer, const std::filesystem::path& tracefs) {
    if (tracer.empty()) {
        return "";
    }
    const std::filesystem::path file = tracefs / "available_tracers";
    std::ifstream stream(file);
    if (!stream) {
        return "the kernel's tracers cannot be read (" + file.string() +
               "): run it as root, where tracefs is mounted (sudo mount -t tracefs nodev " + tracefs.string() + ")";
    }
    for (std::string name; stream >> name;) {
        if (name == tracer) {
            return "";
        }
    }
    std::string option(tracer);
    std::transform(option.begin(), option.end(), option.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return "this kernel has no tracer " + std::string(tracer) + ": boot one that was built with CONFIG_" + option +
           "_TRACER, as Debian's are";
}

}  // namespace haptic::rt
