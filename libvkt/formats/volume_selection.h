// Some of the volumes of a series by their numbers: "3", "2:8", "::2".
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/engine/source.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// Every step-th volume from `first` up to, not including, `end`, counted from 0; without an end, to the last one.
struct VolumeRange {
    std::int64_t first = 0;
    std::optional<std::int64_t> end;
    std::int64_t step = 1;
};

/// One word: "N", "A:B" or "A:B:S", where A and B may be left out. Throws Error{usage} for anything else and for ranges
/// that hold no number.
template <> struct ValueText<VolumeRange> : OneWord {
    static VolumeRange read(std::vector<std::string> const& w, std::string_view name);
    static std::vector<std::string> write(VolumeRange const& v);
};

/// The volumes of the source in the range. The others are passed over; what can only be read forwards is read to its
/// end, which proves that it is whole. Throws Error{usage}, when it comes to that, if the source ends before the range
/// does.
std::unique_ptr<Source> selected(std::unique_ptr<Source> source, VolumeRange range);

} // namespace vkt
