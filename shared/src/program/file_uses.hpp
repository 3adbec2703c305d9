// Files that a command reads and writes. No result may destroy an input or another result.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace haptic {

/// Lists the files of a command, to be checked before it opens any of them. Empty names are ignored; so are devices and
/// pipes, which several options may share.
class FileUses {
  public:
    /// A file that an option names. `option`: what precedes the name on the command line, as in "--record " or
    /// "--device replay:".
    void reads(const std::string& option, const std::optional<std::filesystem::path>& file);
    void writes(const std::string& option, const std::optional<std::filesystem::path>& file);
    /// A file whose name is derived. `given`: the option with its value, as in "--record run.csv".
    void also_reads(const std::string& given, const std::filesystem::path& file);
    void also_writes(const std::string& given, const std::filesystem::path& file);

    /// Throws std::invalid_argument if a file that is written is also read or written through another option, by
    /// whatever path or link. The message names both options and the file.
    void require_distinct() const;

  private:
    struct Use {
        std::string given;
        std::filesystem::path file;
        bool written;
        bool derived;
    };
    void add(Use use);
    [[nodiscard]] static bool same_file(const Use& a, const Use& b);

    std::vector<Use> uses_;
};

}  // namespace haptic
