#include "commands/reach_command.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <optional>
#include <string_view>

#include "commands/commands.hpp"
#include "haptic/csv.hpp"
#include "haptic/device/device_geometry_file.hpp"
#include "haptic/device/wrench_closure.hpp"
#include "haptic/types.hpp"

namespace haptic::device {
namespace {

constexpr double kDegrees = 57.29577951308232;

/// Columns of a recording, in the order of kColumns.
constexpr std::array<std::string_view, 14> kColumns{"time_s", "x_m",  "y_m",  "z_m",  "qw",    "qx",    "qy",
                                                    "qz",     "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"};

}  // namespace

ReachUse reach_use(const DeviceGeometry& geometry, const std::filesystem::path& recording) {
    CsvReader csv(recording);
    std::array<std::size_t, kColumns.size()> column{};
    std::transform(kColumns.begin(), kColumns.end(), column.begin(),
                   [&](std::string_view name) { return csv.index(name); });
    ReachUse use;
    while (csv.next()) {
        std::array<double, kColumns.size()> v{};
        std::transform(column.begin(), column.end(), v.begin(), [&](std::size_t k) { return csv.number(k); });
        // Pose: its distance from the centre, and wrench closure.
        const Pose pose{{v[1], v[2], v[3]}, {v[4], v[5], v[6], v[7]}};
        ++use.rows;
        use.excursion = std::max(use.excursion, glm::length(pose.position));
        use.rotation = std::max(use.rotation, 2.0 * std::acos(std::min(1.0, std::fabs(pose.orientation.w))));
        use.open += wrench_closure(geometry, pose).closed() ? 0U : 1U;
        // Wrench: its share of the largest one in its direction.
        const Wrench wrench{{v[8], v[9], v[10]}, {v[11], v[12], v[13]}};
        if (wrench.force == Vec3(0.0) && wrench.torque == Vec3(0.0)) {
            continue;
        }
        use.force = std::max(use.force, std::hypot(v[8], v[9], v[10]));
        use.torque = std::max(use.torque, std::hypot(v[11], v[12], v[13]));
        const std::optional<double> share = share_of_reach(geometry, pose, wrench);
        use.unreached += share && *share <= 1.0 ? 0U : 1U;
        if (share && *share > use.share) {
            use.share = *share;
            use.share_at_s = v[0];
        }
    }
    return use;
}

CLI::App* add_reach(CLI::App& app, ReachArguments& arguments) {
    CLI::App* reach =
        app.add_subcommand("reach", "Show how much of a device's reach a recording of host-sim or rt-core needs");
    reach->add_option("RECORDING", arguments.recording, "CSV with poses of the grip and wrenches at the hand")
        ->required();
    reach->add_option("--geometry", arguments.geometry, "Device geometry: a built-in name or a TOML file")
        ->capture_default_str();
    return reach;
}

void run_reach(const ReachArguments& arguments) {
    const DeviceGeometry geometry = find_device_geometry(arguments.geometry);
    const ReachUse use = reach_use(geometry, arguments.recording);
    std::printf("%-28s %s\n", "device", geometry.name.c_str());
    std::printf("%-28s %zu\n", "poses", use.rows);
    std::printf("%-28s %.2f mm\n", "largest excursion", kMilli * use.excursion);
    std::printf("%-28s %.1f deg\n", "largest rotation", kDegrees * use.rotation);
    std::printf("%-28s %zu\n", "poses not wrench-closed", use.open);
    std::printf("%-28s %.3f N\n", "peak force", use.force);
    std::printf("%-28s %.2f mN*m\n", "peak torque", kMilli * use.torque);
    std::printf("%-28s %.1f %% at %.3f s\n", "peak share of the reach", 100.0 * use.share, use.share_at_s);
    std::printf("%-28s %zu\n", "wrenches out of reach", use.unreached);
}

}  // namespace haptic::device
