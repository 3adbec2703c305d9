#include "process/arm_socket.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <future>
#include <stdexcept>
#include <string>
#include <vector>

#include "tick_rig.hpp"

namespace haptic::rt {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

class ArmSocket : public testing::Test {
  protected:
    /// Asks in another thread, while this one serves.
    ArmAnswer ask(ArmServer& server, ArmQuestion question) {
        std::future<ArmAnswer> answer = std::async(std::launch::async, ask_session, session, question);
        while (answer.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
            server.poll([this](ArmQuestion asked) { return answer_to(asked); });
        }
        return answer.get();
    }
    ArmAnswer answer_to(ArmQuestion asked) {
        return asked == ArmQuestion::State ? ArmAnswer{.done = true, .text = "disarmed"}
                                           : ArmAnswer{.done = ready, .text = ready ? "armed" : "already armed"};
    }

    std::string session = test::unique_session();
    bool ready = true;
};

TEST_F(ArmSocket, BringsTheQuestionAndItsAnswer) {
    ArmServer server(session);
    EXPECT_EQ(ask(server, ArmQuestion::State).text, "disarmed");
    EXPECT_TRUE(ask(server, ArmQuestion::Arm).done);
    ready = false;
    const ArmAnswer refused = ask(server, ArmQuestion::Arm);
    EXPECT_FALSE(refused.done);
    EXPECT_EQ(refused.text, "already armed");
}

TEST_F(ArmSocket, IsForItsUserOnlyAndGoesWithItsServer) {
    const std::filesystem::path path = arm_socket_path(session);
    {
        const ArmServer server(session);
        struct stat status{};
        ASSERT_EQ(lstat(path.c_str(), &status), 0);
        EXPECT_TRUE(S_ISSOCK(status.st_mode));
        EXPECT_EQ(status.st_mode & 07777U, 0600U);
    }
    EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(ArmSocket, RefusesAnotherUser) {
    if (geteuid() != 0) {
        GTEST_SKIP() << "only root can become another user";
    }
    ArmServer server(session);
    const std::filesystem::path path = arm_socket_path(session);
    std::filesystem::permissions(path, std::filesystem::perms::all);  // so that the kernel lets it connect
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
        const int fd = socket(AF_UNIX, SOCK_SEQPACKET, 0);
        char answer = 0;
        const bool asked = setuid(65534) == 0 &&
                           connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                           send(fd, "arm", 3, MSG_NOSIGNAL) == 3;
        _exit(asked && recv(fd, &answer, 1, 0) == 1 && answer == '+' ? 1 : 0);
    }
    bool asked = false;
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) {
        server.poll([&asked](ArmQuestion) {
            asked = true;
            return ArmAnswer{.done = true, .text = ""};
        });
    }
    EXPECT_FALSE(asked);
    EXPECT_EQ(status, 0);
}

TEST_F(ArmSocket, ReplacesTheSocketThatAKilledProcessLeft) {
    const pid_t child = fork();
    if (child == 0) {
        const ArmServer server(session);
        _exit(0);  // without the destructor, as SIGKILL does
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_TRUE(std::filesystem::exists(arm_socket_path(session)));
    EXPECT_THAT([&] { (void)ask_session(session, ArmQuestion::Arm); },
                ThrowsMessage<std::runtime_error>(HasSubstr("no rt-core runs in session \"" + session + "\"")));
    ArmServer server(session);
    EXPECT_TRUE(ask(server, ArmQuestion::Arm).done);
}

TEST_F(ArmSocket, NamesASessionThatDoesNotExistAndAProcessThatDoesNotAnswer) {
    EXPECT_THAT([&] { (void)ask_session(session, ArmQuestion::State); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(session), HasSubstr("no rt-core"))));
    const ArmServer silent(session);
    EXPECT_THAT([&] { (void)ask_session(session, ArmQuestion::State); },
                ThrowsMessage<std::runtime_error>(HasSubstr("does not answer")));
}

TEST_F(ArmSocket, IsNotHeldUpByClientsThatSayNothing) {
    ArmServer server(session);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, arm_socket_path(session).c_str(), sizeof address.sun_path - 1);
    std::vector<int> silent;
    for (int k = 0; k < 8; ++k) {
        silent.push_back(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
        ASSERT_EQ(connect(silent.back(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    }
    // Each is dropped after a second, and the ninth is answered.
    EXPECT_TRUE(ask(server, ArmQuestion::Arm).done);
    for (const int fd : silent) {
        close(fd);
    }
}

}  // namespace
}  // namespace haptic::rt
