// Setting tables of a scene: every key outside [model], [[objects]] and [tool].
#pragma once

#include <vector>

#include "haptic/probe.hpp"
#include "haptic/setting.hpp"
#include "haptic/sim/scene.hpp"

namespace haptic::sim {

/// Table [hand]: a script of the hand's motion, with one element, or three or four numbers, for each time.
struct HandScript {
    std::vector<double> times{0.0};                // s
    std::vector<double> positions{0.0, 0.0, 0.0};  // m, x, y, z
    std::vector<double> orientations;              // w, x, y, z; empty: none
    std::vector<double> curl;                      // empty: none
    bool repeat = false;
};

const SettingTable<Scene>& top_level_table();
const SettingTable<SolverSettings>& solver_table();
const SettingTable<CollisionSettings>& collisions_table();
const SettingTable<ProxySettings>& proxy_table();
const SettingTable<ContactSettings>& proxy_friction_table();
const SettingTable<ContactSettings>& contact_table();
const SettingTable<CouplingSettings>& coupling_table();
const SettingTable<HandScript>& hand_table();
const SettingTable<WorkspaceSettings>& workspace_table();
const SettingTable<Scene>& step_probe_table();

/// The keys that read_scene() turns into something else.
struct SceneKeys {
    HandScript hand;
    ProbeSettings probes;
};

/// Calls visit(table, struct) for each table and the struct that it fills.
template <typename Visitor>
void visit_tables(Scene& scene, SceneKeys& keys, const Visitor& visit) {
    visit(solver_table(), scene.solver);
    visit(collisions_table(), scene.collisions);
    visit(proxy_table(), scene.proxy);
    visit(proxy_friction_table(), scene.contact);
    visit(contact_table(), scene.contact);
    visit(coupling_table(), scene.coupling);
    visit(hand_table(), keys.hand);
    visit(workspace_table(), scene.workspace);
    visit(probe_settings(), keys.probes);
    visit(step_probe_table(), scene);
}

}  // namespace haptic::sim
