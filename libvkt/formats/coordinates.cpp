// Steps of coordinates.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/coordinates.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vkt {

std::optional<EvenSteps> even_steps(std::span<double const> coordinates) {
    if (coordinates.empty()) return std::nullopt;
    double const first = coordinates.front(), n = static_cast<double>(coordinates.size());
    double const step = coordinates.size() > 1 ? (coordinates.back() - first) / (n - 1) : 1;
    if (!std::isfinite(first) || !std::isfinite(step) || step == 0) return std::nullopt;
    for (std::size_t i = 0; i < coordinates.size(); ++i)
        // Not a number is no distance either.
        if (!(std::abs(coordinates[i] - (first + step * static_cast<double>(i))) <= 1e-3 * std::abs(step)))
            return std::nullopt;
    return EvenSteps{first, step};
}

void place_axis(Header& header, int axis, std::span<double const> coordinates) {
    auto const steps = even_steps(coordinates);
    if (!steps) {
        header.attributes[text("coordinates ", std::string(1, "xyz"[axis]))] = "uneven: not kept";
        return;
    }
    header.geometry.spacing[axis] = std::abs(steps->step);
    header.geometry.origin[axis] = steps->first;
    if (steps->step < 0) header.geometry.direction[static_cast<std::size_t>(axis)][axis] = -1;
}

std::vector<std::map<std::string, std::string>> sequence_places(std::span<double const> coordinates,
                                                                std::string const& units) {
    auto const steps = even_steps(coordinates);
    std::vector<std::map<std::string, std::string>> result;
    for (double const position : coordinates) {
        std::map<std::string, std::string> said{{"sequence position", to_text(position)}};
        if (steps && steps->step > 0) said["sequence step"] = to_text(steps->step);
        if (steps && steps->step > 0 && !units.empty()) said["sequence units"] = text("\"", units, "\"");
        result.push_back(std::move(said));
    }
    return result;
}

bool enumerates(std::string const& dimension) {
    static constexpr std::array names{"t", "time", "c", "channel"};
    std::string const name = lower_case(dimension);
    return std::any_of(names.begin(), names.end(), [&](char const* n) { return name == n; });
}

} // namespace vkt
