// Machine: read-only access to /proc, /sys, /dev and /etc, below a root that need not be this machine's.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace haptic::rt {

/// An interrupt that has a handler.
struct Interrupt {
    int number = 0;
    std::string handlers;   // "xhci_hcd", "ahci, ehci"
    std::vector<int> cpus;  // processors it is delivered to, ascending
};

/// A thread of a process or of the kernel.
struct Thread {
    int id = 0;
    std::string name;        // truncated by the kernel to 15 characters
    int priority = 0;        // of SCHED_FIFO or SCHED_RR, 1..99; 0 for any other policy
    bool of_kernel = false;  // started by kthreadd, so no user chose its name
    std::vector<int> cpus;   // its affinity, ascending
};

/// Read-only view of a machine. No method throws: missing or unreadable files yield empty results.
class Machine {
  public:
    using MayWrite = std::function<bool(const std::filesystem::path&)>;
    using Wait = std::function<void()>;

    /// `root` is "/" or a folder with a copy of such a tree. `may_write` tells whether this process may write to a
    /// file; the default is access(2). `wait` lets counters grow; the default sleeps for kWait.
    explicit Machine(std::filesystem::path root = "/", MayWrite may_write = {}, Wait wait = {});

    static constexpr std::chrono::seconds kWait{1};

    /// Path below the root: file("/proc/cmdline").
    [[nodiscard]] std::filesystem::path file(const std::string& absolute) const;
    /// First line without surrounding white space; empty optional if the file cannot be read.
    [[nodiscard]] std::optional<std::string> line(const std::string& absolute) const;
    [[nodiscard]] std::vector<std::string> lines(const std::string& absolute) const;
    [[nodiscard]] std::optional<std::int64_t> number(const std::string& absolute) const;
    /// The CPU list in a file like /sys/devices/system/cpu/online.
    [[nodiscard]] std::vector<int> cpus(const std::string& absolute) const;
    /// Eight bytes at an offset of a file like /dev/cpu/0/msr, in the byte order of this machine.
    [[nodiscard]] std::optional<std::uint64_t> word_at(const std::string& absolute, std::int64_t offset) const;
    /// Names of the entries of a folder, sorted.
    [[nodiscard]] std::vector<std::string> names(const std::string& absolute) const;
    [[nodiscard]] bool has(const std::string& absolute) const;
    [[nodiscard]] bool may_write(const std::string& absolute) const { return may_write_(file(absolute)); }

    /// Rest of the first line that begins with `key`, in a file like /proc/self/status, without surrounding white
    /// space.
    [[nodiscard]] std::string value_of(const std::string& absolute, const std::string& key) const;
    /// Interrupts of /proc/irq that have handlers, by number.
    [[nodiscard]] std::vector<Interrupt> interrupts() const;
    /// Threads of all processes and of the kernel that are visible to this process, by id. A thread that ends meanwhile
    /// is left out.
    [[nodiscard]] std::vector<Thread> threads() const;
    /// True if the threads of the kernel are visible. They are root's, so a process that sees them sees all processes:
    /// proc(5), hidepid, hides what this process may not trace, and a PID namespace whatever is outside it.
    [[nodiscard]] bool shows_every_process() const;
    void wait() const { wait_(); }

  private:
    std::filesystem::path root_;
    MayWrite may_write_;
    Wait wait_;
};

}  // namespace haptic::rt
