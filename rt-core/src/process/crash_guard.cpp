#include "process/crash_guard.hpp"

#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <mutex>
#include <stdexcept>
#include <vector>

namespace haptic::rt {
namespace {

// What a mistake in the program raises: handled here whoever else would.
constexpr std::array kCrashes = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
// What others may send or a limit may raise, and ends a process that has said nothing else. The real-time signals too.
constexpr std::array kKillers = {SIGTRAP, SIGSYS,  SIGQUIT, SIGXCPU, SIGXFSZ, SIGALRM,  SIGVTALRM,
                                 SIGPROF, SIGUSR1, SIGUSR2, SIGIO,   SIGPWR,  SIGSTKFLT};
constexpr std::size_t kSignalStackBytes = std::size_t{64} << 10;

// A signal handler is given nothing but a number, so what it works on has to be global.
std::atomic<MotorGate*> guarded_gate{nullptr};
std::atomic<pid_t> closing_thread{0};
static_assert(std::atomic<MotorGate*>::is_always_lock_free && std::atomic<pid_t>::is_always_lock_free,
              "only then may a signal handler use them");

/// Once in the life of the process; whoever comes meanwhile waits a little for the zeros to be sent.
void close_gate() noexcept {
    MotorGate* const gate = guarded_gate.exchange(nullptr);
    if (gate != nullptr) {
        closing_thread.store(gettid());
        gate->close();
        closing_thread.store(0);
        return;
    }
    const pid_t other = closing_thread.load();
    if (other != 0 && other != gettid()) {  // the same thread: closing has crashed, and there is nothing to wait for
        const timespec a_little{0, 2 * MotorGate::kLongestWaitNs};
        nanosleep(&a_little, nullptr);
    }
}

extern "C" void send_zero_and_die(int signal) {
    close_gate();
    // Blocked while this handler runs, so that it takes effect on the return from here.
    std::signal(signal, SIG_DFL);
    std::raise(signal);
}

extern "C" void send_zero() {
    close_gate();
}

std::vector<int> fatal_signals() {
    std::vector<int> signals(kCrashes.begin(), kCrashes.end());
    std::vector<int> killers(kKillers.begin(), kKillers.end());
    for (int signal = SIGRTMIN; signal <= SIGRTMAX; ++signal) {
        killers.push_back(signal);
    }
    for (const int signal : killers) {
        // What somebody handles or ignores does not end the process. (Profilers and sanitizers handle some.)
        struct sigaction present{};
        if (sigaction(signal, nullptr, &present) == 0 && present.sa_handler == SIG_DFL) {
            signals.push_back(signal);
        }
    }
    return signals;
}

}  // namespace

CrashGuard::CrashGuard(MotorGate& gate) : signals_(fatal_signals()) {
    MotorGate* none = nullptr;
    if (!guarded_gate.compare_exchange_strong(none, &gate)) {
        throw std::logic_error("CrashGuard: the process already guards a board");
    }
    // They cannot be taken back, and do nothing while nothing is guarded.
    static std::once_flag once;
    std::call_once(once, [] {
        std::atexit(&send_zero);
        std::at_quick_exit(&send_zero);
    });
    struct sigaction action{};
    action.sa_handler = &send_zero_and_die;
    action.sa_flags = SA_ONSTACK;
    sigemptyset(&action.sa_mask);
    for (const int signal : signals_) {
        sigaction(signal, &action, nullptr);
    }
}

CrashGuard::~CrashGuard() {
    for (const int signal : signals_) {
        std::signal(signal, SIG_DFL);
    }
    guarded_gate.store(nullptr);
}

AlternateSignalStack::AlternateSignalStack() : memory_(std::make_unique<std::byte[]>(kSignalStackBytes)) {
    stack_t stack{};
    stack.ss_sp = memory_.get();
    stack.ss_size = kSignalStackBytes;
    sigaltstack(&stack, nullptr);
}

AlternateSignalStack::~AlternateSignalStack() {
    stack_t none{};
    none.ss_flags = SS_DISABLE;
    sigaltstack(&none, nullptr);
}

}  // namespace haptic::rt
