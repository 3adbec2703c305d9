// Live view of a run: serves a page and a stream to browsers, from a thread of its own.
//
//    simulation's thread                              view's thread
//    set_scene(description) ------ mutex, rare ----->  "scene", geometry
//    requested_snapshot() -> fill -> publish_snapshot() -- triple buffer --->  "frame" to each client that has received
//    the previous one add_sample(sample) ------------- bounded queue -------->  "samples" next_command() <---------
//    bounded queue ---------  checked requests of clients
//
// The simulation never waits. A snapshot is copied at most 60 times a second, and only while a client is connected; the
// newest replaces older ones, and a slow or dead client misses those in between. The view's thread uses the ordinary
// scheduling policy, whatever the policy of the process.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "view/command.hpp"
#include "view/snapshot.hpp"

namespace haptic::sim::view {

struct LiveViewSettings {
    std::string address = "127.0.0.1";
    std::uint16_t port = 7060;  // 0: any free port
    bool control = false;       // viewers may change the run
    std::string session;        // whose rings' device states are shown; empty: none
};

/// Parses "ADDR:PORT", "PORT" or "[::1]:PORT"; an empty text gives the defaults. Throws std::invalid_argument with the
/// reason.
[[nodiscard]] LiveViewSettings parse_view_address(const std::string& text);

/// A warning of one sentence if other machines can reach the view; empty otherwise.
[[nodiscard]] std::string exposure_of(const LiveViewSettings& settings);

class LiveView {
  public:
    LiveView() = default;
    LiveView(const LiveView&) = delete;
    LiveView& operator=(const LiveView&) = delete;
    virtual ~LiveView() = default;  // sends "bye" to the viewers and ends the thread

    /// The address for a browser, e.g. "http://127.0.0.1:7060/".
    [[nodiscard]] virtual std::string url() const = 0;

    // To be called from the simulation's thread only:

    /// Starts the stream of another scene. Allocates.
    virtual void set_scene(const SceneDescription& scene) = 0;
    /// A buffer to fill and publish_snapshot(), sized as introduced, if a viewer is ready for a snapshot; null
    /// otherwise.
    [[nodiscard]] virtual SceneSnapshot* requested_snapshot() noexcept = 0;
    /// Publishes the buffer returned by requested_snapshot().
    virtual void publish_snapshot() noexcept = 0;
    /// Queues a step for the plots; drops it if no viewer subscribed or the queue is full.
    virtual void add_sample(const StepSample& sample) noexcept = 0;
    /// Records the publication of a contact frame, whose age the view finds by its sequence in the device states.
    virtual void frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept = 0;
    /// Takes the oldest pending command; returns false if there is none.
    [[nodiscard]] virtual bool next_command(Command& command) = 0;
    /// Offers a finished record (CSV) for download, in place of the previous one.
    virtual void offer_record(std::string csv) = 0;
};

/// Starts to listen and starts the thread. Throws std::runtime_error if the address is not available or host-sim was
/// built without the live view.
[[nodiscard]] std::unique_ptr<LiveView> open_live_view(const LiveViewSettings& settings);

}  // namespace haptic::sim::view
