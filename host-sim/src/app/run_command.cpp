// host-sim run and host-sim scenes.

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "app/commands.hpp"
#include "app/link_thread.hpp"
#include "app/run.hpp"
#include "app/run_options.hpp"
#include "haptic/sim/scene.hpp"
#include "program/log.hpp"

namespace haptic::sim {

Command add_run_command(CLI::App& app) {
    const auto options = std::make_shared<RunOptions>();
    add_run_options(app, *options);
    return [options] {
        log_to_stderr("host-sim");
        const Plan plan(*options);
        if (plan.view) {
            warn_unless_empty(view::exposure_of(*plan.view));
        }
        // Before the run, whose rings it serves; ends after it.
        std::optional<LinkThread> link;
        if (plan.link) {
            link.emplace(*plan.link);
        }
        return Run(*options, plan, plan.view ? view::open_live_view(*plan.view) : nullptr).execute();
    };
}

Command add_scenes_command(CLI::App& app) {
    const auto reference = std::make_shared<bool>(false);
    app.add_flag("--reference", *reference, "Print a commented scene file with every key and its default instead");
    return [reference] {
        if (*reference) {
            std::cout << default_scene_text();
            return 0;
        }
        for (const BuiltInScene& scene : built_in_scenes()) {
            const Config config = open_scene(std::string(scene.name));
            std::cout << scene.name << ": " << read_scene(config, std::string(scene.name)).description << '\n';
        }
        return 0;
    };
}

}  // namespace haptic::sim
