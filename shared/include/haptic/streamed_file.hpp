// Streamed file: a result that is written under its final name while a run goes on, so that a killed run leaves it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>

namespace haptic {

/// A text file that grows by whole lines. The first write that fails, for example on a full disk, ends it after the
/// last line that fits; the run goes on, and close() reports it. Not thread-safe.
class StreamedFile {
  public:
    /// Creates the file, or empties it. Throws std::runtime_error.
    explicit StreamedFile(const std::filesystem::path& file);
    StreamedFile(const StreamedFile&) = delete;
    StreamedFile& operator=(const StreamedFile&) = delete;
    ~StreamedFile();

    /// Appends lines to the file itself, without a buffer. False once a write has failed.
    bool append(std::string_view lines) noexcept;
    /// Throws std::runtime_error if a write failed.
    void close();

  private:
    void end(std::string_view written, int error) noexcept;

    std::filesystem::path file_;
    int descriptor_ = -1;
    std::uint64_t size_ = 0;  // bytes of whole lines
    std::error_code failure_;
};

}  // namespace haptic
