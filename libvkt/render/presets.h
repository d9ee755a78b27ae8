// Transfer functions per kind of data: values that are known (HU of CT) or that the histogram places.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/header.h"
#include "libvkt/core/parameters.h"
#include "libvkt/render/transfer.h"

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace vkt::render {

enum class DataKind : std::uint8_t {
    ct,           ///< soft tissue and bone; HU, as all of CT
    ct_bone,      ///< bone alone
    ct_lung,      ///< lungs
    ct_contrast,  ///< vessels with contrast medium, stents, bone
    mr,           ///< grey, from the common values on
    fluorescence, ///< the brightest tenth
    density,      ///< over decades, as of gas
};

/// Colours of a map over a span of values, and opacities at values, of a layer as thick as the unit distance.
struct Preset {
    double lower = 0, upper = 1; ///< lower < upper
    std::string colormap;
    std::vector<std::pair<double, double>> opacities; ///< ascending
    bool logarithmic = false;                         ///< the map is spread over logarithms; lower > 0
};

/// Its values are the same for all data of the kind.
constexpr bool has_known_values(DataKind kind) { return kind <= DataKind::ct_contrast; }

/// The units of CT, as headers have them.
inline constexpr char hounsfield[] = "HU";

/// What data are, and how that is known.
struct Recognised {
    DataKind kind;
    std::string why;
};
/// Only where there is no doubt: CT in HU, by the units of the header or by its values. Nothing else is: MR,
/// fluorescence and density have no values of their own.
std::optional<Recognised> recognise(Header const& header, Histogram const& histogram);

Preset preset_of(DataKind kind, Histogram const& histogram);
/// Its function, in the colours of another map if one is named.
TransferFunction transfer_of(Preset const& preset, std::string const& colormap_name);

} // namespace vkt::render

namespace vkt {
template <> struct EnumNames<render::DataKind> {
    static std::vector<std::pair<render::DataKind, char const*>> all() {
        using render::DataKind;
        return {{DataKind::ct, "ct"},           {DataKind::ct_bone, "ct-bone"},
                {DataKind::ct_lung, "ct-lung"}, {DataKind::ct_contrast, "ct-contrast"},
                {DataKind::mr, "mr"},           {DataKind::fluorescence, "fluorescence"},
                {DataKind::density, "density"}};
    }
};
} // namespace vkt
