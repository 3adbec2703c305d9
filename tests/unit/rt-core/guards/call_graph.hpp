// Call graph of static libraries: which functions a function may call, read from their machine code.
//
// The disassembly of each object gives the symbol that each call, jump or address refers to. Calls through pointers are
// not seen, so overriders of virtual functions must be listed as roots of their own.
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

    /// Symbols of the functions with this demangled name, without parameters.
    [[nodiscard]] std::vector<std::string> find(const std::string& qualified_name) const;

    struct Reach {
        std::set<std::string> functions;               // defined in the archives
        std::map<std::string, std::string> externals;  // undefined symbol: a function that refers to it
    };
    [[nodiscard]] Reach reach(const std::vector<std::string>& roots) const;

  private:
    void read_symbols(const std::string& nm, const std::string& archive);
    void read_code(const std::string& objdump, const std::string& archive);

    std::map<std::string, std::set<std::string>> calls_;  // by caller
    std::set<std::string> data_;                          // defined symbols that are not code
};

/// The C++ name of a symbol, or the symbol itself if it has none.
[[nodiscard]] std::string demangle(const std::string& symbol);

}  // namespace haptic::test
