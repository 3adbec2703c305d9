#include "call_graph.hpp"

#include <cxxabi.h>

#include <array>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <functional>
#include <memory>
#include <sstream>
#include <stdexcept>

namespace haptic::test {
namespace {

// On x86-64 an instruction-relative reference counts from the end of its four bytes.
#if defined(__x86_64__)
constexpr std::int64_t kBias = 4;
#else
constexpr std::int64_t kBias = 0;
#endif

void each_line(const std::string& command, const std::function<void(const std::string&)>& take) {
    // The command consists of paths chosen by the build.
    FILE* const pipe = popen(command.c_str(), "r");  // NOLINT(bugprone-command-processor)
    if (pipe == nullptr) {
        throw std::runtime_error("cannot run: " + command);
    }
    std::array<char, 8192> buffer{};
    while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr) {
        std::string line(buffer.data());
        while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) {
            line.pop_back();
        }
        take(line);
    }
    if (pclose(pipe) != 0) {
        throw std::runtime_error("failed: " + command);
    }
}

/// Splits "name+0x12", "name-0x4" or "name" into the name and the addend.
std::string without_addend(const std::string& text, std::int64_t* addend = nullptr) {
    const std::size_t sign = text.find_last_of("+-");
    if (sign == std::string::npos || text.compare(sign + 1, 2, "0x") != 0) {
        return text;
    }
    if (addend != nullptr) {
        *addend = std::strtoll(text.c_str() + sign + 1, nullptr, 16) * (text[sign] == '-' ? -1 : 1);
    }
    return text.substr(0, sign);
}

std::string in_angles(const std::string& line) {
    const std::size_t open = line.rfind('<');
    const std::size_t close = line.rfind('>');
    return open == std::string::npos || close == std::string::npos || close < open
               ? std::string()
               : line.substr(open + 1, close - open - 1);
}

/// The code of one object file of an archive, as printed by objdump.
struct Object {
    struct Reference {
        std::string from;
        std::string section;  // of the target, if only section and offset are known
        std::int64_t offset;
    };
    std::map<std::string, std::map<std::int64_t, std::string>> functions;  // by section and address
    std::vector<Reference> references;

    /// Turns references to section offsets into calls of the functions there.
    void resolve(std::map<std::string, std::set<std::string>>& calls) const {
        for (const Reference& reference : references) {
            const auto section = functions.find(reference.section);
            if (section == functions.end()) {
                continue;
            }
            auto after = section->second.upper_bound(reference.offset);
            if (after != section->second.begin()) {
                calls[reference.from].insert((--after)->second);
            }
        }
    }
};

}  // namespace

std::string demangle(const std::string& symbol) {
    int status = 0;
    const std::unique_ptr<char, decltype(&std::free)> name(
        abi::__cxa_demangle(symbol.c_str(), nullptr, nullptr, &status), &std::free);
    return status == 0 ? std::string(name.get()) : symbol;
}

CallGraph::CallGraph(const std::string& objdump, const std::string& nm, const std::vector<std::string>& archives) {
    for (const std::string& archive : archives) {
        read_symbols(nm, archive);
        read_code(objdump, archive);
    }
}

void CallGraph::read_symbols(const std::string& nm, const std::string& archive) {
    each_line(nm + " --defined-only '" + archive + "'", [this](const std::string& line) {
        std::istringstream words(line);
        std::string address;
        std::string type;
        std::string name;
        if (words >> address >> type >> name && std::string("TtWwi").find(type) == std::string::npos) {
            data_.insert(name);
        }
    });
}

void CallGraph::read_code(const std::string& objdump, const std::string& archive) {
    Object object;
    std::string section;
    std::string function;
    std::string pending;  // target of the last instruction, unless a relocation follows
    const auto take_pending = [&] {
        if (!pending.empty() && pending != function) {
            calls_[function].insert(pending);
        }
        pending.clear();
    };
    each_line(objdump + " -dr --no-show-raw-insn '" + archive + "'", [&](const std::string& line) {
        // "\t\t\t1b2: R_X86_64_PLT32\tname-0x4" from binutils, the same with other spaces from LLVM.
        const std::size_t relocation = line.starts_with('\t') ? line.find(" R_") : std::string::npos;
        if (relocation != std::string::npos) {
            pending.clear();
            const std::size_t name = line.find_first_of("\t ", relocation + 1);
            std::int64_t addend = 0;
            const std::string target = without_addend(line.substr(line.find_first_not_of("\t ", name)), &addend);
            if (target.starts_with(".text")) {
                object.references.push_back({function, target, addend + kBias});
            } else if (!target.starts_with(".")) {
                calls_[function].insert(target);
            }
            return;
        }
        take_pending();
        if (line.find("file format") != std::string::npos) {
            object.resolve(calls_);
            object = Object();
        } else if (line.starts_with("Disassembly of section ")) {
            section = line.substr(23, line.size() - 24);
        } else if (line.ends_with(">:")) {
            function = in_angles(line);
            calls_[function];
            object.functions[section][std::strtoll(line.c_str(), nullptr, 16)] = function;
        } else if (!function.empty()) {
            pending = without_addend(in_angles(line));
        }
    });
    take_pending();
    object.resolve(calls_);
}

std::vector<std::string> CallGraph::find(const std::string& qualified_name) const {
    std::vector<std::string> found;
    for (const auto& [symbol, unused] : calls_) {
        const std::string name = demangle(symbol);
        // Parts split off by the compiler: "f() [clone .cold]".
        if (name == qualified_name || name.starts_with(qualified_name + "(")) {
            found.push_back(symbol);
        }
    }
    return found;
}

CallGraph::Reach CallGraph::reach(const std::vector<std::string>& roots) const {
    Reach result;
    std::deque<std::string> waiting(roots.begin(), roots.end());
    result.functions.insert(roots.begin(), roots.end());
    while (!waiting.empty()) {
        const std::string function = waiting.front();
        waiting.pop_front();
        for (const std::string& target : calls_.at(function)) {
            if (calls_.contains(target)) {
                if (result.functions.insert(target).second) {
                    waiting.push_back(target);
                }
            } else if (!data_.contains(target)) {
                result.externals.emplace(target, function);
            }
        }
    }
    return result;
}

}  // namespace haptic::test
