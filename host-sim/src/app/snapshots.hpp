// Moments of a run, kept in memory while it goes on and written as pictures to be rendered when it is over.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <haptic/sim/simulation.hpp>

namespace haptic::sim {

/// Keeps the step before the first contact, that of the contact, and those 10 and 40 steps later.
class Snapshots {
  public:
    /// `simulation` has to outlive this object.
    explicit Snapshots(const Simulation& simulation);

    /// To be called before each step: the surfaces as the step will find them.
    void before_step();
    void after_step(const StepResult& result);

    /// Writes NAME.pov for each moment that came about, into a folder that is made if need be. Returns the files.
    [[nodiscard]] std::vector<std::filesystem::path> write(const std::filesystem::path& folder) const;

  private:
    struct Moment {
        std::string name;
        double time_s = 0.0;
        std::vector<Vec3> vertices;
        Vec3 proxy{0.0};
        Vec3 hip{0.0};
        bool from_below = false;  // while the sheet is flat, the proxy is seen from there only
    };
    void keep(const char* name, const StepResult& result);

    const Simulation* simulation_;
    Moment last_;     // the step before
    Moment present_;  // this step
    std::vector<Moment> kept_;
    std::uint64_t first_contact_ = 0;  // step; 0: none yet
};

}  // namespace haptic::sim
