#include "haptic/sim/mesh_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "haptic/sim/fish.hpp"
#include "mesh/mesh_import.hpp"

namespace haptic::sim {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// Proportions 2 : 1 : 3; all coordinates are exact in 32 bits.
constexpr std::array<std::array<float, 3>, 8> kBox{
    {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}, {2, 1, 0}, {0, 0, 3}, {2, 0, 3}, {0, 1, 3}, {2, 1, 3}}};
constexpr std::array<std::array<std::uint32_t, 4>, 6> kSides{
    {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};

std::vector<Triangle> box_triangles() {
    std::vector<Triangle> triangles;
    for (const auto& [a, b, c, d] : kSides) {
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
    }
    return triangles;
}

void append(std::string& bytes, const auto& value, bool swapped = false) {
    auto raw = std::bit_cast<std::array<char, sizeof(value)>>(value);
    if (swapped) {
        std::reverse(raw.begin(), raw.end());
    }
    bytes.append(raw.data(), raw.size());
}

std::string obj_quads() {
    std::ostringstream out;
    out << "# a box\nmtllib nowhere.mtl\no box\n";
    for (const auto& v : kBox) {
        out << "v " << v[0] << ' ' << v[1] << ' ' << v[2] << '\n';
    }
    out << "vn 0 0 1\nvt 0 0\nusemtl red\n";
    for (const auto& side : kSides) {
        out << "f";
        for (const std::uint32_t i : side) {
            out << ' ' << i + 1 << "/1/1";
        }
        out << '\n';
    }
    return out.str();
}

std::string ply_text() {
    std::ostringstream out;
    out << "ply\nformat ascii 1.0\ncomment a box\nelement vertex 8\nproperty float x\nproperty float y\nproperty float "
           "z\n"
        << "element face 12\nproperty list uchar int vertex_indices\nend_header\n";
    for (const auto& v : kBox) {
        out << v[0] << ' ' << v[1] << ' ' << v[2] << '\n';
    }
    for (const auto& [a, b, c] : box_triangles()) {
        out << "3 " << a << ' ' << b << ' ' << c << '\n';
    }
    return out.str();
}

std::string ply_binary(bool big_endian) {
    std::string out = std::string("ply\nformat ") + (big_endian ? "binary_big_endian" : "binary_little_endian") +
                      " 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
                      "element face 6\nproperty list uchar int vertex_indices\nend_header\n";
    for (const auto& v : kBox) {
        for (const float coordinate : v) {
            append(out, coordinate, big_endian);
        }
    }
    for (const auto& side : kSides) {
        out += '\4';
        for (const std::uint32_t i : side) {
            append(out, i, big_endian);
        }
    }
    return out;
}

std::string stl_text() {
    std::ostringstream out;
    out << "solid box\n";
    for (const Triangle& triangle : box_triangles()) {
        out << " facet normal 0 0 0\n  outer loop\n";
        for (const std::uint32_t i : triangle) {
            out << "   vertex " << kBox[i][0] << ' ' << kBox[i][1] << ' ' << kBox[i][2] << '\n';
        }
        out << "  endloop\n endfacet\n";
    }
    out << "endsolid box\n";
    return out.str();
}

std::string stl_binary(std::string_view header = "made by a test") {
    std::string out(header);
    out.resize(80, '\0');
    append(out, std::uint32_t{12});
    for (const Triangle& triangle : box_triangles()) {
        out.append(12, '\0');
        for (const std::uint32_t i : triangle) {
            for (const float coordinate : kBox[i]) {
                append(out, coordinate);
            }
        }
        out.append(2, '\0');
    }
    return out;
}

std::string gltf_buffer() {
    std::string out;
    for (const auto& v : kBox) {
        for (const float coordinate : v) {
            append(out, coordinate);
        }
    }
    for (const Triangle& triangle : box_triangles()) {
        for (const std::uint32_t i : triangle) {
            append(out, static_cast<std::uint16_t>(i));
        }
    }
    return out;
}

std::string base64(const std::string& bytes) {
    constexpr std::string_view kDacCodes = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t group = 0;
        for (std::size_t j = 0; j < 3; ++j) {
            group = group << 8U | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0U);
        }
        for (std::size_t j = 0; j < 4; ++j) {
            out += i + j > bytes.size() ? '=' : kDacCodes[group >> (18U - 6U * static_cast<unsigned>(j)) & 63U];
        }
    }
    return out;
}

/// `buffer` has the members of the buffer object besides its length; `nodes` and `mode` are those of the scene.
std::string gltf_json(const std::string& buffer, const std::string& nodes = R"([{"mesh": 0}])", int mode = 4) {
    return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": )" + nodes +
           R"(, "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": )" +
           std::to_string(mode) + R"(}]}], "buffers": [{)" + buffer + R"("byteLength": 168}],
 "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0,0,0], "max": [2,1,3]},
               {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}]})";
}

std::string gltf_embedded(const std::string& nodes = R"([{"mesh": 0}])", int mode = 4) {
    return gltf_json(R"("uri": "data:application/octet-stream;base64,)" + base64(gltf_buffer()) + R"(", )", nodes,
                     mode);
}

std::string glb() {
    std::string json = gltf_json("");
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::string buffer = gltf_buffer();
    std::string out = "glTF";
    append(out, std::uint32_t{2});
    append(out, static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + buffer.size()));
    append(out, static_cast<std::uint32_t>(json.size()));
    out += "JSON" + json;
    append(out, static_cast<std::uint32_t>(buffer.size()));
    out += std::string("BIN\0", 4) + buffer;
    return out;
}

CheckedMesh parse(const std::string& bytes, MeshFormat format, const MeshFileSettings& settings = {}) {
    return parse_mesh(std::as_bytes(std::span(bytes)), format, "box", settings);
}

std::string refusal(const std::string& bytes, MeshFormat format, const MeshFileSettings& settings = {}) {
    try {
        (void)parse(bytes, format, settings);
    } catch (const MeshError& error) {
        return error.what();
    }
    return "not refused";
}

void expect_the_box(const CheckedMesh& checked) {
    EXPECT_EQ(checked.mesh.vertices.size(), 8u);
    EXPECT_EQ(checked.mesh.triangles.size(), 12u);
    EXPECT_TRUE(checked.mesh.closed);
    EXPECT_FALSE(checked.report.turned);
    EXPECT_EQ(checked.report.flipped, 0u);
    EXPECT_EQ(checked.report.low, Vec3(0.0));
    EXPECT_EQ(checked.report.high, Vec3(2.0, 1.0, 3.0));
    EXPECT_NEAR(checked.report.volume, 6.0, 1e-12);
    EXPECT_NEAR(checked.report.area, 22.0, 1e-12);
    EXPECT_THAT(checked.report.warnings, IsEmpty());
}

/// A temporary folder, removed after the test.
class MeshFile : public ::testing::Test {
  protected:
    MeshFile() { std::filesystem::create_directories(folder_); }
    ~MeshFile() override { std::filesystem::remove_all(folder_); }

    [[nodiscard]] std::filesystem::path write(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder_ / name, std::ios::binary) << bytes;
        return folder_ / name;
    }

    [[nodiscard]] static std::string refusal_of(const std::filesystem::path& file) {
        try {
            (void)read_mesh(file);
        } catch (const MeshError& error) {
            return error.what();
        }
        return "not refused";
    }

    std::filesystem::path folder_ =
        std::filesystem::path(::testing::TempDir()) /
        (std::string("haptic-mesh-") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(MeshFile, IsReadInEachFormat) {
    expect_the_box(read_mesh(write("box.obj", obj_quads())));
    expect_the_box(read_mesh(write("box.ply", ply_text())));
    expect_the_box(read_mesh(write("box.PLY", ply_binary(false))));
    expect_the_box(read_mesh(write("big.ply", ply_binary(true))));
    expect_the_box(read_mesh(write("box.stl", stl_text())));
    expect_the_box(read_mesh(write("binary.stl", stl_binary())));
    expect_the_box(read_mesh(write("solid.stl", stl_binary("solid, says its header, and is binary"))));
    expect_the_box(read_mesh(write("box.gltf", gltf_embedded())));
    expect_the_box(read_mesh(write("box.glb", glb())));
}

TEST_F(MeshFile, OfGltfMayHaveASeparateBufferFile) {
    (void)write("box.bin", gltf_buffer());
    expect_the_box(read_mesh(write("box.gltf", gltf_json(R"("uri": "box.bin", )"))));
}

TEST_F(MeshFile, OfGltfReadsNothingOutsideItsFolder) {
    (void)write("outside.bin", gltf_buffer());
    std::filesystem::create_directory(folder_ / "inner");
    std::filesystem::create_symlink(folder_ / "outside.bin", folder_ / "inner" / "link.bin");
    const std::string absolute = (folder_ / "outside.bin").string();
    for (const std::string& uri : {std::string("../outside.bin"), absolute, std::string("link.bin")}) {
        EXPECT_NE(refusal_of(write("inner/box.gltf", gltf_json(R"("uri": ")" + uri + R"(", )"))), "not refused") << uri;
    }
    std::filesystem::rename(folder_ / "outside.bin", folder_ / "inner" / "outside.bin");
    EXPECT_EQ(refusal_of(write("inner/box.gltf", gltf_json(R"("uri": "outside.bin", )"))), "not refused");
}

TEST_F(MeshFile, IsScaledToMetres) {
    const CheckedMesh checked = read_mesh(write("box.stl", stl_binary()), {.scale = 0.001});
    EXPECT_NEAR(checked.report.volume, 6e-9, 1e-20);
    EXPECT_EQ(checked.report.vertices, 8u);
    EXPECT_EQ(load_mesh(folder_ / "box.stl", {.scale = 0.5}).vertices.size(), 8u);
}

TEST(MeshParser, AppliesTheTransformsOfNodes) {
    // A parent that scales by 2 and translates, a child with a quarter turn about y, and one that mirrors.
    const std::string nodes = R"([{"children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0.70710678118, 0, 0.70710678118]},
        {"mesh": 0, "translation": [0, 5, 0], "scale": [1, -1, 1]}])";
    const CheckedMesh checked = parse(gltf_embedded(nodes), MeshFormat::Gltf);
    EXPECT_EQ(checked.report.components, 2u);
    EXPECT_EQ(checked.report.triangles, 24u);
    EXPECT_TRUE(checked.report.closed);
    EXPECT_FALSE(checked.report.turned);
    EXPECT_NEAR(checked.report.volume, 2 * 48.0, 1e-4);
    // First child: x to -z, z to x, scaled, translated. Second: y from 4 to 5, scaled, translated.
    EXPECT_NEAR(glm::length(checked.report.low - Vec3(10.0, 0.0, -4.0)), 0.0, 1e-5);
    EXPECT_NEAR(glm::length(checked.report.high - Vec3(16.0, 10.0, 6.0)), 0.0, 1e-5);
}

TEST(MeshParser, ReversesAMirroredPart) {
    const CheckedMesh checked = parse(gltf_embedded(R"([{"mesh": 0, "scale": [-1, 1, 1]}])"), MeshFormat::Gltf);
    EXPECT_FALSE(checked.report.turned);
    EXPECT_NEAR(checked.report.volume, 6.0, 1e-12);
    EXPECT_EQ(checked.report.low, Vec3(-2.0, 0.0, 0.0));
}

TEST(MeshParser, SplitsConcavePolygons) {
    // An L of three unit squares.
    const CheckedMesh checked =
        parse("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5 6\n", MeshFormat::Obj);
    EXPECT_EQ(checked.report.triangles, 4u);
    EXPECT_NEAR(checked.report.area, 3.0, 1e-12);
    EXPECT_FALSE(checked.report.closed);
}

TEST(MeshParser, WarnsAboutIgnoredPrimitives) {
    const CheckedMesh checked = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\nl 2 3\np 1\n", MeshFormat::Obj);
    EXPECT_EQ(checked.report.triangles, 1u);
    EXPECT_THAT(checked.report.warnings,
                AllOf(Contains(StartsWith("2 lines are ignored")), Contains(StartsWith("1 point is ignored"))));
}

TEST(MeshParser, RefusesPointClouds) {
    EXPECT_THAT(refusal("v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n", MeshFormat::Obj), HasSubstr("triangle"));
    EXPECT_THAT(refusal(gltf_embedded(R"([{"mesh": 0}])", 0), MeshFormat::Gltf), HasSubstr("triangle"));
    EXPECT_THAT(refusal(gltf_embedded(R"([{"mesh": 0}])", 1), MeshFormat::Gltf), HasSubstr("triangle"));
}

TEST(MeshParser, DoesNotTrustHeaders) {
    std::string stl = stl_binary();
    stl[83] = '\x7f';
    EXPECT_THAT(refusal(stl, MeshFormat::Stl), AllOf(StartsWith("box: "), HasSubstr("2130706444 triangles")));
    EXPECT_THAT(refusal(stl_binary().substr(0, 400), MeshFormat::Stl), HasSubstr("400 bytes in place of 684"));
    EXPECT_THAT(refusal("short", MeshFormat::Stl), HasSubstr("shorter than the header"));
    EXPECT_THAT(refusal("plx", MeshFormat::Ply), HasSubstr("begin with \"ply\""));
    EXPECT_THAT(refusal("ply\nelement vertex 99999999999\nend_header\n", MeshFormat::Ply),
                HasSubstr("element vertex 99999999999"));
    EXPECT_THAT(refusal("ply\nformat ascii 1.0\nelement vertex 0end_header\n", MeshFormat::Ply), HasSubstr("no line"));
    const std::string text = ply_text();
    EXPECT_THAT(refusal(text.substr(0, text.rfind("3 ")), MeshFormat::Ply),
                AllOf(HasSubstr("element face 12"), HasSubstr("19 lines")));
    EXPECT_EQ(refusal(text.substr(0, text.size() - 1), MeshFormat::Ply), "not refused");
    EXPECT_EQ(refusal(text + "\n \r\n", MeshFormat::Ply), "not refused");
    EXPECT_THAT(refusal("ply\nelement vertex many\nend_header\n", MeshFormat::Ply), HasSubstr("element vertex many"));
    EXPECT_THAT(refusal("ply\nformat ascii 1.0\n", MeshFormat::Ply), HasSubstr("end_header"));
    EXPECT_THAT(refusal("GLTF\2\0\0\0________________", MeshFormat::Glb), HasSubstr("begin with \"glTF\""));
    std::string binary = glb();
    binary[4] = '\1';
    EXPECT_THAT(refusal(binary, MeshFormat::Glb), HasSubstr("glTF 1"));
    binary = glb();
    binary += "rest";
    EXPECT_THAT(refusal(binary, MeshFormat::Glb), HasSubstr("bytes, but has"));
    binary = glb();
    binary[14] = '\x7f';
    EXPECT_THAT(refusal(binary, MeshFormat::Glb), HasSubstr("chunk at byte 12"));
    EXPECT_THAT(refusal("", MeshFormat::Obj), HasSubstr("is empty"));
}

TEST(MeshParser, SurvivesTruncatedFiles) {
    const std::array<std::pair<MeshFormat, std::string>, 7> files{{{MeshFormat::Obj, obj_quads()},
                                                                   {MeshFormat::Ply, ply_text()},
                                                                   {MeshFormat::Ply, ply_binary(false)},
                                                                   {MeshFormat::Stl, stl_text()},
                                                                   {MeshFormat::Stl, stl_binary()},
                                                                   {MeshFormat::Gltf, gltf_embedded()},
                                                                   {MeshFormat::Glb, glb()}}};
    for (const auto& [format, bytes] : files) {
        for (std::size_t length = 1; length < bytes.size(); length += 1 + bytes.size() / 16) {
            try {
                const CheckedMesh checked = parse(bytes.substr(0, length), format);
                EXPECT_GT(checked.report.triangles, 0u);
            } catch (const MeshError& error) {
                EXPECT_THAT(error.what(), StartsWith("box: "));
            }
        }
    }
}

TEST(MeshParser, HasLimits) {
    MeshFileSettings settings;
    settings.check.max_triangles = 11;
    EXPECT_THAT(refusal(stl_binary(), MeshFormat::Stl, settings), HasSubstr("12 triangles, more than the 11"));
    EXPECT_THAT(refusal(obj_quads(), MeshFormat::Obj, settings), HasSubstr("more than the 11 triangles"));
    settings.check.max_triangles = 12;
    EXPECT_EQ(refusal(obj_quads(), MeshFormat::Obj, settings), "not refused");
    settings.check.max_vertices = 23;  // OBJ: four per side
    EXPECT_THAT(refusal(obj_quads(), MeshFormat::Obj, settings), HasSubstr("more than the 23 vertices"));
    settings.max_bytes = 100;
    EXPECT_THAT(refusal(obj_quads(), MeshFormat::Obj, settings), HasSubstr("100 bytes"));
    EXPECT_THROW((void)parse(obj_quads(), MeshFormat::Obj, {.scale = 0.0}), std::invalid_argument);
    EXPECT_THROW((void)parse(obj_quads(), MeshFormat::Obj, {.max_seconds = 0}), std::invalid_argument);
}

TEST_F(MeshFile, NamesTheFileThatCannotBeRead) {
    EXPECT_THAT(refusal_of(folder_ / "fish.fbx"), AllOf(HasSubstr("fish.fbx"), HasSubstr(".glb")));
    EXPECT_THAT(refusal_of(folder_ / "none.obj"), HasSubstr("none.obj"));
    std::filesystem::create_directory(folder_ / "folder.stl");
    EXPECT_THAT(refusal_of(folder_ / "folder.stl"), HasSubstr("is not a regular file"));
    EXPECT_THAT(refusal_of(write("empty.ply", "")), HasSubstr("is empty"));
    try {
        (void)read_mesh(write("large.stl", stl_binary()), {.max_bytes = 600});
        FAIL() << "read";
    } catch (const MeshError& error) {
        EXPECT_THAT(error.what(), AllOf(HasSubstr("large.stl"), HasSubstr("684 bytes, more than the 600")));
    }
}

TEST_F(MeshFile, ReadsBackWhatItWrites) {
    const TriangleMesh fish = make_fish_mesh({.length = 0.5});
    for (const char* name : {"fish.obj", "fish.ply"}) {
        write_mesh(folder_ / name, fish);
        const auto [mesh, report] = read_mesh(folder_ / name);
        EXPECT_EQ(report.triangles, 1700u);
        EXPECT_EQ(report.vertices, 852u);
        EXPECT_TRUE(mesh.closed);
        EXPECT_THAT(report.warnings, IsEmpty());
        for (std::size_t t = 0; t < fish.triangles.size(); ++t) {
            for (std::size_t i = 0; i < 3; ++i) {
                // Rounding of 0.5 m in 32 bits.
                const Vec3 apart = mesh.vertices[mesh.triangles[t][i]] - fish.vertices[fish.triangles[t][i]];
                EXPECT_LT(glm::length(apart), 5e-8);
            }
        }
    }
    EXPECT_THROW(write_mesh(folder_ / "fish.stl", fish), MeshError);
    EXPECT_THROW(write_mesh(folder_ / "nowhere" / "fish.ply", fish), std::runtime_error);
}

detail::ImportRequest small_request() {
    return {.bytes = {}, .folder = {}, .max_bytes = 1000, .max_vertices = 4, .max_triangles = 4};
}

std::string death_of(const std::function<detail::ImportedMesh()>& work, const detail::ChildLimits& limits = {}) {
    try {
        (void)detail::in_child(work, small_request(), limits);
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "alive";
}

TEST(ImportInAChild, ReturnsTheResult) {
    const auto mesh = detail::in_child(
        [] { return detail::ImportedMesh{{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}, {{2, 1, 0}}, {"one", "two"}}; },
        small_request(), {});
    EXPECT_THAT(mesh.vertices, ElementsAre(Vec3(1, 2, 3), Vec3(4, 5, 6), Vec3(7, 8, 9)));
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{2, 1, 0}));
    EXPECT_THAT(mesh.warnings, ElementsAre("one", "two"));
}

TEST(ImportInAChild, ReportsCrashesOfTheChild) {
    EXPECT_THAT(death_of([]() -> detail::ImportedMesh { std::abort(); }), HasSubstr("broke assimp"));
    EXPECT_THAT(death_of([]() -> detail::ImportedMesh {
                    (void)std::raise(SIGSEGV);
                    return {};
                }),
                HasSubstr("broke assimp"));
    EXPECT_THAT(death_of([]() -> detail::ImportedMesh { std::_Exit(0); }), HasSubstr("broke assimp"));
    EXPECT_EQ(death_of([]() -> detail::ImportedMesh { throw std::runtime_error("so"); }), "so");
    EXPECT_THAT(death_of([]() -> detail::ImportedMesh { throw 5; }), HasSubstr("unknown"));
}

TEST(ImportInAChild, RefusesResultsBeyondTheLimits) {
    // Also such that do not fit a pipe: their child waits for someone to read them.
    for (const std::size_t vertices : {5UL, 100'000UL}) {
        EXPECT_THAT(death_of([vertices] {
                        detail::ImportedMesh mesh;
                        mesh.vertices.resize(vertices);
                        return mesh;
                    }),
                    HasSubstr("not what was announced"));
    }
}

TEST(ImportInAChild, EndsAtTheTimeLimit) {
    EXPECT_THAT(death_of(
                    [] {
                        const volatile bool for_ever = true;
                        while (for_ever) {
                        }
                        return detail::ImportedMesh{};
                    },
                    {.cpu_s = 1}),
                HasSubstr("given up after 1 s"));
}

}  // namespace
}  // namespace haptic::sim
