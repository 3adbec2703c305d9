// The units of toolchain/deploy as systemd reads them, in a root of their own. Nothing is started.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "process.hpp"

namespace haptic::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class Deploy : public testing::Test {
  protected:
    void SetUp() override {
        if (run({"/bin/sh", "-c", "command -v systemd-analyze systemd-sysusers"}).status != 0) {
            GTEST_SKIP() << "systemd is not installed";
        }
        const std::filesystem::path root = folder / "root";
        for (const char* const part : {"usr/bin", "usr/sbin", "usr/lib/sysusers.d", "etc"}) {
            std::filesystem::create_directories(root / part);
        }
        for (const char* const program : {"usr/bin/rt-core", "usr/bin/host-sim", "usr/sbin/haptic-tune"}) {
            std::filesystem::copy_file("/bin/true", root / program);
        }
        // The units of systemd itself, which those refer to.
        const auto copied = std::filesystem::copy_options::recursive | std::filesystem::copy_options::copy_symlinks;
        std::filesystem::create_directories(root / "usr/lib/systemd");
        std::filesystem::copy("/lib/systemd/system", root / "usr/lib/systemd/system", copied);
        const auto replaced = std::filesystem::copy_options::overwrite_existing;
        for (const auto& unit : std::filesystem::directory_iterator(DEPLOY "/systemd")) {
            if (unit.path().extension() != ".service") {
                continue;
            }
            std::filesystem::copy_file(unit.path(), root / "usr/lib/systemd/system" / unit.path().filename(), replaced);
        }
        std::filesystem::copy_file(DEPLOY "/sysusers.d/haptic.conf", root / "usr/lib/sysusers.d/haptic.conf");
    }

    /// As an administrator does who wants the live view.
    void allow_view() {
        const std::filesystem::path change = folder / "root" / "etc/systemd/system/haptic-host-sim.service.d";
        std::filesystem::create_directories(change);
        std::filesystem::copy_file(DEPLOY "/systemd/view.conf", change / "view.conf");
    }
    /// Its scale is 0 to 10, times ten: 9.6 without any restriction, 2 and less is "OK".
    Finished security(const std::string& unit) {
        return run({"/usr/bin/env", "systemd-analyze", "--root=" + (folder / "root").string(), "--offline=true",
                    "--threshold=20", "security", unit});
    }

    ScratchFolder folder;
};

TEST_F(Deploy, UnitsAreAsSystemdWantsThem) {
    for (const char* const unit : {"haptic-rt-core.service", "haptic-host-sim.service", "haptic-tune.service"}) {
        const Finished verify = run(
            {"/usr/bin/env", "systemd-analyze", "--root=" + (folder / "root").string(), "--man=no", "verify", unit});
        EXPECT_EQ(verify.status, 0) << unit;
        EXPECT_THAT(verify.output, IsEmpty()) << unit;
    }
}

TEST_F(Deploy, TheServicePullsAtNothingUntilAPersonArmsIt) {
    // The options of the unit, and those of the installed file, which replace them.
    for (const char* const file : {DEPLOY "/systemd/haptic-rt-core.service", DEPLOY "/default/haptic-rt-core"}) {
        std::ifstream stream(file);
        std::string options;
        for (std::string line; std::getline(stream, line);) {
            options = line.find("RT_CORE_OPTIONS=") != std::string::npos && line.front() != '#' ? line : options;
        }
        EXPECT_THAT(options, HasSubstr("--set safety.arm=person")) << file;
    }
}

TEST_F(Deploy, ServicesAreExposedAsLittleAsSystemdCanSay) {
    for (const char* const unit : {"haptic-rt-core.service", "haptic-host-sim.service"}) {
        const Finished found = security(unit);
        EXPECT_EQ(found.status, 0) << found.output;
    }
}

TEST_F(Deploy, TheLiveViewMayListenForThisMachineOnlyAndNoMoreThanThat) {
    allow_view();
    const std::string unit = "haptic-host-sim.service";
    const Finished verify =
        run({"/usr/bin/env", "systemd-analyze", "--root=" + (folder / "root").string(), "--man=no", "verify", unit});
    EXPECT_THAT(verify.output, IsEmpty());
    const Finished found = security(unit);
    EXPECT_EQ(found.status, 0) << found.output;
    EXPECT_THAT(found.output, HasSubstr("Service defines IP address allow list with only localhost entries"));
}

TEST_F(Deploy, MakesOneUserForBothServices) {
    const Finished sysusers = run({"/usr/bin/env", "systemd-sysusers", "--root=" + (folder / "root").string()});
    EXPECT_EQ(sysusers.status, 0) << sysusers.output;
    const Finished users = run({"/bin/cat", folder / "root" / "etc/passwd"});
    EXPECT_THAT(users.output, HasSubstr("haptic:x:"));
    EXPECT_THAT(users.output, HasSubstr(":/var/lib/haptic:/usr/sbin/nologin"));
}

}  // namespace
}  // namespace haptic::test
