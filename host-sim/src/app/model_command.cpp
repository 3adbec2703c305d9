// host-sim model: builds the particles of a body, describes them, and writes them to an editable file.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <glm/geometric.hpp>
#include <iomanip>
#include <iostream>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "app/body_argument.hpp"
#include "app/commands.hpp"
#include "dynamics/rotation.hpp"
#include "haptic/config.hpp"
#include "haptic/sim/model_settings.hpp"
#include "model/generator_table.hpp"
#include "model/idle_keys.hpp"
#include "model/model_file.hpp"
#include "program/option_checks.hpp"
#include "program/progress_bar.hpp"
#include "program/results.hpp"

namespace haptic::sim {
namespace {

struct ModelOptions {
    std::string what;
    std::vector<std::string> assignments;
    std::string out;
};

/// Minimum, median and maximum of some values.
struct Spread {
    explicit Spread(std::vector<double> values) {
        if (values.empty()) {
            return;
        }
        std::sort(values.begin(), values.end());
        min = values.front();
        median = values[values.size() / 2];
        max = values.back();
    }
    double min = 0.0;
    double median = 0.0;
    double max = 0.0;
};

std::ostream& operator<<(std::ostream& out, const Spread& spread) {
    return out << spread.min << " .. " << spread.max << ", median " << spread.median;
}

/// Particles in the order of their x, to look only at those near in x.
class ParticlesByX {
  public:
    explicit ParticlesByX(const ParticleModel& model) {
        for (std::uint32_t i = 0; i < model.size(); ++i) {
            order_.emplace_back(model.rest_position[i].x, i);
        }
        std::sort(order_.begin(), order_.end());
    }

    /// Calls `visit` with particles by their distance in x from `x` on either side, while it returns true.
    template <class Visit>
    void visit_from(double x, const Visit& visit) const {
        const auto middle = std::lower_bound(order_.begin(), order_.end(), std::pair{x, std::uint32_t{0}});
        for (auto next = middle; next != order_.end() && visit(next->second); ++next) {
        }
        for (auto next = middle; next != order_.begin() && visit((next - 1)->second); --next) {
        }
    }

  private:
    std::vector<std::pair<double, std::uint32_t>> order_;
};

std::vector<double> nearest_distances(const ParticleModel& model, const ParticlesByX& by_x) {
    std::vector<double> nearest(model.size(), std::numeric_limits<double>::infinity());
    for (std::uint32_t i = 0; i < model.size(); ++i) {
        const Vec3& p = model.rest_position[i];
        by_x.visit_from(p.x, [&](std::uint32_t j) {
            if (j != i) {
                nearest[i] = std::min(nearest[i], glm::length(p - model.rest_position[j]));
            }
            return std::abs(model.rest_position[j].x - p.x) <= nearest[i];
        });
    }
    return nearest;
}

double covered_part(const DeformableBody& body, const ParticlesByX& by_x) {
    const ParticleModel& model = body.particles;
    double reach = 0.0;  // m, of any ellipsoid
    for (const Vec3& axes : model.semi_axes) {
        reach = std::max({reach, axes.x, axes.y, axes.z});
    }
    std::size_t covered = 0;
    for (const Vec3& p : body.mesh.vertices) {
        bool inside = false;
        by_x.visit_from(p.x, [&](std::uint32_t i) {
            const Vec3& axes = model.semi_axes[i];
            if (std::min({axes.x, axes.y, axes.z}) > 0.0) {
                const Vec3 q = glm::transpose(to_matrix(model.axes[i])) * (p - model.rest_position[i]) / axes;
                inside = inside || glm::dot(q, q) <= 1.0;
            }
            return !inside && std::abs(model.rest_position[i].x - p.x) <= reach;
        });
        covered += inside ? 1 : 0;
    }
    return static_cast<double>(covered) / static_cast<double>(body.mesh.vertices.size());
}

void print(std::ostream& out, const DeformableBody& body) {
    const ParticleModel& model = body.particles;
    const ParticlesByX by_x(model);
    std::vector<double> members;
    std::set<double> stiffnesses;
    for (const Group& group : model.groups) {
        members.push_back(static_cast<double>(group.members.size()));
        stiffnesses.insert(group.stiffness);
    }
    double mass = 0.0;
    for (const double m : model.mass) {
        mass += m;
    }
    std::size_t driven = 0;
    for (const Motion& motion : body.motions) {
        driven += motion.particles.size();
    }
    std::vector<double> semi_axes;
    for (const Vec3& axes : model.semi_axes) {
        semi_axes.insert(semi_axes.end(), {axes.x, axes.y, axes.z});
    }
    out << std::setprecision(4) << body.name << ":\n"
        << "  mesh          " << body.mesh.vertices.size() << " vertices, " << body.mesh.triangles.size()
        << " triangles, " << (body.mesh.closed ? "closed" : "open") << '\n'
        << "  particles     " << model.size() << " (" << std::count(model.pinned.begin(), model.pinned.end(), 1)
        << " fixed, " << driven << " of them driven)\n";
    if (model.size() > 1) {
        out << "  spacing       " << Spread(nearest_distances(model, by_x)) << " m, to the nearest neighbour\n";
    }
    out << "  mass          " << mass << " kg; per particle " << Spread(model.mass) << " kg\n"
        << "  groups        " << model.groups.size() << " of " << Spread(members) << " members; stiffness";
    for (const double stiffness : stiffnesses) {
        out << ' ' << stiffness;
    }
    out << "\n  links         " << model.links.size() << '\n'
        << "  ellipsoids    semi-axes " << Spread(semi_axes) << " m; " << 100.0 * covered_part(body, by_x)
        << " % of the vertices are inside one\n";
}

int run_model(const ModelOptions& options) {
    Config config = config_of_body(options.what);
    for (const std::string& assignment : options.assignments) {
        config.set(assignment);
    }
    const ModelSettings settings = read_model(config, "model");
    config.reject_unknown();
    if (const std::string notice = idle_key_notice(config, "model", settings); !notice.empty()) {
        std::cerr << notice << '\n';
    }
    const DeformableBody body = with_progress_bar(
        "building " + options.what, [&](const Progress& progress) { return make_body(settings, progress); });
    print(std::cout, body);
    if (!options.out.empty()) {
        write_for("--out", [&] { save_model(options.out, body); });
        std::cout << "  written to    " << options.out << '\n';
    }
    return 0;
}

}  // namespace

Command add_model_command(CLI::App& app) {
    const auto options = std::make_shared<ModelOptions>();
    app.add_option("what", options->what, generator_names() + ", or a mesh file")->required();
    app.add_option("--set", options->assignments,
                   "Override a key of the [model] table, e.g. model.particles_count=200; repeatable")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    app.add_option("--out", options->out, "Write the particles to this file; a scene reads it with model.particles")
        ->check(result_file());
    return [options] { return run_model(*options); };
}

}  // namespace haptic::sim
