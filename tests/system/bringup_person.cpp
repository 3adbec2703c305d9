#include "bringup_person.hpp"

#include <poll.h>
#include <pthread.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <stdexcept>
#include <utility>

#include "haptic/clock.hpp"

namespace haptic::test {
namespace {

constexpr double kGravity = 9.80665;            // m/s^2, standard
constexpr double kWeight = 0.03;                // kg
constexpr double kTight = 0.05;                 // N
constexpr std::int64_t kRepeatNs = 33'000'000;  // of a keyboard
constexpr double kPulledOut = 0.05;             // m

constexpr int kPersonPriority = 5;
constexpr int kBoardPriority = 10;

/// Where it is allowed: other processes of the machine starve neither a board nor a person.
void be_prompt(int priority) {
    const sched_param parameters{.sched_priority = priority};
    (void)pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

}  // namespace

EmulatedLine::EmulatedLine(device::EmulatedDevice::Settings settings)
    : device_(std::move(settings)), firmware_(device_), server_(firmware_, {}), thread_([this] { serve(); }) {
    be_prompt(kPersonPriority);
}

EmulatedLine::~EmulatedLine() {
    done_ = true;
    thread_.join();
}

void EmulatedLine::serve() {
    be_prompt(kBoardPriority);
    while (!done_) {
        pollfd watched{server_.descriptor(), POLLIN, 0};
        poll(&watched, 1, 2);
        const std::scoped_lock lock(mutex_);
        server_.step(monotonic_now_ns());
        for (const std::int16_t code : device_.dac_codes()) {
            largest_code_ = std::max(largest_code_.load(), std::abs(static_cast<int>(code)));
        }
    }
}

bool EmulatedLine::motors_at_zero() {
    return with([](const device::EmulatedDevice& device) {
        return device.dac_codes() == std::array<std::int16_t, kStrings>{};
    });
}

BringupPerson::BringupPerson(EmulatedLine& line, const std::vector<std::string>& command) : line_(&line) {
    std::vector<std::string> copy = command;
    std::vector<char*> arguments;
    arguments.reserve(copy.size() + 1);
    for (std::string& one : copy) {
        arguments.push_back(one.data());
    }
    arguments.push_back(nullptr);
    pid_ = forkpty(&terminal_, nullptr, nullptr, nullptr);
    if (pid_ < 0) {
        throw std::runtime_error("no pseudo terminal to be had");
    }
    if (pid_ == 0) {
        setenv("TERM", "xterm", 1);
        execv(arguments[0], arguments.data());
        _exit(127);
    }
}

BringupPerson::~BringupPerson() {
    if (pid_ > 0) {
        kill(pid_, SIGKILL);
        waitpid(pid_, nullptr, 0);
    }
    close(terminal_);
}

void BringupPerson::type(const std::string& text) const {
    if (write(terminal_, text.data(), text.size()) < 0) {
        return;  // the program has ended
    }
}

bool BringupPerson::repeat_key() {
    type(" ");
    const std::int64_t until_ns = monotonic_now_ns() + kRepeatNs;
    for (std::int64_t left_ns = kRepeatNs; left_ns > 0; left_ns = until_ns - monotonic_now_ns()) {
        if (!listen(static_cast<int>(left_ns / 1'000'000) + 1)) {
            return false;
        }
    }
    return true;
}

void BringupPerson::signal(int number) const {
    kill(pid_, number);
}

bool BringupPerson::listen(int milliseconds) {
    pollfd watched{terminal_, POLLIN, 0};
    if (poll(&watched, 1, milliseconds) <= 0) {
        return true;
    }
    std::array<char, 4096> buffer{};
    const ssize_t count = read(terminal_, buffer.data(), buffer.size());
    if (count <= 0) {
        return false;  // EIO: nobody has the other end open
    }
    transcript_.append(buffer.data(), static_cast<std::size_t>(count));
    return true;
}

int BringupPerson::status() {
    while (listen(1000)) {
    }
    int state = 0;
    waitpid(pid_, &state, 0);
    pid_ = -1;
    return WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state);
}

int BringupPerson::work(const std::string& until) {
    const std::int64_t end_ns = monotonic_now_ns() + 120 * kNanosecondsPerSecond;
    while (monotonic_now_ns() < end_ns) {
        if (!listen(20)) {
            return status();
        }
        if (!until.empty() && said(until)) {
            return -1;
        }
        while (answer()) {
        }
    }
    return -2;
}

bool BringupPerson::asked(const std::string& text) {
    const std::size_t at = transcript_.find(text, answered_);
    if (at == std::string::npos) {
        return false;
    }
    answered_ = at + text.size();
    return true;
}

void BringupPerson::look() {
    line_->with([this](const device::EmulatedDevice& device) {
        const std::array<double, kStrings> tensions = device.string_tensions();
        const auto* const tightest = std::max_element(tensions.begin(), tensions.end());
        if (*tightest > kTight) {
            tight_ = static_cast<int>(tightest - tensions.begin());
            newtons_ = device.tensions()[static_cast<std::size_t>(tight_)];
        }
    });
}

void BringupPerson::hold_key() {
    // Repeats like a keyboard, until the program says that it is steady, or speaks of something else.
    const std::size_t begin = answered_;
    const auto heard = [&](const char* text) { return transcript_.find(text, begin) != std::string::npos; };
    const bool cuts_power = transcript_.rfind("switch the motors' supply off") + 60 > begin;
    tight_ = -1;
    for (int k = 0; k < 1000; ++k) {
        const bool goes_on = repeat_key();
        const bool steady = heard("steady: release");
        if (steady && cuts_power) {
            line_->with([](device::EmulatedDevice& device) { device.set_motor_power(false); });
            listen(100);
        }
        if (!steady || !cuts_power) {
            look();
        }
        if (steady && !cuts_power) {
            type("x");  // any other key releases at once
        }
        if (steady || heard("motor was cut") || heard("Did the string") || heard("Released too early") || !goes_on) {
            break;
        }
    }
    // A look at the strings after the supply was cut.
    loose_ = line_->with([](const device::EmulatedDevice& device) {
        const std::array<double, kStrings> tensions = device.string_tensions();
        return *std::max_element(tensions.begin(), tensions.end()) <= kTight;
    });
}

void BringupPerson::lift() {
    newtons_ = 0.0;
    while (newtons_ < kWeight * kGravity && repeat_key()) {
        look();
    }
    type("x");
}

bool BringupPerson::answer() {
    // Only the oldest question that is still open.
    const std::size_t from = answered_;
    for (std::size_t s = 0; s < kStrings; ++s) {
        if (asked("Pull string " + std::to_string(s) + " (")) {
            line_->with([s](device::EmulatedDevice& device) { device.pull_out(s, kPulledOut); });
            pulled_ = s;
            (void)listen(50);
            type("\n");
            return true;
        }
    }
    if (asked("press Enter.")) {
        line_->with([](device::EmulatedDevice& device) { device.set_motor_power(true); });
        type("\n");
        return true;
    }
    if (asked("hold the space bar until") || asked("hold the key, read the balance") ||
        asked("hold the key. After the ramp") || asked("Power cut: hold the key")) {
        hold_key();
        return true;
    }
    if (asked("? for a list:")) {
        type(tight_ >= 0 ? std::to_string(tight_) + "\n" : "n\n");
        return true;
    }
    if (asked("or s to skip:")) {
        type(std::exchange(has_weight, false) ? std::to_string(kWeight) + "\n" : "b\n");
        return true;
    }
    if (asked("when the weight just lifts.")) {
        lift();
        return true;
    }
    if (asked("newtons on the balance:")) {
        type(std::to_string(newtons_) + "\n");
        return true;
    }
    if (asked("before the time was over? [y/n]")) {
        type(loose_ ? "y\n" : "n\n");
        return true;
    }
    if (asked("loose at once? [y/n]")) {
        type(loose_ ? "y\n" : "n\n");
        return true;
    }
    if (asked("the supply came back? [y/n]")) {
        tight_ = -1;
        look();
        type(tight_ >= 0 ? "y\n" : "n\n");
        return true;
    }
    if (asked("Wind the string back and try again? (n keeps this result) [y/n]")) {
        line_->with([this](device::EmulatedDevice& device) { device.pull_out(pulled_, -kPulledOut); });
        type("y\n");
        return true;
    }
    if (asked("[y/n]")) {
        type("n\n");
        return true;
    }
    if (asked("leave the protocol unsigned:")) {
        type(name + "\n");
        return true;
    }
    if (asked("Type agree:")) {
        type("agree\n");
        return true;
    }
    answered_ = from;
    return false;
}

}  // namespace haptic::test
