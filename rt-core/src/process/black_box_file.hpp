// Black box file: the memory of the black box as a file that survives the process.
//
// It is in /dev/shm, whose pages are never written to a disk. On another file system the kernel would write the pages
// back now and then and protect them meanwhile, and the next tick's store would wait for the file system. In return it
// does not survive the machine. All of it is allocated at the start, so that a full /dev/shm is an error then and no
// SIGBUS later. The file is locked as long as the process or its guard lives.
//
// An orderly end removes the file. What a killed process has left is saved as the usual CSV file by its guard, by the
// next run of the session or by `rt-core black-box`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace haptic::rt {

class BlackBoxFile {
  public:
    /// Creates the file. `csv`: where the ticks belong if the process is killed. Throws std::runtime_error if that is
    /// not possible, or if another process has the file; one that a killed process has left must be removed first.
    BlackBoxFile(const std::string& session, std::size_t bytes, const std::filesystem::path& csv);
    BlackBoxFile(const BlackBoxFile&) = delete;
    BlackBoxFile& operator=(const BlackBoxFile&) = delete;
    /// Removes the file.
    ~BlackBoxFile();

    [[nodiscard]] std::span<std::byte> memory() const noexcept;
    /// Holds the lock; share it with a process that is to save the ticks.
    [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
    /// Removes the file; the memory stays usable.
    void remove() noexcept;

    /// /dev/shm/haptic-UID-SESSION-blackbox
    [[nodiscard]] static std::filesystem::path path_of(const std::string& session);

  private:
    std::filesystem::path path_;
    int descriptor_ = -1;
    void* mapped_ = nullptr;
    std::size_t mapped_bytes_ = 0;
};

/// A black box that a killed process has left.
struct LeftBlackBox {
    std::filesystem::path csv;      // where its ticks belong
    std::filesystem::path file;     // to be removed once they are there
    std::vector<std::byte> memory;  // for BlackBox
};

/// Reads the file of a session; empty if there is none. Waits for the guard that may be saving it, at most
/// `max_wait_s`. Throws std::runtime_error if it cannot be read or is in use.
[[nodiscard]] std::optional<LeftBlackBox> read_left_black_box(const std::string& session, double max_wait_s);
/// Reads the file of an open descriptor, whose owner is gone.
[[nodiscard]] LeftBlackBox read_left_black_box(int descriptor);

}  // namespace haptic::rt
