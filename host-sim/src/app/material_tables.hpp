// Tables of virtual tests: what was asked for beside what was measured, as text and as CSV.
#pragma once

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace haptic::sim {

/// A measured quantity.
struct TestLine {
    std::string specimen;  // "bar of 120 particles"; without commas
    double number = 0.0;   // what differs between specimens: particles or step, ms
    std::string quantity;  // "Young's modulus in tension"; without commas
    std::string unit;
    std::optional<double> requested;
    double measured = 0.0;
    int substeps = 0;     // of a step
    double time_s = 0.0;  // that the test took
    bool at_rest = true;  // when it was measured
};

struct TestTable {
    std::string name;  // of the file
    std::string title;
    std::vector<TestLine> lines;
};

/// A sphere pressed into a layer of a material.
struct PressLine {
    std::size_t particles = 0;
    double depth = 0.0;       // m
    double half_space = 0.0;  // N, of a half-space (Hertz)
    double series = 0.0;      // N, of the layer (Dimitriadis et al.)
    double requested = 0.0;   // N, of the layer
    double measured = 0.0;    // N
    int substeps = 0;         // of a step
    bool at_rest = true;      // when it was measured
};

struct PressTable {
    std::string name;  // of the file
    std::string title;
    std::vector<PressLine> lines;
};

/// A value with its unit and the prefix that fits: "30 kPa"; four digits.
[[nodiscard]] std::string with_unit(double value, const std::string& unit);

void print(std::ostream& out, const TestTable& table);
void print(std::ostream& out, const PressTable& table);

/// Columns: specimen,number,quantity,unit,requested,measured,ratio,substeps,time_s,at_rest; "-" where there is no
/// value.
[[nodiscard]] std::string csv_of(const TestTable& table);
/// Columns: particles,depth_m,half_space_n,series_n,requested_n,measured_n,ratio,substeps,at_rest.
[[nodiscard]] std::string csv_of(const PressTable& table);

/// Writes NAME.csv, NAME.gp and NAME.svg: the ratio of measured to requested values over the specimens' numbers.
/// Returns why there is no plot; empty if there is one. Throws std::runtime_error.
[[nodiscard]] std::string write_table(const std::filesystem::path& folder, const TestTable& table,
                                      const std::string& axis, const std::string& plotted);
/// The same of a press: its plot has the forces over depth, with what was requested as a line.
[[nodiscard]] std::string write_table(const std::filesystem::path& folder, const PressTable& table);

}  // namespace haptic::sim
