// Arm socket: by which `rt-core arm` asks the rt-core of a session for its state, and arms it.
//
// A Unix domain socket beside the session's rings, /dev/shm/haptic-<uid>-<session>-arm, with mode 0600. Each packet of
// a client gets one packet as the answer. The kernel tells who the client is, and other users are refused.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace haptic::rt {

enum class ArmQuestion : std::uint8_t { Arm, State };

struct ArmAnswer {
    bool done = false;  // false: refused, and the text says why
    std::string text;
};

/// Path of a session's socket. Throws RingError::Kind::BadSessionName.
[[nodiscard]] std::filesystem::path arm_socket_path(const std::string& session);

class ArmServer {
  public:
    /// Opens the socket, in place of one that a killed process left: the rings allow one rt-core per session. Throws
    /// std::runtime_error.
    explicit ArmServer(const std::string& session);
    ArmServer(const ArmServer&) = delete;
    ArmServer& operator=(const ArmServer&) = delete;
    /// Removes it.
    ~ArmServer();

    /// Answers the clients that have asked. Never waits.
    void poll(const std::function<ArmAnswer(ArmQuestion)>& answer);

  private:
    struct Client {
        int descriptor;
        std::int64_t since_ns;
    };
    void accept_clients();
    /// Closes the client's connection if it was answered or has said nothing for too long.
    [[nodiscard]] bool serve(const Client& client, const std::function<ArmAnswer(ArmQuestion)>& answer);

    std::filesystem::path path_;
    int listener_ = -1;
    std::vector<Client> clients_;
};

/// Asks the rt-core of a session. Throws std::runtime_error if there is none or it does not answer.
[[nodiscard]] ArmAnswer ask_session(const std::string& session, ArmQuestion question);

}  // namespace haptic::rt
