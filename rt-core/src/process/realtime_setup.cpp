#include "process/realtime_setup.hpp"

#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "process/cpu_list.hpp"

namespace haptic::rt {
namespace {

std::string error_text(int error) {
    return std::system_category().message(error);
}

std::string setcap_command(const char* capabilities) {
    std::error_code ignored;
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", ignored);
    return "sudo setcap " + std::string(capabilities) + "+ep " + (ignored ? std::string("rt-core") : self.string());
}

std::string limits_line(const std::string& line) {
    return "or, for members of group haptic after the next login: echo '@haptic - " + line +
           "' | sudo tee -a /etc/security/limits.d/haptic.conf";
}

/// Processors that the calling thread may use, ascending.
std::vector<int> allowed_cpus() {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    std::vector<int> cpus;
    if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) {
        return cpus;
    }
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
        if (CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) {
            cpus.push_back(cpu);
        }
    }
    return cpus;
}

std::vector<int> listed_cpus(const char* file) {
    std::ifstream stream(file);
    std::string line;
    std::getline(stream, line);
    return parse_cpu_list(line);
}

/// The loop's processor for loop.cpu = -1.
int default_cpu() {
    return choose_cpu({.allowed = allowed_cpus(),
                       .online = listed_cpus("/sys/devices/system/cpu/online"),
                       .isolated = listed_cpus("/sys/devices/system/cpu/isolated")});
}

int try_to_pin(int cpu) {
    cpu_set_t set;
    CPU_ZERO(&set);
    if (cpu < CPU_SETSIZE) {
        CPU_SET(static_cast<std::size_t>(cpu), &set);
    }
    return pthread_setaffinity_np(pthread_self(), sizeof set, &set);
}

void pin(RealtimeSetup& setup, int cpu) {
    int wanted = cpu < 0 ? default_cpu() : cpu;
    int error = try_to_pin(wanted);
    if (const std::vector<int> allowed = allowed_cpus(); error != 0 && cpu < 0 && !allowed.empty()) {
        wanted = allowed.back();  // a cpuset excludes the isolated one
        error = try_to_pin(wanted);
    }
    if (error == 0) {
        setup.cpu = wanted;
        return;
    }
    setup.missing.push_back(
        {"not pinned to processor " + std::to_string(wanted) + ": " + error_text(error),
         "a processor that exists and that this process's cpuset allows",
         "--set loop.cpu=-1 selects an allowed one; taskset -p " + std::to_string(getpid()) + " lists them"});
}

void set_fifo(RealtimeSetup& setup, int priority) {
    sched_param parameters{};
    parameters.sched_priority = priority;
    const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
    if (error == 0) {
        setup.policy = "SCHED_FIFO";
        setup.priority = priority;
        return;
    }
    const std::string number = std::to_string(priority);
    // What watches the loop has to come before it.
    setup.missing.push_back({"not scheduled as SCHED_FIFO " + number + ": " + error_text(error),
                             "RLIMIT_RTPRIO above " + number + ", or CAP_SYS_NICE",
                             setcap_command("cap_sys_nice,cap_ipc_lock") + "; " +
                                 limits_line("rtprio " + std::to_string(kHighestPriority))});
}

/// Writes to each page of the stack that a tick may use, so that none faults later.
void touch_stack() {
    std::array<volatile unsigned char, kTouchedStackBytes> pages;  // NOLINT(*-member-init): only touched
    const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    for (std::size_t i = 0; i < pages.size(); i += page) {
        pages[i] = 0;
    }
}

}  // namespace

bool is_preempt_rt(const std::string& uname_version) {
    return uname_version.find("PREEMPT_RT") != std::string::npos;
}

std::string kernel_name() {
    utsname name{};
    return uname(&name) == 0 ? std::string(name.release) + " " + name.version : std::string("unknown");
}

void prepare_process(RealtimeSetup& setup) {
    setup.kernel = kernel_name();
    setup.preempt_rt = is_preempt_rt(setup.kernel);
    // Never return freed memory to the kernel, and never allocate with mmap(): both would cause page faults later.
    mallopt(M_TRIM_THRESHOLD, -1);
    mallopt(M_MMAP_MAX, 0);
    setup.memory_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    if (!setup.memory_locked) {
        const int error = errno;
        setup.missing.push_back(
            {"memory is not locked: " + error_text(error), "RLIMIT_MEMLOCK of unlimited, or CAP_IPC_LOCK",
             setcap_command("cap_sys_nice,cap_ipc_lock") + "; " + limits_line("memlock unlimited")});
    }
}

ScopedAffinity::ScopedAffinity(int cpu, Change change) {
    CPU_ZERO(&before_);
    if (cpu < 0 || cpu >= CPU_SETSIZE || sched_getaffinity(0, sizeof before_, &before_) != 0) {
        return;
    }
    cpu_set_t changed = before_;
    if (change == Change::Include) {
        CPU_SET(static_cast<std::size_t>(cpu), &changed);
    } else if (CPU_COUNT(&before_) > 1) {
        CPU_CLR(static_cast<std::size_t>(cpu), &changed);
    }
    changed_ = pthread_setaffinity_np(pthread_self(), sizeof changed, &changed) == 0;
}

ScopedAffinity::~ScopedAffinity() {
    if (changed_) {
        pthread_setaffinity_np(pthread_self(), sizeof before_, &before_);
    }
}

pthread_t create_thread(void* (*entry)(void*), void* argument, std::size_t stack_bytes, const char* what) {
    pthread_t thread{};
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error == 0) {
        error = pthread_attr_setstacksize(&attributes, stack_bytes);
        error = error == 0 ? pthread_create(&thread, &attributes, entry, argument) : error;
        pthread_attr_destroy(&attributes);
    }
    if (error != 0) {
        throw std::system_error(error, std::system_category(), what);
    }
    return thread;
}

int prepare_side_thread(int priority, int loop_cpu) {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    const int avoided = loop_cpu < 0 ? default_cpu() : loop_cpu;
    if (sched_getaffinity(0, sizeof allowed, &allowed) == 0 && avoided < CPU_SETSIZE && CPU_COUNT(&allowed) > 1) {
        CPU_CLR(static_cast<std::size_t>(avoided), &allowed);
        pthread_setaffinity_np(pthread_self(), sizeof allowed, &allowed);
    }
    // RLIMIT_RTPRIO may have been granted only up to the loop's own priority.
    for (const int wanted : {priority, priority - 1, priority - 2}) {
        sched_param parameters{};
        parameters.sched_priority = wanted;
        if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0) {
            return wanted;
        }
    }
    return 0;
}

void prepare_thread(RealtimeSetup& setup, int priority, int cpu) {
    touch_stack();
    pin(setup, cpu);
    set_fifo(setup, priority);
}

}  // namespace haptic::rt
