// Results: what a run writes at its end, each file independently of the others.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace haptic {

/// Calls `write`. The message of a std::exception that it throws then begins with the option that asked for the file.
void write_for(const std::string& option, const std::function<void()>& write);

class Results {
  public:
    /// Calls `write`, and keeps the message of a std::exception that it throws.
    void write(const std::function<void()>& write);
    /// What could not be written, in order.
    [[nodiscard]] const std::vector<std::string>& problems() const noexcept { return problems_; }
    /// Exit status of a run that ended with this one: kExitFailed if all went well but for a result.
    [[nodiscard]] int status(int of_run) const noexcept;

  private:
    std::vector<std::string> problems_;
};

}  // namespace haptic
