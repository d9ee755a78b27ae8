// Attributes of labels.
// SPDX-License-Identifier: MIT
#include "libvkt/core/label_marks.h"

#include <algorithm>
#include <utility>

namespace vkt {

namespace {

constexpr std::string_view segment_prefix = "Segment";

} // namespace

std::optional<SegmentKey> segment_key(std::string_view key) {
    if (!key.starts_with(segment_prefix)) return {};
    std::size_t const underscore = key.find('_');
    if (underscore == std::string_view::npos || underscore == segment_prefix.size()) return {};
    std::string const digits(key.substr(segment_prefix.size(), underscore - segment_prefix.size()));
    if (!std::ranges::all_of(digits, [](char c) { return c >= '0' && c <= '9'; }) || digits.size() > 9) return {};
    return SegmentKey{std::stoll(digits), std::string(key.substr(underscore + 1))};
}

void forget_label_names(Header& header) {
    std::erase_if(header.attributes, [](auto const& pair) {
        return segment_key(pair.first).has_value() || pair.first.starts_with("Segmentation_");
    });
}

void forget_labels(Header& header) {
    forget_label_names(header);
    for (auto const& [key, value] : {std::pair(meaning_key, labels_meaning), std::pair("intent_code", "1002")})
        if (auto const found = header.attributes.find(key); found != header.attributes.end() && found->second == value)
            header.attributes.erase(found);
}

} // namespace vkt
