// Small scene without a simulation: a description with every kind of content, and a stand-in for host-sim's run loop.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "view/live_view.hpp"

namespace haptic::sim::view::test {

/// Two bodies, a cross of two triangles with both faces and a tetrahedron; three particles; a tool of one triangle.
inline SceneDescription small_description() {
    SceneDescription scene;
    scene.name = "small";
    scene.text = "Two bodies \xE2\x80\x93 and a tool";
    scene.scenes = {"small", "other"};
    scene.bodies = {{"sheet", 0, 4, {{0, 1, 2}, {1, 3, 2}, {2, 1, 0}, {2, 3, 1}}, 0, 2},
                    {"solid", 4, 4, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}, 2, 1}};
    scene.semi_axes = {Vec3(0.1), Vec3(0.1, 0.2, 0.3), Vec3(0.0)};
    scene.ellipsoid_axes = std::vector<Quat>(3, Quat(1.0, 0.0, 0.0, 0.0));
    scene.groups = {{0, {0, 1}, 1.0, 0.0}, {2, {2}, 1.0, 0.0}};
    scene.links = {{0, 1, 1.0, 1.0, 0.0}};
    scene.tool_triangles = {{0, 1, 2}};
    scene.tool_vertices = 3;
    scene.proxy_radii = {0.05, 0.06};
    scene.ground_height = -1.5;
    scene.parameters = {{"coupling.stiffness", "Stiffness", "N/m", 0.0, 100.0, false, false, {}, "Hand to tool."},
                        {"solver.iterations", "Iterations", "", 1.0, 20.0, true, false, {}, "Passes."},
                        {"contact.method", "Method", "", 0.0, 0.0, true, false, {"complete", "thesis"}, "How."}};
    scene.closes = true;
    return scene;
}

/// A snapshot whose vectors have the lengths of small_description().
inline SceneSnapshot small_snapshot() {
    SceneSnapshot snapshot;
    snapshot.vertices = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0},  {1.0, 0.3, 1.0},
                         {2.0, 0.0, 0.0}, {3.0, 0.0, 0.0}, {2.0, 0.0, -1.0}, {2.0, 1.0, 0.0}};
    snapshot.particles = {{0.1, 0.2, 0.3}, {1.1, 1.2, 1.3}, {2.1, 2.2, 2.3}};
    snapshot.orientations = std::vector<Quat>(3, Quat(1.0, 0.0, 0.0, 0.0));
    snapshot.tool_vertices = {{0.0, 2.0, 0.0}, {0.1, 2.0, 0.0}, {0.0, 2.0, 0.1}};
    snapshot.proxies = {{{0.5, 1.0, 0.5}, {0.5, 0.9, 0.5}, 0.05, true, false},
                        {{0.6, 1.0, 0.5}, {}, 0.06, false, true}};
    snapshot.planes = {{{0.0, 1.0, 0.0}, 0.25, -0.5, 1, true}};
    snapshot.run.parameters = {20.0, 5.0, 1.0};
    return snapshot;
}

/// Stand-in for a run: publishes a snapshot whenever the view requests one, adds a sample per step, and stores the
/// commands.
class Run {
  public:
    explicit Run(LiveView& view, SceneSnapshot snapshot = small_snapshot())
        : view_(view), snapshot_(std::move(snapshot)), thread_([this] { go(); }) {}
    Run(const Run&) = delete;
    Run& operator=(const Run&) = delete;
    ~Run() {
        stop_ = true;
        thread_.join();
    }

    /// Waits for the next command.
    Command next_command() {
        while (true) {
            {
                const std::lock_guard lock(mutex_);
                if (!commands_.empty()) {
                    Command command = std::move(commands_.front());
                    commands_.erase(commands_.begin());
                    return command;
                }
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }
    std::size_t commands() {
        const std::lock_guard lock(mutex_);
        return commands_.size();
    }
    std::uint64_t steps() const { return steps_; }

  private:
    void go() {
        while (!stop_) {
            ++snapshot_.step;
            snapshot_.time = static_cast<double>(snapshot_.step) * 1e-3;
            if (!snapshot_.vertices.empty()) {
                snapshot_.vertices[0].y = 0.01 * std::sin(snapshot_.time);
            }
            if (SceneSnapshot* buffer = view_.requested_snapshot()) {
                *buffer = snapshot_;
                view_.publish_snapshot();
            }
            view_.add_sample({snapshot_.time, 1.0F, 0.5F, 0.001F});
            Command command;
            while (view_.next_command(command)) {
                const std::lock_guard lock(mutex_);
                commands_.push_back(command);
            }
            steps_ = snapshot_.step;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }

    LiveView& view_;
    SceneSnapshot snapshot_;
    std::mutex mutex_;
    std::vector<Command> commands_;
    std::atomic<std::uint64_t> steps_{0};
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

/// The port in "http://127.0.0.1:PORT/".
inline std::uint16_t port_in(const std::string& url) {
    return static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1)));
}

}  // namespace haptic::sim::view::test
