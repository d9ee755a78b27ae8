// Streams as files.
// SPDX-License-Identifier: MIT
#include "ipc/descriptor.h"
#include "ipc/stream.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/wrapper.h"
#include "libvkt/io/shared_memory.h"

namespace vkt::ipc {
namespace {

class StreamFile : public Sink {
public:
    StreamFile(std::string const& path, bool force, StreamOptions options)
        : file_(path, force), sink_(file_.descriptor(), std::move(options)) {}

    void begin(Header const& header) override {
        Header kept = header;
        kept.timing = false; // files hold nothing that differs from run to run
        if (!header.dry_run) file_.expect(header.bytes());
        sink_.begin(kept);
    }
    AnyView acquire(Box const& slab) override { return sink_.acquire(slab); }
    void commit() override { sink_.commit(); }
    void end() override { sink_.end(); }
    void put_bricks(BrickSequence bricks) override { sink_.put_bricks(std::move(bricks)); }
    void close() override {
        sink_.close();
        file_.commit();
    }

private:
    OutputFile file_;
    StreamSink sink_;
};

} // namespace

bool is_stream_file(std::string const& path, std::string const& format) {
    if (is_segment(path) && format == "vkt")
        throw Error(ErrorKind::usage, text("--format vkt: '", path, "' is shared memory and no file"),
                    text("a file of that name is ./", path));
    return format == "vkt" ||
           (format.empty() && !is_segment(path) && lower_case(without_wrapper(path)).ends_with(".vkt"));
}

std::unique_ptr<Sink> create_stream_file(std::string const& path, bool force, bool checksum) {
    StreamOptions options;
    options.checksum = checksum;
    Wrapper const wrapper = wrapper_of_name(path);
    if (wrapper == Wrapper::none) return std::make_unique<StreamFile>(path, force, options);
    WriteOptions own;
    own.force = force;
    return wrapping_sink(path, wrapper, own, [options](std::string const& inner) {
        return std::make_unique<StreamFile>(inner, false, options);
    });
}

} // namespace vkt::ipc
