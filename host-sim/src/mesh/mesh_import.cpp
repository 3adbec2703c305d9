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

/// How assimp calls the importer of a format: of all that it has, only this one is left to look at the bytes.
struct FormatName {
    const char* importer;
    const char* file;  // the name that the bytes get
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

/// A file that was read whole.
class OwnedStream final : public Assimp::MemoryIOStream {
  public:
    explicit OwnedStream(std::vector<std::uint8_t> bytes)
        : MemoryIOStream(bytes.data(), bytes.size()), bytes_(std::move(bytes)) {}

  private:
    std::vector<std::uint8_t> bytes_;  // moved, its elements stay where they are
};

/// The files that assimp may open: the one in memory, and those in its folder that it refers to.
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
        if (path.empty() || error || size > request_.most_bytes - read_) {
            return nullptr;
        }
        read_ += static_cast<std::size_t>(size);
        std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
        std::ifstream in(path, std::ios::binary);
        in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
        return in ? new OwnedStream(std::move(bytes)) : nullptr;
    }

  private:
    /// Where a file is that may be read; empty for any other. Links that lead out of the folder do not help.
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
    std::size_t read_ = 0;  // bytes, of all files but the first
};

/// Leaves the importer of the format only; assimp would let each of its fifty guess.
void keep_only(Assimp::Importer& importer, const char* name) {
    for (std::size_t i = importer.GetImporterCount(); i > 0; --i) {
        const aiImporterDesc* description = importer.GetImporterInfo(i - 1);
        if (description == nullptr || std::string_view(description->mName) != name) {
            Assimp::BaseImporter* other = importer.GetImporter(i - 1);
            (void)importer.UnregisterLoader(other);  // and leaves it to the caller, whose process ends soon
        }
    }
    if (importer.GetImporterCount() != 1) {
        throw std::runtime_error("this assimp has no \"" + std::string(name) + "\"");
    }
}

using Mat4 = glm::dmat4;

Mat4 to_matrix(const aiMatrix4x4& m) {
    return {{m.a1, m.b1, m.c1, m.d1}, {m.a2, m.b2, m.c2, m.d2}, {m.a3, m.b3, m.c3, m.d3}, {m.a4, m.b4, m.c4, m.d4}};
}

/// Collects the triangles of a scene, each where its node puts it.
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
            const Mat4 placed = parent * to_matrix(node->mTransformation);
            for (unsigned i = 0; i < node->mNumMeshes; ++i) {
                if (node->mMeshes[i] < scene.mNumMeshes) {
                    add(*scene.mMeshes[node->mMeshes[i]], placed);
                }
            }
            for (unsigned i = node->mNumChildren; i > 0; --i) {
                open.emplace_back(node->mChildren[i - 1], placed);
            }
        }
        warn(points_, "point", "points");
        warn(lines_, "line", "lines");
        return std::move(mesh_);
    }

  private:
    void add(const aiMesh& part, const Mat4& placed) {
        if (part.mVertices == nullptr || (part.mFaces == nullptr && part.mNumFaces > 0)) {
            return;
        }
        // Limits first: a scene may show one mesh as often as it likes.
        if (part.mNumVertices > request_.most_vertices - mesh_.vertices.size()) {
            throw std::runtime_error("has more than the " + std::to_string(request_.most_vertices) +
                                     " vertices that are allowed; simplify it first");
        }
        const auto first = static_cast<std::uint32_t>(mesh_.vertices.size());
        for (unsigned i = 0; i < part.mNumVertices; ++i) {
            const aiVector3D& v = part.mVertices[i];
            mesh_.vertices.emplace_back(placed * glm::dvec4(v.x, v.y, v.z, 1.0));
        }
        const bool mirrors = glm::determinant(Mat3(placed)) < 0.0;
        for (unsigned f = 0; f < part.mNumFaces; ++f) {
            const aiFace& face = part.mFaces[f];
            // assimp leaves out nothing of a file that was cut off, and fills up with faces without corners.
            if (face.mNumIndices == 0 || face.mIndices == nullptr) {
                throw std::runtime_error("face " + std::to_string(f) + " of " + std::to_string(part.mNumFaces) +
                                         " has no corners; is the file whole?");
            }
            for (unsigned i = 0; i < face.mNumIndices; ++i) {
                if (face.mIndices[i] >= part.mNumVertices) {
                    throw std::runtime_error("face " + std::to_string(f) + " has vertex " +
                                             std::to_string(face.mIndices[i]) + ", there are " +
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
        if (face.size() > kMostCorners) {
            throw std::runtime_error("has a face of " + std::to_string(face.size()) + " corners, more than the " +
                                     std::to_string(kMostCorners) + " that are cut into triangles");
        }
        if (face.size() - 2 > request_.most_triangles - mesh_.triangles.size()) {
            throw std::runtime_error("has more than the " + std::to_string(request_.most_triangles) +
                                     " triangles that are allowed; simplify it first");
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
                                     " left out: only faces can be felt");
        }
    }

    static constexpr std::size_t kMostCorners = 1000;

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
    importer.SetIOHandler(new Files(request, name.file));  // the importer's from here
    const aiScene* scene = importer.ReadFile(name.file, 0);
    if (scene == nullptr) {
        throw std::runtime_error(importer.GetErrorString());
    }
    return Collector(request).collect(*scene);
}

}  // namespace haptic::sim::detail
