// The live view of a run: a page and a stream for browsers, served from a thread of its own.
//
//     simulation's thread                              view's thread
//     introduce(description) ------ mutex, rare ----->  "scene", geometry
//     wanted() -> fill -> show() -- three buffers ---->  "frame" to each client that has taken the one before
//     add(sample) ------------- bounded queue -------->  "samples"
//     next_command() <--------- bounded queue ---------  what a client asked for, checked
//
// The simulation never waits: a moment is copied at most 60 times a second, and only while somebody looks; the newest
// wins, a client that is slow or dead misses what came between. The view's thread runs with the ordinary scheduling
// policy, whatever that of the process is.
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
    std::uint16_t port = 7060;  // 0: any that is free
    bool control = false;       // viewers may change the run
    std::string session;        // of the rings, whose device states are shown; empty: none
};

/// "ADDR:PORT", "PORT", "[::1]:PORT"; empty: the defaults. Throws std::invalid_argument that says what is wrong.
[[nodiscard]] LiveViewSettings parse_view_address(const std::string& text);

/// One sentence if others than this machine's users can reach such a view, for whoever started it; empty otherwise.
[[nodiscard]] std::string exposure_of(const LiveViewSettings& settings);

class LiveView {
  public:
    LiveView() = default;
    LiveView(const LiveView&) = delete;
    LiveView& operator=(const LiveView&) = delete;
    virtual ~LiveView() = default;  // says good-bye to the viewers, and ends the thread

    /// Where a browser finds it, e.g. "http://127.0.0.1:7060/".
    [[nodiscard]] virtual std::string url() const = 0;

    // What follows is for the simulation's thread alone.

    /// Another scene from here on; allocates.
    virtual void introduce(const SceneDescription& scene) = 0;
    /// A buffer to be filled and shown, sized as introduced, if somebody waits for a moment; null otherwise.
    [[nodiscard]] virtual SceneSnapshot* wanted() noexcept = 0;
    /// Shows what wanted() gave.
    virtual void show() noexcept = 0;
    /// Keeps a step for the plots; drops it if nobody takes them.
    virtual void add(const StepSample& sample) noexcept = 0;
    /// A frame went to the haptic loop; by the sequence in its states the view knows how old it became.
    virtual void frame_published(std::uint64_t sequence, std::int64_t time_ns) noexcept = 0;
    /// The oldest command that was not taken yet, if there is one.
    [[nodiscard]] virtual bool next_command(Command& command) = 0;
    /// Offers a finished record (CSV) for download, in place of the one before.
    virtual void offer_record(std::string csv) = 0;
};

/// Listens, and starts the thread. Throws std::runtime_error: the address cannot be had, or this host-sim was built
/// without the live view.
[[nodiscard]] std::unique_ptr<LiveView> open_live_view(const LiveViewSettings& settings);

}  // namespace haptic::sim::view
