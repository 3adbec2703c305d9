#include "served/tty_server.hpp"

#include <fcntl.h>
#include <stdlib.h>  // NOLINT(modernize-deprecated-headers): posix_openpt and its friends
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <span>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace haptic::device {
namespace {

constexpr std::size_t kChunkBytes = 512;
// Faults can delay a reply: after input, the firmware is polled for a while.
constexpr std::int64_t kReplyPollNs = 500'000;
constexpr std::int64_t kReplyPollForNs = 200'000'000;

[[noreturn]] void fail(const char* what) {
    throw std::system_error(errno, std::generic_category(), what);
}

void close_if_open(int descriptor) noexcept {
    if (descriptor >= 0) {
        (void)close(descriptor);
    }
}

/// Passes bytes unchanged, for clients that do not set the terminal to raw mode.
void make_raw(int terminal) {
    termios settings{};
    if (tcgetattr(terminal, &settings) != 0) {
        fail("cannot read the settings of a pseudo terminal");
    }
    cfmakeraw(&settings);
    if (tcsetattr(terminal, TCSANOW, &settings) != 0) {
        fail("cannot make a pseudo terminal raw");
    }
}

}  // namespace

TtyServer::TtyServer(Firmware& firmware, std::optional<std::filesystem::path> link)
    : firmware_(&firmware), link_(std::move(link)) {
    try {
        master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
        std::array<char, 128> name{};
        if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0 ||
            ptsname_r(master_, name.data(), name.size()) != 0) {
            fail("cannot open a pseudo terminal");
        }
        path_ = name.data();
        slave_ = open(path_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
        if (slave_ < 0) {
            fail("cannot open the slave of a pseudo terminal");
        }
        make_raw(slave_);
        if (link_) {
            make_link(*link_);
        }
    } catch (...) {
        close_if_open(slave_);
        close_if_open(master_);
        throw;
    }
}

TtyServer::~TtyServer() {
    std::error_code ignored;
    if (link_ && std::filesystem::read_symlink(*link_, ignored) == path_) {
        std::filesystem::remove(*link_, ignored);
    }
    close_if_open(slave_);
    close_if_open(master_);
}

void TtyServer::make_link(const std::filesystem::path& link) const {
    std::error_code none;
    const std::filesystem::file_type there = std::filesystem::symlink_status(link, none).type();
    if (there == std::filesystem::file_type::symlink) {
        std::filesystem::remove(link);  // left by a server that was killed
    } else if (there != std::filesystem::file_type::not_found) {
        throw std::runtime_error(link.string() +
                                 " exists and is not a symbolic link: choose another name or remove it");
    }
    std::filesystem::create_symlink(path_, link);
}

void TtyServer::step(std::int64_t now_ns) {
    // Pass on all input, with the replies in between, so that the firmware's queue does not overflow.
    std::array<std::byte, kChunkBytes> chunk{};
    for (ssize_t count = read(master_, chunk.data(), chunk.size()); count > 0;
         count = read(master_, chunk.data(), chunk.size())) {
        last_input_ns_ = now_ns;
        due_ns_ = now_ns;
        if (firmware_->connected(now_ns)) {
            firmware_->receive(std::span<const std::byte>(chunk).first(static_cast<std::size_t>(count)), now_ns);
            send_replies(now_ns);
        }
    }
    // Poll for late replies until kReplyPollForNs after the last input.
    if (due_ns_) {
        send_replies(now_ns);
        due_ns_ = now_ns - last_input_ns_ < kReplyPollForNs ? std::optional(now_ns + kReplyPollNs) : std::nullopt;
    }
}

void TtyServer::send_replies(std::int64_t now_ns) {
    if (!firmware_->connected(now_ns)) {
        return;
    }
    std::array<std::byte, kChunkBytes> chunk{};
    for (std::size_t count = firmware_->reply(chunk, now_ns); count > 0; count = firmware_->reply(chunk, now_ns)) {
        if (write(master_, chunk.data(), count) < 0) {
            return;  // the terminal is full: nobody reads it
        }
    }
}

}  // namespace haptic::device
