// UART motor boards that hang on a pseudo terminal: for any program that opens a serial line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "emulated/firmware.hpp"
#include "usbip/server.hpp"

namespace haptic::device {

/// Feeds a firmware with what is written to the terminal, and writes what it answers. The speed that a client sets has
/// no meaning; answers that nobody fetches get lost once the terminal is full, as on a real line. While the firmware's
/// cable is out nothing goes either way.
class TtyServer final : public Server {
  public:
    /// The firmware must outlive the server. `link` becomes a symbolic link to the terminal, in place of one that may
    /// be there, and is removed with the server. Throws std::system_error where there is no terminal to be had, and
    /// std::runtime_error where `link` is something else already.
    TtyServer(Firmware& firmware, std::optional<std::filesystem::path> link);
    TtyServer(const TtyServer&) = delete;
    TtyServer& operator=(const TtyServer&) = delete;
    ~TtyServer() override;

    [[nodiscard]] int descriptor() const noexcept override { return master_; }
    [[nodiscard]] std::optional<std::int64_t> due_ns() const override { return due_ns_; }
    void step(std::int64_t now_ns) override;

    /// What a client opens: /dev/pts/N.
    [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

  private:
    void make_link(const std::filesystem::path& link) const;
    void answer(std::int64_t now_ns);

    Firmware* firmware_;
    std::optional<std::filesystem::path> link_;
    std::filesystem::path path_;
    int master_ = -1;
    int slave_ = -1;  // kept open: a terminal that no client has open would always be "hung up"
    std::int64_t last_input_ns_ = 0;
    std::optional<std::int64_t> due_ns_;
};

}  // namespace haptic::device
