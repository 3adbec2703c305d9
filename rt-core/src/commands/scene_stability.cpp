#include "commands/scene_stability.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "commands/child_process.hpp"
#include "commands/run_command.hpp"
#include "haptic/csv.hpp"
#include "measure/scene_trial.hpp"
#include "measure/trial_rig.hpp"
#include "process/settings.hpp"
#include "program/exit_status.hpp"
#include "program/progress_bar.hpp"

namespace haptic::rt {
namespace {

constexpr double kApproachS = 1.0;    // s, from the device's centre to the start of the script
constexpr double kSampleS = 0.005;    // s, between rows of the hand's track
constexpr double kVisible = 2e-4;     // m, smaller oscillations come from encoder and DAC quantisation
constexpr double kMinEnergy = -1e-4;  // J, below: energy was generated
// Amplification of the body's own motion by the mass of the grip on the hand's spring.
constexpr double kDrivenFactor = 2.0;
// Ratio of last to first amplitude: the periods of a body that moves by itself are not quite the same.
constexpr double kGrowth = 1.25;

/// The hand: the scene's script until it is held still.
struct Hand {
    PoseTrack track{Pose{}};
    double moving_s = 0.0;
    std::filesystem::path file;  // the track as a recording
};

struct SceneCell {
    double rate_hz = 0.0;
    double stiffness = 0.0;  // N/m requested at the hand
    double delay_ms = 0.0;
    double driven = 0.0;  // m, amplitude of the hand's spring under the scene's force on a rigid hand
    SceneOutcome outcome;
    bool grows = false;
};

/// Of a built-in scene or a scene file.
std::string name_of(const std::string& scene) {
    return std::filesystem::path(scene).stem().string();
}

// Beginnings of the names of the files that are written.
constexpr const char* kScriptFile = "script-";
constexpr const char* kHandFile = "hand-";
constexpr const char* kRigidFile = "rigid-";
constexpr const char* kMapFile = "stability-";

std::string result_name(const char* beginning, const std::string& scene) {
    return beginning + name_of(scene) + ".csv";
}

class SceneMap {
  public:
    explicit SceneMap(const StabilityOptions& options)
        : options_(options),
          host_sim_(options.host_sim.empty() ? find_program("host-sim", "haptic") : options.host_sim.string()),
          still_s_(options.duration_s.value_or(SceneTrial{}.still_s)),
          tick_(read_settings(load_config(options.config, options.assignments)).tick) {
        mechanics_.hand_stiffness = options.hand_stiffness.value_or(mechanics_.hand_stiffness);
        mechanics_.hand_damping = options.hand_damping.value_or(mechanics_.hand_damping);
        hand_ = record_hand();
        // N/m at the hand per N/m in the scene: the first frame of the shortest trial has it.
        hand_stiffness_ratio_ = run_trial({"coupling.stiffness=1", "coupling.torque_stiffness=1"}, 0, 0.0,
                                          kSceneSettleS + 2.0 * kSceneWindowS)
                                    .stiffness;
        if (!(hand_stiffness_ratio_ > 0.0)) {
            throw std::runtime_error(options.scene + ": the hand feels no force in this scene");
        }
    }

    [[nodiscard]] std::vector<SceneCell> run() {
        std::vector<SceneCell> cells;
        ProgressBar progress("running " + name_of(options_.scene));
        const std::size_t all = options_.rates_hz.size() * options_.stiffnesses.size() * options_.delays_ms.size();
        for (const double rate : options_.rates_hz) {
            for (const double stiffness : options_.stiffnesses) {
                const std::vector<std::string> settings = settings_of(rate, stiffness);
                const double driven = driven_amplitude(settings);
                for (const double delay_ms : options_.delays_ms) {
                    SceneCell cell{
                        .rate_hz = rate, .stiffness = stiffness, .delay_ms = delay_ms, .driven = driven, .outcome = {}};
                    progress.show(static_cast<double>(cells.size()) / static_cast<double>(all));
                    cell.outcome = run_trial(settings, nanoseconds(delay_ms * 1e-3), hand_.moving_s, still_s_);
                    cell.grows = grows(cell);
                    cells.push_back(cell);
                }
            }
        }
        return cells;
    }

  private:
    /// Step and stiffness of a row as keys of the scene.
    [[nodiscard]] std::vector<std::string> settings_of(double rate, double stiffness) const {
        const std::string of_scene = haptic::text_of(CsvCell{stiffness / hand_stiffness_ratio_});
        return {"solver.step=" + haptic::text_of(CsvCell{1.0 / rate}), "coupling.stiffness=" + of_scene,
                "coupling.torque_stiffness=" + of_scene};
    }

    [[nodiscard]] std::vector<std::string> host_sim(const std::vector<std::string>& settings,
                                                    const std::vector<std::string>& arguments) const {
        std::vector<std::string> command{host_sim_, "run", options_.scene};
        for (const std::vector<std::string>* list : {&options_.scene_assignments, &settings}) {
            for (const std::string& assignment : *list) {
                command.insert(command.end(), {"--set", assignment});
            }
        }
        command.insert(command.end(), arguments.begin(), arguments.end());
        return command;
    }

    /// Runs host-sim to its end.
    static void run_to_end(const std::vector<std::string>& command) {
        ChildProcess child(command);
        std::optional<int> status;
        while (!(status = child.exit_status())) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        if (*status != 0) {
            throw std::runtime_error(command_text(command) + ": ended with status " + std::to_string(*status));
        }
    }

    /// The scene's script in the device frame, after an approach from the centre and until the hand is held.
    [[nodiscard]] Hand record_hand() const {
        const std::filesystem::path script_file = options_.out / result_name(kScriptFile, options_.scene);
        run_to_end(host_sim({}, {"--clock", "lockstep", "--record", script_file.string()}));
        const PoseTrack script = PoseTrack::load(script_file);
        Hand hand;
        hand.file = options_.out / result_name(kHandFile, options_.scene);
        const double hold_s = std::min(options_.hold_s.value_or(script.duration_s()), script.duration_s());
        hand.moving_s = kApproachS + hold_s;
        std::vector<double> times{0.0};
        std::vector<Pose> poses{Pose{}};
        for (int i = 0; i * kSampleS <= hold_s; ++i) {
            times.push_back(kApproachS + i * kSampleS);
            poses.push_back(script.at(nanoseconds(i * kSampleS)));
        }
        CsvWriter csv(hand.file, {"time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"});
        for (std::size_t i = 0; i < times.size(); ++i) {
            const Vec3& p = poses[i].position;
            const Quat& q = poses[i].orientation;
            csv.row(std::array{times[i], p.x, p.y, p.z, q.w, q.x, q.y, q.z});
        }
        csv.close();
        hand.track = PoseTrack(std::move(times), std::move(poses));
        return hand;
    }

    [[nodiscard]] SceneOutcome run_trial(const std::vector<std::string>& settings, std::int64_t delay_ns,
                                         double moving_s, double still_s) const {
        SceneTrial trial{.session = unique_session(),
                         .peer_runs = {},
                         .delay_ns = delay_ns,
                         .hand = hand_.track,
                         .moving_s = moving_s,
                         .still_s = still_s,
                         .tick = tick_,
                         .mechanics = mechanics_};
        ChildProcess child(host_sim(settings, {"--clock", "device", "--session", trial.session, "--duration", "0"}));
        trial.peer_runs = [&child] { return !child.exit_status().has_value(); };
        const SceneOutcome outcome = run_scene_trial(trial);
        end(child);
        return outcome;
    }

    /// Ends host-sim as Ctrl-C does, so that it removes the rings of its session.
    static void end(ChildProcess& child) {
        child.interrupt();
        const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(5);
        while (!child.exit_status() && std::chrono::steady_clock::now() < deadline) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }

    /// The body's own motion: largest amplitude, over the windows of a still hand, of a spring of the hand's stiffness
    /// under the force that a rigid hand feels in the scene without rt-core.
    [[nodiscard]] double driven_amplitude(const std::vector<std::string>& settings) const {
        const std::filesystem::path file = options_.out / result_name(kRigidFile, options_.scene);
        const double end_s = hand_.moving_s + still_s_;
        run_to_end(host_sim(settings, {"--clock", "lockstep", "--input", hand_.file.string(), "--duration",
                                       haptic::text_of(CsvCell{end_s}), "--record", file.string()}));
        const CsvTable record = CsvTable::load(file);
        const auto time = record.column("time_s");
        const auto row_at = [&](double time_s) {
            return static_cast<std::size_t>(std::lower_bound(time.begin(), time.end(), time_s) - time.begin());
        };
        double largest = 0.0;
        for (const char* const axis : {"fx_n", "fy_n", "fz_n"}) {
            const auto force = record.column(axis);
            const int windows = static_cast<int>((end_s - hand_.moving_s) / kSceneWindowS);
            for (int window = 1; window <= windows; ++window) {
                const double from_s = end_s - window * kSceneWindowS;
                const std::size_t begin = row_at(from_s);
                const std::size_t end = row_at(from_s + kSceneWindowS);
                largest = std::max(largest, amplitude_of(std::span<const double>(force).subspan(begin, end - begin)));
            }
        }
        return mechanics_.hand_stiffness > 0.0 ? largest / mechanics_.hand_stiffness : 0.0;
    }

    /// As for the wall, beyond what the body's own motion does to the hand and by more than its periods differ.
    [[nodiscard]] static bool grows(const SceneCell& cell) {
        const SceneOutcome& o = cell.outcome;
        const bool sustained = o.min_energy < kMinEnergy && o.last_amplitude > 0.5 * o.first_amplitude;
        return o.faults != 0 || (o.last_amplitude > std::max(kVisible, kDrivenFactor * cell.driven) &&
                                 (o.last_amplitude > kGrowth * o.first_amplitude || sustained));
    }

    const StabilityOptions& options_;
    std::string host_sim_;
    double still_s_;
    TickSettings tick_;
    device::GripMechanics mechanics_;
    Hand hand_;
    double hand_stiffness_ratio_ = 1.0;
};

void write_scene_csv(const std::filesystem::path& file, const std::vector<SceneCell>& cells) {
    CsvWriter csv(file, {"rate_hz", "stiffness_n_m", "delay_ms", "first_mm", "last_mm", "driven_mm", "energy_min_j",
                         "peak_force_n", "touching_share", "controlled_share", "faults", "grows"});
    for (const SceneCell& cell : cells) {
        const SceneOutcome& o = cell.outcome;
        csv.row(std::array{cell.rate_hz, cell.stiffness, cell.delay_ms, o.first_amplitude / kMillimetre,
                           o.last_amplitude / kMillimetre, cell.driven / kMillimetre, o.min_energy, o.peak_force,
                           o.touching, o.controlled, static_cast<double>(o.faults), cell.grows ? 1.0 : 0.0});
    }
    csv.close();
}

/// A table per step rate: rows of stiffness, columns of delay, the last amplitude in mm, and * where it grows.
void print_map(const std::vector<SceneCell>& cells, const StabilityOptions& options) {
    std::printf("%s: amplitude of the still hand's grip, mm; * grows\n", options.scene.c_str());
    std::size_t next = 0;
    for (const double rate : options.rates_hz) {
        std::printf("%g steps/s\n%10s", rate, "N/m");
        for (const double delay_ms : options.delays_ms) {
            std::printf(" %6g ms", delay_ms);
        }
        for (const double stiffness : options.stiffnesses) {
            std::printf("\n%10g", stiffness);
            for (std::size_t i = 0; i < options.delays_ms.size(); ++i, ++next) {
                std::printf(" %7.2f %c", cells[next].outcome.last_amplitude / kMillimetre,
                            cells[next].grows ? '*' : ' ');
            }
        }
        std::printf("\n");
    }
}

}  // namespace

std::vector<std::string> result_names(const std::string& scene) {
    std::vector<std::string> names;
    for (const char* const beginning : {kScriptFile, kHandFile, kRigidFile, kMapFile}) {
        names.push_back(result_name(beginning, scene));
    }
    return names;
}

int scene_stability_command(const StabilityOptions& options) {
    std::filesystem::create_directories(options.out);
    const std::vector<SceneCell> cells = SceneMap(options).run();
    const std::filesystem::path file = options.out / result_name(kMapFile, options.scene);
    write_scene_csv(file, cells);
    print_map(cells, options);
    const auto growing =
        static_cast<int>(std::count_if(cells.begin(), cells.end(), [](const SceneCell& cell) { return cell.grows; }));
    std::printf("%d of %d trials grow\nwritten: %s\n", growing, static_cast<int>(cells.size()), file.c_str());
    return growing == 0 ? 0 : kExitFaulted;
}

}  // namespace haptic::rt
