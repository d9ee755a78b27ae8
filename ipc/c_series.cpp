// Series of the C API: the volumes of a file one after another, and into one.
// SPDX-License-Identifier: MIT
#include "ipc/c_series.h"

#include "ipc/c_call.h"
#include "ipc/c_files.h"

#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"

#include <memory>
#include <string>
#include <utility>

using namespace vkt;
using namespace vkt::c;

struct vkt_series_writer {
    std::unique_ptr<Sink> sink{};
    ipc::Failure failure{"the series"};
};

vkt_status vkt_count_volumes(char const* path, char const* const* words, size_t count, int64_t* volumes) {
    return ipc::guarded([&](Call& call) {
        need(path, "path");
        need(volumes, "volumes");
        ipc::ReadWords const said(words, count, call.policy());
        ipc::Caller caller;
        ipc::Calling const calling(caller, call.monitor());
        auto const source = said.open(path, ipc::ended_by(caller));
        std::int64_t counted = 0;
        for (; source->next_volume(); ++counted) source->finish();
        *volumes = counted;
    });
}

vkt_status vkt_series_open(char const* path, char const* const* words, size_t count, vkt_series_reader** reader) {
    return ipc::guarded([&](Call& call) {
        need(path, "path");
        need(reader, "reader");
        auto result = std::make_unique<vkt_series_reader>();
        auto const said = std::make_shared<ipc::ReadWords>(words, count, call.policy());
        ipc::Calling const calling(result->caller, call.monitor());
        result->options = said->options();
        result->source = said->open(path, ipc::ended_by(result->caller));
        result->complete = [said, name = std::string(path)](Header& header, std::int64_t number) {
            if (!header.history) header.history = said->step(name, number);
        };
        *reader = result.release();
    });
}

vkt_status vkt_series_next(vkt_series_reader* reader, vkt_volume** volume) {
    return ipc::guarded([&](Call& call) {
        need(reader, "reader");
        need(volume, "volume");
        ipc::Calling const calling(reader->caller, call.monitor());
        reader->failure.guard([&] {
            vkt_volume* next = nullptr;
            if (reader->source->next_volume()) {
                Volume read = load(*reader->source, call.execution(reader->options));
                if (reader->complete) reader->complete(read.header(), reader->number);
                ++reader->number;
                next = wrapped(std::move(read));
            }
            *volume = next;
        });
    });
}

void vkt_series_free_reader(vkt_series_reader* reader) { delete reader; }

vkt_status vkt_series_create(char const* path, char const* const* words, size_t count, vkt_series_writer** writer) {
    return ipc::guarded([&](Call& call) {
        need(path, "path");
        need(writer, "writer");
        WriteRequest request;
        Parameters parameters;
        request.declare(parameters);
        read_options(words, count, {&parameters});
        request.check(path);
        auto result = std::make_unique<vkt_series_writer>();
        result->sink = ipc::file_sink(path, request.options(), call.execution());
        *writer = result.release();
    });
}

vkt_status vkt_series_put(vkt_series_writer* writer, vkt_volume const* volume) {
    return ipc::guarded([&](Call& call) {
        need(writer, "writer");
        need(volume, "volume");
        if (!writer->sink) throw Error(ErrorKind::usage, "the series is closed");
        writer->failure.guard([&] {
            auto const source = volume_source({volume->volume});
            source->next_volume();
            drain_volume(*source, *writer->sink, call.execution());
        });
    });
}

vkt_status vkt_series_close(vkt_series_writer* writer) {
    return ipc::guarded([&](Call&) {
        need(writer, "writer");
        if (!writer->sink) throw Error(ErrorKind::usage, "the series is closed");
        writer->failure.guard([&] {
            writer->sink->close();
            writer->sink.reset();
        });
    });
}

void vkt_series_free_writer(vkt_series_writer* writer) { delete writer; }
