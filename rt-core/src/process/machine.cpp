#include "process/machine.hpp"

#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "process/cpu_list.hpp"

namespace haptic::rt {
namespace {

std::string_view trimmed(std::string_view text) {
    constexpr std::string_view blank = " \t\n";
    const std::size_t first = text.find_first_not_of(blank);
    return first == std::string_view::npos ? std::string_view()
                                           : text.substr(first, text.find_last_not_of(blank) - first + 1);
}

template <class Number>
std::optional<Number> whole_number(std::string_view text) {
    Number number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc{} || end != text.data() + text.size()) {
        return std::nullopt;
    }
    return number;
}

/// Processors that the next interrupt will be delivered to. The effective affinity is empty for an interrupt that was
/// never enabled or where the kernel does not know it, and outdated until the first interrupt after a change.
std::vector<int> delivered_to(const std::vector<int>& effective, const std::vector<int>& allowed) {
    std::vector<int> both;
    std::set_intersection(effective.begin(), effective.end(), allowed.begin(), allowed.end(), std::back_inserter(both));
    return both.empty() ? allowed : both;
}

constexpr int kThreadStarter = 2;  // id of kthreadd, parent of all other threads of the kernel

/// Parses /proc/PID/task/TID/stat (proc(5): name in parentheses; fields 4, 40 and 41 are ppid, rt_priority and policy).
std::optional<Thread> parse_thread(const std::string& stat) {
    const std::size_t open = stat.find('(');
    const std::size_t close = stat.rfind(')');  // a name may contain parentheses
    if (open == std::string::npos || close == std::string::npos || close < open) {
        return std::nullopt;
    }
    std::istringstream fields(stat.substr(close + 1));
    std::string field;
    int parent = 0;
    fields >> field >> parent;
    constexpr int next_field = 5;
    constexpr int priority_field = 40;
    for (int number = next_field; number < priority_field; ++number) {
        fields >> field;
    }
    Thread thread;
    int policy = 0;
    if (!(fields >> thread.priority >> policy)) {
        return std::nullopt;
    }
    thread.priority = policy == SCHED_FIFO || policy == SCHED_RR ? thread.priority : 0;
    thread.of_kernel = parent == kThreadStarter;
    thread.name = stat.substr(open + 1, close - open - 1);
    return thread;
}

bool accessible(const std::filesystem::path& file) {
    return access(file.c_str(), W_OK) == 0;
}

}  // namespace

Machine::Machine(std::filesystem::path root, MayWrite may_write, Wait wait)
    : root_(std::move(root)),
      may_write_(may_write ? std::move(may_write) : MayWrite(&accessible)),
      wait_(wait ? std::move(wait) : Wait([] { std::this_thread::sleep_for(kWait); })) {}

std::filesystem::path Machine::file(const std::string& absolute) const {
    return root_ / std::filesystem::path(absolute).relative_path();
}

std::vector<std::string> Machine::lines(const std::string& absolute) const {
    std::ifstream stream(file(absolute));
    std::vector<std::string> all;
    for (std::string one; std::getline(stream, one);) {
        all.push_back(one);
    }
    return all;
}

std::optional<std::string> Machine::line(const std::string& absolute) const {
    std::ifstream stream(file(absolute));
    std::string first;
    if (!std::getline(stream, first) && !stream.eof()) {
        return std::nullopt;
    }
    return std::string(trimmed(first));
}

std::optional<std::int64_t> Machine::number(const std::string& absolute) const {
    const std::optional<std::string> text = line(absolute);
    return text ? whole_number<std::int64_t>(*text) : std::nullopt;
}

std::vector<int> Machine::cpus(const std::string& absolute) const {
    return parse_cpu_list(line(absolute).value_or(std::string()));
}

std::optional<std::uint64_t> Machine::word_at(const std::string& absolute, std::int64_t offset) const {
    // One read of eight bytes: a register of a processor answers no other.
    const int descriptor = open(file(absolute).c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) {
        return std::nullopt;
    }
    std::uint64_t word = 0;
    const ssize_t count = pread(descriptor, &word, sizeof word, offset);
    close(descriptor);
    return count == static_cast<ssize_t>(sizeof word) ? std::optional(word) : std::nullopt;
}

std::vector<std::string> Machine::names(const std::string& absolute) const {
    std::vector<std::string> all;
    std::error_code ignored;
    for (std::filesystem::directory_iterator entry(file(absolute), ignored), end; !ignored && entry != end;
         entry.increment(ignored)) {
        all.push_back(entry->path().filename().string());
    }
    std::sort(all.begin(), all.end());
    return all;
}

bool Machine::has(const std::string& absolute) const {
    std::error_code ignored;
    return std::filesystem::exists(file(absolute), ignored);
}

std::string Machine::value_of(const std::string& absolute, const std::string& key) const {
    for (const std::string& one : lines(absolute)) {
        if (one.starts_with(key)) {
            return std::string(trimmed(std::string_view(one).substr(key.size())));
        }
    }
    return {};
}

std::vector<Interrupt> Machine::interrupts() const {
    std::vector<Interrupt> all;
    for (const std::string& name : names("/proc/irq")) {
        const std::optional<int> number = whole_number<int>(name);
        if (!number) {
            continue;  // default_smp_affinity
        }
        const std::string folder = "/proc/irq/" + name;
        Interrupt interrupt{*number, {}, {}};
        // Each handler has a folder of its name.
        for (const std::string& entry : names(folder)) {
            std::error_code ignored;
            if (std::filesystem::is_directory(file(folder) / entry, ignored)) {
                interrupt.handlers += (interrupt.handlers.empty() ? "" : ", ") + entry;
            }
        }
        interrupt.cpus = delivered_to(cpus(folder + "/effective_affinity_list"), cpus(folder + "/smp_affinity_list"));
        if (!interrupt.handlers.empty()) {
            all.push_back(std::move(interrupt));
        }
    }
    std::sort(all.begin(), all.end(), [](const Interrupt& a, const Interrupt& b) { return a.number < b.number; });
    return all;
}

std::vector<Thread> Machine::threads() const {
    std::vector<Thread> all;
    for (const std::string& process : names("/proc")) {
        if (!whole_number<int>(process)) {
            continue;
        }
        const std::string tasks = "/proc/" + process + "/task";
        for (const std::string& task : names(tasks)) {
            std::string folder = tasks;
            folder.append("/").append(task);
            std::optional<Thread> thread = parse_thread(line(folder + "/stat").value_or(std::string()));
            if (thread) {
                thread->id = whole_number<int>(task).value_or(0);
                thread->cpus = parse_cpu_list(value_of(folder + "/status", "Cpus_allowed_list:"));
                all.push_back(std::move(*thread));
            }
        }
    }
    std::sort(all.begin(), all.end(), [](const Thread& a, const Thread& b) { return a.id < b.id; });
    return all;
}

bool Machine::shows_every_process() const {
    const std::string id = std::to_string(kThreadStarter);
    const std::string folder = "/proc/" + id + "/task/" + id;
    const std::optional<Thread> starter = parse_thread(line(folder + "/stat").value_or(std::string()));
    return starter && starter->name == "kthreadd";
}

}  // namespace haptic::rt
