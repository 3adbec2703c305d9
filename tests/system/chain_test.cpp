// The real processes with real clocks, joined by real shared memory: what a user does, and what goes wrong for users.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "haptic/csv.hpp"
#include "process.hpp"
#include "unique_session.hpp"

namespace haptic::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kForceLimit = 8.0;  // N, rt-core's default limit of the wrench

nlohmann::json read_json(const std::filesystem::path& file) {
    return nlohmann::json::parse(std::ifstream(file));
}

std::vector<std::string> rt_core(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), RT_CORE);
    return arguments;
}

std::vector<std::string> host_sim(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), HOST_SIM);
    return arguments;
}

/// Size of the force on the hand over an interval of a record, N.
std::vector<double> force_sizes(const CsvTable& record, double from_s, double to_s) {
    const auto time = record.column("time_s");
    const auto x = record.column("fx_n");
    const auto y = record.column("fy_n");
    const auto z = record.column("fz_n");
    std::vector<double> sizes;
    for (std::size_t i = 0; i < record.rows(); ++i) {
        if (time[i] >= from_s && time[i] < to_s) {
            sizes.push_back(std::hypot(x[i], y[i], z[i]));
        }
    }
    return sizes;
}

double largest(const std::vector<double>& values) {
    return values.empty() ? std::nan("") : *std::max_element(values.begin(), values.end());
}

class Chain : public testing::Test {
  protected:
    /// rt-core on the emulated device, once its loop is running.
    Process start_rt_core(const std::string& name = "rt-core") {
        return Process(rt_core({"run", "--device", "emulated", "--session", session_, "--duration", "60", "--report",
                                folder_ / (name + ".json"), "--record", folder_ / (name + ".csv")}),
                       folder_ / (name + ".log"));
    }
    Process start_host_sim(const std::string& name, const std::string& duration_s) {
        return Process(
            host_sim({"run", "cloth-drop", "--clock", "real", "--session", session_, "--duration", duration_s,
                      "--verify", "--report", folder_ / (name + ".json"), "--record", folder_ / (name + ".csv")}),
            folder_ / (name + ".log"));
    }

    ScratchFolder folder_;
    std::string session_ = unique_session();
};

TEST_F(Chain, CatchesTheClothAndMakesTheHandFeelIt) {
    Process rt = start_rt_core();
    ASSERT_TRUE(rt.wait_for_text("running", seconds(10))) << rt.output();
    Process sim = start_host_sim("host-sim", "3");
    ASSERT_EQ(sim.wait_for(seconds(30)), 0) << sim.output();
    rt.signal(SIGINT);
    ASSERT_EQ(rt.wait_for(seconds(10)), 0) << rt.output();

    const nlohmann::json sim_report = read_json(folder_ / "host-sim.json");
    EXPECT_TRUE(sim_report.at("caught"));
    EXPECT_EQ(sim_report.at("contact").at("escapes"), 0);
    EXPECT_GT(sim_report.at("contact").at("steps_in_contact"), 10);

    const nlohmann::json rt_report = read_json(folder_ / "rt-core.json");
    EXPECT_GT(rt_report.at("frames").at("received"), 100);
    EXPECT_EQ(rt_report.at("frames").at("rejected"), 0);

    const CsvTable record = CsvTable::load(folder_ / "rt-core.csv");
    const double peak = largest(force_sizes(record, 0.0, 1e9));
    EXPECT_GT(peak, 0.1) << "N: the hand felt nothing";
    EXPECT_LE(peak, kForceLimit * 1.01);
    EXPECT_THAT(segments_of(session_), IsEmpty());
}

TEST_F(Chain, IsReplayedFromItsRecordingToTheLastBit) {
    Process rt(rt_core({"run", "--session", session_, "--set", "limits.force=6", "--record", folder_ / "rt-core.csv"}),
               folder_ / "rt-core.log");
    ASSERT_TRUE(rt.wait_for_text("running", seconds(10))) << rt.output();
    Process sim = start_host_sim("host-sim", "1.8");  // the cloth arrives after 1.43 s
    ASSERT_EQ(sim.wait_for(seconds(30)), 0) << sim.output();
    rt.signal(SIGINT);
    ASSERT_EQ(rt.wait_for(seconds(10)), 0) << rt.output();
    ASSERT_GT(largest(force_sizes(CsvTable::load(folder_ / "rt-core.csv"), 0.0, 1e9)), 0.1) << "N: nothing was felt";

    const std::string device = "replay:" + (folder_ / "rt-core.csv").string();
    const Finished same = run(rt_core({"run", "--device", device, "--report", folder_ / "replay.json"}));
    EXPECT_EQ(same.status, 0) << same.output;
    EXPECT_THAT(same.output, HasSubstr("identical"));
    const nlohmann::json report = read_json(folder_ / "replay.json").at("replay");
    EXPECT_GT(report.at("ticks"), 2000);
    EXPECT_GT(report.at("frames"), 100);
    EXPECT_EQ(report.at("differing_ticks"), 0);

    // Other settings are asked for, and differ; missing ones are not asked for.
    const Finished softer = run(rt_core({"run", "--device", device, "--set", "limits.force=0.05"}));
    EXPECT_EQ(softer.status, 0) << softer.output;
    EXPECT_THAT(softer.output, AllOf(HasSubstr("DIFFERS"), HasSubstr("fy_n")));
    std::ofstream(folder_ / "rt-core.config.toml") << "[limits]\nforce = 0.05\n";
    EXPECT_EQ(run(rt_core({"run", "--device", device})).status, 4);
}

TEST_F(Chain, FadesTheForceWhenHostSimIsKilledAndTakesUpTheNextOne) {
    Process rt = start_rt_core();
    ASSERT_TRUE(rt.wait_for_text("running", seconds(10))) << rt.output();
    {
        Process sim = start_host_sim("killed", "30");
        std::this_thread::sleep_for(milliseconds(1900));  // the cloth arrives after 1.43 s
        sim.signal(SIGKILL);
        ASSERT_EQ(sim.wait_for(seconds(5)), 128 + SIGKILL);
    }
    std::this_thread::sleep_for(milliseconds(800));
    Process sim = start_host_sim("second", "2.5");
    ASSERT_EQ(sim.wait_for(seconds(30)), 0) << sim.output();
    rt.signal(SIGINT);
    ASSERT_EQ(rt.wait_for(seconds(10)), 0) << rt.output();

    const CsvTable record = CsvTable::load(folder_ / "rt-core.csv");
    const auto time = record.column("time_s");
    const auto age_ms = record.column("frame_age_ms");
    std::size_t oldest = 0;
    for (std::size_t i = 0; i < record.rows(); ++i) {
        oldest = age_ms[i] > age_ms[oldest] ? i : oldest;
    }
    ASSERT_GT(age_ms[oldest], 600.0) << "ms: frames never stopped";
    const double died_s = time[oldest] - age_ms[oldest] * 1e-3;
    EXPECT_GT(largest(force_sizes(record, 0.0, died_s)), 0.1) << "N: nothing was felt before the death";
    EXPECT_LT(largest(force_sizes(record, died_s + 0.4, time[oldest])), 0.02)
        << "N: the force of a dead simulation remains";
    EXPECT_GT(largest(force_sizes(record, time[oldest], 1e9)), 0.1) << "N: the new simulation is not felt";
    EXPECT_EQ(read_json(folder_ / "rt-core.json").at("safety").at("state"), "disarmed");
    EXPECT_THAT(segments_of(session_), IsEmpty());
}

TEST_F(Chain, HostSimGoesOnWhenRtCoreIsKilledAndRtCoreComesBack) {
    auto rt = std::make_unique<Process>(
        rt_core({"run", "--device", "emulated", "--session", session_, "--duration", "60"}), folder_ / "first.log");
    ASSERT_TRUE(rt->wait_for_text("running", seconds(10))) << rt->output();
    Process sim = start_host_sim("host-sim", "4");
    std::this_thread::sleep_for(milliseconds(500));
    rt->signal(SIGKILL);
    ASSERT_EQ(rt->wait_for(seconds(5)), 128 + SIGKILL);
    rt.reset();
    Process again = start_rt_core("again");
    ASSERT_TRUE(again.wait_for_text("running", seconds(10))) << again.output();
    ASSERT_EQ(sim.wait_for(seconds(30)), 0) << sim.output();
    again.signal(SIGTERM);
    ASSERT_EQ(again.wait_for(seconds(10)), 0) << again.output();
    EXPECT_GT(read_json(folder_ / "again.json").at("frames").at("received"), 50);
    EXPECT_EQ(read_json(folder_ / "host-sim.json").at("contact").at("escapes"), 0);
    EXPECT_THAT(segments_of(session_), IsEmpty());
}

TEST_F(Chain, TakesTheWorkspaceAnewWheneverItsFileChanges) {
    const std::string file = folder_ / "workspace.toml";
    std::ofstream(file) << "[workspace]\nscale = 0.02\n";
    Process sim(host_sim({"run", "cloth-drop", "--clock", "real", "--session", session_, "--duration", "0",
                          "--workspace", file, "--report", folder_ / "host-sim.json"}),
                folder_ / "host-sim.log");
    ASSERT_TRUE(sim.wait_for_text("no fresh device state", seconds(10))) << sim.output();
    std::ofstream(file) << "[workspace]\nscael = 0.05\n";
    ASSERT_TRUE(sim.wait_for_text("workspace.toml:2: workspace.scael", seconds(10))) << sim.output();
    std::ofstream(file) << "[workspace]\nscale = 0.05\nforce_scale = 0.4\n";
    ASSERT_TRUE(sim.wait_for_text("workspace: scale 0.05, force scale 0.4", seconds(10))) << sim.output();
    sim.signal(SIGINT);
    ASSERT_EQ(sim.wait_for(seconds(10)), 0) << sim.output();
    EXPECT_EQ(read_json(folder_ / "host-sim.json").at("workspace_changes"), 1);

    const Finished missing = run(host_sim({"run", "cloth-drop", "--workspace", folder_ / "none.toml"}));
    EXPECT_NE(missing.status, 0);
    EXPECT_THAT(missing.output, HasSubstr("none.toml"));
}

TEST_F(Chain, CtrlCLeavesReportsAndNothingElseBehind) {
    Process rt = start_rt_core();
    Process sim = start_host_sim("host-sim", "60");
    std::this_thread::sleep_for(milliseconds(700));
    sim.signal(SIGINT);
    rt.signal(SIGINT);
    EXPECT_EQ(sim.wait_for(seconds(10)), 0) << sim.output();
    EXPECT_EQ(rt.wait_for(seconds(10)), 0) << rt.output();
    EXPECT_NO_THROW(read_json(folder_ / "host-sim.json"));
    EXPECT_NO_THROW(read_json(folder_ / "rt-core.json"));
    EXPECT_THAT(segments_of(session_), IsEmpty());
}

TEST_F(Chain, CtrlCAtAnyTimeEndsBothProcesses) {
    for (const int delay_ms : {0, 1, 1, 2, 2, 3, 3, 4, 5, 7, 10, 30, 100, 300}) {
        Process rt = start_rt_core();
        Process sim = start_host_sim("host-sim", "60");
        std::this_thread::sleep_for(milliseconds(delay_ms));
        rt.signal(SIGINT);
        sim.signal(SIGINT);
        // Before its handlers are in place a process dies of the signal itself, which is as good.
        EXPECT_THAT(rt.wait_for(seconds(10)), testing::AnyOf(testing::Optional(0), testing::Optional(128 + SIGINT)))
            << delay_ms << " ms\n"
            << rt.output();
        EXPECT_THAT(sim.wait_for(seconds(10)), testing::AnyOf(testing::Optional(0), testing::Optional(128 + SIGINT)))
            << delay_ms << " ms\n"
            << sim.output();
        EXPECT_THAT(segments_of(session_), IsEmpty()) << delay_ms << " ms";
    }
}

TEST_F(Chain, RefusesASecondInstanceOnTheSameSession) {
    Process rt = start_rt_core();
    ASSERT_TRUE(rt.wait_for_text("running", seconds(10))) << rt.output();
    const Finished second_rt = run(rt_core({"run", "--session", session_, "--duration", "1"}));
    EXPECT_NE(second_rt.status, 0);
    EXPECT_THAT(second_rt.output, AllOf(HasSubstr(session_), HasSubstr(std::to_string(rt.pid()))));

    Process sim = start_host_sim("host-sim", "60");
    std::this_thread::sleep_for(milliseconds(500));
    const Finished second_sim =
        run(host_sim({"run", "cloth-drop", "--clock", "real", "--session", session_, "--duration", "1"}));
    EXPECT_NE(second_sim.status, 0);
    EXPECT_THAT(second_sim.output, AllOf(HasSubstr(session_), HasSubstr(std::to_string(sim.pid()))));

    sim.signal(SIGINT);
    rt.signal(SIGINT);
    EXPECT_EQ(sim.wait_for(seconds(10)), 0);
    EXPECT_EQ(rt.wait_for(seconds(10)), 0);
}

class BadInput : public Chain {
  protected:
    std::string write(const std::string& name, const std::string& content) {
        std::ofstream(folder_ / name) << content;
        return folder_ / name;
    }
    void expect_refusal(const std::vector<std::string>& command, const std::vector<std::string>& said) {
        const Finished finished = run(command);
        EXPECT_NE(finished.status, 0) << finished.output;
        EXPECT_LT(finished.status, 126) << "died of a signal\n" << finished.output;
        for (const std::string& text : said) {
            EXPECT_THAT(finished.output, HasSubstr(text));
        }
        EXPECT_THAT(segments_of(session_), IsEmpty());
    }
    /// Wrong arguments: the same status for every program.
    void expect_wrong_usage(const std::vector<std::string>& command, const std::vector<std::string>& said) {
        EXPECT_EQ(run(command).status, 64);
        expect_refusal(command, said);
    }
};

TEST_F(BadInput, AnUnknownSceneIsRefusedAndTheKnownOnesAreNamed) {
    expect_refusal(host_sim({"run", "cloth-dorp"}), {"cloth-dorp", "cloth-drop"});
}

TEST_F(BadInput, AnUnknownKeyIsRefusedWithFileAndLine) {
    const std::string config = write("rt.toml", "# mine\n[loop]\npriorty = 80\n");
    expect_refusal(rt_core({"run", "--config", config, "--session", session_}), {"rt.toml:3", "priorty", "priority"});
    expect_refusal(host_sim({"run", "cloth-drop", "--set", "proxy.radios=0.03"}), {"proxy.radios", "proxy.radius"});
}

TEST_F(BadInput, MalformedTomlIsRefusedWithFileAndLine) {
    const std::string scene = write("broken.toml", "[model]\nkind = \"cloth\nmass = 1\n");
    expect_refusal(host_sim({"run", scene}), {"broken.toml:2"});
    expect_refusal(rt_core({"run", "--config", scene, "--session", session_}), {"broken.toml:2"});
}

TEST_F(BadInput, AMissingFileIsNamed) {
    expect_refusal(host_sim({"run", "no/such/scene.toml"}), {"no/such/scene.toml"});
    expect_refusal(rt_core({"run", "--config", "no/such.toml", "--session", session_}), {"no/such.toml"});
    expect_refusal(rt_core({"run", "--hand", "no/such.csv", "--session", session_}), {"no/such.csv"});
}

TEST_F(BadInput, ValuesThatAreNotFiniteOrNotOfUnitLengthAreRefusedWithTheirLine) {
    const std::string nan = write("nan.csv", "time_s,x_m,y_m,z_m\n0,0,0,0\n1,nan,0,0\n");
    expect_refusal(rt_core({"run", "--hand", nan, "--session", session_}), {"nan.csv:3"});
    const std::string quaternion =
        write("q.csv", "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0,0,0,0.5,0,0,0\n");
    expect_refusal(rt_core({"run", "--hand", quaternion, "--session", session_}), {"q.csv:3"});
    expect_refusal(host_sim({"run", "cloth-drop", "--set", "proxy.radius=inf"}), {"proxy.radius"});
}

TEST_F(BadInput, AWrongArgumentSaysWhatIsRight) {
    expect_refusal(rt_core({"run", "--device", "usbb", "--session", session_}), {"usbb", "emulated"});
    expect_refusal(host_sim({"run", "cloth-drop", "--clock", "sundial"}), {"sundial", "lockstep"});
    expect_wrong_usage(rt_core({"rnu"}), {"did you mean run?", "--help"});
    expect_wrong_usage(host_sim({"runn"}), {"there is no command runn; did you mean run?"});
    expect_wrong_usage({FIRMWARE_HOST, "serv"}, {"did you mean serve?"});
    expect_wrong_usage(host_sim({}), {"run, play, scenes"});
    expect_wrong_usage(host_sim({"run", "cloth-drop", "--durration", "1"}), {"--durration; did you mean --duration?"});
    expect_wrong_usage(rt_core({"run", "--reports=r.json"}), {"did you mean --report?"});
}

TEST_F(BadInput, ANumberIsFiniteWholeWhereItCountsAndInItsRange) {
    expect_wrong_usage(host_sim({"run", "cloth-drop", "--duration", "nan"}), {"--duration", "from 0 to 1e+06, is nan"});
    for (const char* const steps : {"-1", "2.5", "99999999999999999999999"}) {
        expect_wrong_usage(host_sim({"run", "cloth-drop", "--steps", steps}), {"--steps", "whole number", steps});
    }
    expect_wrong_usage(host_sim({"mesh", "any.obj", "--scale", "inf"}), {"--scale", "from 1e-06 to 1e+06"});
    expect_wrong_usage(rt_core({"run", "--duration", "nan"}), {"--duration", "above 0"});
    expect_wrong_usage(rt_core({"measure", "--cyclictest", "--alternate", "nan"}), {"--alternate", "1 to 3600"});
    expect_wrong_usage(rt_core({"stability", "--out", folder_ / "map", "--scene", "fish-hold", "--rates", "100,-1"}),
                       {"--rates", "above 0, is -1"});
}

TEST_F(BadInput, AResultThatCannotBeWrittenIsRefusedBeforeTheRun) {
    expect_wrong_usage(rt_core({"run", "--record", "/"}), {"--record", "is a folder"});
    expect_wrong_usage(host_sim({"run", "cloth-drop", "--report", folder_ / "."}), {"--report", "is a folder"});
    expect_wrong_usage(host_sim({"run", "cloth-drop", "--record", folder_ / "none" / "r.csv"}),
                       {"--record", "none does not exist"});
    expect_wrong_usage(host_sim({"run", "cloth-drop", "--snapshots", "/dev/null/pictures"}), {"is not a folder"});
    expect_wrong_usage(host_sim({"model", "fish", "--out", folder_ / "none" / "m.toml"}), {"--out", "does not exist"});
}

TEST_F(BadInput, OutputThatCouldNotBeWrittenIsAnError) {
    for (const std::string& command : {std::string(HOST_SIM) + " scenes", std::string(RT_CORE) + " --print-config"}) {
        const Finished finished = run({"/bin/sh", "-c", command + " >/dev/full"});
        EXPECT_EQ(finished.status, 1) << finished.output;
        EXPECT_THAT(finished.output, HasSubstr("standard output: ")) << command;
        EXPECT_EQ(run({"/bin/sh", "-c", command + " | head -n 1"}).status, 0) << command;
    }
}

TEST_F(BadInput, ASceneWithoutABodyOrWithoutItsMeshSaysWhatIsMissingAndWhere) {
    expect_refusal(host_sim({"run", write("empty.toml", "")}), {"empty.toml", "no table [model]"});
    expect_refusal(host_sim({"run", write("mesh.toml", "[model]\nscale = 0.1\nfile = \"no-fish.obj\"\n")}),
                   {"mesh.toml:3", "model.file", "no-fish.obj", "No such file", "searched in /"});
    expect_refusal(host_sim({"run", "cloth-drop", "--set", "model.particles=/tmp"}),
                   {"model.particles", "is a folder"});
}

TEST_F(BadInput, ASmallProxyNeedsNoOtherKey) {
    const Finished finished = run(host_sim({"run", "cloth-drop", "--steps", "2", "--set", "proxy.radius=0.015"}));
    EXPECT_EQ(finished.status, 0) << finished.output;
}

TEST_F(BadInput, WaitingInVainEndsTheRunAndNamesTheSession) {
    expect_refusal(host_sim({"run", "cloth-drop", "--clock", "real", "--session", session_, "--wait", "0.2"}),
                   {"no rt-core ran in session " + session_, "0.2 s"});
}

TEST_F(BadInput, EveryProgramTellsItsVersion) {
    for (const char* const program : {RT_CORE, HOST_SIM, FIRMWARE_HOST}) {
        const Finished finished = run({program, "--version"});
        EXPECT_EQ(finished.status, 0) << finished.output;
        EXPECT_EQ(finished.output, std::filesystem::path(program).filename().string() + " " HAPTIC_VERSION "\n");
    }
}

/// What remains of a run that ends badly.
class Remains : public Chain {
  protected:
    static bool grows_to(const std::filesystem::path& file, std::uintmax_t bytes) {
        for (int k = 0; k < 600; ++k) {
            if (std::filesystem::exists(file) && std::filesystem::file_size(file) >= bytes) {
                return true;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
        }
        return false;
    }
};

TEST_F(Remains, AKilledSimulationLeavesARecordThatCanBeRepeated) {
    const std::filesystem::path record = folder_ / "killed.csv";
    {
        Process sim(host_sim({"run", "fish-slide", "--steps", "100000", "--record", record}), folder_ / "sim.log");
        ASSERT_TRUE(grows_to(record, 30'000)) << sim.output();
        sim.signal(SIGKILL);
        ASSERT_EQ(sim.wait_for(std::chrono::seconds(10)), 128 + SIGKILL);
    }
    const CsvTable table = CsvTable::load(record);
    EXPECT_GT(table.rows(), 50u);
    const std::string steps = std::to_string(table.rows());
    const std::filesystem::path again = folder_ / "again.csv";
    const Finished repeated =
        run(host_sim({"run", "fish-slide", "--input", record, "--steps", steps, "--record", again}));
    ASSERT_EQ(repeated.status, 0) << repeated.output;
    const auto was = table.column("proxy_y_m");
    const CsvTable second = CsvTable::load(again);
    const auto is = second.column("proxy_y_m");
    EXPECT_TRUE(std::equal(was.begin(), was.end(), is.begin(), is.end()));
}

TEST_F(Remains, AKilledLoopLeavesARecordingThatCanBeReplayed) {
    const std::filesystem::path record = folder_ / "killed.csv";
    {
        Process rt(rt_core({"run", "--session", session_, "--record", record}), folder_ / "rt.log");
        ASSERT_TRUE(rt.wait_for_text("running", std::chrono::seconds(30))) << rt.output();
        ASSERT_TRUE(grows_to(record, 300'000)) << rt.output();
        rt.signal(SIGKILL);
        ASSERT_EQ(rt.wait_for(std::chrono::seconds(10)), 128 + SIGKILL);
    }
    EXPECT_GT(CsvTable::load(record).rows(), 100u);
    const Finished replayed = run(rt_core({"run", "--device", "replay:" + record.string()}));
    EXPECT_EQ(replayed.status, 0) << replayed.output;
    EXPECT_THAT(replayed.output, HasSubstr("identical: "));
}

TEST_F(Remains, ALoopThatWasStoppedForAMomentLeavesARecordingThatCanBeReplayed) {
    // Long enough for a fault with a real device, and too short for one with the emulated device.
    const std::filesystem::path record = folder_ / "stopped.csv";
    {
        Process rt(rt_core({"run", "--session", session_, "--record", record}), folder_ / "rt.log");
        ASSERT_TRUE(rt.wait_for_text("running", std::chrono::seconds(30))) << rt.output();
        rt.signal(SIGSTOP);
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        rt.signal(SIGCONT);
        ASSERT_TRUE(grows_to(record, 300'000)) << rt.output();
        rt.signal(SIGINT);
        ASSERT_EQ(rt.wait_for(std::chrono::seconds(10)), 0) << rt.output();
    }
    const Finished replayed = run(rt_core({"run", "--device", "replay:" + record.string()}));
    EXPECT_THAT(replayed.output, HasSubstr("identical: "));
}

TEST_F(Remains, AFullDiskCostsTheRestOfOneFile) {
    // A limit of the size of each file stands for the full disk: the record does not fit, the report does.
    const std::string limited = "ulimit -f 36; trap '' XFSZ; exec ";
    const std::filesystem::path record = folder_ / "sim.csv";
    const Finished sim = run({"/bin/sh", "-c",
                              limited + HOST_SIM + " run cloth-drop --steps 300 --record " + record.string() +
                                  " --report " + (folder_ / "sim.json").string()});
    EXPECT_EQ(sim.status, 1) << sim.output;
    EXPECT_THAT(sim.output,
                AllOf(HasSubstr("sim.csv: could not be written completely: File too large"), HasSubstr("300 steps")));
    EXPECT_EQ(read_json(folder_ / "sim.json").at("steps"), 300);
    const std::size_t rows = CsvTable::load(record).rows();
    EXPECT_GT(rows, 20u);
    EXPECT_LT(rows, 300u);

    const Finished rt = run(rt_core(
        {"run", "--session", session_, "--duration", "0.5", "--record", "/dev/full", "--report", folder_ / "rt.json"}));
    EXPECT_EQ(rt.status, 1) << rt.output;
    EXPECT_THAT(rt.output,
                AllOf(HasSubstr("/dev/full: could not be written completely: No space left"), HasSubstr("ticks")));
    EXPECT_GT(read_json(folder_ / "rt.json").at("ticks"), 100);
}

TEST_F(Remains, AFaultIsToldAndItsLastTicksKeptWhereTheFolderIsGone) {
    const std::filesystem::path gone = folder_ / "gone";
    std::filesystem::create_directory(gone);
    const std::string name = "run-" + session_;
    Process rt(rt_core({"run", "--session", session_, "--fault", "unplug@1.0", "--report", gone / (name + ".json")}),
               folder_ / "rt.log");
    ASSERT_TRUE(rt.wait_for_text("hold the grip still", std::chrono::seconds(30))) << rt.output();
    std::filesystem::remove_all(gone);
    EXPECT_EQ(rt.wait_for(std::chrono::seconds(60)), 3) << rt.output();
    const std::filesystem::path box = std::filesystem::temp_directory_path() / (name + ".fault.csv");
    EXPECT_THAT(rt.output(), AllOf(HasSubstr("FAULT: "), HasSubstr(name + ".json: cannot be written: No such file"),
                                   HasSubstr("ticks are in " + box.string())));
    EXPECT_GT(CsvTable::load(box).rows(), 100u);
    std::filesystem::remove(box);
}

TEST_F(Remains, ARecordDoesNotOverwriteWhatTheRunReads) {
    const std::filesystem::path hand = folder_ / "hand.csv";
    std::ofstream(hand) << "time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n";
    for (const Finished& refused : {run(host_sim({"run", "cloth-drop", "--input", hand, "--record", hand})),
                                    run(rt_core({"run", "--session", session_, "--hand", hand, "--record", hand})),
                                    run(rt_core({"run", "--device", "replay:" + hand.string(), "--record", hand}))}) {
        EXPECT_EQ(refused.status, 1) << refused.output;
        EXPECT_THAT(refused.output, AllOf(HasSubstr(hand.string() + ", which"), HasSubstr("reads")));
        EXPECT_EQ(CsvTable::load(hand).rows(), 2u);
    }
}

TEST_F(Remains, NoTwoResultsGoToOneFile) {
    const std::filesystem::path same = folder_ / "same.csv";
    const std::string also = folder_ / "." / "same.csv";
    for (const Finished& refused :
         {run(host_sim({"run", "cloth-drop", "--duration", "0.1", "--record", same, "--report", also})),
          run(host_sim({"run", "cloth-drop", "--duration", "0.1", "--report", same, "--snapshots", also})),
          run(rt_core({"run", "--session", session_, "--duration", "1", "--record", same, "--report", also}))}) {
        EXPECT_EQ(refused.status, 1) << refused.output;
        EXPECT_THAT(refused.output, AllOf(HasSubstr("same.csv, which"), HasSubstr("writes")));
        EXPECT_FALSE(std::filesystem::exists(same));
    }
    EXPECT_EQ(
        run(host_sim({"run", "popout-fan", "--steps", "1", "--record", "/dev/null", "--report", "/dev/null"})).status,
        0);
}

}  // namespace
}  // namespace haptic::test
