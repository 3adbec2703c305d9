// Bring-up protocol: everything that was measured on the first day of a device, as JSON and as text. It is saved after
// each measurement, so that an interrupted bring-up can be resumed.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "device/bringup.hpp"
#include "haptic/device/device_geometry.hpp"

namespace haptic::rt {

/// A question that the person answered, with what it means if the answer is not the expected one.
struct Answer {
    std::string question;
    bool yes = false;
    bool expected = false;
    std::string meaning;
    bool must_be_fixed = false;

    [[nodiscard]] bool deviates() const noexcept { return yes != expected; }
};

struct BringupProtocol {
    std::string started;  // ISO 8601
    std::string device;   // description
    std::string nominal;  // geometry, name or file
    std::string nominal_fingerprint;
    std::string haptic_version;
    std::string kernel;
    std::string geometry_file;  // that was written; empty: none yet

    // Measurements; empty while they are missing.
    std::optional<std::array<std::int64_t, kStrings>> noise;  // range of each counter, counts
    std::array<std::optional<PullOut>, kStrings> pull_outs;   // by string
    std::array<std::optional<MotorPull>, kStrings> pulls;     // by channel
    std::array<std::vector<Weighing>, kStrings> weighings;    // by string
    std::array<std::string, kStrings> weighed_with;           // "spring balance", "weight"
    std::optional<RoundTrips> round_trips;
    std::vector<Answer> power;  // of the power-cut test
    bool power_done = false;
    std::vector<std::string> skipped;  // steps that the person left out

    // The end.
    bool finished = false;
    std::string person;  // who signed; empty: nobody
    std::string signed_on;
    std::string geometry_fingerprint;
};

/// Encoders, motors and weights by the measurements.
[[nodiscard]] BringupFindings findings_of(const BringupProtocol& protocol, const device::DeviceGeometry& nominal);

/// All deviations, those of noise, round trips and power included.
struct BringupSummary {
    BringupResult device;
    std::vector<Deviation> deviations;
    [[nodiscard]] bool can_be_signed() const;
};
[[nodiscard]] BringupSummary summary_of(const BringupProtocol& protocol, const device::DeviceGeometry& nominal,
                                        std::int64_t period_ns, int exchanges);

/// Removes the measurements that keep the protocol from being signed, so that they are made again.
void drop_what_must_be_fixed(BringupProtocol& protocol, const device::DeviceGeometry& nominal, std::int64_t period_ns,
                             int exchanges);

/// Writes F.json. Throws std::runtime_error.
void save(const BringupProtocol& protocol, const std::filesystem::path& file, const std::vector<Deviation>& deviations);
/// Throws std::runtime_error for a file that is none.
[[nodiscard]] BringupProtocol load_bringup(const std::filesystem::path& file);

/// The protocol for people.
[[nodiscard]] std::string protocol_text(const BringupProtocol& protocol, const device::DeviceGeometry& nominal,
                                        const BringupSummary& summary);

/// Lines for one table: encoder, motor and weight of each string.
[[nodiscard]] std::string strings_text(const device::DeviceGeometry& nominal, const BringupFindings& findings);
[[nodiscard]] std::string deviations_text(const std::vector<Deviation>& deviations);

/// Now, ISO 8601 with the zone.
[[nodiscard]] std::string now_text();

}  // namespace haptic::rt
