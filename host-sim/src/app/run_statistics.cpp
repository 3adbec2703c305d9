#include "app/run_statistics.hpp"

#include <algorithm>
#include <cstdio>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "haptic/report.hpp"
#include "tool/tool_proxies.hpp"

namespace haptic::sim {
namespace {

// Tolerance for rounding in a sum of steps.
constexpr double kRounding = 1.0 - 1e-9;

template <class... Values>
std::string format(const char* pattern, Values... values) {
    std::string text(static_cast<std::size_t>(std::snprintf(nullptr, 0, pattern, values...)), '\0');
    std::snprintf(text.data(), text.size() + 1, pattern, values...);
    return text;
}

std::string hexadecimal(std::uint64_t value) {
    return format("%016llx", static_cast<unsigned long long>(value));
}

std::string line(const char* name, const std::string& value) {
    return format("  %-16s %s\n", name, value.c_str());
}

std::string durations(const Histogram& h) {
    return format("%9.1f %9.1f %9.1f", static_cast<double>(h.percentile_ns(0.5)) * 1e-3,
                  static_cast<double>(h.percentile_ns(0.99)) * 1e-3, static_cast<double>(h.max_ns()) * 1e-3);
}

std::string box_text(const Aabb& box) {
    return format("(%.3f %.3f %.3f) to (%.3f %.3f %.3f) m", box.min.x, box.min.y, box.min.z, box.max.x, box.max.y,
                  box.max.z);
}

std::string crossings(const CrossingTally& tally, const char* what) {
    return tally.steps == 0
               ? std::string("never")
               : format("%llu steps, at most %zu %s", static_cast<unsigned long long>(tally.steps), tally.most, what);
}

/// Where the tool was, where the bodies are, and what would have brought them together.
std::string why_never(const Aabb& tool, const Simulation& simulation) {
    Aabb bodies;
    for (const Vec3& vertex : simulation.vertices()) {
        bodies.extend(vertex);
    }
    const std::string text = line("  tool was in", box_text(tool)) + line("  bodies are in", box_text(bodies));
    // The widest gap between the boxes, and the way across it.
    const Vec3 above = bodies.min - tool.max;  // positive: the bodies lie beyond the tool
    const Vec3 below = tool.min - bodies.max;
    int axis = 0;
    for (int i = 1; i < 3; ++i) {
        axis = std::max(above[i], below[i]) > std::max(above[axis], below[axis]) ? i : axis;
    }
    const double gap = std::max(above[axis], below[axis]);
    if (gap <= 0.0) {
        return text + line("  to touch", "the tool passed beside the surfaces: --view shows where");
    }
    return text +
           line("  to touch", format("move the hand at least %.3f m along %c, or the bodies by as much the other way "
                                     "(hand.positions, model.offset)",
                                     above[axis] > below[axis] ? gap : -gap, "xyz"[axis]));
}

}  // namespace

void RunStatistics::add(const StepResult& result) {
    ++steps_;
    const StageTimes& t = result.times;
    times_.total.record(t.total_ns);
    times_.ccd.record(t.ccd_ns);
    times_.popout.record(t.popout_ns);
    times_.proxy.record(t.proxy_ns);
    times_.tool.record(t.tool_ns);
    times_.deform.record(t.deform_ns);
    times_.collide.record(t.collide_ns);
    times_.skin.record(t.skin_ns);
    reached_.extend(result.proxy);
    // Contact: total, mean force, and the longest contact without a break.
    const double hand_force = glm::length(result.hand_force);
    if (result.in_contact) {
        ++in_contact_;
        force_sum_ += hand_force;
        held_since_s_ = held_s_ > 0.0 ? held_since_s_ : result.time;
        held_s_ = result.time + result.step - held_since_s_;
        if (first_contact_s_ < 0.0) {
            first_contact_s_ = result.time;
        }
    } else {
        held_s_ = 0.0;
    }
    max_held_s_ = std::max(max_held_s_, held_s_);
    // Impulses of hand and bodies. The hand may meet a surface before the simulation does.
    if (result.in_contact || result.hand_impulse != Vec3(0.0)) {
        impulses_until_s_ = result.time + kAfterContact;
    }
    if (result.time <= impulses_until_s_) {
        window_hand_ += result.hand_impulse;
        window_bodies_ += result.body_impulse;
        window_s_ += result.step;
    }
    // Along what the bodies received over a window: across it the hand feels the strings' own noise.
    if (const double bodies = glm::length(window_bodies_);
        window_s_ >= kImpulseWindow || result.time > impulses_until_s_) {
        hand_impulse_ += bodies > 0.0 ? glm::dot(window_hand_, window_bodies_) / bodies : 0.0;
        body_impulse_ += bodies;
        window_hand_ = window_bodies_ = Vec3(0.0);
        window_s_ = 0.0;
    }
    // Failures and extremes.
    overconstrained_ += result.overconstrained ? 1 : 0;
    stood_still_ += result.stood_still ? 1 : 0;
    sleeping_ += result.asleep > 0 ? 1 : 0;
    asleep_ = result.asleep;
    escapes_ += result.crossed ? 1 : 0;
    sheets_.add(result.surfaces.sheets);
    solids_.add(result.surfaces.solids);
    others_.add(result.surfaces.others);
    below_ground_.add(result.surfaces.below_ground);
    max_ground_depth_ = std::max(max_ground_depth_, result.surfaces.ground_depth);
    max_collided_ = std::max(max_collided_, result.collided);
    max_hand_torque_ = std::max(max_hand_torque_, glm::length(result.hand_torque));
    max_depth_ = std::max(max_depth_, result.depth);
    max_hand_force_ = std::max(max_hand_force_, hand_force);
    max_scene_force_ = std::max(max_scene_force_, glm::length(result.force));
}

bool RunStatistics::caught() const noexcept {
    const bool held = max_held_s_ >= kHeldForSeconds * kRounding || held_s_ > 0.0;
    return held && escapes_ == 0;
}

std::vector<std::string> RunStatistics::violations() const {
    // Other crossings, as those of solids with sheets, are reported only: nothing keeps their surfaces from it.
    std::vector<std::string> violations;
    if (sheets_.steps > 0) {
        violations.push_back("a sheet passed through a sheet, seen in " + std::to_string(sheets_.steps) + " steps");
    }
    if (solids_.steps > 0) {
        violations.push_back("a solid passed through a solid, seen in " + std::to_string(solids_.steps) + " steps");
    }
    if (below_ground_.steps > 0) {
        violations.push_back("a surface was below the ground, seen in " + std::to_string(below_ground_.steps) +
                             " steps");
    }
    if (escapes_ > 0) {
        violations.push_back("the proxy's centre passed through a surface in " + std::to_string(escapes_) + " steps");
    }
    return violations;
}

nlohmann::json RunStatistics::surface_report(bool verified) const {
    const auto tally = [](const CrossingTally& t) { return nlohmann::json{{"steps", t.steps}, {"most", t.most}}; };
    nlohmann::json report = {{"verified", verified},
                             {"sheets", tally(sheets_)},
                             {"solids", tally(solids_)},
                             {"others", tally(others_)},
                             {"ground", tally(below_ground_)}};
    report["ground"]["max_depth_m"] = max_ground_depth_;
    return report;
}

nlohmann::json RunStatistics::report(const Simulation& simulation, double wall_s, bool verified) const {
    const Scene& scene = simulation.scene();
    nlohmann::json report;
    report["scene"] = scene.name;
    report["steps"] = steps_;
    report["sim_s"] = simulation.time();
    report["wall_s"] = wall_s;
    report["steps_per_s"] = wall_s > 0.0 ? static_cast<double>(steps_) / wall_s : 0.0;
    report["caught"] = caught();
    report["state_hash"] = hexadecimal(simulation.state_hash());
    report["counts"] = {{"vertices", simulation.mesh().vertices.size()},
                        {"triangles", simulation.mesh().triangles.size()},
                        {"particles", simulation.model().size()},
                        {"proxies", simulation.tool().particles().size()}};
    report["contact"] = {{"steps_in_contact", in_contact_},
                         {"escapes", escapes_},
                         {"verified", verified},
                         {"max_depth_m", max_depth_},
                         {"squeezed_steps", overconstrained_},
                         {"standing_steps", stood_still_},
                         {"sleeping_steps", sleeping_},
                         {"most_proxies", max_collided_}};
    if (first_contact_s_ >= 0.0) {
        report["contact"]["first_contact_s"] = first_contact_s_;
    }
    report["surface_crossings"] = surface_report(verified);
    report["force_N"] = {{"max", max_hand_force_},
                         {"mean_in_contact", in_contact_ > 0 ? force_sum_ / static_cast<double>(in_contact_) : 0.0},
                         {"max_in_scene", max_scene_force_}};
    report["hand"] = {{"impulse_N_s", hand_impulse_},
                      {"impulse_on_bodies_N_s", body_impulse_},
                      {"ratio", body_impulse_ > 0.0 ? nlohmann::json(hand_impulse_ / body_impulse_) : nullptr}};
    report["torque_Nm"] = {{"max", max_hand_torque_}};
    report["timing_us"] = {{"total", summary_us(times_.total)},     {"ccd", summary_us(times_.ccd)},
                           {"popout", summary_us(times_.popout)},   {"proxy", summary_us(times_.proxy)},
                           {"tool", summary_us(times_.tool)},       {"deform", summary_us(times_.deform)},
                           {"collide", summary_us(times_.collide)}, {"skin", summary_us(times_.skin)}};
    report["histograms"] = {{"step", buckets_us(times_.total)}};
    return report;
}

std::string RunStatistics::summary(const Simulation& simulation, double wall_s, bool verified) const {
    const double simulated = simulation.time();
    std::string text = simulation.scene().name + ": " +
                       format("%.2f s in %llu steps\n", simulated, static_cast<unsigned long long>(steps_));
    text += line("caught", caught() ? "yes" : "no");
    text += line("escapes", verified ? std::to_string(escapes_) : "not counted (use --verify)");
    if (verified) {
        text += line("surfaces cross", "");
        text += line("  sheets", crossings(sheets_, "edges through them"));
        text += line("  solids", crossings(solids_, "edges through them"));
        text += line("  others", crossings(others_, "edges through them"));
        text += line("  the ground",
                     crossings(below_ground_, "vertices below it") +
                         (below_ground_.steps > 0 ? format(", %.2g mm deep", 1e3 * max_ground_depth_) : std::string()));
    }
    text += line("in contact", first_contact_s_ < 0.0
                                   ? std::string("never")
                                   : format("%llu steps, first at %.2f s", static_cast<unsigned long long>(in_contact_),
                                            first_contact_s_));
    if (first_contact_s_ < 0.0 && steps_ > 0) {
        text += why_never(reached_, simulation);
    }
    if (overconstrained_ > 0) {
        text += line("overconstrained", format("%llu steps", static_cast<unsigned long long>(overconstrained_)));
    }
    if (stood_still_ > 0) {
        text += line("stood still", format("bodies in %llu steps", static_cast<unsigned long long>(stood_still_)));
    }
    if (sleeping_ > 0) {
        text += line("asleep", format("bodies in %llu steps, %zu of %zu at the end",
                                      static_cast<unsigned long long>(sleeping_), asleep_, simulation.bodies().size()));
    }
    text += line("peak force", format("%.2f N at the hand, %.2f N in the scene", max_hand_force_, max_scene_force_));
    if (simulation.tool().particles().size() > 1) {
        text += line("tool", format("%zu proxies, at most %zu in contact, peak torque %.4f N*m at the hand",
                                    simulation.tool().particles().size(), max_collided_, max_hand_torque_));
    }
    text += line("speed", format("%.0f steps/s", wall_s > 0.0 ? static_cast<double>(steps_) / wall_s : 0.0));
    text += line("us per step", "      p50       p99       max");
    text += line("  total", durations(times_.total));
    text += line("  ccd", durations(times_.ccd));
    text += line("  pop-out", durations(times_.popout));
    text += line("  proxy", durations(times_.proxy));
    text += line("  tool", durations(times_.tool));
    text += line("  collide", durations(times_.collide));
    text += line("  deform", durations(times_.deform));
    text += line("  skin", durations(times_.skin));
    text += line("state", hexadecimal(simulation.state_hash()));
    return text;
}

}  // namespace haptic::sim
