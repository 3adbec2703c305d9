#include "app/host_sim_documents.hpp"

#include "haptic/sim/scene.hpp"
#include "program/exit_status.hpp"

namespace haptic::sim {
namespace {

constexpr const char* kReferenceHeading =
    "# Settings of a scene\n\n"
    "Every key of a scene file. This page is generated from the setting tables "
    "(`host-sim/src/scene/scene_tables.cpp`,\n"
    "`src/model/model_keys.cpp`, `src/tool/tool_settings.cpp`); `host-sim --generate DIR` writes it as\n"
    "`DIR/settings.md`. Every key is optional. Use a file with `host-sim run FILE.toml`, and `--set "
    "SECTION.KEY=VALUE`\n"
    "for one key; tables of a list count from 0, as in `--set objects.0.height=1`. Units: m, kg, s, N; y points up.\n";

}  // namespace

ProgramDocuments host_sim_documents() {
    const SettingReference& reference = scene_reference();
    ProgramDocuments documents;
    documents.text = {
        .summary = "simulation of deformable objects for a haptic device",
        .description =
            "host-sim simulates deformable bodies, cloth and rigid tools with position-based dynamics, finds the "
            "contacts of a tool that a hand holds, and publishes the contact planes in shared memory for rt-core(1), "
            "which renders them at 1 kHz.\n\n"
            "A scene is built in (host-sim scenes) or a TOML file; see haptic-scene(5).",
        .exit_status = exit_statuses({kExitDone, kExitFailed, kExitUsage}),
        .files = {{"/usr/share/haptic/scenes", "The built-in scenes, to be copied and changed."},
                  {"/usr/share/haptic/haptic-scene.schema.json", "Schema of scene files, for editors."},
                  {"/etc/default/haptic-host-sim", "Options of haptic-host-sim.service."}},
        .examples = {{"host-sim run fish-hold --view", "Shows a scene in a browser, with the hand of its script."},
                     {"host-sim run cloth-drop --clock real", "Runs a scene with rt-core."},
                     {"host-sim material liver", "Tests bars of a named material, and compares with its figures."},
                     {"host-sim scenes --reference >scene.toml", "Writes a scene file with every key."}},
        .see_also = {"haptic-scene(5)", "rt-core(1)"},
    };
    documents.words.settings = completion_words(reference);
    for (const BuiltInScene& scene : built_in_scenes()) {
        documents.words.names.emplace_back(scene.name);
    }
    documents.settings = {
        .page = "haptic-scene",
        .text =
            {.summary = "scene file of host-sim",
             .description =
                 "A TOML file that says what host-sim simulates. Every key is optional. Units are m, kg, s and N; y "
                 "points up. An unknown key, a wrong type or a value out of range is refused with its line. Keys "
                 "that can be changed while a scene runs are marked. host-sim scenes --reference prints a file "
                 "with all keys.",
             .exit_status = {},
             .files = {{"/usr/share/haptic/scenes", "The built-in scenes."}},
             .examples = {},
             .see_also = {"host-sim(1)"}},
        .default_name = "scene.toml",
        .default_file = default_scene_text(),
        .markdown = markdown_reference(kReferenceHeading, reference),
        .reference = reference,
    };
    return documents;
}

}  // namespace haptic::sim
