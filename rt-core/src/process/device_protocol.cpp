#include "process/device_protocol.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "haptic/device/device_geometry_file.hpp"

namespace haptic::rt {
namespace {

constexpr std::uint64_t kFnvBasis = 14695981039346656037ULL;
constexpr std::uint64_t kFnvPrime = 1099511628211ULL;

}  // namespace

std::string fingerprint(const device::DeviceGeometry& geometry) {
    std::uint64_t hash = kFnvBasis;
    for (const char byte : device::to_toml(geometry, "")) {
        hash = (hash ^ static_cast<unsigned char>(byte)) * kFnvPrime;
    }
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
    return text;
}

std::filesystem::path protocol_beside(const std::string& geometry) {
    const bool is_path = geometry.find('/') != std::string::npos || geometry.ends_with(".toml");
    return is_path ? std::filesystem::path(geometry).replace_extension("protocol.json") : std::filesystem::path();
}

DeviceProtocol read_protocol(const std::filesystem::path& file, const device::DeviceGeometry& geometry) {
    DeviceProtocol protocol;
    if (file.empty()) {
        protocol.lacks = "a built-in geometry describes no particular device";
        return protocol;
    }
    std::ifstream stream(file);
    if (!stream) {
        protocol.lacks = file.string() + " is missing";
        return protocol;
    }
    try {
        const nlohmann::json all = nlohmann::json::parse(stream);
        const nlohmann::json signature = all.value("signature", nlohmann::json::object());
        protocol.person = signature.value("person", "");
        protocol.date = signature.value("date", "");
        if (!all.value("finished", false) || protocol.person.empty() || !signature.value("consent", false)) {
            protocol.lacks = file.string() + " is not signed";
        } else if (signature.value("geometry_fingerprint", "") != fingerprint(geometry)) {
            protocol.lacks = file.string() + " was signed for another geometry than the present one";
        }
    } catch (const nlohmann::json::exception&) {
        protocol.lacks = file.string() + " is no protocol of rt-core bringup";
    }
    return protocol;
}

TickSettings commissioning(const TickSettings& settings) {
    TickSettings limited = settings;
    limited.limits.force = std::min(limited.limits.force, kCommissioningForce);
    limited.limits.torque = std::min(limited.limits.torque, kCommissioningTorque);
    limited.commissioning = true;
    return limited;
}

}  // namespace haptic::rt
