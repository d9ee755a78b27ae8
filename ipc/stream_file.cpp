// Streams as files.
// SPDX-License-Identifier: MIT
#include "ipc/descriptor.h"
#include "ipc/stream.h"

namespace vkt::ipc {
namespace {

class StreamFile : public Sink {
public:
    StreamFile(std::string const& path, bool force, StreamOptions options)
        : file_(path, force), sink_(file_.descriptor(), std::move(options)) {}

    void begin(Header const& header) override {
        Header kept = header;
        kept.timing = false; // files hold nothing that differs from run to run
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

std::unique_ptr<Sink> create_stream_file(std::string const& path, bool force, bool checksum) {
    StreamOptions options;
    options.checksum = checksum;
    return std::make_unique<StreamFile>(path, force, options);
}

} // namespace vkt::ipc
