// What DICOM's elements say of a slice: its plane, and to which volume it belongs.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/gdcm/slice.h"

#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/gdcm/elements.h"
#include "libvkt/formats/header_text.h"

#include <cmath>
#include <utility>

namespace vkt::dicom {

void read_plane(gdcm::DataSet const& set, Slice& slice) {
    if (auto const v = element_numbers(set, 0x0020, 0x0032); v.size() == 3) {
        slice.position = {v[0], v[1], v[2]};
        slice.placed = true;
    }
    if (auto const v = element_numbers(set, 0x0020, 0x0037); v.size() == 6) {
        Vec3 const across{v[0], v[1], v[2]}, down{v[3], v[4], v[5]};
        if (length(across) > 0.5 && length(down) > 0.5 && length(cross(across, down)) > 0.5) {
            slice.across = across * (1 / length(across));
            slice.down = down * (1 / length(down));
        }
    }
    auto spacing = element_numbers(set, 0x0028, 0x0030);
    if (spacing.size() != 2) spacing = element_numbers(set, 0x0018, 0x1164); // of projections, at the detector
    if (spacing.size() == 2 && spacing[0] > 0 && spacing[1] > 0) {
        slice.spacing_down = spacing[0];
        slice.spacing_across = spacing[1];
    }
    for (std::uint16_t const element : {std::uint16_t{0x0088}, std::uint16_t{0x0050}}) // between slices, else thickness
        if (auto const v = element_numbers(set, 0x0018, element); v.size() == 1 && v[0] != 0 && !slice.spacing_slices)
            slice.spacing_slices = std::abs(v[0]);
    auto const slope = element_numbers(set, 0x0028, 0x1053), intercept = element_numbers(set, 0x0028, 0x1052);
    if (slope.size() == 1 && slope[0] != 0) slice.slope = slope[0];
    if (intercept.size() == 1) slice.intercept = intercept[0];
    if (std::string const type = element_text(set, 0x0028, 0x1054); !type.empty()) slice.rescale_type = type;
}

std::vector<Dimension> dimensions_of(gdcm::DataSet const& set) {
    std::vector<Dimension> dimensions;
    auto const items = sequence(set, 0x0020, 0x9222);
    for (std::size_t i = 1; items != nullptr && i <= items->GetNumberOfItems(); ++i) {
        auto const tag = element_values<std::uint16_t>(items->GetItem(i).GetNestedDataSet(), 0x0020, 0x9165);
        std::uint32_t const pointer = tag.size() == 2 ? std::uint32_t{tag[0]} << 16 | tag[1] : 0;
        switch (pointer) {
        case 0x00209056: // stack, segment
        case 0x0062000b:
            dimensions.push_back(Dimension::stack);
            break;
        case 0x00209057: // position in the stack, of the image in space or in the volume, of the slice
        case 0x00200032:
        case 0x00209301:
        case 0x00201041:
            dimensions.push_back(Dimension::place);
            break;
        default:
            dimensions.push_back(Dimension::other);
        }
    }
    return dimensions;
}

void read_group(gdcm::DataSet const& group, Slice& slice) {
    for (auto const& [g, e] : {std::pair<std::uint16_t, std::uint16_t>{0x0020, 0x9113},
                               {0x0020, 0x9116},
                               {0x0028, 0x9110},
                               {0x0028, 0x9145}})
        if (auto const item = first_item(group, g, e)) read_plane(*item, slice);
}

void read_membership(gdcm::DataSet const& group, std::vector<Dimension> const& dimensions, Slice& slice) {
    std::vector<double> values;
    auto const number = [&](gdcm::DataSet const& set, std::uint16_t g, std::uint16_t e, char const* name) {
        auto v = element_values<double>(set, g, e);
        if (v.empty()) // phases
            for (float const value : element_values<float>(set, g, e)) v.push_back(double{value});
        bool const there = v.size() == 1 && std::isfinite(v[0]);
        if (there) slice.told[name] = to_text(v[0]);
        values.push_back(there ? v[0] : 0);
    };
    if (auto const item = first_item(group, 0x0018, 0x9117)) { // diffusion
        number(*item, 0x0018, 0x9087, "b value");
        if (auto const gradient = first_item(*item, 0x0018, 0x9076)) {
            auto const v = element_values<double>(*gradient, 0x0018, 0x9089);
            if (v.size() == 3) {
                slice.told["gradient direction"] = text(v[0], " ", v[1], " ", v[2]);
                values.insert(values.end(), v.begin(), v.end());
            }
        }
    }
    values.resize(4);
    auto const of = [&](std::uint16_t g, std::uint16_t e, std::uint16_t ge, std::uint16_t ee, char const* name) {
        if (auto const item = first_item(group, g, e))
            number(*item, ge, ee, name);
        else
            values.push_back(0);
    };
    of(0x0018, 0x9114, 0x0018, 0x9082, "echo time");
    of(0x0018, 0x9118, 0x0020, 0x9241, "cardiac phase");
    of(0x0020, 0x9253, 0x0020, 0x9245, "respiratory phase");
    std::vector<std::uint32_t> indices;
    if (auto const item = first_item(group, 0x0020, 0x9111)) { // frame content
        if (auto const index = element_long(*item, 0x0020, 0x9128)) slice.time = std::int64_t{*index};
        slice.stack = std::string(trimmed(element_text(*item, 0x0020, 0x9056)));
        indices = element_values<std::uint32_t>(*item, 0x0020, 0x9157);
    }
    if (auto const item = first_item(group, 0x0062, 0x000a)) // segment
        if (auto const segment = element_short(*item, 0x0062, 0x000b, 0); segment > 0) slice.stack = to_text(segment);
    slice.order.clear();
    if (indices.size() == dimensions.size())
        for (std::size_t i = 0; i < indices.size(); ++i)
            if (dimensions[i] == Dimension::other) slice.order.push_back(indices[i]);
    slice.order.push_back(static_cast<double>(slice.time));
    slice.counted = slice.order.size();
    slice.order.insert(slice.order.end(), values.begin(), values.end());
}

} // namespace vkt::dicom
