// No command of rt-core writes over a file that it reads, or twice to one file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// A command line, in which DIR stands for the test's folder, and what its refusal must name.
struct Collision {
    const char* arguments;
    const char* file;
    const char* option;
    const char* other;
};

constexpr Collision kCollisions[] = {
    // A recording and the files beside it.
    {"run --device replay:DIR/run.csv --record DIR/run.new", "run.frames.csv", "--record DIR/run.new",
     "--device replay:DIR/run.csv"},
    {"run --device replay:DIR/run.csv --record DIR/run.csv", "run.csv", "--record DIR/run.csv",
     "--device replay:DIR/run.csv"},
    {"run --device replay:DIR/run.csv --report DIR/run.csv", "run.csv", "--report DIR/run.csv",
     "--device replay:DIR/run.csv"},
    {"run --device replay:DIR/run.csv --report DIR/run.config.toml", "run.config.toml", "--report DIR/run.config.toml",
     "--device replay:DIR/run.csv"},
    {"run --device replay:DIR/run.csv --report DIR/run.compliance.csv", "run.compliance.csv",
     "--report DIR/run.compliance.csv", "--device replay:DIR/run.csv"},
    {"run --config DIR/lab.config.toml --record DIR/lab.csv", "lab.config.toml", "--record DIR/lab.csv",
     "--config DIR/lab.config.toml"},
    // Other inputs.
    {"run --hand DIR/h.csv --report DIR/h.csv", "h.csv", "--report DIR/h.csv", "--hand DIR/h.csv"},
    {"run --hand DIR/h.csv --record DIR/link.csv", "link.csv", "--record DIR/link.csv", "--hand DIR/h.csv"},
    {"run --config DIR/c.toml --report DIR/c.toml", "c.toml", "--report DIR/c.toml", "--config DIR/c.toml"},
    {"run --set device.geometry=DIR/g.toml --report DIR/g.toml", "g.toml", "--report DIR/g.toml",
     "device.geometry=DIR/g.toml"},
    {"run --set device.geometry=DIR/g.toml --report DIR/g.protocol.json", "g.protocol.json",
     "--report DIR/g.protocol.json", "device.geometry=DIR/g.toml"},
    // Black boxes.
    {"run --report DIR/x.json --record DIR/x.fault.csv --fault unplug@0.1", "x.fault.csv", "--report DIR/x.json",
     "--record DIR/x.fault.csv"},
    {"run --hand DIR/y.fault.csv --report DIR/y.json --fault unplug@0.1", "y.fault.csv", "--report DIR/y.json",
     "--hand DIR/y.fault.csv"},
    {"run --hand DIR/y.killed.csv --record DIR/y.csv", "y.killed.csv", "--record DIR/y.csv", "--hand DIR/y.killed.csv"},
    // Two results.
    {"run --record DIR/new.csv --report DIR/./new.csv", "new.csv", "--record DIR/new.csv", "--report DIR/./new.csv"},
    {"run --record DIR/new.csv --report DIR/new.frames.csv", "new.frames.csv", "--record DIR/new.csv",
     "--report DIR/new.frames.csv"},
    {"measure --report DIR/m --html DIR/m", "m", "--report DIR/m", "--html DIR/m"},
    {"measure --report DIR/m --break-above 100 --trace DIR/m", "m", "--report DIR/m", "--trace DIR/m"},
    {"measure --html DIR/m --break-above 100 --trace DIR/m", "m", "--html DIR/m", "--trace DIR/m"},
    {"measure --hand DIR/h.csv --html DIR/h.csv", "h.csv", "--html DIR/h.csv", "--hand DIR/h.csv"},
    {"measure --from DIR/r.json --html DIR/r.json", "r.json", "--html DIR/r.json", "--from DIR/r.json"},
    {"measure --compare DIR/r.json DIR/s.json --report DIR/s.json", "s.json", "--report DIR/s.json",
     "--compare DIR/s.json"},
    {"measure --compare DIR/r.json DIR/s.json --html DIR/r.json", "r.json", "--html DIR/r.json",
     "--compare DIR/r.json"},
    {"calibrate --yes --out DIR/new.toml --record DIR/new.toml", "new.toml", "--record DIR/new.toml",
     "--out DIR/new.toml"},
    {"calibrate --yes --out DIR/lab.config.toml --record DIR/lab.csv", "lab.config.toml", "--record DIR/lab.csv",
     "--out DIR/lab.config.toml"},
    {"calibrate --yes --hand DIR/h.csv --record DIR/h.csv --out DIR/new.toml", "h.csv", "--record DIR/h.csv",
     "--hand DIR/h.csv"},
    {"calibrate --yes --fit DIR/run.csv --out DIR/run.csv", "run.csv", "--out DIR/run.csv", "--fit DIR/run.csv"},
    {"calibrate --yes --fit DIR/run.csv --out DIR/run.config.toml", "run.config.toml", "--out DIR/run.config.toml",
     "--fit DIR/run.csv"},
    // Commands without a run.
    {"doctor --config DIR/c.toml --json DIR/c.toml", "c.toml", "--json DIR/c.toml", "--config DIR/c.toml"},
    {"doctor --set device.geometry=DIR/g.toml --json DIR/g.protocol.json", "g.protocol.json",
     "--json DIR/g.protocol.json", "device.geometry=DIR/g.toml"},
    {"stability --rows 2 --columns 2 --config DIR/c.toml --out DIR", "stability.csv", "--out DIR",
     "--config DIR/c.toml"},
    {"stability --scene cloth-drop --config DIR/c.toml --out DIR", "hand-cloth-drop.csv", "--out DIR",
     "--config DIR/c.toml"},
    {"bringup --config DIR/c.toml --out DIR/c.toml", "c.toml", "--out DIR/c.toml", "--config DIR/c.toml"},
    {"bringup --config DIR/x.protocol.json --out DIR/x.toml", "x.protocol.json", "--out DIR/x.toml",
     "--config DIR/x.protocol.json"},
};

constexpr const char* kInputs[] = {"run.csv", "run.frames.csv", "run.compliance.csv", "lab.config.toml",
                                   "h.csv",   "c.toml",         "y.fault.csv",        "y.killed.csv",
                                   "r.json",  "s.json",         "run.config.toml"};

class RtCoreFiles : public testing::Test {
  protected:
    void SetUp() override {
        std::filesystem::create_directory(at("DIR"));
        for (const char* const input : kInputs) {
            const std::string name = input;
            std::ofstream(at("DIR/" + name)) << (name.ends_with(".json")  ? "{}\n"
                                                 : name.ends_with("toml") ? "[limits]\nforce = 1.0\n"
                                                                          : "time_s,x_m,y_m,z_m\n0,0,0,0\n9,0,0,0\n");
        }
        std::filesystem::copy_file(X3R, at("DIR/g.toml"));
        std::filesystem::create_symlink(at("DIR/h.csv"), at("DIR/link.csv"));
        std::filesystem::create_symlink(at("DIR/c.toml"), at("DIR/stability.csv"));
        std::filesystem::create_symlink(at("DIR/c.toml"), at("DIR/hand-cloth-drop.csv"));
    }
    void TearDown() override { EXPECT_THAT(segments_of(session), testing::IsEmpty()); }

    /// A text with DIR replaced by the folder.
    [[nodiscard]] std::string at(std::string text) const {
        for (std::size_t begin = 0; (begin = text.find("DIR", begin)) != std::string::npos;) {
            const std::string path = folder / "files";
            text.replace(begin, 3, path);
            begin += path.size();
        }
        return text;
    }
    [[nodiscard]] Finished rt_core(const std::string& arguments) const {
        std::vector<std::string> command = {RT_CORE};
        std::istringstream words(at(arguments));
        for (std::string word; words >> word;) {
            command.push_back(word);
        }
        if (command.at(1) == "run" ||
            (command.at(1) == "measure" && command.at(2) != "--from" && command.at(2) != "--compare")) {
            command.insert(command.end(), {"--session", session});
        }
        return run(command);
    }
    /// Contents of every file.
    [[nodiscard]] std::map<std::string, std::string> contents() const {
        std::map<std::string, std::string> files;
        for (const auto& entry : std::filesystem::directory_iterator(at("DIR"))) {
            std::ostringstream content;
            content << std::ifstream(entry.path()).rdbuf();
            files[entry.path().filename()] = content.str();
        }
        return files;
    }

    ScratchFolder folder;
    std::string session = unique_session();
};

TEST_F(RtCoreFiles, AreNeitherOverwrittenNorWrittenTwice) {
    const auto before = contents();
    for (const Collision& collision : kCollisions) {
        const Finished refused = rt_core(collision.arguments);
        EXPECT_EQ(refused.status, 1) << collision.arguments;
        EXPECT_THAT(refused.output,
                    AllOf(HasSubstr(std::string("/") + collision.file + ", which"), HasSubstr(at(collision.option)),
                          HasSubstr(at(collision.other)), HasSubstr("choose another name")))
            << collision.arguments;
        EXPECT_EQ(contents(), before) << collision.arguments;
    }
}

TEST_F(RtCoreFiles, MayHaveRelatedNames) {
    // Files beside one another, inputs named twice, and results that nobody keeps.
    for (const char* const arguments :
         {"run --duration 0.01 --hand DIR/h.csv --record DIR/new.csv --report DIR/new.json",
          "run --duration 0.01 --config DIR/c.toml --record DIR/c.csv --report DIR/c.json",
          "run --duration 0.01 --record /dev/null --report /dev/null",
          "run --device replay:DIR/new.csv --config DIR/new.config.toml --record DIR/again.csv",
          "run --device replay:DIR/y.fault.csv --report DIR/y.json", "measure --duration 0.01 --html DIR/m.html",
          "measure --compare DIR/r.json DIR/r.json --report DIR/both.json",
          "calibrate --fit DIR/run.csv --out "
          "DIR/run.toml --geometry DIR/run.toml"}) {
        EXPECT_THAT(rt_core(arguments).output, Not(HasSubstr("choose another name"))) << arguments;
    }
}

TEST_F(RtCoreFiles, AreNotPromisedInVain) {
    const Finished refused = rt_core("measure --from DIR/r.json --report DIR/new.json");
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.output, AllOf(HasSubstr("--report"), HasSubstr("--from shows an existing report")));
    const Finished fit = rt_core("calibrate --fit DIR/run.csv --record DIR/new.csv --out DIR/new.toml");
    EXPECT_EQ(fit.status, 1);
    EXPECT_THAT(fit.output, HasSubstr("new.csv: --fit fits an existing recording and makes no other"));
}

TEST_F(RtCoreFiles, AreNotTheBlackBoxItself) {
    const std::string box = "/dev/shm/haptic-" + std::to_string(geteuid()) + "-" + session + "-blackbox";
    const Finished refused = rt_core("black-box --session " + session + " --out " + box);
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.output, AllOf(HasSubstr(box + ", which --session"), HasSubstr("choose another name")));
}

TEST_F(RtCoreFiles, AreNotBegunForADurationThatNoClockHolds) {
    for (const char* const arguments :
         {"run --duration 1e10 --report DIR/new.json", "measure --duration 1e10 --report DIR/new.json",
          "measure --break-above 1e16 --report DIR/new.json"}) {
        const Finished refused = rt_core(arguments);
        EXPECT_NE(refused.status, 0) << arguments;
        EXPECT_THAT(refused.output, HasSubstr("must be a number above 0 and at most 1e+")) << arguments;
        EXPECT_FALSE(std::filesystem::exists(at("DIR/new.json")));
    }
}

}  // namespace
}  // namespace haptic::test
