#include "measure/kernel_trace.hpp"

#include <unistd.h>

#include <charconv>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "haptic/types.hpp"

namespace haptic::rt {
namespace {

// Of each processor: a tenth of a second of a busy one, until the late tick is noticed, and what was before it.
constexpr int kBufferKilobytes = 8192;

/// Writes a value to a file of the kernel; false if it refuses.
bool put(const std::filesystem::path& file, const std::string& value) {
    std::ofstream stream(file);
    stream << value << std::flush;
    return stream.good();
}

/// Nanoseconds of "30833.157886" at a place of a text; -1 if there is no such number.
std::int64_t seconds_at(const std::string& text, std::size_t at) {
    const char* const end = text.data() + text.size();
    std::int64_t whole = 0;
    const auto [dot, whole_error] = std::from_chars(text.data() + at, end, whole);
    if (whole_error != std::errc{} || dot == end || *dot != '.') {
        return -1;
    }
    std::int64_t part_ns = 0;
    const auto [rest, part_error] = std::from_chars(dot + 1, end, part_ns);
    constexpr std::ptrdiff_t nano_digits = 9;
    const std::ptrdiff_t digits = rest - (dot + 1);
    if (part_error != std::errc{} || digits > nano_digits) {
        return -1;
    }
    for (std::ptrdiff_t k = digits; k < nano_digits; ++k) {
        part_ns *= 10;
    }
    return whole * kNanosecondsPerSecond + part_ns;
}

}  // namespace

std::size_t processor_in(const std::string& line) noexcept {
    const auto is_digit = [&](std::size_t at) { return line[at] >= '0' && line[at] <= '9'; };
    for (std::size_t at = line.find(" ["); at != line.npos; at = line.find(" [", at + 1)) {
        if (at + 1 + kProcessorLength <= line.size() && is_digit(at + 2) && is_digit(at + 3) && is_digit(at + 4) &&
            line[at + 5] == ']' && line[at + 6] == ' ') {
            return at + 1;
        }
    }
    return line.npos;
}

std::int64_t time_of_line(const std::string& line) {
    // "  comm-pid  [cpu] flags seconds: event: ...".
    const std::size_t processor = processor_in(line);
    if (processor == line.npos) {
        return -1;
    }
    const std::size_t flags = line.find_first_not_of(' ', processor + kProcessorLength);
    const std::size_t time = line.find_first_not_of(' ', line.find(' ', flags));
    return time == line.npos ? -1 : seconds_at(line, time);
}

KernelTrace::KernelTrace(const std::filesystem::path& tracefs)
    : instance_(tracefs / "instances" / ("rt-core-" + std::to_string(getpid()))) {
    // A folder in `instances` is a buffer of its own, so that other users of the tracer are not disturbed.
    std::error_code error;
    if (!std::filesystem::create_directory(instance_, error)) {
        throw std::runtime_error("--break-above: the kernel's tracer cannot be used (" + instance_.string() + ": " +
                                 (error ? error.message() : std::string("exists")) +
                                 "); it needs root and tracefs: sudo mount -t tracefs nodev " + kTracefs);
    }
    const bool ready = put(instance_ / "tracing_on", "0") && put(instance_ / "trace_clock", "mono") &&
                       put(instance_ / "buffer_size_kb", std::to_string(kBufferKilobytes)) &&
                       enable("sched/sched_switch") && enable("sched/sched_waking") &&
                       enable("irq/irq_handler_entry") && enable("irq/irq_handler_exit") &&
                       put(instance_ / "tracing_on", "1");
    if (!ready) {
        std::filesystem::remove(instance_, error);
        throw std::runtime_error("--break-above: the kernel's tracer in " + instance_.parent_path().string() +
                                 " lacks the events or the clock that are needed; Debian's kernels have them");
    }
}

KernelTrace::~KernelTrace() {
    stop();
    std::error_code ignored;
    std::filesystem::remove(instance_, ignored);
}

bool KernelTrace::enable(const std::string& event, const std::string& filter) const {
    const std::filesystem::path folder = instance_ / "events" / event;
    return (filter.empty() || put(folder / "filter", filter)) && put(folder / "enable", "1");
}

void KernelTrace::follow(int thread) {
    const std::string only = "common_pid == " + std::to_string(thread);
    // The end of a page fault is not recorded: the next system call tells that it is over. Both or none.
    if (enable("raw_syscalls/sys_enter", only)) {
        (void)enable("exceptions/page_fault_user", only);  // of x86 only
    }
    (void)enable("syscalls/sys_enter_futex", only);
}

void KernelTrace::stop() noexcept {
    (void)put(instance_ / "tracing_on", "0");
}

std::string KernelTrace::lines(std::int64_t from_ns, std::int64_t to_ns) const {
    std::ifstream stream(instance_ / "trace");
    std::string text;
    for (std::string line; std::getline(stream, line);) {
        const std::int64_t at_ns = time_of_line(line);
        if (at_ns >= from_ns && at_ns <= to_ns) {
            text += line + "\n";
        }
    }
    return text;
}

}  // namespace haptic::rt
