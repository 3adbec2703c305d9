// Peer tools: other programs that measure what a processor does to a real-time thread. `rt-core measure` runs them in
// the pauses of the loop, on its processor with its policy, priority and period, so that its report shows both.
//
// A tool is one entry of peer_tools(): its command, and the parser of what it prints. Everything else, from the command
// line to the page, goes through that table.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/histogram.hpp"
#include "measure/kernel_trace.hpp"
#include "process/realtime_setup.hpp"

namespace haptic::rt {

/// What took a processor from a thread that would use it all the time, as rtla's osnoise reports it.
struct ProcessorNoise {
    double runtime_us = 0.0;  // observed
    double noise_us = 0.0;    // as long as the thread did not have the processor
    double available_percent = 0.0;
    double max_period_us = 0.0;  // most noise in one period of the tool
    double max_single_us = 0.0;  // longest single noise
    std::uint64_t hardware = 0;  // noises without an interrupt or thread: firmware, hypervisor
    std::uint64_t nmi = 0;
    std::uint64_t interrupts = 0;
    std::uint64_t softirqs = 0;
    std::uint64_t threads = 0;
};

/// What a tool found, over all its turns.
struct PeerResult {
    std::string command;
    std::string missing;                  // why it was not run, and what to do; empty if it was
    std::string failure;                  // why it was not run again; empty if every turn succeeded
    Histogram wakeup;                     // ns, of its thread, from the expiry of its timer
    Histogram interrupt;                  // ns, of the interrupt of that timer, if the tool measures it
    std::uint64_t beyond = 0;             // wake-ups beyond the tool's histogram; in `wakeup` with its maximum
    std::optional<ProcessorNoise> noise;  // of a tool that measures no wake-ups
};

/// One turn of a tool: how the loop's thread is scheduled, and for how long.
struct PeerTurn {
    const RealtimeSetup& setup;
    std::int64_t period_ns;
    int duration_s;  // whole seconds, as the tools require
};

struct PeerTool {
    std::string_view name;     // on the command line, in the report and in text
    std::string_view program;  // searched in PATH
    std::string_view package;  // of Debian, that has it
    std::string_view tracer;   // of the kernel, that it needs; empty: none
    std::string_view colour;   // of its curve: a quantity of plot.gp
    bool once;                 // runs in the first pause only
    int least_s;               // of a turn
    bool own_thread;           // measures with a thread of its own, which must be allowed on the loop's processor;
                               // otherwise with the kernel's, on every processor unless the loop has one
    std::string_view result_option;  // names the file of its result, such as "--json="; empty: it prints the result
    std::vector<std::string> (*arguments)(const PeerTurn& turn);
    /// Adds the result of one turn. Throws std::runtime_error if it cannot be understood.
    void (*parse)(const std::string& output, PeerResult& result);
};

/// cyclictest (rt-tests), and timerlat and osnoise (rtla), in the order of their turns.
[[nodiscard]] std::span<const PeerTool> peer_tools() noexcept;

/// Why the kernel does not let this process use a tracer, and what to do about it; empty if it does.
[[nodiscard]] std::string missing_tracer(std::string_view tracer,
                                         const std::filesystem::path& tracefs = KernelTrace::kTracefs);

}  // namespace haptic::rt
