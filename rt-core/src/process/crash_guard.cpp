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

// Raised by program errors; always handled here, replacing any other handler.
constexpr std::array kCrashSignals = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
// Sent by others or raised by resource limits; fatal by default. The real-time signals belong to them too.
constexpr std::array kFatalByDefault = {SIGTRAP, SIGSYS,  SIGQUIT, SIGXCPU, SIGXFSZ, SIGALRM,  SIGVTALRM,
                                        SIGPROF, SIGUSR1, SIGUSR2, SIGIO,   SIGPWR,  SIGSTKFLT};
constexpr std::size_t kSignalStackBytes = std::size_t{64} << 10;

// Global, because a signal handler receives nothing but a number.
std::atomic<MotorGate*> guarded_gate{nullptr};
std::atomic<pid_t> closing_thread{0};
static_assert(std::atomic<MotorGate*>::is_always_lock_free && std::atomic<pid_t>::is_always_lock_free,
              "a signal handler may only use lock-free atomics");

/// Closes the guarded gate, once in the life of the process. A second thread waits a bounded time for the zeros to be
/// sent. Async-signal-safe.
void close_gate() noexcept {
    // The first thread that fails closes the gate. It says so before it takes it, so that no other ends the process.
    const pid_t self = gettid();
    pid_t closing = 0;
    if (closing_thread.compare_exchange_strong(closing, self)) {
        if (MotorGate* const gate = guarded_gate.exchange(nullptr)) {
            gate->close();
        }
        closing_thread.store(0);
        return;
    }
    // Another thread is closing the gate: ending the process now would cut its exchange short.
    if (closing != self) {  // in the same thread close() itself has crashed: nothing to wait for
        const timespec wait{0, 2 * MotorGate::kLongestWaitNs};
        nanosleep(&wait, nullptr);
    }
}

extern "C" void send_zero_and_die(int signal) {
    close_gate();
    // The signal is blocked while this handler runs; the default action takes effect when it returns.
    std::signal(signal, SIG_DFL);
    std::raise(signal);
}

extern "C" void send_zero() {
    close_gate();
}

std::vector<int> fatal_signals() {
    // Crash signals always; the optional ones only where nobody handles them.
    std::vector<int> signals(kCrashSignals.begin(), kCrashSignals.end());
    std::vector<int> optional(kFatalByDefault.begin(), kFatalByDefault.end());
    for (int signal = SIGRTMIN; signal <= SIGRTMAX; ++signal) {
        optional.push_back(signal);
    }
    for (const int signal : optional) {
        // A signal that is handled or ignored does not end the process; profilers and sanitizers handle some.
        struct sigaction present{};
        if (sigaction(signal, nullptr, &present) == 0 && present.sa_handler == SIG_DFL) {
            signals.push_back(signal);
        }
    }
    return signals;
}

}  // namespace

CrashGuard::CrashGuard(MotorGate& gate) : signals_(fatal_signals()) {
    // One gate per process, because the handlers are global.
    MotorGate* none = nullptr;
    if (!guarded_gate.compare_exchange_strong(none, &gate)) {
        throw std::logic_error("CrashGuard: the process already guards a board");
    }
    // Exit handlers cannot be removed again; they do nothing while no gate is guarded.
    static std::once_flag once;
    std::call_once(once, [] {
        std::atexit(&send_zero);
        std::at_quick_exit(&send_zero);
    });
    // Handlers run on the alternate stack, so that a stack overflow can be handled.
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
