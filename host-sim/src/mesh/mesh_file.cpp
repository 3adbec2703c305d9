#include "haptic/sim/mesh_file.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "haptic/text_file.hpp"
#include "mesh/mesh_import.hpp"

namespace haptic::sim {
namespace {

constexpr double kImported = 0.6;  // share of the time of reading after which the checks begin, roughly
constexpr std::array<std::pair<std::string_view, MeshFormat>, 5> kFormats{{{".obj", MeshFormat::Obj},
                                                                           {".ply", MeshFormat::Ply},
                                                                           {".stl", MeshFormat::Stl},
                                                                           {".gltf", MeshFormat::Gltf},
                                                                           {".glb", MeshFormat::Glb}}};
constexpr std::string_view kKnownFormats = ".obj, .ply, .stl, .gltf and .glb";

std::string lower_extension(const std::filesystem::path& file) {
    std::string extension = file.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

std::string_view as_text(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Little-endian number at `at`; 0 if the bytes end before.
std::uint32_t u32_at(std::span<const std::byte> bytes, std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; at + 4 <= bytes.size() && i < 4; ++i) {
        value |= std::to_integer<std::uint32_t>(bytes[at + i]) << (8U * static_cast<unsigned>(i));
    }
    return value;
}

// Binary STL: bytes of the header and of each facet.
constexpr std::size_t kStlHeader = 84;
constexpr std::size_t kStlFacet = 50;
constexpr std::size_t kMaxPlyHeader = 1U << 16U;
constexpr std::size_t kGlbHeader = 12;
constexpr std::size_t kGlbChunkHeader = 8;

// Consistency of a file's own claims with its size, checked before assimp trusts them. Each function returns a
// description of the contradiction, or nothing.

std::string contradiction_in_stl(std::span<const std::byte> bytes, const MeshCheckSettings& limits) {
    const std::size_t count = u32_at(bytes, kStlHeader - 4);
    const bool exact = bytes.size() >= kStlHeader && bytes.size() == kStlHeader + kStlFacet * count;
    if (!exact && as_text(bytes).starts_with("solid")) {
        return {};
    }
    if (bytes.size() < kStlHeader) {
        return "is not an STL file: it is shorter than the header of a binary one and does not begin with \"solid\"";
    }
    if (!exact) {
        return "claims to have " + std::to_string(count) + " triangles, but has " + std::to_string(bytes.size()) +
               " bytes in place of " + std::to_string(kStlHeader + kStlFacet * count);
    }
    return count > limits.max_triangles ? "has " + std::to_string(count) + " triangles, more than the " +
                                              std::to_string(limits.max_triangles) + " allowed"
                                        : std::string();
}

/// Number of non-blank lines.
std::size_t count_lines(std::string_view text) {
    std::size_t count = 0;
    bool has_something = false;
    for (const char c : text) {
        const bool ends = c == '\n' || c == '\r';
        count += ends && has_something ? 1U : 0U;
        has_something = !ends && (has_something || (c != ' ' && c != '\t'));
    }
    return count + (has_something ? 1U : 0U);
}

/// Bytes before the line end_header; npos without such a line. assimp accepts the word within another line and then
/// reads out of bounds.
std::size_t ply_header(std::string_view text) {
    constexpr std::string_view word = "end_header";
    for (std::size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) {
        const std::size_t end = at + word.size();
        if (at > 0 && (text[at - 1] == '\n' || text[at - 1] == '\r') && end < text.size() &&
            (text[end] == '\n' || text[end] == '\r')) {
            return at;
        }
    }
    return std::string_view::npos;
}

std::string contradiction_in_ply(std::span<const std::byte> bytes) {
    const std::string_view head = as_text(bytes).substr(0, kMaxPlyHeader);
    if (!head.starts_with("ply")) {
        return "is not a PLY file: it does not begin with \"ply\"";
    }
    const std::size_t header = ply_header(head);
    if (header == std::string_view::npos) {
        return "has no line \"end_header\" in its first " + std::to_string(head.size()) + " bytes";
    }
    std::string_view rest = head.substr(0, header);
    const bool is_text = rest.find("format ascii") != std::string_view::npos;
    const std::size_t room = is_text ? count_lines(as_text(bytes).substr(rest.size())) - 1 : bytes.size();
    std::uint64_t total = 0;
    while (!rest.empty()) {
        const std::string_view line = rest.substr(0, rest.find_first_of("\r\n"));
        rest.remove_prefix(std::min(line.size() + 1, rest.size()));
        const std::size_t last = line.find_last_of(' ');
        if (!line.starts_with("element ") || last == std::string_view::npos) {
            continue;
        }
        std::uint64_t count = 0;
        const auto [end, error] = std::from_chars(line.data() + last + 1, line.data() + line.size(), count);
        // Each element takes a line of text, or at least a byte. assimp searches for a missing line for ever.
        if (error != std::errc() || end == line.data() + last + 1 || count > room - total) {
            return "declares \"" + std::string(line.substr(0, 80)) + "\", but has room for " + std::to_string(room) +
                   (is_text ? " lines after its header" : " bytes") + (total > 0 ? " in total" : "") +
                   "; is the file complete?";
        }
        total += count;
    }
    return {};
}

std::string contradiction_in_glb(std::span<const std::byte> bytes) {
    if (bytes.size() < kGlbHeader + kGlbChunkHeader || !as_text(bytes).starts_with("glTF")) {
        return "is not a binary glTF file: it does not begin with \"glTF\"";
    }
    if (u32_at(bytes, 4) != 2) {
        return "is glTF " + std::to_string(u32_at(bytes, 4)) + "; only glTF 2 is supported";
    }
    if (u32_at(bytes, 8) != bytes.size()) {
        return "claims to have " + std::to_string(u32_at(bytes, 8)) + " bytes, but has " + std::to_string(bytes.size());
    }
    for (std::size_t at = kGlbHeader; at < bytes.size();) {
        const std::size_t length = u32_at(bytes, at);
        if (bytes.size() - at < kGlbChunkHeader || bytes.size() - at - kGlbChunkHeader < length) {
            return "has a chunk at byte " + std::to_string(at) + " that extends beyond the end of the file";
        }
        at += kGlbChunkHeader + length;
    }
    return {};
}

std::string contradiction_in(std::span<const std::byte> bytes, MeshFormat format, const MeshCheckSettings& limits) {
    switch (format) {
        case MeshFormat::Stl:
            return contradiction_in_stl(bytes, limits);
        case MeshFormat::Ply:
            return contradiction_in_ply(bytes);
        case MeshFormat::Glb:
            return contradiction_in_glb(bytes);
        case MeshFormat::Obj:
        case MeshFormat::Gltf:
            break;
    }
    return {};
}

/// Reads a regular file. Refuses pipes and devices, which could block.
std::vector<std::byte> read_bytes(const std::filesystem::path& file, std::size_t max_bytes) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
        throw MeshError(file.string() + ": " + (error ? error.message() : "is not a regular file"));
    }
    const std::uintmax_t size = std::filesystem::file_size(file, error);
    if (error || size > max_bytes) {
        throw MeshError(file.string() + ": " +
                        (error ? error.message()
                               : "has " + std::to_string(size) + " bytes, more than the " + std::to_string(max_bytes) +
                                     " allowed; simplify the mesh first"));
    }
    std::vector<std::byte> bytes(static_cast<std::size_t>(size));
    std::ifstream in(file, std::ios::binary);
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!in) {
        throw MeshError(file.string() + ": cannot be read");
    }
    return bytes;
}

CheckedMesh parse(std::span<const std::byte> bytes, MeshFormat format, const std::string& name,
                  const std::filesystem::path& folder, const MeshFileSettings& settings, const Progress& progress) {
    settings.validate();
    if (bytes.size() > settings.max_bytes) {
        throw MeshError(name + ": has more than the " + std::to_string(settings.max_bytes) + " bytes allowed");
    }
    if (bytes.empty()) {
        throw MeshError(name + ": is empty");
    }
    const std::string contradiction = contradiction_in(bytes, format, settings.check);
    if (!contradiction.empty()) {
        throw MeshError(name + ": " + contradiction);
    }
    // assimp runs in a child process with limits.
    const detail::ImportRequest request{
        bytes, format, folder, settings.max_bytes, settings.check.max_vertices, settings.check.max_triangles};
    detail::ImportedMesh imported;
    try {
        imported =
            detail::in_child([&] { return detail::import_mesh(request); }, request, {.cpu_s = settings.max_seconds});
    } catch (const std::runtime_error& error) {
        throw MeshError(name + ": " + error.what());
    }
    report(progress, kImported);
    for (Vec3& vertex : imported.vertices) {
        vertex *= settings.scale;
    }
    CheckedMesh checked = check_mesh(imported.vertices, imported.triangles, settings.check, name);
    std::vector<std::string>& warnings = checked.report.warnings;
    warnings.insert(warnings.begin(), imported.warnings.begin(), imported.warnings.end());
    return checked;
}

/// Shortest text that reads back as the same double.
std::string shortest(double value) {
    std::array<char, 32> digits{};
    return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
}

void write_obj(std::ostream& out, const TriangleMesh& mesh) {
    for (const Vec3& v : mesh.vertices) {
        out << "v " << shortest(v.x) << ' ' << shortest(v.y) << ' ' << shortest(v.z) << '\n';
    }
    for (const auto& [a, b, c] : mesh.triangles) {
        out << "f " << std::uint64_t{a} + 1 << ' ' << std::uint64_t{b} + 1 << ' ' << std::uint64_t{c} + 1 << '\n';
    }
}

void write_ply(std::ostream& out, const TriangleMesh& mesh) {
    out << "ply\nformat ascii 1.0\nelement vertex " << mesh.vertices.size()
        << "\nproperty double x\nproperty double y\nproperty double z\nelement face " << mesh.triangles.size()
        << "\nproperty list uchar uint vertex_indices\nend_header\n";
    for (const Vec3& v : mesh.vertices) {
        out << shortest(v.x) << ' ' << shortest(v.y) << ' ' << shortest(v.z) << '\n';
    }
    for (const auto& [a, b, c] : mesh.triangles) {
        out << "3 " << a << ' ' << b << ' ' << c << '\n';
    }
}

}  // namespace

void MeshFileSettings::validate() const {
    if (!(scale >= kMinScale) || !(scale <= kMaxScale)) {
        throw std::invalid_argument("mesh: scale must be 1e-6 to 1e6 m per unit of the file");
    }
    if (max_seconds < 1 || max_seconds > 3600) {
        throw std::invalid_argument("mesh: max_seconds must be 1 to 3600");
    }
    check.check();
}

MeshFormat mesh_format(const std::filesystem::path& file) {
    const std::string extension = lower_extension(file);
    for (const auto& [known, format] : kFormats) {
        if (extension == known) {
            return format;
        }
    }
    throw MeshError(file.string() + ": not a mesh file; known extensions are " + std::string(kKnownFormats));
}

CheckedMesh read_mesh(const std::filesystem::path& file, const MeshFileSettings& settings, const Progress& progress) {
    settings.validate();
    const MeshFormat format = mesh_format(file);
    const std::vector<std::byte> bytes = read_bytes(file, settings.max_bytes);
    const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    return parse(bytes, format, file.string(), folder, settings, progress);
}

TriangleMesh load_mesh(const std::filesystem::path& file, const MeshFileSettings& settings) {
    return read_mesh(file, settings).mesh;
}

CheckedMesh parse_mesh(std::span<const std::byte> bytes, MeshFormat format, const std::string& name,
                       const MeshFileSettings& settings) {
    return parse(bytes, format, name, {}, settings, {});
}

void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh) {
    const std::string extension = lower_extension(file);
    if (extension != ".obj" && extension != ".ply") {
        throw MeshError(file.string() + ": meshes are written as .obj or .ply");
    }
    std::ostringstream out;
    if (extension == ".obj") {
        write_obj(out, mesh);
    } else {
        write_ply(out, mesh);
    }
    write_text(file, out.str());
}

}  // namespace haptic::sim
