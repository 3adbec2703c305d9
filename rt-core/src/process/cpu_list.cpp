#include "process/cpu_list.hpp"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <iterator>

namespace haptic::rt {
namespace {

constexpr int kMaxCpus = 8192;  // NR_CPUS of the largest kernels
constexpr int kBitsOfGroup = 32;

/// Consumes a number at the front of the text; -1 if there is none.
int take_number(std::string_view& text) {
    int number = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc{} || number < 0 || number >= kMaxCpus) {
        return -1;
    }
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    return number;
}

bool take(std::string_view& text, char wanted) {
    if (text.empty() || text.front() != wanted) {
        return false;
    }
    text.remove_prefix(1);
    return true;
}

std::vector<int> intersection(const std::vector<int>& a, const std::vector<int>& b) {
    std::vector<int> both;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
    return both;
}

}  // namespace

std::vector<int> parse_cpu_list(std::string_view text) {
    std::vector<int> cpus;
    while (!text.empty()) {
        // A single number or a range "first-last", followed by a comma or the end.
        const int first = take_number(text);
        const int last = take(text, '-') ? take_number(text) : first;
        if (first < 0 || last < first || (!text.empty() && !take(text, ','))) {
            return {};
        }
        for (int cpu = first; cpu <= last; ++cpu) {
            cpus.push_back(cpu);
        }
    }
    std::sort(cpus.begin(), cpus.end());
    cpus.erase(std::unique(cpus.begin(), cpus.end()), cpus.end());
    return cpus;
}

std::vector<int> parse_cpu_mask(std::string_view text) {
    std::vector<int> cpus;
    // From the last group, which has processors 0 to 31.
    for (int first = 0; first < kMaxCpus; first += kBitsOfGroup) {
        const std::size_t comma = text.rfind(',');
        const std::string_view group = comma == std::string_view::npos ? text : text.substr(comma + 1);
        std::uint32_t bits = 0;
        const auto [end, error] = std::from_chars(group.data(), group.data() + group.size(), bits, 16);
        if (error != std::errc{} || end != group.data() + group.size()) {
            return {};
        }
        for (int bit = 0; bit < kBitsOfGroup; ++bit) {
            if (((bits >> bit) & 1U) != 0) {
                cpus.push_back(first + bit);
            }
        }
        if (comma == std::string_view::npos) {
            return cpus;
        }
        text = text.substr(0, comma);
    }
    return {};
}

std::string cpu_list_text(const std::vector<int>& cpus) {
    std::string text;
    for (std::size_t i = 0; i < cpus.size();) {
        std::size_t last = i;
        while (last + 1 < cpus.size() && cpus[last + 1] == cpus[last] + 1) {
            ++last;
        }
        text += (text.empty() ? "" : ",") + std::to_string(cpus[i]);
        text += last > i ? "-" + std::to_string(cpus[last]) : "";
        i = last + 1;
    }
    return text;
}

int choose_cpu(const CpuChoice& choice) {
    // An isolated processor within the affinity comes first.
    const std::vector<int> isolated = intersection(choice.isolated, choice.online);
    const std::vector<int> both = intersection(choice.allowed, isolated);
    if (!both.empty()) {
        return both.back();
    }
    // The affinity counts as narrowed if it lacks a processor that is not isolated.
    std::vector<int> shared;
    std::set_difference(choice.online.begin(), choice.online.end(), isolated.begin(), isolated.end(),
                        std::back_inserter(shared));
    const bool narrowed = !std::includes(choice.allowed.begin(), choice.allowed.end(), shared.begin(), shared.end());
    if (!isolated.empty() && !narrowed) {
        return isolated.back();
    }
    return choice.allowed.empty() ? 0 : choice.allowed.back();
}

}  // namespace haptic::rt
