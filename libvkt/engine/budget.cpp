// Budgets: all choices, or a greedy walk.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/budget.h"

#include <limits>

namespace vkt {
namespace {

using Evaluate = std::function<Outcome(Settings const&)>;

std::optional<Settings> best_of_all(double limit, std::vector<std::size_t> const& counts, Evaluate const& evaluate) {
    std::optional<Settings> best;
    double least = std::numeric_limits<double>::infinity();
    Settings at(counts.size(), 0);
    while (true) {
        Outcome const outcome = evaluate(at);
        if (outcome.error <= limit && (!best || outcome.cost < least)) {
            best = at;
            least = outcome.cost;
        }
        std::size_t k = 0;
        while (k < at.size() && ++at[k] == counts[k]) at[k++] = 0;
        if (k == at.size()) return best;
    }
}

/// The change of one knob that takes most error away for what it costs; false if none takes any.
bool tighten(Settings& at, double& error, std::vector<std::size_t> const& counts, Evaluate const& evaluate) {
    Outcome const now = evaluate(at);
    double most = 0;
    Settings best;
    for (std::size_t k = 0; k < at.size(); ++k)
        for (std::size_t s = at[k] + 1; s < counts[k]; ++s) {
            Settings next = at;
            next[k] = s;
            Outcome const then = evaluate(next);
            double const gain = now.error - then.error, price = then.cost - now.cost;
            if (!(gain > 0)) continue;
            double const worth = price > 0 ? gain / price : std::numeric_limits<double>::infinity();
            if (best.empty() || worth > most) {
                most = worth;
                best = next;
                error = then.error;
            }
        }
    if (best.empty()) return false;
    at = best;
    return true;
}

/// The change of one knob to a looser setting that saves most and stays within the limit; false if there is none.
bool loosen(Settings& at, double limit, Evaluate const& evaluate) {
    double least = evaluate(at).cost;
    Settings best;
    for (std::size_t k = 0; k < at.size(); ++k)
        for (std::size_t s = 0; s < at[k]; ++s) {
            Settings next = at;
            next[k] = s;
            Outcome const then = evaluate(next);
            if (then.error > limit || !(then.cost < least)) continue;
            least = then.cost;
            best = next;
        }
    if (best.empty()) return false;
    at = best;
    return true;
}

} // namespace

std::optional<Settings> cheapest_within(double limit, std::vector<std::size_t> const& counts, Evaluate const& evaluate,
                                        std::size_t exhaustive) {
    double choices = 1;
    for (std::size_t const count : counts) choices *= static_cast<double>(count);
    if (choices <= static_cast<double>(exhaustive)) return best_of_all(limit, counts, evaluate);
    Settings at(counts.size(), 0);
    double error = evaluate(at).error;
    while (!(error <= limit))
        if (!tighten(at, error, counts, evaluate)) return std::nullopt;
    while (loosen(at, limit, evaluate)) {
    }
    return at;
}

} // namespace vkt
