// Volume streams over a file descriptor: a Source that reads ahead on a thread, a Sink that writes behind on one.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/frame.h"
#include "ipc/gpu_memory.h"
#include "libvkt/engine/source.h"
#include "libvkt/formats/format.h"

#include <functional>
#include <memory>
#include <string>

namespace vkt::ipc {

/// How a stream's voxels travel: in the pipe, in memory that both ends map, or in that of a GPU on which both work.
/// Whatever stands in the way of one, those before it do.
enum class Transport : std::uint8_t { pipe, shm, gpu };

struct StreamOptions {
    Transport transport = Transport::pipe;
    /// Writing with Transport::gpu: the GPU where slabs are left. Reading: the one on which they are worked on, where
    /// the writer may leave them; null if they are wanted in the host's memory.
    std::shared_ptr<GpuMemory> gpu{};
    bool checksum = true;
    std::size_t piece = std::size_t{2} << 20; ///< reading: slices beyond this are handed out in pieces of rows
    bool whole = false;        ///< reading: whole volumes are wanted, in one segment of shared memory if the writer can
    std::string stage = "vkt"; ///< names this process in ERR frames and notices
    std::function<void(std::string const&)> notice; ///< fallbacks are told here, once; may be empty
    /// Called every 20 ms while nothing arrives, or while there is no room to write (of a descriptor that does not
    /// block), by any thread that waits; what it throws ends the stream. May be empty.
    std::function<void()> waiting;
};

/// Time and bytes at this end of a stream.
struct Traffic {
    double wait = 0; ///< seconds the computing thread waited
    std::uint64_t bytes = 0;
};

/// True if the bytes begin a volume stream, of whatever version.
bool is_stream(std::span<std::byte const> head);

/// What a stream's reader knows of it; outlives the reader.
struct StreamRecord {
    Traffic traffic;
    std::vector<StageReport> stages; ///< timing rows that arrived with END
};

/// Reads a stream. Skipped slabs are not copied. EOF before END, a broken checksum, slabs out of order or of the wrong
/// size are Error{data}; an ERR frame is an UpstreamError.
class StreamSource : public Source {
public:
    StreamSource(std::unique_ptr<ByteSource> bytes, StreamOptions options);
    ~StreamSource() override;

    bool next_volume() override;
    Header const& header() const override;
    Access access() const override { return Access::forward; }
    void read(AnyView out) override;
    std::optional<ConstView> borrow(Box const& region) override;
    std::shared_ptr<Lease> lease(Box const& region) override;
    void expect(Box const& region) override;
    std::int64_t natural_slab() const override;
    /// Where the current volume's first slab lies, for which it waits. read() writes to either space.
    Space space() const override;
    void finish() override;
    BrickSequence take_bricks() override;
    std::optional<Volume> take_whole() override;

    /// Up to date after finish() and when the source is gone.
    std::shared_ptr<StreamRecord const> record() const;

private:
    class Reader;
    std::unique_ptr<Reader> reader_;
};

/// Writes a stream. A reader that went away raises SIGPIPE as any Unix filter does.
class StreamSink : public Sink {
public:
    /// Does not own the descriptor.
    StreamSink(int descriptor, StreamOptions options);
    ~StreamSink() override;

    void begin(Header const& header) override;
    AnyView acquire(Box const& slab) override;
    void commit() override;
    bool pass_on(Box const& slab, std::shared_ptr<Lease> const& lease) override;
    void end() override;
    void close() override;
    void fail(std::string const& stage, std::string const& message) override;
    void put_bricks(BrickSequence bricks) override;
    /// After begin(): where acquire() wants the slabs of the volume.
    Space space() const override;
    std::int64_t natural_slab() const override;

    Traffic traffic() const;
    /// What the voxels of the last volume went through: "pipe", "shared memory" or "GPU memory".
    char const* way() const;
    /// Timing rows to send with the next END.
    void report_stages(std::function<std::vector<StageReport>()> reports);

private:
    class Writer;
    std::unique_ptr<Writer> writer_;
};

/// Whether an output of this name and --format is a file with a stream in it. Throws Error{usage} for a segment of
/// shared memory that is to be one.
bool is_stream_file(std::string const& path, std::string const& format);
/// A stream kept in a file, which appears under its name only when it is whole.
std::unique_ptr<Sink> create_stream_file(std::string const& path, bool force, bool checksum);

} // namespace vkt::ipc
