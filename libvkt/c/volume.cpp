// Volumes of the C API: made, described, freed.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"

#include <cmath>
#include <cstring>
#include <utility>

namespace vkt::c {

vkt_volume* wrapped(Volume volume) {
    std::string dtype = to_text(volume.header().dtype);
    return new vkt_volume{std::move(volume), std::move(dtype)};
}

std::vector<Volume> volumes_of(vkt_volume const* const* inputs, size_t count) {
    if (count > 0) need(inputs, "inputs");
    std::vector<Volume> volumes;
    for (size_t i = 0; i < count; ++i) {
        need(inputs[i], text("inputs[", i, "]").c_str());
        volumes.push_back(inputs[i]->volume);
    }
    return volumes;
}

Listener into(std::string& remarks) {
    return [&remarks](std::string const&, std::string const& message, bool lossy) {
        if (lossy) remarks += (remarks.empty() ? "" : "\n") + printable(message);
    };
}

namespace {

Header header_of(vkt_description const& d) {
    Header header;
    need(d.dtype, "description->dtype");
    header.dims = {d.dims[0], d.dims[1], d.dims[2]};
    header.dtype = parse_data_type(d.dtype);
    for (int axis = 0; axis < 3; ++axis) {
        header.geometry.origin[axis] = d.origin[axis];
        header.geometry.spacing[axis] = d.spacing[axis];
        for (int i = 0; i < 3; ++i)
            header.geometry.direction[static_cast<std::size_t>(axis)][i] = d.direction[3 * axis + i];
    }
    header.values = {d.slope, d.intercept};
    header.units = d.units == nullptr ? "" : d.units;
    if (d.space != nullptr && *d.space != 0) header.attributes["space"] = d.space;
    mark_as_given(header);
    if (d.hierarchical != 0) throw Error(ErrorKind::usage, "only structured volumes can be created from voxels");
    try {
        check(header);
    } catch (Error const& e) { // what of a file would be damage
        throw Error(ErrorKind::usage, e.what(), e.hint());
    }
    for (Vec3 const& direction : header.geometry.direction)
        if (std::abs(length(direction) - 1) > 1e-4)
            throw Error(ErrorKind::usage, text("direction ", direction, " has no unit length"));
    return header;
}

} // namespace
} // namespace vkt::c

using namespace vkt;
using namespace vkt::c;

void vkt_default_description(vkt_description* description) {
    if (description != nullptr)
        *description = {{1, 1, 1}, "uint8", {0, 0, 0}, {1, 1, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 1}, 1, 0, "", 0, ""};
}

vkt_status vkt_create(vkt_description const* description, void const* voxels, vkt_volume** volume) {
    return guarded([&](Call& call) {
        need(description, "description");
        need(volume, "volume");
        Header header = header_of(*description);
        check_budget(header.bytes(), call.execution());
        Volume result(std::move(header));
        AnyView const view = result.mutable_view();
        if (voxels == nullptr)
            std::memset(view.data, 0, view.bytes());
        else
            std::memcpy(view.data, voxels, view.bytes());
        *volume = wrapped(std::move(result));
    });
}

void vkt_free(vkt_volume* volume) { delete volume; }

vkt_status vkt_describe(vkt_volume const* volume, vkt_description* description) {
    return guarded([&](Call&) {
        need(volume, "volume");
        need(description, "description");
        Header const& header = volume->volume.header();
        vkt_description& d = *description;
        for (int axis = 0; axis < 3; ++axis) {
            d.dims[axis] = header.dims[axis];
            d.origin[axis] = header.geometry.origin[axis];
            d.spacing[axis] = header.geometry.spacing[axis];
            for (int i = 0; i < 3; ++i)
                d.direction[3 * axis + i] = header.geometry.direction[static_cast<std::size_t>(axis)][i];
        }
        d.dtype = volume->dtype.c_str();
        d.slope = header.values.slope;
        d.intercept = header.values.intercept;
        d.units = header.units.c_str();
        d.hierarchical = header.kind == Kind::hierarchical ? 1 : 0;
        auto const space = header.attributes.find("space");
        d.space = space == header.attributes.end() ? "" : space->second.c_str();
    });
}

vkt_status vkt_header(vkt_volume const* volume, char** json) {
    return guarded([&](Call&) {
        need(volume, "volume");
        need(json, "json");
        *json = copied(to_json(volume->volume.header()));
    });
}

char const* vkt_remarks(vkt_volume const* volume) { return volume == nullptr ? "" : volume->remarks.c_str(); }

char const* vkt_report(vkt_volume const* volume) {
    if (volume == nullptr) return "";
    std::lock_guard const lock(volume->reporting);
    if (volume->reporter != nullptr) {
        if (!attempted([&] { volume->report = volume->reporter->report().json(); })) return "";
        volume->reporter.reset();
    }
    return volume->report.c_str();
}
