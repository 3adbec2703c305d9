#include "view/mesh_upload.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "haptic/clock.hpp"
#include "haptic/sim/mesh_file.hpp"
#include "scene/mesh_scene.hpp"

namespace haptic::sim::view {
namespace {

constexpr std::size_t kMaxNameBytes = 100;
constexpr unsigned kMaxReadingS = 10;  // CPU time of the import

bool is_plain_name(std::string_view name) {
    const auto plain = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
               c == '-';
    };
    return !name.empty() && name.size() <= kMaxNameBytes && name.front() != '.' &&
           std::all_of(name.begin(), name.end(), plain);
}

MeshUpload::Outcome outcome_of(const std::string& name, const std::vector<std::byte>& content) {
    try {
        MeshFileSettings settings;
        settings.check.max_triangles = kMaxUploadedTriangles;
        settings.max_seconds = kMaxReadingS;
        const CheckedMesh mesh = parse_mesh(content, mesh_format(name), name, settings);
        MeshScene made = make_mesh_scene(mesh, name, monotonic_now_ns);
        return {std::make_shared<const Scene>(std::move(made.scene)), std::move(made.explanation)};
    } catch (const std::exception& error) {
        return {nullptr, error.what()};
    }
}

}  // namespace

MeshUpload::~MeshUpload() {
    if (worker_.joinable()) {
        worker_.join();
    }
}

std::optional<UploadAnswer> MeshUpload::refusal_of(std::string_view path) {
    if (!path.starts_with(kMeshPath)) {
        return UploadAnswer{405, "Only GET and HEAD are supported here."};
    }
    const std::string name(path.substr(kMeshPath.size()));
    if (!is_plain_name(name)) {
        return UploadAnswer{400, "The name of a mesh may have letters, digits, '.', '_' and '-'."};
    }
    try {
        (void)mesh_format(name);
        return std::nullopt;
    } catch (const MeshError& error) {
        return UploadAnswer{415, error.what()};
    }
}

void MeshUpload::start(std::string_view path, std::vector<std::byte> content) {
    std::promise<Outcome> promise;
    outcome_ = promise.get_future();
    worker_ = std::thread([this, name = std::string(path.substr(kMeshPath.size())), content = std::move(content),
                           promise = std::move(promise)]() mutable {
        (void)pthread_setname_np(pthread_self(), "haptic-mesh");
        promise.set_value(outcome_of(name, content));
        done_();
    });
}

std::optional<MeshUpload::Outcome> MeshUpload::take_outcome() {
    if (!outcome_.valid() || outcome_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
        return std::nullopt;
    }
    worker_.join();
    return outcome_.get();
}

}  // namespace haptic::sim::view
