// Which functions a function may call, read from the machine code of static libraries.
//
// The disassembly of each object says which symbol each call, jump or address refers to; calls through a pointer are
// not seen, so that overriders of virtual functions have to be named as roots of their own.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace haptic::test {

class CallGraph {
  public:
    /// Runs objdump and nm. Throws std::runtime_error if either fails.
    CallGraph(const std::string& objdump, const std::string& nm, const std::vector<std::string>& archives);

    /// Symbols of functions whose demangled name, without its parameters, is this one.
    [[nodiscard]] std::vector<std::string> find(const std::string& qualified_name) const;

    struct Reach {
        std::set<std::string> functions;               // defined in the archives
        std::map<std::string, std::string> externals;  // symbol from elsewhere: the function that refers to it
    };
    [[nodiscard]] Reach reach(const std::vector<std::string>& roots) const;

  private:
    void read_symbols(const std::string& nm, const std::string& archive);
    void read_code(const std::string& objdump, const std::string& archive);

    std::map<std::string, std::set<std::string>> calls_;  // by function
    std::set<std::string> data_;                          // defined, and no code
};

/// The C++ name of a symbol; the symbol itself if it has none.
[[nodiscard]] std::string demangle(const std::string& symbol);

}  // namespace haptic::test
