// Record file: text that a thread of its own writes while a run goes on, so that a slow disk delays no step and a
// killed run leaves what it had done.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <future>
#include <mutex>
#include <string>
#include <string_view>

#include "haptic/streamed_file.hpp"

namespace haptic::sim {

class RecordFile {
  public:
    /// Creates the file, or empties it. Throws std::runtime_error.
    explicit RecordFile(const std::filesystem::path& file);
    RecordFile(const RecordFile&) = delete;
    RecordFile& operator=(const RecordFile&) = delete;
    ~RecordFile();

    /// Whole lines, which are in the file within a quarter of a second. Does not wait for the disk.
    void append(std::string_view lines);
    /// Writes the rest. Throws std::runtime_error if the file is incomplete, for example because the disk is full.
    void close();

  private:
    void write_until_closed();
    void end_writer();

    StreamedFile file_;  // of the thread, until it has ended
    std::mutex mutex_;
    std::condition_variable wake_;
    std::string pending_;  // guarded by mutex_
    bool closing_ = false;
    std::future<void> writer_;
};

}  // namespace haptic::sim
