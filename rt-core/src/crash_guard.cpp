#include "haptic/rt/crash_guard.hpp"

#include <array>
#include <atomic>
#include <csignal>
#include <stdexcept>

#include "haptic/clock.hpp"

namespace haptic::rt {
namespace {

constexpr std::array kFatalSignals = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
constexpr std::size_t kSignalStackBytes = std::size_t{64} << 10;

// A signal handler is given nothing but a number, so what it works on has to be global.
std::atomic<device::Board*> guarded_board{nullptr};
static_assert(std::atomic<device::Board*>::is_always_lock_free, "only then may a signal handler use it");

extern "C" void send_zero_and_die(int signal) {
    // exchange: a second crash, in here or in another thread, goes straight to its end.
    device::Board* const board = guarded_board.exchange(nullptr);
    if (board != nullptr) {
        board->zero_motors(monotonic_now_ns());
    }
    // The default action took this handler's place when it was called (SA_RESETHAND).
    std::raise(signal);
}

}  // namespace

CrashGuard::CrashGuard(device::Board& board) {
    device::Board* none = nullptr;
    if (!guarded_board.compare_exchange_strong(none, &board)) {
        throw std::logic_error("CrashGuard: the process already guards a board");
    }
    struct sigaction action{};
    action.sa_handler = &send_zero_and_die;
    action.sa_flags = static_cast<int>(SA_RESETHAND | SA_ONSTACK);
    sigemptyset(&action.sa_mask);
    for (const int signal : kFatalSignals) {
        sigaction(signal, &action, nullptr);
    }
}

CrashGuard::~CrashGuard() {
    for (const int signal : kFatalSignals) {
        std::signal(signal, SIG_DFL);
    }
    guarded_board.store(nullptr);
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
