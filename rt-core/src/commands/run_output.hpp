// Output of a run: a thread that writes the log and the results, in order. A standard output or error that blocks, such
// as a pipe whose reader has stopped, then holds up neither the loop nor the thread that stops it.
#pragma once

#include <pthread.h>

#include <memory>
#include <string>

#include "commands/stop_signals.hpp"

namespace haptic::rt {

class RunOutput {
  public:
    /// Starts the thread. From here on spdlog's default logger only queues its lines. Throws std::system_error.
    RunOutput();
    RunOutput(const RunOutput&) = delete;
    RunOutput& operator=(const RunOutput&) = delete;
    /// Waits a second at most until everything is written. What blocks longer is left to the end of the process.
    ~RunOutput();

    /// Queues a text for standard output.
    void print(std::string text);
    /// Waits until everything is written, and returns `status`. If that takes more than a second, a stop signal, even
    /// one that came before, ends the process, with status 1 in place of 0: for the end of a command, when nothing is
    /// left to do.
    [[nodiscard]] int finish(const StopSignals& signals, int status) const;
    /// Ends the process without any destructor, after waiting a second at most until everything is written.
    [[noreturn]] void leave(int status) const;

  private:
    struct Queue;
    class QueueSink;
    static void* thread_entry(void* queue);

    std::shared_ptr<Queue> queue_;  // shared with the thread, which may outlive this object
    pthread_t thread_{};
};

}  // namespace haptic::rt
