// Pseudo terminal as a serial line with a peer, for tests.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>  // NOLINT(modernize-deprecated-headers): posix_openpt and its friends
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>

#include "bytes.hpp"

namespace haptic::device::test {

class Pty {
  public:
    Pty() : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
        std::array<char, 64> name{};
        if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0 ||
            ptsname_r(master_, name.data(), name.size()) != 0) {
            throw std::runtime_error("no pseudo terminal to be had");
        }
        path_ = name.data();
    }
    Pty(const Pty&) = delete;
    Pty& operator=(const Pty&) = delete;
    ~Pty() { hang_up(); }

    [[nodiscard]] const std::string& path() const noexcept { return path_; }

    void write(const Bytes& bytes) const {
        if (::write(master_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
            throw std::runtime_error("the pseudo terminal takes nothing");
        }
    }
    /// Reads this many bytes, or fewer if none arrives for a second.
    [[nodiscard]] Bytes read(std::size_t count) const {
        Bytes all;
        while (all.size() < count && wait(1000)) {
            std::array<std::byte, 256> part{};
            const ssize_t got = ::read(master_, part.data(), std::min(part.size(), count - all.size()));
            if (got <= 0) {
                break;
            }
            all.insert(all.end(), part.begin(), part.begin() + got);
        }
        return all;
    }
    [[nodiscard]] bool wait(int milliseconds) const {
        pollfd watched{master_, POLLIN, 0};
        return poll(&watched, 1, milliseconds) == 1 && (watched.revents & POLLIN) != 0;
    }
    void hang_up() {
        if (master_ >= 0) {
            close(master_);
            master_ = -1;
        }
    }

  private:
    int master_;
    std::string path_;
};

/// Peer at the far end of a pseudo terminal, in a separate thread.
class FarEnd {
  public:
    /// `answer` maps received bytes to the reply.
    FarEnd(const Pty& pty, std::function<Bytes(const Bytes&)> answer)
        : thread_([this, &pty, answer = std::move(answer)] {
              while (!done_) {
                  if (pty.wait(5)) {
                      Bytes in;
                      while (pty.wait(0)) {
                          const Bytes more = pty.read(1);
                          if (more.empty()) {
                              return;
                          }
                          in.insert(in.end(), more.begin(), more.end());
                      }
                      const Bytes out = answer(in);
                      if (!out.empty()) {
                          pty.write(out);
                      }
                  }
              }
          }) {}
    FarEnd(const FarEnd&) = delete;
    FarEnd& operator=(const FarEnd&) = delete;
    ~FarEnd() {
        done_ = true;
        thread_.join();
    }

  private:
    std::atomic<bool> done_{false};
    std::thread thread_;
};

}  // namespace haptic::device::test
