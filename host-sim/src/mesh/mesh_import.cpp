#include "mesh/mesh_import.hpp"

#include <assimp/MemoryIOWrapper.h>
#include <assimp/importerdesc.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cstring>
#include <fstream>
#include <glm/mat4x4.hpp>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "mesh/polygon.hpp"

namespace haptic::sim::detail {
namespace {

/// Name of assimp's importer for a format, and of the file that it is told to read.
struct FormatName {
    const char* importer;
    const char* file;  // name given to the bytes in memory
};

FormatName name_of(MeshFormat format) {
    switch (format) {
        case MeshFormat::Obj:
            return {"Wavefront Object Importer", "mesh.obj"};
        case MeshFormat::Ply:
            return {"Stanford Polygon Library (PLY) Importer", "mesh.ply"};
        case MeshFormat::Stl:
            return {"Stereolithography (STL) Importer", "mesh.stl"};
        case MeshFormat::Gltf:
            return {"glTF2 Importer", "mesh.gltf"};
        case MeshFormat::Glb:
            return {"glTF2 Importer", "mesh.glb"};
    }
    throw std::runtime_error("unknown format");
}

/// A file read completely into memory.
class OwnedStream final : public Assimp::MemoryIOStream {
  public:
    explicit OwnedStream(std::vector<std::uint8_t> bytes)
        : MemoryIOStream(bytes.data(), bytes.size()), bytes_(std::move(bytes)) {}

  private:
    std::vector<std::uint8_t> bytes_;  // the base class points to the elements, which a move keeps
};

/// The files that assimp may open: the one in memory, and for .gltf those in its folder.
class Files final : public Assimp::IOSystem {
  public:
    Files(const ImportRequest& request, std::string name) : request_(request), name_(std::move(name)) {}

    bool Exists(const char* file) const override { return file == name_ || !inside(file).empty(); }
    char getOsSeparator() const override { return '/'; }
    void Close(Assimp::IOStream* stream) override { delete stream; }

    Assimp::IOStream* Open(const char* file, const char* mode) override {
        if (std::strchr(mode, 'w') != nullptr || std::strchr(mode, 'a') != nullptr) {
            return nullptr;
        }
        if (file == name_) {
            return new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(request_.bytes.data()),
                                              request_.bytes.size());
        }
        const std::filesystem::path path = inside(file);
        std::error_code error;
        const std::uintmax_t size = path.empty() ? 0 : std::filesystem::file_size(path, error);
        if (path.empty() || error || size > request_.max_bytes - read_) {
            return nullptr;
        }
        read_ += static_cast<std::size_t>(size);
        std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
        std::ifstream in(path, std::ios::binary);
        in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
        return in ? new OwnedStream(std::move(bytes)) : nullptr;
    }

  private:
    /// Path of a file that may be read; empty for any other, also for links that lead out of the folder.
    [[nodiscard]] std::filesystem::path inside(const char* file) const {
        if (request_.folder.empty() || request_.format != MeshFormat::Gltf) {
            return {};
        }
        std::error_code error;
        const std::filesystem::path folder = std::filesystem::canonical(request_.folder, error);
        const std::filesystem::path path = error ? folder : std::filesystem::canonical(folder / file, error);
        if (error || !std::filesystem::is_regular_file(path, error)) {
            return {};
        }
        const std::filesystem::path relative = path.lexically_relative(folder);
        return relative.empty() || *relative.begin() == ".." ? std::filesystem::path{} : path;
    }

    const ImportRequest& request_;
    std::string name_;
    std::size_t read_ = 0;  // bytes, of all files except the first
};

/// Removes all other importers, so that assimp does not guess the format.
void keep_only(Assimp::Importer& importer, const char* name) {
    for (std::size_t i = importer.GetImporterCount(); i > 0; --i) {
        const aiImporterDesc* description = importer.GetImporterInfo(i - 1);
        if (description == nullptr || std::string_view(description->mName) != name) {
            Assimp::BaseImporter* other = importer.GetImporter(i - 1);
            (void)importer.UnregisterLoader(other);  // not deleted: the process ends soon
        }
    }
    if (importer.GetImporterCount() != 1) {
        throw std::runtime_error("this version of assimp has no \"" + std::string(name) + "\"");
    }
}

using Mat4 = glm::dmat4;

Mat4 to_matrix(const aiMatrix4x4& m) {
    return {{m.a1, m.b1, m.c1, m.d1}, {m.a2, m.b2, m.c2, m.d2}, {m.a3, m.b3, m.c3, m.d3}, {m.a4, m.b4, m.c4, m.d4}};
}

/// Collects the triangles of a scene, transformed by its nodes.
class Collector {
  public:
    explicit Collector(const ImportRequest& request) : request_(request) {}

    ImportedMesh collect(const aiScene& scene) {
        std::vector<std::pair<const aiNode*, Mat4>> open{{scene.mRootNode, Mat4(1.0)}};
        while (!open.empty()) {
            const auto [node, parent] = open.back();
            open.pop_back();
            if (node == nullptr) {
                continue;
            }
            const Mat4 transform = parent * to_matrix(node->mTransformation);
            for (unsigned i = 0; i < node->mNumMeshes; ++i) {
                if (node->mMeshes[i] < scene.mNumMeshes) {
                    add(*scene.mMeshes[node->mMeshes[i]], transform);
                }
            }
            for (unsigned i = node->mNumChildren; i > 0; --i) {
                open.emplace_back(node->mChildren[i - 1], transform);
            }
        }
        warn(points_, "point", "points");
        warn(lines_, "line", "lines");
        return std::move(mesh_);
    }

  private:
    void add(const aiMesh& part, const Mat4& transform) {
        if (part.mVertices == nullptr || (part.mFaces == nullptr && part.mNumFaces > 0)) {
            return;
        }
        // Check the limit first: a scene may instantiate one mesh any number of times.
        if (part.mNumVertices > request_.max_vertices - mesh_.vertices.size()) {
            throw std::runtime_error("has more than the " + std::to_string(request_.max_vertices) +
                                     " vertices allowed; simplify the mesh first");
        }
        const auto first = static_cast<std::uint32_t>(mesh_.vertices.size());
        for (unsigned i = 0; i < part.mNumVertices; ++i) {
            const aiVector3D& v = part.mVertices[i];
            mesh_.vertices.emplace_back(transform * glm::dvec4(v.x, v.y, v.z, 1.0));
        }
        // A mirroring transform reverses the winding.
        const bool mirrors = glm::determinant(Mat3(transform)) < 0.0;
        for (unsigned f = 0; f < part.mNumFaces; ++f) {
            const aiFace& face = part.mFaces[f];
            // assimp completes a truncated file with faces without corners.
            if (face.mNumIndices == 0 || face.mIndices == nullptr) {
                throw std::runtime_error("face " + std::to_string(f) + " of " + std::to_string(part.mNumFaces) +
                                         " has no corners; is the file complete?");
            }
            for (unsigned i = 0; i < face.mNumIndices; ++i) {
                if (face.mIndices[i] >= part.mNumVertices) {
                    throw std::runtime_error("face " + std::to_string(f) + " refers to vertex " +
                                             std::to_string(face.mIndices[i]) + ", but the number of vertices is " +
                                             std::to_string(part.mNumVertices));
                }
            }
            add_face(std::span(face.mIndices, face.mNumIndices), first, mirrors);
        }
    }

    void add_face(std::span<const unsigned> face, std::uint32_t first, bool mirrors) {
        points_ += face.size() == 1 ? 1U : 0U;
        lines_ += face.size() == 2 ? 1U : 0U;
        if (face.size() < 3) {
            return;
        }
        if (face.size() > kMaxCorners) {
            throw std::runtime_error("has a face of " + std::to_string(face.size()) + " corners, more than the " +
                                     std::to_string(kMaxCorners) + " allowed");
        }
        if (face.size() - 2 > request_.max_triangles - mesh_.triangles.size()) {
            throw std::runtime_error("has more than the " + std::to_string(request_.max_triangles) +
                                     " triangles allowed; simplify the mesh first");
        }
        corners_.clear();
        for (const unsigned i : face) {
            corners_.push_back(mesh_.vertices[first + i]);
        }
        for (const auto& [a, b, c] : cut_polygon(corners_)) {
            mesh_.triangles.push_back({first + face[a], first + face[mirrors ? c : b], first + face[mirrors ? b : c]});
        }
    }

    void warn(std::size_t count, const char* singular, const char* plural) {
        if (count > 0) {
            mesh_.warnings.push_back(std::to_string(count) + " " +
                                     (count == 1 ? std::string(singular) + " is" : std::string(plural) + " are") +
                                     " ignored: only faces have a surface to touch");
        }
    }

    static constexpr std::size_t kMaxCorners = 1000;

    const ImportRequest& request_;
    ImportedMesh mesh_;
    std::vector<Vec3> corners_;  // of one face
    std::size_t points_ = 0;
    std::size_t lines_ = 0;
};

}  // namespace

ImportedMesh import_mesh(const ImportRequest& request) {
    const FormatName name = name_of(request.format);
    Assimp::Importer importer;
    keep_only(importer, name.importer);
    importer.SetIOHandler(new Files(request, name.file));  // the importer takes ownership
    const aiScene* scene = importer.ReadFile(name.file, 0);
    if (scene == nullptr) {
        throw std::runtime_error(importer.GetErrorString());
    }
    return Collector(request).collect(*scene);
}

}  // namespace haptic::sim::detail
