#include "documents/completion.hpp"

#include <algorithm>
#include <string_view>

#include "joined.hpp"

namespace haptic {
namespace {

using detail::joined;

/// The name of a shell function: "rt-core" becomes "_rt_core".
std::string function_name(const std::string& program) {
    std::string name = "_" + program;
    std::replace(name.begin(), name.end(), '-', '_');
    return name;
}

/// Text within single quotes; `quote` is how the shell writes a single quote there.
std::string quoted(std::string_view text, std::string_view quote) {
    std::string out = "'";
    for (const char c : text) {
        out += c == '\'' ? std::string(quote) : std::string(1, c);
    }
    return out + "'";
}

/// The first sentence of a meaning, in one line.
std::string brief(std::string_view meaning) {
    std::string text(meaning.substr(0, meaning.find(". ")));
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
}

std::vector<std::string> option_names(const CommandText& command) {
    std::vector<std::string> names;
    for (const OptionText& option : command.options) {
        if (!option.positional) {
            names.insert(names.end(), option.names.begin(), option.names.end());
        }
    }
    return names;
}

std::vector<std::string> command_names(const CommandText& program) {
    std::vector<std::string> names;
    names.reserve(program.commands.size());
    for (const CommandText& command : program.commands) {
        names.push_back(command.name);
    }
    return names;
}

// bash

/// The possible values, as assignments to the variables that the script ends with.
std::string bash_value(const OptionText& option) {
    switch (option.kind) {
        case ValueKind::Words:
            return "words='" + joined(option.choices, " ") + "'";
        case ValueKind::Settings:
            return "words=$settings";
        case ValueKind::Folder:
            return "kind=-d";
        case ValueKind::File:
            return "kind=-f";
        case ValueKind::None:
        case ValueKind::Other:
            break;
    }
    return "kind=none";
}

void write_bash_command(std::string& out, const CommandText& command, const CompletionWords& words,
                        const std::string& indent) {
    out += indent + "options='" + joined(option_names(command), " ") + "'\n";
    std::string cases;
    std::string positional;
    for (const OptionText& option : command.options) {
        if (option.positional) {
            positional = option.kind == ValueKind::Words ? "words='" + joined(option.choices, " ") + "'"
                                                         : "kind=-f words='" + joined(words.names, " ") + "'";
        } else if (option.kind != ValueKind::None) {
            cases += indent + "    " + joined(option.names, " | ") + ") " + bash_value(option) + " ;;\n";
        }
    }
    if (!cases.empty()) {
        out += indent + "case $prev in\n" + cases;
        out += positional.empty() ? "" : indent + "    *) " + positional + " ;;\n";
        out += indent + "esac\n";
    } else if (!positional.empty()) {
        out += indent + positional + '\n';
    }
}

// zsh

std::string zsh_action(const OptionText& option, const std::string& function) {
    switch (option.kind) {
        case ValueKind::Words:
            return "(" + joined(option.choices, " ") + ")";
        case ValueKind::Settings:
            return function + "_settings";
        case ValueKind::Folder:
            return "_files -/";
        case ValueKind::File:
            return option.positional ? function + "_names" : "_files";
        case ValueKind::None:
        case ValueKind::Other:
            break;
    }
    return "";
}

/// Text within a specification of _arguments: brackets and colons have a meaning there.
std::string zsh_text(std::string_view text) {
    std::string out;
    for (const char c : text) {
        out += c == '[' || c == ']' || c == ':' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    }
    return out;
}

void write_zsh_options(std::string& out, const CommandText& command, const std::string& function,
                       const std::string& indent) {
    const auto add_argument = [&](const std::string& text) {
        out.append(indent).append(quoted(text, "'\\''")).append(" \\\n");
    };
    for (const OptionText& option : command.options) {
        const std::string value =
            ":" + zsh_text(option.value.empty() ? option.names[0] : option.value) + ":" + zsh_action(option, function);
        if (option.positional) {
            const std::string many = option.repeatable ? "*" : "";
            add_argument(many + ":" + zsh_text(option.names[0]) + ":" + zsh_action(option, function));
            continue;
        }
        for (const std::string& name : option.names) {
            add_argument((option.repeatable ? "*" : "") + name + "[" + zsh_text(brief(option.meaning)) + "]" +
                         (option.kind == ValueKind::None ? "" : (option.value_optional ? ":" : "") + value));
        }
    }
}

// fish

std::string fish_options(const std::string& program, const std::string& condition, const OptionText& option) {
    std::string out;
    for (const std::string& name : option.names) {
        const bool is_long = name.starts_with("--");
        out += "complete -c " + program + " -n " + quoted(condition, "\\'") + (is_long ? " -l " : " -s ") +
               name.substr(is_long ? 2 : 1);
        switch (option.kind) {
            case ValueKind::Words:
                out += " -x -a " + quoted(joined(option.choices, " "), "\\'");
                break;
            case ValueKind::Settings:
                out += " -x -a \"$" + function_name(program) + "_settings\"";
                break;
            case ValueKind::Folder:
                out += " -x -a '(__fish_complete_directories)'";
                break;
            case ValueKind::File:
                out += option.value_optional ? " -F" : " -r -F";
                break;
            case ValueKind::Other:
                out += option.value_optional ? "" : " -x";
                break;
            case ValueKind::None:
                break;
        }
        out += " -d " + quoted(brief(option.meaning), "\\'") + '\n';
    }
    return out;
}

}  // namespace

std::string bash_completion(const CommandText& program, const CompletionWords& words) {
    const std::string function = function_name(program.name);
    std::string out = "# bash completion for " + program.name +
                      "(1)                              -*- shell-script -*-\n" + function + "() {\n" +
                      // `line` holds the words of the command line, `words` the candidates.
                      "    local cur prev line cword command= options= words= kind= i\n"
                      "    _get_comp_words_by_ref -n '=:' -c cur -p prev -w line -i cword 2>/dev/null || return\n";
    out += "    local settings='" + joined(words.settings, " ") + "'\n";
    out += "    for ((i = 1; i < cword; i++)); do\n        case ${line[i]} in\n            " +
           joined(command_names(program), " | ") + ") command=${line[i]} && break ;;\n        esac\n    done\n";
    out += "    case $command in\n";
    for (const CommandText& command : program.commands) {
        out += "        " + command.name + ")\n";
        write_bash_command(out, command, words, "            ");
        out += "            ;;\n";
    }
    out += "        *)\n            words='" + joined(command_names(program), " ") + "'\n";
    write_bash_command(out, program, words, "            ");
    out += "            ;;\n    esac\n";
    out +=
        "    if [[ $cur == -* ]]; then\n"
        "        words=$options kind=\n"
        "    fi\n"
        "    COMPREPLY=()\n"
        "    if [[ -n $words ]]; then\n"
        "        mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$cur\")\n"
        "    fi\n"
        "    if [[ $kind == -[df] ]]; then\n"
        "        compopt -o filenames\n"
        "        mapfile -t -O \"${#COMPREPLY[@]}\" COMPREPLY < <(compgen \"$kind\" -- \"$cur\")\n"
        "    fi\n"
        "    # bash completes only what follows the last = of a word.\n"
        "    if [[ $cur == *=* && $COMP_WORDBREAKS == *=* ]]; then\n"
        "        COMPREPLY=(\"${COMPREPLY[@]#\"${cur%\"${cur##*=}\"}\"}\")\n"
        "    fi\n"
        "    if [[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *= ]]; then\n"
        "        compopt -o nospace\n"
        "    fi\n"
        "}\n";
    return out + "complete -F " + function + " " + program.name + '\n';
}

std::string zsh_completion(const CommandText& program, const CompletionWords& words) {
    const std::string function = function_name(program.name);
    std::string out = "#compdef " + program.name + "\n\n";
    out += function + "_settings() {\n    compadd -S '' -- " + joined(words.settings, " ") + "\n}\n\n";
    out += function + "_names() {\n";
    out += words.names.empty() ? "" : "    compadd -- " + joined(words.names, " ") + '\n';
    out += "    _files\n}\n\n" + function + "() {\n    local context state line\n    typeset -A opt_args\n";
    out += "    _arguments -C \\\n";
    write_zsh_options(out, program, function, "        ");
    out += "        '1: :->command' \\\n        '*:: :->arguments'\n    case $state in\n        command)\n";
    out += "            local -a commands\n            commands=(\n";
    for (const CommandText& command : program.commands) {
        out += "                " + quoted(command.name + ":" + brief(command.meaning), "'\\''") + '\n';
    }
    out += "            )\n            _describe command commands\n            ;;\n        arguments)\n";
    out += "            case $line[1] in\n";
    for (const CommandText& command : program.commands) {
        out += "                " + command.name + ")\n                    _arguments \\\n";
        write_zsh_options(out, command, function, "                        ");
        out.erase(out.size() - 3);  // the last " \\\n"
        out += "\n                    ;;\n";
    }
    return out + "            esac\n            ;;\n    esac\n}\n\n" + function + " \"$@\"\n";
}

std::string fish_completion(const CommandText& program, const CompletionWords& words) {
    std::string out = "# fish completion for " + program.name + "(1)\n";
    out += "set -g " + function_name(program.name) + "_settings " + joined(words.settings, " ") + '\n';
    out += "complete -c " + program.name + " -f\n";
    for (const OptionText& option : program.options) {
        if (!option.positional) {
            out += fish_options(program.name, "__fish_use_subcommand", option);
        }
    }
    for (const CommandText& command : program.commands) {
        out += "complete -c " + program.name + " -n __fish_use_subcommand -a " + command.name + " -d " +
               quoted(brief(command.meaning), "\\'") + '\n';
        const std::string condition = "__fish_seen_subcommand_from " + command.name;
        for (const OptionText& option : command.options) {
            if (!option.positional) {
                out += fish_options(program.name, condition, option);
                continue;
            }
            const std::vector<std::string>& names = option.choices.empty() ? words.names : option.choices;
            out += "complete -c " + program.name + " -n " + quoted(condition, "\\'") +
                   (option.choices.empty() ? " -F" : "") +
                   (names.empty() ? "" : " -a " + quoted(joined(names, " "), "\\'")) + '\n';
        }
    }
    return out;
}

}  // namespace haptic
