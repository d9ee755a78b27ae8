// Streams of the C API: volumes one after another over descriptors of the program.
// SPDX-License-Identifier: MIT
#include "ipc/c_call.h"
#include "ipc/c_calling.h"
#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/byte_source.h"

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <string>
#include <unistd.h>
#include <utility>

using namespace vkt;
using namespace vkt::c;

namespace {

int duplicate(int descriptor) {
    int const own = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 3);
    if (own >= 0) return own;
    throw Error(errno == EBADF ? ErrorKind::usage : ErrorKind::resources,
                text("descriptor ", descriptor, ": ", std::strerror(errno)));
}

/// Throws Error{usage} for descriptors that are not open for this.
void need_mode(int descriptor, int other, char const* what) {
    int const flags = ::fcntl(descriptor, F_GETFL);
    if (flags >= 0 && (flags & O_ACCMODE) == other)
        throw Error(ErrorKind::usage, text("descriptor ", descriptor, " is not open for ", what));
}

/// While it lives, writing to a pipe that nobody reads is an error in this thread, and in those that it starts, and not
/// the end of the program.
class WithoutBrokenPipeSignal {
public:
    WithoutBrokenPipeSignal() {
        sigset_t waiting;
        ::sigemptyset(&waiting);
        ::sigpending(&waiting);
        pending_ = ::sigismember(&waiting, SIGPIPE) == 1;
        sigset_t broken_pipe = only();
        ::pthread_sigmask(SIG_BLOCK, &broken_pipe, &before_);
    }
    ~WithoutBrokenPipeSignal() {
        sigset_t broken_pipe = only();
        timespec const now{0, 0};
        while (!pending_ && ::sigtimedwait(&broken_pipe, nullptr, &now) < 0 && errno == EINTR) {
        }
        ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    }
    WithoutBrokenPipeSignal(WithoutBrokenPipeSignal const&) = delete;
    WithoutBrokenPipeSignal& operator=(WithoutBrokenPipeSignal const&) = delete;

private:
    static sigset_t only() {
        sigset_t set;
        ::sigemptyset(&set);
        ::sigaddset(&set, SIGPIPE);
        return set;
    }

    sigset_t before_{};
    bool pending_ = false;
};

ipc::Transport transport_of(std::string const& asked, char const* what) {
    if (asked.empty() || asked == "pipe") return ipc::Transport::pipe;
    if (asked == "shm") return ipc::Transport::shm;
    if (asked == "gpu") return ipc::Transport::gpu;
    throw Error(ErrorKind::usage, text(what, ": '", asked, "' is not one of pipe, shm, gpu"));
}

} // namespace

struct vkt_stream_reader {
    ipc::Caller caller{}; ///< who waits for bytes
    ipc::Failure failure{"the stream"};
    std::unique_ptr<ipc::StreamSource> source{};
};

struct vkt_stream_writer {
    vkt_stream_writer() = default;
    vkt_stream_writer(vkt_stream_writer const&) = delete;
    vkt_stream_writer& operator=(vkt_stream_writer const&) = delete;
    ~vkt_stream_writer() { finish(); }
    /// The reader sees the end once the program has closed its descriptor, too.
    void finish() {
        sink.reset();
        if (own >= 0) ::close(std::exchange(own, -1));
    }

    ipc::Caller caller{}; ///< who waits for room
    int own = -1;         ///< of a pipe: a writing end that does not block
    std::unique_ptr<ipc::StreamSink> sink{};
    bool pipe = false, closed = false;
    ipc::Failure failure{"the stream"};
    std::string notice{};
};

namespace {

void tell_reader(vkt_stream_writer& writer, std::string const& message) {
    if (writer.pipe || writer.sink->traffic().bytes > 0) writer.sink->fail(program_invocation_short_name, message);
}

} // namespace

vkt_status vkt_stream_open(int descriptor, vkt_stream_reader** reader) {
    return ipc::guarded([&](Call&) {
        need(reader, "reader");
        need_mode(descriptor, O_WRONLY, "reading");
        auto result = std::make_unique<vkt_stream_reader>();
        ipc::StreamOptions options;
        options.stage = program_invocation_short_name;
        options.waiting = ipc::ended_by(result->caller);
        auto bytes = std::make_unique<ByteSource>(duplicate(descriptor), text("descriptor ", descriptor));
        result->source = std::make_unique<ipc::StreamSource>(std::move(bytes), options);
        *reader = result.release();
    });
}

vkt_status vkt_stream_next(vkt_stream_reader* reader, vkt_volume** volume) {
    return ipc::guarded([&](Call& call) {
        need(reader, "reader");
        need(volume, "volume");
        ipc::Calling const calling(reader->caller, call.monitor());
        reader->failure.guard([&] {
            vkt_volume* next = nullptr;
            if (reader->source->next_volume()) next = wrapped(load(*reader->source, call.execution()));
            *volume = next;
        });
    });
}

void vkt_stream_free_reader(vkt_stream_reader* reader) { delete reader; }

vkt_status vkt_stream_create(int descriptor, char const* const* words, size_t count, vkt_stream_writer** writer) {
    return ipc::guarded([&](Call&) {
        need(writer, "writer");
        Parameters parameters;
        std::string transport;
        bool no_checksum = false;
        parameters.option("transport", transport, "T", "pipe, shm or gpu");
        parameters.flag("no-checksum", no_checksum, "spare the checksums");
        read_options(words, count, {&parameters});
        need_mode(descriptor, O_RDONLY, "writing");
        if (::fcntl(descriptor, F_GETFD) < 0)
            throw Error(ErrorKind::usage, text("descriptor ", descriptor, ": ", std::strerror(errno)));
        char const* const variable = std::getenv("VKT_TRANSPORT");
        auto result = std::make_unique<vkt_stream_writer>();
        ipc::StreamOptions options;
        options.stage = program_invocation_short_name;
        options.checksum = !no_checksum;
        bool const said = !transport.empty() || variable == nullptr;
        options.transport = said ? transport_of(transport, "--transport") : transport_of(variable, "VKT_TRANSPORT");
        if (options.transport == ipc::Transport::gpu)
            options.gpu = ipc::cuda_memory(0, said ? "--transport gpu" : "VKT_TRANSPORT=gpu");
        options.notice = [own = result.get()](std::string const& notice) { own->notice = printable(notice); };
        WithoutBrokenPipeSignal const quiet;
        result->pipe = ipc::is_pipe(descriptor);
        if (result->pipe) result->own = ipc::without_blocking(descriptor);
        if (result->own >= 0) options.waiting = ipc::ended_by(result->caller);
        result->sink = std::make_unique<ipc::StreamSink>(result->own >= 0 ? result->own : descriptor, options);
        *writer = result.release();
    });
}

vkt_status vkt_stream_put(vkt_stream_writer* writer, vkt_volume const* volume) {
    return ipc::guarded([&](Call& call) {
        need(writer, "writer");
        need(volume, "volume");
        if (writer->closed) throw Error(ErrorKind::usage, "the stream is closed");
        ipc::Calling const calling(writer->caller, call.monitor());
        writer->failure.guard([&] {
            WithoutBrokenPipeSignal const quiet;
            auto const source = volume_source({volume->volume});
            source->next_volume();
            try {
                drain_volume(*source, *writer->sink, call.execution());
            } catch (std::exception const& e) {
                tell_reader(*writer, e.what());
                throw;
            }
        });
    });
}

vkt_status vkt_stream_fail(vkt_stream_writer* writer, char const* message) {
    return ipc::guarded([&](Call&) {
        need(writer, "writer");
        need(message, "message");
        if (writer->closed) throw Error(ErrorKind::usage, "the stream is closed");
        writer->failure.guard([&] {
            WithoutBrokenPipeSignal const quiet;
            writer->closed = true;
            tell_reader(*writer, message);
            writer->finish();
        });
    });
}

vkt_status vkt_stream_close(vkt_stream_writer* writer) {
    return ipc::guarded([&](Call& call) {
        need(writer, "writer");
        if (writer->closed) throw Error(ErrorKind::usage, "the stream is closed");
        ipc::Calling const calling(writer->caller, call.monitor());
        writer->failure.guard([&] {
            WithoutBrokenPipeSignal const quiet;
            writer->sink->close();
            writer->closed = true;
            writer->finish();
        });
    });
}

char const* vkt_stream_notice(vkt_stream_writer const* writer) {
    return writer == nullptr ? "" : writer->notice.c_str();
}

void vkt_stream_free_writer(vkt_stream_writer* writer) {
    if (writer == nullptr) return;
    WithoutBrokenPipeSignal const quiet;
    if (!writer->closed && !writer->failure)
        (void)ipc::guarded([&](Call&) { tell_reader(*writer, "the stream was not closed"); });
    delete writer;
}
