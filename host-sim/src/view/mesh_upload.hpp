// Mesh upload: makes a scene of a mesh that a viewer has sent, on a thread of its own, so that neither the simulation
// nor the view waits for it.
#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "haptic/sim/scene.hpp"
#include "view/web_server.hpp"

namespace haptic::sim::view {

inline constexpr std::string_view kMeshPath = "/mesh/";  // then the name of the file
inline constexpr std::size_t kMaxUploadedTriangles = 200'000;

class MeshUpload {
  public:
    struct Outcome {
        std::shared_ptr<const Scene> scene;  // null: the text says what is wrong
        std::string text;
    };

    /// `done` is called on the thread that has made an outcome.
    explicit MeshUpload(std::function<void()> done) : done_(std::move(done)) {}
    MeshUpload(const MeshUpload&) = delete;
    MeshUpload& operator=(const MeshUpload&) = delete;
    /// Waits for the mesh that is being read.
    ~MeshUpload();

    /// Why a path does not name a mesh: it must be kMeshPath and a file name of letters, digits, '.', '_' and '-' with
    /// the extension of a mesh file.
    [[nodiscard]] static std::optional<UploadAnswer> refusal_of(std::string_view path);

    /// Makes a scene of the content. To be called again only after take_outcome() returned one.
    void start(std::string_view path, std::vector<std::byte> content);
    [[nodiscard]] std::optional<Outcome> take_outcome();

  private:
    std::function<void()> done_;
    std::thread worker_;
    std::future<Outcome> outcome_;
};

}  // namespace haptic::sim::view
