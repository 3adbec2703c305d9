// Shell completion scripts of a program, for bash, zsh and fish.
#pragma once

#include <string>
#include <vector>

#include "documents/command_text.hpp"

namespace haptic {

/// Words for values that depend on the program: assignments after --set, and names in place of a file.
struct CompletionWords {
    std::vector<std::string> settings;  // "solver.step=", "contact.method=thesis"
    std::vector<std::string> names;     // for positional arguments beside files: built-in scenes
};

[[nodiscard]] std::string bash_completion(const CommandText& program, const CompletionWords& words);
[[nodiscard]] std::string zsh_completion(const CommandText& program, const CompletionWords& words);
[[nodiscard]] std::string fish_completion(const CommandText& program, const CompletionWords& words);

}  // namespace haptic
