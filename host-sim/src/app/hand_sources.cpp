#include "app/hand_sources.hpp"

#include "haptic/pose_track.hpp"
#include "haptic/types.hpp"

namespace haptic::sim {
namespace {

// m/s, a fast human hand
constexpr double kHostileSpeed = 5.0;
// rad/s, faster than a wrist
constexpr double kHostileTurn = 15.0;
// s, time constant of the hand's lag behind the mouse: smooths positions that arrive at a screen's rate
constexpr double kMouseLag = 0.03;
// s, duration of the hand's return to the script
constexpr double kReturn = 0.5;

}  // namespace

HandSources::HandSources(const HandSettings& settings, RingReader<DeviceState>* states)
    : hostile_seed_(settings.hostile_seed),
      without_others_(settings.scripted ? view::HandSource::Script : view::HandSource::Still),
      source_(without_others_) {
    if (states != nullptr) {
        device_.emplace(*states, StepInput{});
    }
    if (!settings.input.empty()) {
        input_ = RecordedRun::load(settings.input);
        source_ = view::HandSource::Input;
    }
}

void HandSources::begin(const Simulation& simulation) {
    last_ = simulation.scripted_input(0);
    mouse_ = simulation.workspace().to_scene(last_.device);
    returning_from_.reset();
    // A mouse held the hand of the scene before.
    if (!is_locked()) {
        source_ = without_others_;
    }
    if (hostile_seed_) {
        hostile_.emplace(*hostile_seed_, kHostileSpeed, kHostileTurn, simulation.proxy());
    }
}

bool HandSources::is_locked() const noexcept {
    return source_ == view::HandSource::Input || source_ == view::HandSource::Device;
}

StepInput HandSources::at(const Simulation& simulation, const Times& times) {
    StepInput input;
    input.time_ns = times.step_ns;
    const bool had_device = source_ == view::HandSource::Device;
    if (device_) {
        input = device_->at(times.step_ns, times.now_ns);
    }
    // A recording takes precedence; it is followed over the scene's time.
    const bool has_device = device_ && device_->fresh() && !input_;
    device_appeared_ = has_device && !had_device;
    if (!has_device) {
        input.feedback.reset();
    }
    if (input_) {
        const StepInput recorded = input_->at(seconds(times.scene_ns) - input_->begin());
        input.device = recorded.device;
        input.curl = recorded.curl;
        input.buttons = recorded.buttons;
    } else if (has_device) {
        source_ = view::HandSource::Device;
        returning_from_.reset();
    } else {
        source_ = had_device ? view::HandSource::Still : source_;
        input.device = last_.device;
        input.curl = last_.curl;
        if (source_ == view::HandSource::Mouse) {
            follow_mouse(simulation, input);
        } else if (source_ == view::HandSource::Script) {
            play_script(simulation, times.scene_ns, input);
        }
    }
    last_ = input;
    return input;
}

void HandSources::follow_mouse(const Simulation& simulation, StepInput& input) {
    // First-order lag.
    const double step = simulation.scene().solver.step;
    mouse_ = interpolate(mouse_, mouse_goal_, step / (step + kMouseLag));
    input.device = simulation.workspace().to_device(mouse_);
    if (mouse_curl_) {
        input.curl = mouse_curl_;
    }
}

void HandSources::play_script(const Simulation& simulation, std::int64_t time_ns, StepInput& input) {
    if (hostile_) {
        const Vec3 hand = hostile_->advance(simulation.scene().solver.step, simulation.vertices());
        input.device = simulation.workspace().to_device(Pose{hand, hostile_->orientation()});
        input.curl = hostile_->curl();
        return;
    }
    const StepInput script = simulation.scripted_input(time_ns);
    input.device = script.device;
    input.curl = script.curl;
    input.buttons = script.buttons;
    // Ease from where the hand was left to the moving script pose: 3 s^2 - 2 s^3.
    if (!returning_from_) {
        return;
    }
    returning_s_ += simulation.scene().solver.step;
    const double part = returning_s_ / kReturn;
    if (part >= 1.0) {
        returning_from_.reset();
        return;
    }
    const Workspace& workspace = simulation.workspace();
    const double eased = part * part * (3.0 - 2.0 * part);
    input.device = workspace.to_device(interpolate(*returning_from_, workspace.to_scene(script.device), eased));
}

void HandSources::move(const Simulation& simulation, const view::MoveHand& where) {
    if (is_locked()) {
        return;
    }
    if (source_ != view::HandSource::Mouse) {
        source_ = view::HandSource::Mouse;
        mouse_ = simulation.workspace().to_scene(last_.device);
        mouse_goal_ = mouse_;
        mouse_curl_.reset();
        returning_from_.reset();
    }
    mouse_goal_.position = where.position;
    mouse_goal_.orientation = where.orientation.value_or(mouse_goal_.orientation);
    mouse_curl_ = where.curl ? where.curl : mouse_curl_;
}

void HandSources::release() noexcept {
    source_ = source_ == view::HandSource::Mouse ? view::HandSource::Still : source_;
}

void HandSources::follow_script(const Simulation& simulation) {
    if (is_locked() || source_ == view::HandSource::Script) {
        return;
    }
    source_ = view::HandSource::Script;
    returning_from_ = simulation.workspace().to_scene(last_.device);
    returning_s_ = 0.0;
}

}  // namespace haptic::sim
