// A machine as its files show it: /proc, /sys, /dev and /etc, under a root that need not be this machine's.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

/// A line of interrupts that has a handler.
struct Interrupt {
    int number = 0;
    std::string handlers;   // "xhci_hcd", "ahci, ehci"
    std::vector<int> cpus;  // where it is delivered, ascending
};

/// A thread of SCHED_FIFO or SCHED_RR.
struct RealtimeThread {
    int id = 0;
    std::string name;       // at most 15 characters, as the kernel keeps it
    int priority = 0;       // 1..99
    std::vector<int> cpus;  // that it may use, ascending
};

/// Reads, and never writes. What is not there, or may not be read, is empty: no method throws for it.
class Machine {
  public:
    using MayWrite = std::function<bool(const std::filesystem::path&)>;

    /// `root` is "/", or a folder with a tree like it. `may_write` says whether this process may write to a file;
    /// by default access(2) does.
    explicit Machine(std::filesystem::path root = "/", MayWrite may_write = {});

    /// The path of a file of the machine: file("/proc/cmdline").
    [[nodiscard]] std::filesystem::path file(const std::string& absolute) const;
    /// The first line; nothing if the file cannot be read.
    [[nodiscard]] std::optional<std::string> line(const std::string& absolute) const;
    [[nodiscard]] std::vector<std::string> lines(const std::string& absolute) const;
    [[nodiscard]] std::optional<std::int64_t> number(const std::string& absolute) const;
    /// Processors in a file like /sys/devices/system/cpu/online.
    [[nodiscard]] std::vector<int> cpus(const std::string& absolute) const;
    /// What a folder holds, in alphabetical order.
    [[nodiscard]] std::vector<std::string> names(const std::string& absolute) const;
    [[nodiscard]] bool has(const std::string& absolute) const;
    [[nodiscard]] bool may_write(const std::string& absolute) const { return may_write_(file(absolute)); }

    /// The rest of the line of /proc/self/status or the like that begins with `key`, without spaces around it.
    [[nodiscard]] std::string value_of(const std::string& absolute, const std::string& key) const;
    /// Those of /proc/irq that have handlers, ascending.
    [[nodiscard]] std::vector<Interrupt> interrupts() const;
    /// Those of all processes and of the kernel, ascending; of one that ends meanwhile nothing.
    [[nodiscard]] std::vector<RealtimeThread> realtime_threads() const;

  private:
    std::filesystem::path root_;
    MayWrite may_write_;
};

}  // namespace haptic::rt
