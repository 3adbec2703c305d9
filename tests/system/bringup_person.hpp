// A person who brings up an emulated device: types at a pseudo terminal, holds keys, pulls strings, looks at them, and
// switches the motors' supply.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "emulated/uart_firmware.hpp"
#include "haptic/device/emulated_device.hpp"
#include "served/tty_server.hpp"

namespace haptic::test {

/// UART boards on a pseudo terminal, with the device behind them in this process.
class EmulatedLine {
  public:
    explicit EmulatedLine(device::EmulatedDevice::Settings settings);
    ~EmulatedLine();
    EmulatedLine(const EmulatedLine&) = delete;
    EmulatedLine& operator=(const EmulatedLine&) = delete;

    [[nodiscard]] std::string path() const { return server_.path(); }
    /// Does something with the device while no exchange is under way.
    template <typename Act>
    auto with(Act act) {
        const std::scoped_lock lock(mutex_);
        return act(device_);
    }
    [[nodiscard]] bool motors_at_zero();
    /// Largest magnitude of any DAC code so far.
    [[nodiscard]] int largest_code() const { return largest_code_; }

  private:
    void serve();

    std::mutex mutex_;
    device::EmulatedDevice device_;
    device::UartFirmware firmware_;
    device::TtyServer server_;
    std::atomic<int> largest_code_{0};
    std::atomic<bool> done_{false};
    std::thread thread_;
};

class BringupPerson {
  public:
    /// Starts the command at a terminal of its own.
    BringupPerson(EmulatedLine& line, const std::vector<std::string>& command);
    ~BringupPerson();
    BringupPerson(const BringupPerson&) = delete;
    BringupPerson& operator=(const BringupPerson&) = delete;

    /// Answers questions until the program ends, or a text appears. Returns the exit status; -1 if the text appeared,
    /// -2 after two minutes.
    int work(const std::string& until = "");
    /// Looks which string is tight now; remembers the last one.
    void look();
    /// Types.
    void type(const std::string& text) const;
    /// Types a space and waits for the time of a keyboard's repeat; false if the program has ended.
    bool repeat_key();
    void signal(int number) const;
    /// Reads what the program says for this long.
    bool listen(int milliseconds);
    /// Waits for the program's end.
    [[nodiscard]] int status();

    [[nodiscard]] const std::string& transcript() const { return transcript_; }
    [[nodiscard]] bool said(const std::string& text) const { return transcript_.find(text) != std::string::npos; }

    std::string name = "Ada Example";  // to sign with; empty: does not sign
    bool has_weight = false;  // hangs it to the first string that is to be weighed, for which a balance does else

  private:
    bool answer();
    [[nodiscard]] bool asked(const std::string& text);
    void hold_key();
    /// Holds the key until the tightest string carries the weight.
    void lift();

    EmulatedLine* line_;
    pid_t pid_ = -1;
    int terminal_ = -1;
    std::string transcript_;
    std::size_t answered_ = 0;  // position in the transcript up to which everything was answered
    std::size_t pulled_ = 0;    // string that was pulled out last
    int tight_ = -1;            // string that was tight when the counters were steady
    double newtons_ = 0.0;      // its motor pulled with
    bool loose_ = false;        // no string was tight any more at the end of the hold
};

}  // namespace haptic::test
