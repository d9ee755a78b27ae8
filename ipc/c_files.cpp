// Files of the C API: volumes read from and written to any format, streams among them.
// SPDX-License-Identifier: MIT
#include "ipc/c_files.h"

#include "ipc/c_call.h"
#include "ipc/c_calling.h"
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

namespace vkt::ipc {

ReadWords::ReadWords(char const* const* words, size_t count, ExecutionOptions policy) : options_(std::move(policy)) {
    Parameters own, shared;
    bool trust_paths = false;
    request_.declare(parameters_);
    ReadRequest::declare_trust(own, trust_paths);
    options_.declare(shared);
    read_options(words, count, {&parameters_, &own, &shared});
    request_.check();
    request_.trust(trust_paths);
}

std::unique_ptr<Source> ReadWords::open(std::string const& path, std::function<void()> waiting) const {
    // A series opens its files one after another.
    auto const open_one = [options = request_.options(), waiting](std::string const& one) -> std::unique_ptr<Source> {
        auto bytes = open_bytes(one);
        if (options.describes() || !holds_stream(bytes)) return open_volume(std::move(bytes), options);
        StreamOptions stream;
        stream.waiting = waiting;
        return std::make_unique<StreamSource>(std::move(bytes), stream);
    };
    return request_.region_of(open_path(path, open_one));
}

History ReadWords::step(std::string const& path) const {
    std::vector<std::string> step{"read", path};
    for (auto& word : parameters_.words()) step.push_back(std::move(word));
    return History{std::move(step), {}};
}

History ReadWords::step(std::string const& path, std::int64_t volume) const {
    History step = this->step(path);
    auto const said = std::ranges::find(step.command, "--index");
    if (said != step.command.end()) {
        VolumeRange const range = ValueText<VolumeRange>::read({said[1]}, "--index");
        said[1] = to_text(range.first + volume * range.step);
    } else {
        step.command.insert(step.command.end(), {"--index", to_text(volume)});
    }
    return step;
}

std::unique_ptr<Sink> file_sink(std::string const& path, WriteOptions options, Execution const& execution) {
    options.memory = execution.memory;
    options.threads = execution.threads;
    auto const create = [](std::string const& one, WriteOptions const& own) {
        return is_stream_file(one, own.format) ? create_stream_file(one, own.force, true) : create_volume(one, own);
    };
    if (!is_numbered(path)) return create(path, options);
    return numbered_sink(path, holds_slices(path, options.format), options, create);
}

} // namespace vkt::ipc

namespace {

/// The only volume of a source.
Volume read_one(Source& source, std::string const& path, Execution const& execution) {
    if (!source.next_volume()) throw Error(ErrorKind::usage, text("'", path, "' holds no volume"));
    Volume volume = load(source, execution);
    if (source.next_volume())
        throw Error(ErrorKind::usage, text("'", path, "' holds several volumes"),
                    "say which one: --index N, counted from 0; vkt_series_open() reads all");
    return volume;
}

} // namespace

vkt_status vkt_read(char const* path, char const* const* words, size_t count, vkt_volume** volume) {
    return ipc::guarded([&](Call& call) {
        need(path, "path");
        need(volume, "volume");
        ipc::ReadWords const said(words, count, call.policy());
        ipc::Caller caller;
        ipc::Calling const calling(caller, call.monitor());
        auto const source = said.open(path, ipc::ended_by(caller));
        Volume result = read_one(*source, path, call.execution(said.options()));
        if (!result.header().history) result.header().history = said.step(path);
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
        auto const sink = ipc::file_sink(path, request.options(), execution);
        auto const source = volume_source({volume->volume});
        drain(*source, *sink, execution);
    });
}
