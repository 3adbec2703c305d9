// TTY server: emulated UART motor boards on a pseudo terminal, for any program that opens a serial line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "emulated/firmware.hpp"
#include "served/server.hpp"

namespace haptic::device {

/// Passes the bytes written to the terminal to a firmware, and writes its replies back. The baud rate that a client
/// sets has no effect. Replies that nobody reads are lost once the terminal's buffer is full, as on a real line. While
/// the firmware's cable is unplugged, nothing passes in either direction.
class TtyServer final : public Server {
  public:
    /// The firmware must outlive the server. `link` becomes a symbolic link to the terminal, replaces an existing link
    /// and is removed with the server. Throws std::system_error if no terminal is available, and std::runtime_error if
    /// `link` exists and is not a symbolic link.
    TtyServer(Firmware& firmware, std::optional<std::filesystem::path> link);
    TtyServer(const TtyServer&) = delete;
    TtyServer& operator=(const TtyServer&) = delete;
    ~TtyServer() override;

    [[nodiscard]] int descriptor() const noexcept override { return master_; }
    [[nodiscard]] std::optional<std::int64_t> due_ns() const override { return due_ns_; }
    void step(std::int64_t now_ns) override;

    /// Path that a client opens: /dev/pts/N.
    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

  private:
    void make_link(const std::filesystem::path& link) const;
    void send_replies(std::int64_t now_ns);

    Firmware* firmware_;
    std::optional<std::filesystem::path> link_;
    std::filesystem::path path_;
    int master_ = -1;
    int slave_ = -1;  // kept open: without an open slave the master reports a hang-up
    std::int64_t last_input_ns_ = 0;
    std::optional<std::int64_t> due_ns_;
};

}  // namespace haptic::device
