#include "haptic/external_program.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <string>

namespace haptic {
namespace {

TEST(ExternalProgram, PassesMoreTextThanAPipeHoldsInAndOut) {
    const std::string text(1'000'000, 'x');  // a pipe holds 65,536
    const ExternalResult result = run_external({"cat"}, text, "/");
    EXPECT_TRUE(result.found && result.succeeded);
    EXPECT_EQ(result.output, text);
}

TEST(ExternalProgram, KeepsOutputAndErrorsApartAndReportsTheStatus) {
    const ExternalResult result = run_external({"sh", "-c", "echo out; echo err >&2; exit 3"}, "", "/");
    EXPECT_TRUE(result.found);
    EXPECT_FALSE(result.succeeded);
    EXPECT_EQ(result.output, "out\n");
    EXPECT_EQ(result.errors, "err\n");
}

TEST(ExternalProgram, RunsInTheFolder) {
    EXPECT_EQ(run_external({"pwd"}, "", "/usr").output, "/usr\n");
}

TEST(ExternalProgram, IsNotFoundIfItIsNotInstalled) {
    const ExternalResult result = run_external({"no-program-of-this-name"}, "", "/");
    EXPECT_FALSE(result.found);
    EXPECT_FALSE(result.succeeded);
}

TEST(ExternalProgram, CanBeInterruptedEvenIfTheCallerBlocksSignals) {
    sigset_t interrupt;
    sigset_t before;
    sigemptyset(&interrupt);
    sigaddset(&interrupt, SIGINT);
    sigprocmask(SIG_BLOCK, &interrupt, &before);
    const ExternalResult result = run_external({"sh", "-c", "kill -INT $$; echo survived"}, "", "/");
    sigprocmask(SIG_SETMASK, &before, nullptr);
    EXPECT_FALSE(result.succeeded);
    EXPECT_EQ(result.output, "");
}

}  // namespace
}  // namespace haptic
