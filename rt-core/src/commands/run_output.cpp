#include "commands/run_output.hpp"

#include <spdlog/details/log_msg_buffer.h>
#include <spdlog/sinks/sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "process/crash_guard.hpp"
#include "process/realtime_setup.hpp"
#include "program/exit_status.hpp"

namespace haptic::rt {
namespace {

using LogLine = spdlog::details::log_msg_buffer;

// Time that output which nobody takes may cost at the end of a run.
constexpr std::chrono::seconds kOutputPatience{1};
// Log lines and texts that wait for their reader; further log lines are dropped, and counted.
constexpr std::size_t kMostQueued = 1000;

}  // namespace

/// What is to be written. The thread is the only one that takes from it, and the only one that writes.
struct RunOutput::Queue {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<std::variant<LogLine, std::string>> items;  // the first one stays until it is written
    std::size_t dropped = 0;                               // log lines that found the queue full, not yet reported
    bool ending = false;
    std::vector<spdlog::sink_ptr> sinks = spdlog::default_logger()->sinks();  // where the log goes
    std::string logger = spdlog::default_logger()->name();

    void push(const spdlog::details::log_msg& line) {
        const std::lock_guard lock(mutex);
        if (items.size() >= kMostQueued) {
            ++dropped;
            return;
        }
        note_dropped();
        items.emplace_back(LogLine(line));
        changed.notify_all();
    }
    /// Queues a line that says how many were dropped, where they are missing.
    void note_dropped() {
        if (const std::size_t lines = std::exchange(dropped, 0); lines > 0) {
            items.emplace_back(line_of(spdlog::level::warn, std::to_string(lines) + " lines of this log were dropped"));
        }
    }
    /// Waits until everything is written; false if that takes longer than this time.
    [[nodiscard]] bool wait_until_written(std::chrono::nanoseconds at_most) {
        std::unique_lock lock(mutex);
        return changed.wait_for(lock, at_most, [this] { return items.empty(); });
    }
    void write(const std::variant<LogLine, std::string>& item) const {
        if (const auto* const text = std::get_if<std::string>(&item)) {
            if (std::fputs(text->c_str(), stdout) < 0 || std::fflush(stdout) != 0) {
                report_failure(errno);
            }
            return;
        }
        for (const spdlog::sink_ptr& sink : sinks) {
            try {
                sink->log(std::get<LogLine>(item));
            } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): the line is lost, the run goes on
            }
        }
    }
    void report_failure(int error) const {
        // A reader that has seen enough, such as head, is no error.
        if (error == EPIPE) {
            std::clearerr(stdout);
            return;
        }
        // The end of the program reports that output is missing; the reason is known only here.
        write(line_of(spdlog::level::err, "standard output: " + std::generic_category().message(error)));
    }
    [[nodiscard]] LogLine line_of(spdlog::level::level_enum level, const std::string& text) const {
        return LogLine(spdlog::details::log_msg(logger, level, text));
    }
    void write_all() {
        std::unique_lock lock(mutex);
        while (true) {
            changed.wait(lock, [this] { return ending || !items.empty(); });
            if (items.empty()) {
                return;
            }
            // References into a deque stay valid while others append to it.
            const std::variant<LogLine, std::string>& item = items.front();
            lock.unlock();
            write(item);
            lock.lock();
            items.pop_front();
            if (items.empty()) {
                note_dropped();
            }
            changed.notify_all();
        }
    }
};

/// Takes the place of the log's sinks.
class RunOutput::QueueSink final : public spdlog::sinks::sink {
  public:
    explicit QueueSink(std::shared_ptr<Queue> queue) : queue_(std::move(queue)) {}
    void log(const spdlog::details::log_msg& line) override { queue_->push(line); }
    void flush() override {}
    // The sinks behind the queue keep their patterns.
    void set_pattern(const std::string& /*pattern*/) override {}
    void set_formatter(std::unique_ptr<spdlog::formatter> /*formatter*/) override {}

  private:
    std::shared_ptr<Queue> queue_;
};

RunOutput::RunOutput() : queue_(std::make_shared<Queue>()) {
    auto argument = std::make_unique<std::shared_ptr<Queue>>(queue_);
    thread_ = create_thread(&RunOutput::thread_entry, argument.get(), kSideStackBytes, "creating the output's thread");
    [[maybe_unused]] const auto* const owned_by_thread = argument.release();
    spdlog::default_logger()->sinks() = {std::make_shared<QueueSink>(queue_)};
}

RunOutput::~RunOutput() {
    if (!queue_->wait_until_written(kOutputPatience)) {
        // The log stays queued too: its next line would block this thread.
        pthread_detach(thread_);
        return;
    }
    spdlog::default_logger()->sinks() = queue_->sinks;
    {
        const std::lock_guard lock(queue_->mutex);
        queue_->ending = true;
    }
    queue_->changed.notify_all();
    pthread_join(thread_, nullptr);
}

void RunOutput::print(std::string text) {
    const std::lock_guard lock(queue_->mutex);
    queue_->items.emplace_back(std::move(text));
    queue_->changed.notify_all();
}

int RunOutput::finish(const StopSignals& signals, int status) const {
    bool written = queue_->wait_until_written(kOutputPatience);
    while (!written) {
        if (signals.stopped() || signals.wait(0) != 0) {
            _exit(status == kExitDone ? kExitFailed : status);
        }
        written = queue_->wait_until_written(std::chrono::nanoseconds(StopSignals::kPollNs));
    }
    return status;
}

void RunOutput::leave(int status) const {
    (void)queue_->wait_until_written(kOutputPatience);
    _exit(status);
}

void* RunOutput::thread_entry(void* queue) {
    const AlternateSignalStack signal_stack;
    const std::unique_ptr<std::shared_ptr<Queue>> owned(static_cast<std::shared_ptr<Queue>*>(queue));
    (*owned)->write_all();
    return nullptr;
}

}  // namespace haptic::rt
