// Volumes of the C API: made, read, described, written, freed.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volume.h"

#include "ipc/stream.h"
#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/request.h"
#include "libvkt/formats/series.h"
#include "libvkt/formats/stack.h"

#include <algorithm>
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
    return header;
}

/// A file of any format, a stream among them.
std::unique_ptr<Source> open_any(std::string const& path, ReadOptions const& options, Call& call) {
    // A series opens its files one after another, when the call has long had these options.
    return open_path(path, [options, &call](std::string const& one) -> std::unique_ptr<Source> {
        auto bytes = open_bytes(one);
        bool const looked_at = !options.describes() && !bytes->directory();
        if (!looked_at || !ipc::is_stream(bytes->peek(ipc::magic.size())))
            return open_volume(std::move(bytes), options);
        ipc::StreamOptions stream;
        if (ProgressMonitor* const monitor = call.monitor()) stream.waiting = [monitor] { monitor->poll(0, 1); };
        return std::make_unique<ipc::StreamSource>(std::move(bytes), stream);
    });
}

/// The volume of that index; -1 takes the first and insists that there is no other.
Volume read_one(Source& source, std::string const& path, std::int64_t index, Execution const& execution) {
    auto const next = [&](std::int64_t i) {
        if (!source.next_volume())
            throw Error(ErrorKind::usage, text("'", path, "' holds ", i, " volumes; --index counts from 0"));
    };
    for (std::int64_t i = 0; i < index; ++i) {
        next(i);
        source.finish();
    }
    next(std::max<std::int64_t>(index, 0));
    Volume volume = load(source, execution);
    if (index < 0 && source.next_volume())
        throw Error(ErrorKind::usage, text("'", path, "' holds several volumes"), "say --index N, counted from 0");
    return volume;
}

/// A file that holds one volume, or one for each of its slices where the name has a place for numbers.
std::unique_ptr<Sink> file_sink(std::string const& path, WriteOptions options, Execution const& execution) {
    options.memory = execution.memory;
    options.threads = execution.threads;
    auto const create = [options](std::string const& one) {
        return ipc::is_stream_file(one, options.format) ? ipc::create_stream_file(one, options.force, true)
                                                        : create_volume(one, options);
    };
    if (!is_numbered(path)) return create(path);
    return holds_slices(path, options.format) ? slices_sink(path, create) : series_sink(path, create);
}

} // namespace
} // namespace vkt::c

using namespace vkt;
using namespace vkt::c;

vkt_status vkt_read(char const* path, char const* const* words, size_t count, vkt_volume** volume) {
    return guarded([&](Call& call) {
        need(path, "path");
        need(volume, "volume");
        ReadRequest request;
        ExecutionOptions options = call.policy();
        Parameters parameters, own, shared;
        std::int64_t index = -1;
        bool trust_paths = false;
        request.declare(parameters);
        ReadRequest::declare_trust(own, trust_paths);
        own.option("index", index, "N", "which volume of a file that holds several, counted from 0");
        options.declare(shared);
        read_options(words, count, {&parameters, &own, &shared});
        request.check();
        request.trust(trust_paths);
        if (own.given("index") && index < 0) throw Error(ErrorKind::usage, text("--index ", index, " is negative"));
        auto const source = request.region_of(open_any(path, request.options(), call));
        Volume result = read_one(*source, path, index, call.execution(options));
        if (!result.header().history) {
            std::vector<std::string> step{"read", path};
            for (auto& word : parameters.words()) step.push_back(std::move(word));
            result.header().history = History{std::move(step), {}};
        }
        *volume = wrapped(std::move(result));
    });
}

void vkt_default_description(vkt_description* description) {
    *description = {{1, 1, 1}, "uint8", {0, 0, 0}, {1, 1, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 1}, 1, 0, "", 0, ""};
}

vkt_status vkt_create(vkt_description const* description, void const* voxels, vkt_volume** volume) {
    return guarded([&](Call&) {
        need(description, "description");
        need(volume, "volume");
        Volume result(header_of(*description));
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

vkt_status vkt_write(vkt_volume const* volume, char const* path, char const* const* words, size_t count) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        need(path, "path");
        WriteRequest request;
        Parameters parameters;
        request.declare(parameters);
        read_options(words, count, {&parameters});
        request.check(path);
        Execution const execution = call.execution();
        auto const sink = file_sink(path, request.options(), execution);
        auto const source = volume_source({volume->volume});
        drain(*source, *sink, execution);
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
