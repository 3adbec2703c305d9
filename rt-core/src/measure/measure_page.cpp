#include "measure/measure_page.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "haptic/html.hpp"
#include "haptic/period_histogram.hpp"
#include "haptic/plot.hpp"
#include "measure/measure_report.hpp"
#include "measure/plot_commands.hpp"
#include "measure/tick_explanation.hpp"

namespace haptic::rt {
namespace {

using nlohmann::json;

constexpr std::size_t kRowsOfTicks = 12;
constexpr double kBelowOne = 0.5;       // lower end of the axes of counts
constexpr double kMarkRoom = 0.07;      // of the plot's width, for the label of a percentile
constexpr double kMinBinWidth = 0.016;  // in ln(value): two buckets of Histogram
constexpr std::size_t kShownInterrupts = 8;
// us, reach of the fine buckets of a period.
constexpr double kMaxPeriodReach = static_cast<double>(PeriodHistogram::kReachNs) * 1e-3;

/// "500", "1,500", "2.3 million".
std::string number_text(double value) {
    std::array<char, 32> text{};
    const auto whole = static_cast<long>(std::lround(value));
    if (value >= 1e6) {
        std::snprintf(text.data(), text.size(), "%.3g million", value * 1e-6);
    } else if (value >= 1000.0) {
        std::snprintf(text.data(), text.size(), "%ld,%03ld", whole / 1000, whole % 1000);
    } else {
        std::snprintf(text.data(), text.size(), "%.4g", value);
    }
    return text.data();
}

/// Microseconds with one decimal below 100.
std::string us_text(double value_us) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), value_us < 99.95 ? "%.1f" : "%.0f", value_us);
    return value_us >= 999.5 ? number_text(value_us) : text.data();
}

/// "18:02:11.123" of "2026-11-20T18:02:11.123456+01:00".
std::string clock_time(const json& time_of_day) {
    const auto text = time_of_day.get<std::string>();
    return text.size() < 26 ? text : text.substr(11, 12);
}

std::string cell(const std::string& text) {
    return "<td>" + html_text(text) + "</td>";
}

std::string number_cell(const std::string& text) {
    return "<td class=\"n\">" + html_text(text) + "</td>";
}

bool has_values(const json& distribution) {
    return distribution.at("count").get<std::uint64_t>() > 0;
}

/// A distribution to plot. `colour` is a quantity of plot.gp or the number of a line type.
struct Series {
    const json* distribution;
    std::string name;
    std::string colour;
};

/// The wake-ups that peer tools measured.
std::vector<Series> wakeups_of_peers(const json& measure) {
    std::vector<Series> all;
    for (const PeerTool& tool : peer_tools()) {
        const std::string name(tool.name);
        if (!measure.contains(name)) {
            continue;
        }
        const json& peer = measure.at(name);
        if (peer.is_object() && peer.contains("wakeup_us") && has_values(peer.at("wakeup_us"))) {
            all.push_back({&peer.at("wakeup_us"), name, std::string(tool.colour)});
        }
    }
    return all;
}

AxisRange range_of(const std::vector<Series>& all) {
    double min_us = 1e300;
    double max_us = 0.0;
    for (const Series& one : all) {
        min_us = std::min(min_us, one.distribution->at("min").get<double>());
        max_us = std::max(max_us, one.distribution->at("max").get<double>());
    }
    return wide_enough(std::max(min_us, 0.1), max_us);
}

/// Counts of a distribution in logarithmically equal bins over a range.
std::vector<double> binned(const json& distribution, AxisRange range, std::size_t bins) {
    std::vector<double> counts(bins, 0.0);
    for (const json& bucket : distribution.at("histogram")) {
        const double middle = 0.5 * (bucket.at(0).get<double>() + bucket.at(1).get<double>());
        counts[static_cast<std::size_t>(range.part(middle) * static_cast<double>(bins))] += bucket.at(2).get<double>();
    }
    return counts;
}

/// Marks percentiles of a distribution by dotted lines with labels at their upper ends.
void mark_percentiles(PlotCommands& plot, const json& distribution, AxisRange range) {
    std::string labels;
    double last = -1.0;
    for (const Percentile& one : kPercentiles) {
        if (one.key == std::string_view("p90") || one.key == std::string_view("p999")) {
            continue;
        }
        const double value = distribution.at(one.key).get<double>();
        const std::string at = plot_number(value);
        std::string line = "set arrow nohead from ";
        line.append(at).append(", graph 0 to ").append(at).append(", graph 1 linecolor 8 dashtype 3");
        plot.set(line);
        // A label that would overlap the previous one is left out.
        if (range.part(value) - last >= kMarkRoom) {
            labels += (labels.empty() ? "" : ", ") + gnuplot_text(one.title) + " " + at;
            last = range.part(value);
        }
    }
    plot.log_axis("x2", range);
    plot.set("set x2tics (" + labels + ") scale 0");
}

/// Colour of a latency in every plot: its quantity in plot.gp.
const char* colour_of(Latency latency) {
    switch (latency) {
        case Latency::Exchange:
            return "exchange";
        case Latency::Compute:
            return "compute";
        case Latency::MotionToForce:
            return "motion_to_force";
        case Latency::Wakeup:
        case Latency::Period:
        case Latency::DeviceToPlane:
            break;
    }
    return "wakeup";
}

/// Histogram of distributions: the first as bars, the others as outlines over it. Marks the percentiles of the first.
PlotCommands histogram_plot(const std::vector<Series>& all) {
    const AxisRange range = range_of(all);
    const double width = std::log(range.to / range.from);
    const auto bins = static_cast<std::size_t>(std::clamp(width / kMinBinWidth, 4.0, 100.0));
    const auto edge = [&](std::size_t bin) {
        return range.from * std::exp(width * static_cast<double>(bin) / static_cast<double>(bins));
    };
    PlotCommands plot;
    double max_count = 10.0;
    for (std::size_t s = 0; s < all.size(); ++s) {
        // Counts in common bins: centre, count, width of each bar, or the steps of an outline.
        const std::vector<double> counts = binned(*all[s].distribution, range, bins);
        max_count = std::max(max_count, *std::max_element(counts.begin(), counts.end()));
        std::string rows;
        for (std::size_t i = 0; i < bins; ++i) {
            const double from = edge(i);
            const double to = edge(i + 1);
            const double count = std::max(counts[i], kBelowOne);
            if (s > 0) {
                rows += plot_row(from, count) + plot_row(to, count);
            } else if (counts[i] > 0.0) {
                rows += plot_row(0.5 * (from + to), count, to - from);
            }
        }
        const std::string colour = std::string(" linecolor ") + all[s].colour;
        plot.draw(rows, (s == 0 ? "using 1:2:3 with boxes" : "using 1:2 with lines linewidth 2") + colour,
                  all.size() > 1 ? all[s].name : "");
    }
    plot.set("set xlabel 'us'\nset ylabel 'ticks'");
    plot.log_axis("x", range);
    // The y axis begins below one tick, so that a single tick is visible on it.
    plot.log_axis("y", {kBelowOne, max_count * 1.4});
    mark_percentiles(plot, *all[0].distribution, range);
    return plot;
}

/// Periods to plot, less the period that the loop was to keep.
struct PeriodSeries {
    Series series;
    double nominal_us;
};

PeriodSeries period_of(const json& measure, const std::string& name, const char* colour) {
    return {{&measure.at("latency_us").at("period"), name, colour}, 1e6 * measure.at("period_s").get<double>()};
}

/// Ticks whose period differs from the nominal one by more than this, us.
std::uint64_t ticks_beyond(const PeriodSeries& one, double reach_us) {
    std::uint64_t ticks = 0;
    for (const json& bucket : one.series.distribution->at("histogram")) {
        const double middle = 0.5 * (bucket.at(0).get<double>() + bucket.at(1).get<double>()) - one.nominal_us;
        ticks += std::fabs(middle) > reach_us ? bucket.at(2).get<std::uint64_t>() : 0U;
    }
    return ticks;
}

/// Smallest reach to either side, us, beyond which there is no more than in the whole plot.
double reach_of(const std::vector<PeriodSeries>& all) {
    for (const double reach_us : {1.0, 2.0, 5.0, 10.0, 20.0, 50.0}) {
        if (std::all_of(all.begin(), all.end(), [reach_us](const PeriodSeries& one) {
                return ticks_beyond(one, reach_us) == ticks_beyond(one, kMaxPeriodReach);
            })) {
            return reach_us;
        }
    }
    return kMaxPeriodReach;
}

/// Histogram of periods in the buckets of PeriodHistogram, around the nominal one: the first as bars, the others as
/// outlines over it.
PlotCommands period_plot(const std::vector<PeriodSeries>& all) {
    const double reach_us = reach_of(all);
    PlotCommands plot;
    double max_count = 10.0;
    for (std::size_t s = 0; s < all.size(); ++s) {
        std::string rows;
        double last_us = -reach_us;
        for (const json& bucket : all[s].series.distribution->at("histogram")) {
            const double from = bucket.at(0).get<double>() - all[s].nominal_us;
            const double to = bucket.at(1).get<double>() - all[s].nominal_us;
            const auto count = bucket.at(2).get<double>();
            if (std::fabs(0.5 * (from + to)) > reach_us) {
                continue;
            }
            max_count = std::max(max_count, count);
            if (s == 0) {
                rows += plot_row(0.5 * (from + to), count, to - from);
                continue;
            }
            // An outline falls to the axis where buckets are empty.
            rows += plot_row(last_us, kBelowOne) + plot_row(from, kBelowOne);
            rows += plot_row(from, count) + plot_row(to, count);
            last_us = to;
        }
        const std::string colour = std::string(" linecolor ") + all[s].series.colour;
        plot.draw(rows.empty() ? plot_row(0.0, kBelowOne, 0.0) : rows,
                  (s == 0 ? "using 1:2:3 with boxes" : "using 1:2 with lines linewidth 2") + colour,
                  all.size() > 1 ? all[s].series.name : "");
    }
    const std::string end = plot_number(1.05 * reach_us);
    plot.set("set xlabel 'period less the nominal one, us'\nset ylabel 'ticks'\nset xrange [-" + end + ":" + end + "]");
    plot.log_axis("y", {kBelowOne, max_count * 1.4});
    return plot;
}

/// Caption of a plot of periods: what is plotted, and how much of it is out of sight.
std::string period_caption(const std::string& what, const std::vector<PeriodSeries>& all) {
    std::string text = what;
    for (const PeriodSeries& one : all) {
        const std::uint64_t beyond = ticks_beyond(one, kMaxPeriodReach);
        text +=
            " " + (all.size() > 1 ? one.series.name + ": nominal " : std::string("Nominal ")) +
            us_text(one.nominal_us) + " us" +
            (beyond > 0 ? ", " + std::to_string(beyond) + " beyond " + us_text(kMaxPeriodReach) + " us to either side."
                        : ".");
    }
    return text;
}

/// Tail of a distribution: points (1 / (1 - F), value), with F the fraction of smaller values. 10 is p90, 100 is p99.
std::string tail(const json& distribution) {
    const double count = distribution.at("count").get<double>();
    std::string points;
    double seen = 0.0;
    for (const json& bucket : distribution.at("histogram")) {
        const double before = seen;
        seen += bucket.at(2).get<double>();
        const double value = std::min(bucket.at(1).get<double>(), distribution.at("max").get<double>());
        points += plot_row(count / (count - before), value);
    }
    return points + plot_row(count, distribution.at("max").get<double>());
}

PlotCommands tail_plot(const std::vector<Series>& all) {
    PlotCommands plot;
    double count = 10.0;
    for (const Series& one : all) {
        count = std::max(count, one.distribution->at("count").get<double>());
        plot.draw(tail(*one.distribution), std::string("using 1:2 with lines linecolor ") + one.colour, one.name);
    }
    // Ticks of the x axis: 50 %, 90 %, 99 %, 99.9 %, ... In gnuplot's labels "%%" is the sign.
    std::string ticks = "'50 %%' 2, '90 %%' 10";
    std::string nines = "99";
    double at = 100.0;
    while (at <= count) {
        ticks += ", '" + nines + " %%' " + plot_number(at);
        nines += nines == "99" ? ".9" : "9";
        at *= 10.0;
    }
    plot.set("set xlabel 'fraction of values below'\nset ylabel 'us'\nset logscale x");
    plot.set("set xrange [1:" + plot_number(count) + "]\nset xtics (" + ticks + ")");
    plot.log_axis("y", range_of(all));
    return plot;
}

/// A line of a plot over the run: key in the course, name and colour (quantities of plot.gp).
struct TimeLine {
    const char* key;
    const char* name;
    const char* colour;
};
constexpr std::array<TimeLine, 4> kTimeLines = {{{"p50_us", "p50", "p50"},
                                                 {"p99_us", "p99", "p99"},
                                                 {"p999_us", "p99.9", "p999"},
                                                 {"max_us", "maximum", "maximum"}}};

/// Unit of the time axis of a run.
struct TimeUnit {
    const char* name;
    double seconds;
};
TimeUnit time_unit(double until_s) {
    constexpr double long_run = 3.0;  // from so many on, a larger unit is easier to read
    return until_s >= long_run * 3600.0 ? TimeUnit{"h", 3600.0}
           : until_s >= long_run * 60.0 ? TimeUnit{"min", 60.0}
                                        : TimeUnit{"s", 1.0};
}

bool has_course(const json& course) {
    const json& peaks = course.at("max_us");
    return std::any_of(peaks.begin(), peaks.end(), [](const json& value) { return value.is_number(); });
}

PlotCommands time_plot(const json& course) {
    PlotCommands plot;
    const double piece_s = course.at("piece_s").get<double>();
    const double start_s = course.at("start_s").get<double>();
    const double until_s = start_s + piece_s * static_cast<double>(course.at("max_us").size());
    const TimeUnit unit = time_unit(until_s);
    double max_us = 0.1;
    double min_us = 1e300;
    for (const TimeLine& one : kTimeLines) {
        // Reports of older versions have no percentiles.
        if (!course.contains(one.key)) {
            continue;
        }
        double at_s = start_s + 0.5 * piece_s;
        std::string points;
        // Centre of each interval. An empty one is a blank line, which interrupts the plotted line.
        for (const json& value : course.at(one.key)) {
            if (value.is_null()) {
                points += "\n";
            } else {
                const double value_us = std::max(value.get<double>(), 0.1);
                points += plot_row(at_s / unit.seconds, value_us);
                max_us = std::max(max_us, value_us);
                min_us = std::min(min_us, value_us);
            }
            at_s += piece_s;
        }
        plot.draw(points, std::string("using 1:2 with lines linecolor ") + one.colour, one.name);
    }
    plot.set(std::string("set xlabel 'time, ") + unit.name + "'\nset ylabel 'us'");
    plot.set("set xrange [0:" + plot_number(until_s / unit.seconds) + "]");
    // Room for a steady line at either end.
    constexpr double margin = 1.1;
    plot.log_axis("y", wide_enough(std::min(min_us, max_us) / margin, max_us * margin));
    return plot;
}

/// Plots of the percentiles in each interval of the run.
std::string course_section(const json& courses, PageFigures& figures) {
    std::string text;
    for (const CourseName& name : kCourses) {
        if (!courses.contains(name.key) || !has_course(courses.at(name.key))) {
            continue;
        }
        const json& course = courses.at(name.key);
        std::array<char, 160> interval{};
        std::snprintf(interval.data(), interval.size(), ", of each interval of %.4g s of the run.%s",
                      course.at("piece_s").get<double>(), text.empty() ? " Gaps are pauses of the loop." : "");
        text += figures.draw(time_plot(course), std::string(name.title) + ": " + name.what + interval.data());
    }
    return text.empty() ? text : "<h2>Over the run</h2>\n" + text;
}

std::string latency_row(const std::string& title, const json& distribution) {
    std::string row = "<tr>" + cell(title);
    if (!has_values(distribution)) {
        return row + "<td class=\"n\" colspan=\"6\">none</td><td></td></tr>\n";
    }
    for (const Percentile& one : kPercentiles) {
        row += number_cell(us_text(distribution.at(one.key).get<double>()));
    }
    row += number_cell(us_text(distribution.at("max").get<double>()));
    row += distribution.contains("max_at")
               ? cell(clock_time(distribution.at("max_at")) + ", " + distribution.at("max_stage").get<std::string>() +
                      ": " + distribution.at("max_cause").get<std::string>())
               : "<td></td>";
    return row + "</tr>\n";
}

std::string ratio_row(const std::string& title, const json& ratio) {
    std::string row = "<tr>" + cell(title);
    const auto add = [&](const char* key) {
        std::array<char, 32> text{'-'};
        if (ratio.at(key).is_number()) {
            std::snprintf(text.data(), text.size(), "%.2f", ratio.at(key).get<double>());
        }
        row += number_cell(text.data());
    };
    for (const Percentile& one : kPercentiles) {
        add(one.key);
    }
    add("max");
    return row + "<td></td></tr>\n";
}

std::string latency_table(const json& measure) {
    std::string text = "<div class=\"wide\"><table><tr><th>us</th>";
    for (const Percentile& one : kPercentiles) {
        text += std::string("<th class=\"n\">") + one.title + "</th>";
    }
    text += "<th class=\"n\">max</th><th>time, stage and cause of the maximum</th></tr>\n";
    for (const LatencyName& name : latency_names()) {
        text += latency_row(std::string(name.title), measure.at("latency_us").at(std::string(name.key)));
        if (name.latency == Latency::Wakeup) {
            for (const PeerRow& peer : peer_rows(measure)) {
                text += peer.is_ratio ? ratio_row(peer.title, *peer.values) : latency_row(peer.title, *peer.values);
            }
        }
    }
    text += "</table></div>\n";
    for (const std::string& note : peer_notes(measure)) {
        text += "<p>" + html_text(note) + ".</p>\n";
    }
    return text;
}

/// Stacked bar: time of each stage as a share of the time from the tick's deadline to its end.
std::string stage_bar(const json& tick) {
    std::string text = "<div class=\"bar\">";
    const double whole = std::max(tick.at("late_us").get<double>(), 1e-3);
    for (std::size_t i = 0; i < kLateStages; ++i) {
        const std::string name(name_of(static_cast<LateStage>(i)));
        const double share = 100.0 * tick.at("stages_us").at(name).get<double>() / whole;
        std::array<char, 128> span{};
        std::snprintf(span.data(), span.size(),
                      "<span class=\"s%zu\" style=\"width:%.2f%%\" title=\"%s %.1f us\"></span>", i, share,
                      name.c_str(), tick.at("stages_us").at(name).get<double>());
        text += span.data();
    }
    return text + "</div>";
}

std::string worst_table(const json& worst) {
    std::string text = "<p>Each bar is the time from the deadline to the end of the tick:";
    // Legend of the stages, then one row per tick.
    for (std::size_t i = 0; i < kLateStages; ++i) {
        text += "<span class=\"swatch s" + std::to_string(i) + "\"></span>" +
                std::string(name_of(static_cast<LateStage>(i)));
    }
    text +=
        "</p>\n<div class=\"wide\"><table><tr><th>at</th><th class=\"n\">late, us</th><th class=\"n\">missed</th>"
        "<th>stages</th><th>cause</th></tr>\n";
    for (std::size_t i = 0; i < std::min(worst.size(), kRowsOfTicks); ++i) {
        const json& tick = worst.at(i);
        std::string why = tick.at("stage").get<std::string>() + ": " + tick.at("why").get<std::string>();
        if (const auto interrupts = tick.value("unusual_interrupts", std::string()); !interrupts.empty()) {
            why += "; unusually many interrupts at that time: " + interrupts;
        }
        text += "<tr>" + cell(clock_time(tick.at("at"))) + number_cell(us_text(tick.at("late_us").get<double>())) +
                number_cell(tick.at("missed").dump()) + "<td>" + stage_bar(tick) + "</td>" + cell(why) + "</tr>\n";
    }
    return text + "</table></div>\n";
}

std::string kernel_table(const json& kernel) {
    std::vector<std::pair<double, std::string>> rates;
    for (const auto& [name, rate] : kernel.at("interrupts_per_s").items()) {
        rates.emplace_back(rate.get<double>(), name);
    }
    // The most frequent interrupts.
    std::sort(rates.rbegin(), rates.rend());
    rates.resize(std::min(rates.size(), kShownInterrupts));
    std::string text = "<table><tr><th>interrupt of the loop's processor</th><th class=\"n\">per second</th></tr>\n";
    for (const auto& [rate, name] : rates) {
        std::array<char, 32> number{};
        std::snprintf(number.data(), number.size(), "%.1f", rate);
        text += "<tr>" + cell(name) + number_cell(number.data()) + "</tr>\n";
    }
    text += "</table>\n<p>Time stolen by a hypervisor: ";
    text += kernel.at("stolen_ms").is_null() ? "unknown to this kernel"
                                             : us_text(kernel.at("stolen_ms").get<double>()) + " ms";
    text += ". Time that threads waited for this processor: ";
    text += kernel.at("queued_ms").is_null() ? "unknown to this kernel"
                                             : us_text(kernel.at("queued_ms").get<double>()) + " ms";
    return text + ".</p>\n";
}

std::string caption_of(const LatencyName& name) {
    return std::string(name.title) + ": " + std::string(name.what) + ".";
}

/// Section about the loop as measured from outside, on the line wired to the tick's probe.
std::string loopback_section(const json& measure, const json& latencies, PageFigures& figures) {
    const json& loopback = measure.at("loopback");
    std::string text = "<h2>Measured from outside</h2>\n<p>" +
                       html_text("Line " + loopback.at("line").get<std::string>() + ": " +
                                 loopback.at("rising").dump() + " rising edges of " + loopback.at("ticks").dump() +
                                 " ticks. " + loopback.at("problem").get<std::string>()) +
                       "</p>\n";
    // Each distribution from outside over its counterpart in the loop. The period first, around the nominal one.
    if (has_values(loopback.at("period_us")) && has_values(latencies.at("period"))) {
        const double nominal_us = 1e6 * measure.at("period_s").get<double>();
        const std::vector<PeriodSeries> periods = {{{&loopback.at("period_us"), "outside", "1"}, nominal_us},
                                                   {{&latencies.at("period"), "inside", "2"}, nominal_us}};
        text += figures.draw(
            period_plot(periods),
            period_caption("Period: between the kernel's time stamps of the edges, and in the loop.", periods));
    }
    struct Pair {
        const char* outside;
        const char* inside;
        const char* caption;
    };
    for (const Pair& pair :
         {Pair{"lateness_us", "wakeup",
               "Lateness of the edges, and of the wake-ups that caused them. The difference is the time of the output, "
               "the wire and the interrupt that takes the time stamp."},
          Pair{"high_us", "compute", "Time that the line was high, and computation time."}}) {
        if (loopback.at(pair.outside).is_object() && has_values(loopback.at(pair.outside)) &&
            has_values(latencies.at(pair.inside))) {
            text += figures.draw(histogram_plot({{&loopback.at(pair.outside), "outside", "1"},
                                                 {&latencies.at(pair.inside), "inside", "2"}}),
                                 pair.caption);
        }
    }
    return text;
}

/// Scheduling, kernel and load of a measurement, as a sentence.
std::string setup_line(const json& report) {
    const json& setup = report.at("setup");
    const json& measure = report.at("measure");
    std::string text =
        setup.at("policy").get<std::string>() + " " + std::to_string(setup.at("priority").get<int>()) +
        " on processor " + std::to_string(setup.at("cpu").get<int>()) +
        (setup.at("mlocked").get<bool>() ? ", memory locked" : ", memory not locked") + "; kernel " +
        setup.at("kernel").get<std::string>() + (setup.at("preempt_rt").get<bool>() ? "" : " (not PREEMPT_RT)") +
        "; load: " + (measure.at("load").is_null() ? "none" : measure.at("load").get<std::string>()) + ".";
    for (const json& one : setup.at("missing")) {
        text += " Degraded: " + one.at("what").get<std::string>() + ".";
    }
    return text;
}

std::string introduction(const json& report) {
    std::array<char, 200> text{};
    std::snprintf(text.data(), text.size(),
                  "%s ticks in %.1f s of %s, from %s. %llu deadlines missed, %lld page faults. ",
                  number_text(report.at("ticks").get<double>()).c_str(), report.at("duration_s").get<double>(),
                  report.at("exchange").at("device").get<std::string>().c_str(),
                  report.at("measure").at("began").get<std::string>().substr(0, 19).c_str(),
                  report.at("measure").at("overruns").at("deadlines_missed").get<unsigned long long>(),
                  report.at("page_faults").get<long long>());
    return "<p>" + html_text(text.data() + setup_line(report)) + "</p>\n";
}

}  // namespace

std::string measure_page(const json& report, const std::string& redraw) {
    require_measurement(report, "this report");
    const json& measure = report.at("measure");
    const json& latencies = measure.at("latency_us");
    PageFigures figures(redraw);
    std::string page = page_top("Latency of the loop") + introduction(report) + latency_table(measure);

    // Tails of the main latencies in one plot; those without values are left out.
    page += "<h2>Tails</h2>\n";
    std::vector<Series> tails = {{&latencies.at("wakeup"), "wake-up", "wakeup"}};
    for (const Series& peer : wakeups_of_peers(measure)) {
        tails.push_back({peer.distribution, peer.name + "'s wake-up", peer.colour});
    }
    tails.push_back({&latencies.at("compute"), "compute", "compute"});
    tails.push_back({&latencies.at("motion_to_force"), "motion to force", "motion_to_force"});
    tails.erase(
        std::remove_if(tails.begin(), tails.end(), [](const Series& s) { return !has_values(*s.distribution); }),
        tails.end());
    if (!tails.empty()) {
        page += figures.draw(tail_plot(tails),
                             "Latency against the fraction of ticks below it. The curve of a loop that keeps its "
                             "period stays flat to the right.");
    }
    page += course_section(measure.at("course"), figures);
    // One histogram per latency; those of the peer tools over the wake-up.
    page += "<h2>Distributions</h2>\n";
    for (const LatencyName& name : latency_names()) {
        const json& distribution = latencies.at(std::string(name.key));
        if (!has_values(distribution)) {
            continue;
        }
        if (name.latency == Latency::Period) {
            const std::vector<PeriodSeries> periods = {period_of(measure, "rt-core", colour_of(name.latency))};
            page += figures.draw(period_plot(periods), period_caption(caption_of(name), periods));
            continue;
        }
        std::vector<Series> all = {{&distribution, "rt-core", colour_of(name.latency)}};
        if (name.latency == Latency::Wakeup) {
            const std::vector<Series> peers = wakeups_of_peers(measure);
            all.insert(all.end(), peers.begin(), peers.end());
        }
        page += figures.draw(histogram_plot(all), caption_of(name));
    }
    if (measure.at("loopback").is_object()) {
        page += loopback_section(measure, latencies, figures);
    }
    page += "<h2>The latest ticks</h2>\n" + worst_table(measure.at("worst_ticks"));
    page += "<h2>Interrupts</h2>\n" + kernel_table(measure.at("kernel"));
    return page + "</body></html>\n";
}

std::string comparison_page(const json& first, const json& second, const std::string& redraw) {
    require_measurement(first, "the first report");
    require_measurement(second, "the second report");
    PageFigures figures(redraw);
    std::string page = page_top("Two measurements of the loop");
    for (const json* report : {&first, &second}) {
        page += "<h2>" + std::string(report == &first ? "First" : "Second") + "</h2>\n" + introduction(*report) +
                latency_table(report->at("measure"));
    }
    page += "<h2>Distributions</h2>\n";
    for (const LatencyName& name : latency_names()) {
        const json& a = first.at("measure").at("latency_us").at(std::string(name.key));
        const json& b = second.at("measure").at("latency_us").at(std::string(name.key));
        if (!has_values(a) || !has_values(b)) {
            continue;
        }
        if (name.latency == Latency::Period) {
            const std::vector<PeriodSeries> periods = {period_of(first.at("measure"), "first", "1"),
                                                       period_of(second.at("measure"), "second", "2")};
            page += figures.draw(period_plot(periods), period_caption(caption_of(name), periods));
            continue;
        }
        page += figures.draw(histogram_plot({{&a, "first", "1"}, {&b, "second", "2"}}), caption_of(name));
    }
    return page + "</body></html>\n";
}

}  // namespace haptic::rt
