// Cost of viewers to a run: repeats the same steps with none, one and twenty viewers in turn, since the machine's speed
// drifts. Times are of every step, from the recording; the viewers are real connections that read everything, in this
// process, on other processors.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "haptic/csv.hpp"
#include "process.hpp"
#include "unique_session.hpp"
#include "view_client.hpp"

namespace {

using namespace haptic::test;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kFramesWithin = 0.25;  // s, before rates are measured: by then the scene itself has been sent

struct Options {
    std::string host_sim;
    std::vector<std::string> scenes{"four-fish", "curtain-hand"};
    std::vector<std::size_t> viewers{0, 1, 20};
    std::vector<std::string> before;  // a command that starts host-sim, with its arguments
    double step_s = 0.002;
    double seconds = 6.0;
    int rounds = 4;
};

/// Results for one number of viewers, over all rounds.
struct Load {
    std::vector<double> step_us;
    std::vector<double> view_us_p99;  // one per round
    double late_steps = 0.0;
    double view_cpu_s = 0.0;  // CPU time of host-sim's threads other than the simulation's
    double watched_s = 0.0;
    double frames = 0.0;  // mean per viewer
    double bytes = 0.0;   // mean per viewer
};

double percentile(std::vector<double> values, double fraction) {
    if (values.empty()) {
        return std::nan("");
    }
    std::sort(values.begin(), values.end());
    const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size())));
    return values[std::clamp<std::size_t>(rank, 1, values.size()) - 1];
}

/// CPU time, s, of all threads of a process but the main one.
double cpu_of_other_threads(int pid) {
    double total_ns = 0.0;
    for (const auto& thread : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task")) {
        if (thread.path().filename() != std::to_string(pid)) {
            double run_ns = 0.0;
            std::ifstream(thread.path() / "schedstat") >> run_ns;
            total_ns += run_ns;
        }
    }
    return total_ns * 1e-9;
}

/// Lets the viewers read for a while and adds their mean counts to `load`.
void watch(Process& sim, ViewClients& viewers, double watch_s, Load& load) {
    std::vector<ViewClient*> all;
    for (const auto& viewer : viewers) {
        all.push_back(viewer.get());
    }
    const auto take_for = [&](double time_s) {
        take_until(all, milliseconds(static_cast<int>(time_s * 1e3)), [] { return false; });
    };
    const auto sum = [&](auto of) {
        double total = 0.0;
        for (const ViewClient* const viewer : all) {
            total += static_cast<double>(of(*viewer));
        }
        return all.empty() ? 0.0 : total / static_cast<double>(all.size());
    };
    const auto frames = [](const ViewClient& viewer) { return viewer.frames(); };
    const auto bytes = [](const ViewClient& viewer) { return viewer.bytes(); };
    // Skip the start, then measure CPU time, frames and bytes over the interval.
    take_for(kFramesWithin);
    const double cpu_before = cpu_of_other_threads(sim.pid());
    const double frames_before = sum(frames);
    const double bytes_before = sum(bytes);
    take_for(watch_s);
    load.view_cpu_s += cpu_of_other_threads(sim.pid()) - cpu_before;
    load.frames += sum(frames) - frames_before;
    load.bytes += sum(bytes) - bytes_before;
    load.watched_s += watch_s;
}

void run_once(const Options& options, const std::string& scene, std::size_t count, Load& load) {
    const ScratchFolder folder;
    // Start host-sim with a recording and a report.
    std::vector<std::string> command = options.before;
    const std::vector<std::string> run{options.host_sim,
                                       "run",
                                       scene,
                                       "--view",
                                       "127.0.0.1:0",
                                       "--clock",
                                       "real",
                                       "--session",
                                       unique_session(),
                                       "--set",
                                       "solver.step=" + std::to_string(options.step_s),
                                       "--duration",
                                       std::to_string(options.seconds),
                                       "--record",
                                       folder / "record.csv",
                                       "--report",
                                       folder / "report.json"};
    command.insert(command.end(), run.begin(), run.end());
    Process sim(command, folder / "log");
    if (!sim.wait_for_text("the live view is at", seconds(30)) || !view_port_in(sim.output())) {
        throw std::runtime_error("host-sim did not start its live view:\n" + sim.output());
    }
    ViewClients viewers;
    for (std::size_t i = 0; i < count; ++i) {
        viewers.push_back(std::make_unique<ViewClient>(*view_port_in(sim.output())));
        viewers.back()->say(R"({"type":"watch","particles":false,"planes":true,"samples":true})");
    }
    // Measure during most of the run, then keep reading until it ends.
    watch(sim, viewers, 0.8 * options.seconds - kFramesWithin, load);
    std::vector<ViewClient*> all;
    for (const auto& viewer : viewers) {
        all.push_back(viewer.get());
    }
    std::optional<int> status;
    take_until(all, seconds(60), [&] { return (status = sim.wait_for(milliseconds(0))).has_value(); });
    if (status != 0) {
        throw std::runtime_error("host-sim did not end cleanly:\n" + sim.output());
    }
    // Step times from the recording, counters from the report.
    const haptic::CsvTable record = haptic::CsvTable::load(folder / "record.csv");
    const auto steps = record.column("step_us");
    load.step_us.insert(load.step_us.end(), steps.begin(), steps.end());
    const auto report = nlohmann::json::parse(std::ifstream(folder / "report.json"));
    load.late_steps += report.at("late_steps").get<double>();
    if (report.at("view").contains("us")) {
        load.view_us_p99.push_back(report["view"]["us"].at("p99").get<double>());
    }
}

void print(const std::string& scene, const std::map<std::size_t, Load>& loads) {
    std::printf("\n%s\n%8s  %8s %8s %8s  %6s %6s %6s  %6s %8s  %8s %8s %7s\n", scene.c_str(), "viewers", "p50 us",
                "p99 us", "p99.9 us", "p50 x", "p99 x", "p99.9x", "late", "view us", "view cpu", "frames/s", "kB/s");
    const Load& first = loads.begin()->second;
    constexpr std::array kFractions{0.5, 0.99, 0.999};
    for (const auto& [count, load] : loads) {
        std::array<double, 3> us{};
        std::array<double, 3> ratio{};
        for (std::size_t i = 0; i < kFractions.size(); ++i) {
            us[i] = percentile(load.step_us, kFractions[i]);
            ratio[i] = us[i] / percentile(first.step_us, kFractions[i]);
        }
        std::printf("%8zu  %8.1f %8.1f %8.1f  %6.3f %6.3f %6.3f  %6.0f %8.1f  %6.1f %% %8.1f %7.0f\n", count, us[0],
                    us[1], us[2], ratio[0], ratio[1], ratio[2], load.late_steps, percentile(load.view_us_p99, 0.5),
                    100.0 * load.view_cpu_s / load.watched_s, load.frames / load.watched_s,
                    load.bytes / load.watched_s * 1e-3);
    }
}

Options read_options(int argc, char** argv) {
    Options options;
    CLI::App app("Measure the cost of viewers to a run of host-sim");
    std::string before;
    app.add_option("host-sim", options.host_sim, "Path of host-sim")->required();
    app.add_option("--scene", options.scenes, "Scenes; repeatable")->capture_default_str();
    app.add_option("--viewers", options.viewers, "Numbers of viewers; the first is the reference")
        ->capture_default_str();
    app.add_option("--before", before,
                   "Command that starts host-sim, e.g. \"/usr/bin/chrt -f 50 /usr/bin/taskset -c 1\"");
    app.add_option("--step", options.step_s, "Step of the simulation, s")->capture_default_str();
    app.add_option("--seconds", options.seconds, "Duration of one run, s")
        ->check(CLI::Range(1.0, 3600.0))
        ->capture_default_str();
    app.add_option("--rounds", options.rounds, "Runs per number of viewers")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        std::exit(app.exit(error));
    }
    std::istringstream words(before);
    for (std::string word; words >> word;) {
        options.before.push_back(word);
    }
    return options;
}

}  // namespace

int main(int argc, char** argv) {
    const Options options = read_options(argc, argv);
    try {
        for (const std::string& scene : options.scenes) {
            std::map<std::size_t, Load> loads;
            for (int round = 0; round < options.rounds; ++round) {
                for (const std::size_t count : options.viewers) {
                    run_once(options, scene, count, loads[count]);
                }
            }
            print(scene, loads);
        }
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "view_load: %s\n", error.what());
        return 1;
    }
}
