// Files of the C API: volumes read from and written to any format, streams among them.
// SPDX-License-Identifier: MIT
#include "ipc/c_call.h"
#include "ipc/stream.h"

#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/request.h"
#include "libvkt/formats/series.h"
#include "libvkt/formats/stack.h"
#include "libvkt/formats/stream_reader.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

using namespace vkt;
using namespace vkt::c;

namespace {

/// A file of any format, a stream among them.
std::unique_ptr<Source> open_any(std::string const& path, ReadOptions const& options, Call& call) {
    // A series opens its files one after another, when the call has long had these options.
    return open_path(path, [options, &call](std::string const& one) -> std::unique_ptr<Source> {
        auto bytes = open_bytes(one);
        if (options.describes() || !holds_stream(bytes)) return open_volume(std::move(bytes), options);
        ipc::StreamOptions stream;
        if (ProgressMonitor* const monitor = call.monitor()) stream.waiting = [monitor] { monitor->poll(0, 1); };
        return std::make_unique<ipc::StreamSource>(std::move(bytes), stream);
    });
}

/// The only volume of a source.
Volume read_one(Source& source, std::string const& path, Execution const& execution) {
    if (!source.next_volume()) throw Error(ErrorKind::usage, text("'", path, "' holds no volume"));
    Volume volume = load(source, execution);
    if (source.next_volume())
        throw Error(ErrorKind::usage, text("'", path, "' holds several volumes"),
                    "say which one: --index N, counted from 0");
    return volume;
}

/// A file that holds one volume, or one for each of its slices where the name has a place for numbers.
std::unique_ptr<Sink> file_sink(std::string const& path, WriteOptions options, Execution const& execution) {
    options.memory = execution.memory;
    options.threads = execution.threads;
    auto const create = [options](std::string const& one, std::int64_t files) {
        WriteOptions own = options;
        own.files = files;
        return ipc::is_stream_file(one, own.format) ? ipc::create_stream_file(one, own.force, true)
                                                    : create_volume(one, own);
    };
    if (!is_numbered(path)) return create(path, 1);
    return numbered_sink(path, holds_slices(path, options.format), create);
}

} // namespace

vkt_status vkt_read(char const* path, char const* const* words, size_t count, vkt_volume** volume) {
    return ipc::guarded([&](Call& call) {
        need(path, "path");
        need(volume, "volume");
        ReadRequest request;
        ExecutionOptions options = call.policy();
        Parameters parameters, own, shared;
        bool trust_paths = false;
        request.declare(parameters);
        ReadRequest::declare_trust(own, trust_paths);
        options.declare(shared);
        read_options(words, count, {&parameters, &own, &shared});
        request.check();
        request.trust(trust_paths);
        auto const source = request.region_of(open_any(path, request.options(), call));
        Volume result = read_one(*source, path, call.execution(options));
        if (!result.header().history) {
            std::vector<std::string> step{"read", path};
            for (auto& word : parameters.words()) step.push_back(std::move(word));
            result.header().history = History{std::move(step), {}};
        }
        *volume = wrapped(std::move(result));
    });
}

vkt_status vkt_write(vkt_volume const* volume, char const* path, char const* const* words, size_t count) {
    return ipc::guarded([&](Call& call) {
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
