// Snapshots: moments around the first contact, kept in memory during a run and written as POV-Ray scenes afterwards.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "haptic/sim/simulation.hpp"

namespace haptic::sim {

/// Keeps the step before the first contact, the step of the contact, and those 7 and 100 steps later.
class Snapshots {
  public:
    /// `simulation` must outlive this object.
    explicit Snapshots(const Simulation& simulation);

    /// To be called before each step: keeps the surfaces at its beginning.
    void before_step();
    void after_step(const StepResult& result);

    /// Writes a .pov file for each moment that occurred. Creates the folder. Returns the files.
    [[nodiscard]] std::vector<std::filesystem::path> write(const std::filesystem::path& folder) const;

  private:
    struct Moment {
        std::string name;
        double time_s = 0.0;
        std::vector<Vec3> vertices;
        Vec3 proxy{0.0};
        Vec3 hip{0.0};
        bool from_below = false;  // a flat sheet hides the proxy from above
    };
    void keep(const char* name, const StepResult& result);

    const Simulation* simulation_;
    Moment last_;     // previous step
    Moment present_;  // current step
    std::vector<Moment> kept_;
    std::uint64_t first_contact_ = 0;  // step number; 0: none yet
};

}  // namespace haptic::sim
