#include "measure/measure_report.hpp"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "haptic/report.hpp"
#include "measure/tick_explanation.hpp"

namespace haptic::rt {
namespace {

constexpr int kVersion = 1;
constexpr std::int64_t kHourNs = 3600 * kNanosecondsPerSecond;

constexpr std::array<LatencyName, kLatencies> kNames = {{
    {Latency::Wakeup, "wakeup", "wake-up", "from the deadline to the start of the tick"},
    {Latency::Period, "period", "period", "from one wake-up to the next"},
    {Latency::Compute, "compute", "compute", "the whole tick, from wake-up to end, including the exchanges"},
    {Latency::Exchange, "exchange", "exchange", "the exchanges with the board"},
    {Latency::DeviceToPlane, "device_to_plane", "device to plane",
     "age of the device state that the planes in use respond to, at each tick that renders them"},
    {Latency::MotionToForce, "motion_to_force", "motion to force",
     "from the start of the exchange that latches the encoders to the end of the exchange that sends the resulting "
     "force to the motors"},
}};

double us(std::int64_t duration_ns) {
    return static_cast<double>(duration_ns) * 1e-3;
}

const Percentile& percentile(std::string_view key) {
    return *std::find_if(kPercentiles.begin(), kPercentiles.end(),
                         [&](const Percentile& one) { return key == one.key; });
}

/// True of the entry of a peer tool that measured wake-ups.
bool has_wakeups(const nlohmann::json& peer) {
    return peer.is_object() && peer.contains("wakeup_us");
}

/// Of a Histogram or a PeriodHistogram.
template <class AnyHistogram>
nlohmann::json distribution_us(const AnyHistogram& histogram) {
    nlohmann::json result = {{"count", histogram.count()},
                             {"min", us(histogram.min_ns())},
                             {"mean", histogram.mean_ns() * 1e-3},
                             {"max", us(histogram.max_ns())},
                             {"histogram", buckets_us(histogram)}};
    for (const Percentile& one : kPercentiles) {
        result[one.key] = us(histogram.percentile_ns(one.fraction));
    }
    return result;
}

nlohmann::json distribution_of(const Instruments& m, Latency latency) {
    switch (latency) {
        case Latency::Wakeup:
            return distribution_us(m.wakeup);
        case Latency::Period:
            return distribution_us(m.period);
        case Latency::Compute:
            return distribution_us(m.compute);
        case Latency::Exchange:
            return distribution_us(m.exchange);
        case Latency::DeviceToPlane:
            return distribution_us(m.state_age);
        case Latency::MotionToForce:
            break;
    }
    return distribution_us(m.motion_to_force);
}

std::int64_t stolen_ms_around(const Measurement& m, std::int64_t at_ns) {
    const KernelWindow* const window = m.kernel->window_of(at_ns);
    return window == nullptr ? -1 : window->counts.stolen_ms;
}

/// Adds time, stage and cause of a distribution's maximum.
void add_maximum(nlohmann::json& entry, const Measurement& m, const MedianTimes& usual, Latency latency) {
    const TimedTick& tick = m.log->largest(latency);
    if (tick.number == 0) {
        return;
    }
    entry["max_at"] = time_of_day(tick.now_ns + m.real_minus_monotonic_ns);
    entry["max_at_s"] = seconds(tick.now_ns - m.began_ns);
    entry["max_tick"] = tick.number;
    // The age of the planes depends on the simulation, not on this tick.
    if (latency == Latency::DeviceToPlane) {
        entry["max_stage"] = "simulation";
        entry["max_cause"] = "frames";
        entry["max_why"] = "the newest frame responded to a device state of this age: the simulation takes this long";
        return;
    }
    // Wake-up and period are lost before the tick runs, all others in its stages.
    const bool before_tick = latency == Latency::Wakeup || latency == Latency::Period;
    const TickExplanation explained =
        explain(tick, usual, stolen_ms_around(m, tick.now_ns), before_tick ? Explain::Wakeup : Explain::Stages);
    entry["max_stage"] = name_of(explained.stage);
    entry["max_cause"] = name_of(explained.cause);
    entry["max_why"] = explained.why;
}

nlohmann::json latencies_json(const Measurement& m, const MedianTimes& usual) {
    nlohmann::json result = nlohmann::json::object();
    for (const LatencyName& name : kNames) {
        nlohmann::json entry = distribution_of(*m.instruments, name.latency);
        entry["what"] = name.what;
        add_maximum(entry, m, usual, name.latency);
        result[std::string(name.key)] = std::move(entry);
    }
    return result;
}

nlohmann::json tick_json(const Measurement& m, const MedianTimes& usual, const TimedTick& tick) {
    const TickExplanation explained = explain(tick, usual, stolen_ms_around(m, tick.now_ns));
    nlohmann::json stages = nlohmann::json::object();
    for (std::size_t i = 0; i < kLateStages; ++i) {
        const auto stage = static_cast<LateStage>(i);
        stages[std::string(name_of(stage))] = us(time_in(tick, stage));
    }
    nlohmann::json result = {{"tick", tick.number},
                             {"at", time_of_day(tick.now_ns + m.real_minus_monotonic_ns)},
                             {"at_s", seconds(tick.now_ns - m.began_ns)},
                             {"late_us", us(tick.lateness_ns())},
                             {"stages_us", stages},
                             {"missed", tick.missed},
                             {"page_faults", tick.usage.page_faults},
                             {"voluntary_switches", tick.usage.voluntary_switches},
                             {"forced_switches", tick.usage.forced_switches},
                             {"waited_us", tick.waited_ns < 0 ? nlohmann::json() : nlohmann::json(us(tick.waited_ns))},
                             {"state", state_name(static_cast<SafetyState>(tick.safety_state))},
                             {"stage", name_of(explained.stage)},
                             {"excess_us", us(explained.excess_ns)},
                             {"cause", name_of(explained.cause)},
                             {"why", explained.why}};
    if (const KernelWindow* const window = m.kernel->window_of(tick.now_ns); window != nullptr) {
        result["unusual_interrupts"] = unusual_interrupts(*window, *m.kernel);
    }
    return result;
}

nlohmann::json ticks_json(const Measurement& m, const MedianTimes& usual, std::span<const TimedTick> ticks) {
    nlohmann::json list = nlohmann::json::array();
    for (const TimedTick& tick : ticks) {
        list.push_back(tick_json(m, usual, tick));
    }
    return list;
}

/// Missed deadlines, and the causes of the explained late ticks.
nlohmann::json overruns_json(const Measurement& m, const nlohmann::json& late) {
    nlohmann::json causes = nlohmann::json::object();
    const std::size_t explained = late.size();
    for (const nlohmann::json& tick : late) {
        const std::string cause = tick.at("stage").get<std::string>() + ": " + tick.at("cause").get<std::string>();
        causes[cause] = causes.value(cause, 0) + 1;
    }
    return {{"deadlines_missed", m.log->missed()},
            {"late_ticks", m.log->late_ticks()},
            {"explained_ticks", explained},
            {"causes", causes}};
}

nlohmann::json kernel_json(const KernelWatch& kernel) {
    const ProcessorCounts& total = kernel.total();
    nlohmann::json interrupts = nlohmann::json::object();
    const double per_s = kernel.watched_s() > 0.0 ? 1.0 / kernel.watched_s() : 0.0;
    for (std::size_t i = 0; i < total.interrupts.size(); ++i) {
        if (total.interrupts[i] > 0) {
            interrupts[kernel.names()[i]] = static_cast<double>(total.interrupts[i]) * per_s;
        }
    }
    // Counters that the kernel does not have are null.
    const auto known = [](std::int64_t value, double unit) {
        return value < 0 ? nlohmann::json() : nlohmann::json(static_cast<double>(value) * unit);
    };
    return {{"interrupts_per_s", interrupts},
            {"stolen_ms", known(total.stolen_ms, 1.0)},
            {"queued_ms", known(total.queued_us, 1e-3)}};
}

/// Percentiles and maximum of each interval; null where no tick ran.
nlohmann::json course_json(const LatencyCourse& course, std::int64_t began_ns) {
    nlohmann::json result = {{"start_s", course.start_ns() < 0 ? 0.0 : seconds(course.start_ns() - began_ns)},
                             {"piece_s", seconds(course.interval_ns())},
                             {"ticks", nlohmann::json::array()},
                             {"max_us", nlohmann::json::array()}};
    for (std::size_t i = 0; i < course.size(); ++i) {
        const CompactHistogram& interval = course.at(i);
        const auto value = [&](std::int64_t duration_ns) {
            return interval.count() == 0 ? nlohmann::json() : nlohmann::json(us(duration_ns));
        };
        result["ticks"].push_back(interval.count());
        result["max_us"].push_back(value(interval.max_ns()));
        for (const char* key : kCoursePercentiles) {
            result[std::string(key) + "_us"].push_back(value(interval.percentile_ns(percentile(key).fraction)));
        }
    }
    return result;
}

/// Distributions of the ticks in a part of the run, by whole intervals.
nlohmann::json part_json(const RunCourse& run, std::int64_t from_ns, std::int64_t to_ns) {
    nlohmann::json result = {{"from_s", seconds(from_ns)}, {"to_s", seconds(to_ns)}};
    for (const CourseName& name : kCourses) {
        const CompactHistogram part = (run.*name.course).between(from_ns, to_ns);
        nlohmann::json entry = {{"count", part.count()}, {"max", us(part.max_ns())}};
        for (const Percentile& one : kPercentiles) {
            entry[one.key] = us(part.percentile_ns(one.fraction));
        }
        result[name.key] = std::move(entry);
    }
    return result;
}

/// The courses, and their first and last hour; of a run of less than two hours its halves.
nlohmann::json courses_json(const RunCourse& run, std::int64_t began_ns) {
    nlohmann::json result = {{"lost_ticks", run.lost}};
    for (const CourseName& name : kCourses) {
        result[name.key] = course_json(run.*name.course, began_ns);
        result[name.key]["what"] = name.what;
    }
    const std::int64_t whole_ns = static_cast<std::int64_t>(run.wakeup.size()) * run.wakeup.interval_ns();
    const std::int64_t part_ns = std::min(whole_ns / 2, kHourNs);
    result["first"] = part_json(run, 0, part_ns);
    result["last"] = part_json(run, whole_ns - part_ns, whole_ns);
    return result;
}

/// Quotients of the percentiles and maxima of two distributions; null where the divisor is 0.
nlohmann::json ratio_json(const nlohmann::json& dividend, const nlohmann::json& divisor) {
    nlohmann::json result = nlohmann::json::object();
    const auto divide = [&](const char* key) {
        const double by = divisor.at(key).get<double>();
        result[key] = by > 0.0 ? nlohmann::json(dividend.at(key).get<double>() / by) : nlohmann::json();
    };
    for (const Percentile& one : kPercentiles) {
        divide(one.key);
    }
    divide("max");
    return result;
}

nlohmann::json noise_json(const ProcessorNoise& noise) {
    return {{"runtime_us", noise.runtime_us},
            {"noise_us", noise.noise_us},
            {"available_percent", noise.available_percent},
            {"max_period_us", noise.max_period_us},
            {"max_single_us", noise.max_single_us},
            {"hardware", noise.hardware},
            {"nmi", noise.nmi},
            {"interrupts", noise.interrupts},
            {"softirqs", noise.softirqs},
            {"threads", noise.threads}};
}

/// What a peer tool found. `wakeup` is that of the loop.
nlohmann::json peer_json(const PeerResult& peer, const nlohmann::json& wakeup) {
    if (!peer.missing.empty()) {
        return {{"missing", peer.missing}};
    }
    nlohmann::json result = {{"command", peer.command}};
    if (!peer.failure.empty()) {
        result["failure"] = peer.failure;
    }
    if (peer.noise) {
        result["noise"] = noise_json(*peer.noise);
    } else if (peer.wakeup.count() > 0) {
        result["beyond"] = peer.beyond;
        result["wakeup_us"] = distribution_us(peer.wakeup);
        result["ratio"] = ratio_json(wakeup, result.at("wakeup_us"));
    }
    if (peer.interrupt.count() > 0) {
        result["interrupt_us"] = distribution_us(peer.interrupt);
    }
    return result;
}

/// Adds an entry for each tool: null if it was not asked for.
void add_peers(nlohmann::json& measure, const Measurement& m, const nlohmann::json& wakeup) {
    for (const PeerTool& tool : peer_tools()) {
        nlohmann::json& entry = measure[std::string(tool.name)];
        for (const MeasuredPeer& peer : m.peers) {
            if (peer.tool == &tool) {
                entry = peer_json(*peer.result, wakeup);
            }
        }
    }
    // The first tool, cyclictest, is the one that the others are compared with too.
    const nlohmann::json& reference = measure.at(std::string(peer_tools().front().name));
    for (const PeerTool& tool : peer_tools().subspan(1)) {
        nlohmann::json& entry = measure[std::string(tool.name)];
        if (has_wakeups(entry) && has_wakeups(reference)) {
            entry["ratio_to_cyclictest"] = ratio_json(entry.at("wakeup_us"), reference.at("wakeup_us"));
        }
    }
}

nlohmann::json loopback_json(const LoopbackResult& loopback, const ProbesUse& probes) {
    const EdgeStatistics& edges = loopback.edges;
    nlohmann::json result = {{"line", loopback.line},
                             {"edges", loopback.kind == EdgeKind::Both ? "both" : "rising"},
                             {"rising", edges.rising},
                             {"falling", edges.falling},
                             {"ticks", probes.ticks},
                             {"driven_edges", probes.tick.edges},
                             {"lost", edges.lost},
                             {"long_periods", edges.long_periods},
                             {"problem", loopback.problem},
                             {"period_us", distribution_us(edges.period)},
                             {"lateness_us", distribution_us(edges.lateness)}};
    result["high_us"] = loopback.kind == EdgeKind::Both ? distribution_us(edges.high) : nlohmann::json();
    return result;
}

}  // namespace

const std::array<LatencyName, kLatencies>& latency_names() noexcept {
    return kNames;
}

std::string time_of_day(std::int64_t real_ns) {
    const std::time_t whole = real_ns / kNanosecondsPerSecond;
    std::tm date{};
    localtime_r(&whole, &date);
    std::array<char, 32> until_seconds{};
    std::array<char, 8> zone{};
    std::strftime(until_seconds.data(), until_seconds.size(), "%Y-%m-%dT%H:%M:%S", &date);
    std::strftime(zone.data(), zone.size(), "%z", &date);  // +0100
    std::array<char, 16> fraction{};
    std::snprintf(fraction.data(), fraction.size(), ".%06d",
                  static_cast<int>(real_ns % kNanosecondsPerSecond / 1000 % 1'000'000));
    const std::string offset = zone.data();
    return std::string(until_seconds.data()) + fraction.data() + offset.substr(0, 3) + ":" + offset.substr(3);
}

nlohmann::json make_measure_report(const Measurement& m) {
    const MedianTimes usual = median_times(*m.instruments);
    nlohmann::json report = make_report(*m.result, *m.instruments);
    nlohmann::json latencies = latencies_json(m, usual);
    nlohmann::json late = ticks_json(m, usual, m.log->late());
    nlohmann::json& measure = report["measure"];
    measure = {{"version", kVersion},
               {"began", time_of_day(m.began_ns + m.real_minus_monotonic_ns)},
               {"period_s", seconds(m.period_ns)},
               {"load", m.load.empty() ? nlohmann::json() : nlohmann::json(m.load)},
               {"overruns", overruns_json(m, late)},
               {"kernel", kernel_json(*m.kernel)},
               {"course", courses_json(*m.course, m.began_ns)}};
    add_peers(measure, m, latencies.at("wakeup"));
    measure["loopback"] = m.loopback == nullptr ? nlohmann::json() : loopback_json(*m.loopback, m.result->probes);
    measure["latency_us"] = std::move(latencies);
    measure["worst_ticks"] = ticks_json(m, usual, m.log->worst());
    measure["late_ticks"] = std::move(late);
    return report;
}

std::vector<PeerRow> peer_rows(const nlohmann::json& measure) {
    std::vector<PeerRow> rows;
    for (const PeerTool& tool : peer_tools()) {
        const std::string name(tool.name);
        if (!measure.contains(name) || !has_wakeups(measure.at(name))) {
            continue;
        }
        const nlohmann::json& peer = measure.at(name);
        rows.push_back({name + "'s wake-up", &peer.at("wakeup_us"), false});
        if (peer.contains("interrupt_us")) {
            rows.push_back({name + "'s interrupt", &peer.at("interrupt_us"), false});
        }
        rows.push_back({"rt-core / " + name, &peer.at("ratio"), true});
        if (peer.contains("ratio_to_cyclictest")) {
            rows.push_back({name + " / cyclictest", &peer.at("ratio_to_cyclictest"), true});
        }
    }
    return rows;
}

std::vector<std::string> peer_notes(const nlohmann::json& measure) {
    std::vector<std::string> notes;
    for (const PeerTool& tool : peer_tools()) {
        const std::string name(tool.name);
        if (!measure.contains(name) || !measure.at(name).is_object()) {
            continue;
        }
        const nlohmann::json& peer = measure.at(name);
        if (peer.contains("missing")) {
            notes.push_back(name + " was not run: " + peer.at("missing").get<std::string>());
        }
        if (peer.contains("failure")) {
            notes.push_back(name + " was not run again: " + peer.at("failure").get<std::string>());
        }
        if (peer.contains("noise")) {
            const nlohmann::json& noise = peer.at("noise");
            std::array<char, 320> text{};
            std::snprintf(text.data(), text.size(),
                          "%s: a thread of this priority that never sleeps had the processor for %.4f %% of %.1f s; at "
                          "most %.1f us were taken from it at once, by %llu interrupts, %llu softirqs, %llu threads, "
                          "%llu NMIs, and %llu times by firmware or a hypervisor",
                          name.c_str(), noise.at("available_percent").get<double>(),
                          noise.at("runtime_us").get<double>() * 1e-6, noise.at("max_single_us").get<double>(),
                          noise.at("interrupts").get<unsigned long long>(),
                          noise.at("softirqs").get<unsigned long long>(), noise.at("threads").get<unsigned long long>(),
                          noise.at("nmi").get<unsigned long long>(), noise.at("hardware").get<unsigned long long>());
            notes.emplace_back(text.data());
        }
    }
    return notes;
}

nlohmann::json late_tick_json(const TimedTick& tick, const TraceExplanation& explanation) {
    constexpr std::array<const char*, 3> states = {"asleep", "ready", "running"};
    nlohmann::json parts = nlohmann::json::array();
    for (const TracePart& part : explanation.parts) {
        parts.push_back({{"from_us", us(part.begin_ns - tick.deadline_ns)},
                         {"to_us", us(part.end_ns - tick.deadline_ns)},
                         {"state", states[static_cast<std::size_t>(part.state)]},
                         {"cpu", part.cpu},
                         {"by", part.by}});
    }
    return {{"tick", tick.number},
            {"late_us", us(tick.lateness_ns())},
            {"cause", name_of(explanation.cause)},
            {"lost_us", us(explanation.lost_ns)},
            {"thread", explanation.thread},
            {"why", explanation.why},
            {"parts", std::move(parts)}};
}

void require_measurement(const nlohmann::json& report, const std::string& origin) {
    if (!report.is_object() || !report.contains("measure") || !report.at("measure").is_object() ||
        !report.at("measure").contains("latency_us")) {
        throw std::runtime_error(origin + ": is not a measurement report; rt-core measure --report writes one");
    }
    if (report.at("measure").value("version", 0) != kVersion) {
        throw std::runtime_error(origin + ": was written by another version of rt-core measure, and cannot be read");
    }
}

}  // namespace haptic::rt
