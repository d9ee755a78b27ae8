// Volumes of labels: attributes and colours.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/labels.h"

#include "libvkt/formats/header_text.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace vkt {

void mark_as_labels(Header& header) {
    forget_label_names(header);
    header.attributes[meaning_key] = labels_meaning;
}

bool holds_labels(Header const& header) {
    if (!is_integer(header.dtype)) return false;
    auto const says = [&](char const* key, std::string_view value) {
        auto const found = header.attributes.find(key);
        return found != header.attributes.end() && trimmed(found->second) == value;
    };
    if (says(meaning_key, labels_meaning) || says("intent_code", "1002")) return true;
    return std::any_of(header.attributes.begin(), header.attributes.end(), [](auto const& pair) {
        auto const key = segment_key(pair.first);
        return key && key->field == "LabelValue";
    });
}

std::map<std::int64_t, LabelText> label_texts(std::map<std::string, std::string> const& attributes) {
    struct Stated {
        std::optional<std::int64_t> label;
        LabelText text;
    };
    std::map<std::int64_t, Stated> stated;
    for (auto const& [key, value] : attributes) {
        auto const part = segment_key(key);
        if (!part) continue;
        Stated& one = stated[part->number];
        if (part->field == "LabelValue") one.label = integer_in(trimmed(value));
        if (part->field == "Name") one.text.name = trimmed(value);
        if (part->field != "Color") continue;
        std::vector<std::string> const words = words_of(value);
        std::array<double, 3> color{};
        bool fits = words.size() == 3;
        for (std::size_t c = 0; c < 3 && fits; ++c) {
            color[c] = number_in(words[c]).value_or(-1);
            fits = color[c] >= 0 && color[c] <= 1;
        }
        if (fits) one.text.color = color;
    }
    std::map<std::int64_t, LabelText> texts;
    for (auto& [number, one] : stated)
        if (one.label) texts.try_emplace(*one.label, std::move(one.text));
    return texts;
}

std::array<double, 3> label_color(std::int64_t label) {
    struct Shade {
        double brightness, saturation;
    };
    // Hues come close to earlier ones after eight steps.
    constexpr std::array<Shade, 3> shades{{{0.95, 0.65}, {0.65, 0.5}, {0.95, 0.35}}};
    Shade const shade = shades[static_cast<std::size_t>(std::abs(label % 24)) / 8];
    double const turns = static_cast<double>(label % 100'000) * 0.6180339887498949;
    double const hue = (turns - std::floor(turns)) * 6;
    auto const channel = [&](double offset) {
        double const k = std::fmod(offset + hue, 6);
        double const value = shade.brightness - shade.saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0);
        return std::round(value * 1000) / 1000;
    };
    return {channel(5), channel(3), channel(1)};
}

} // namespace vkt
