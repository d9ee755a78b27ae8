// Streams of the C API: volumes one after another over descriptors of the program.
// SPDX-License-Identifier: MIT
#include "ipc/c_call.h"
#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/byte_source.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <optional>
#include <string>
#include <thread>
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

/// The first failure of a stream, which every later call repeats: what follows in it means nothing.
class Failure {
public:
    template <class F> void guard(F const& body) {
        if (failed_) throw Error(failed_->kind(), text("the stream failed before: ", failed_->what()), failed_->hint());
        try {
            body();
        } catch (Error const& e) {
            failed_ = e;
            throw;
        } catch (...) {
            failed_ = Error(ErrorKind::io, "it broke off");
            throw;
        }
    }
    explicit operator bool() const { return failed_.has_value(); }

private:
    std::optional<Error> failed_;
};

ipc::Transport transport_of(std::string const& asked, char const* what) {
    if (asked.empty() || asked == "pipe") return ipc::Transport::pipe;
    if (asked == "shm") return ipc::Transport::shm;
    if (asked == "gpu") return ipc::Transport::gpu;
    throw Error(ErrorKind::usage, text(what, ": '", asked, "' is not one of pipe, shm, gpu"));
}

} // namespace

struct vkt_stream_reader {
    /// Who waits for bytes in a call; the thread that reads ahead is nobody's.
    std::atomic<std::thread::id> caller{};
    ProgressMonitor* monitor = nullptr;
    Failure failure{};
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

    /// Who waits for room in a call; the thread that writes is nobody's.
    std::atomic<std::thread::id> caller{};
    ProgressMonitor* monitor = nullptr;
    int own = -1; ///< of a pipe: a writing end that does not block
    std::unique_ptr<ipc::StreamSink> sink{};
    bool pipe = false, closed = false;
    Failure failure{};
    std::string notice{};
};

namespace {

/// Names the caller of a reader or writer for as long as its call lasts.
template <class Stream> class Calling {
public:
    Calling(Stream& stream, ProgressMonitor* monitor) : stream_(stream) {
        stream_.monitor = monitor;
        stream_.caller = std::this_thread::get_id();
    }
    ~Calling() { stream_.caller = std::thread::id(); }
    Calling(Calling const&) = delete;
    Calling& operator=(Calling const&) = delete;

private:
    Stream& stream_;
};

/// For StreamOptions::waiting: who called may end the call.
template <class Stream> std::function<void()> ended_by_caller(Stream* stream) {
    return [stream] {
        if (stream->caller.load() == std::this_thread::get_id() && stream->monitor != nullptr)
            stream->monitor->poll(0, 1);
    };
}

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
        options.waiting = ended_by_caller(result.get());
        auto bytes = std::make_unique<ByteSource>(duplicate(descriptor), text("descriptor ", descriptor));
        result->source = std::make_unique<ipc::StreamSource>(std::move(bytes), options);
        *reader = result.release();
    });
}

vkt_status vkt_stream_next(vkt_stream_reader* reader, vkt_volume** volume) {
    return ipc::guarded([&](Call& call) {
        need(reader, "reader");
        need(volume, "volume");
        Calling const calling(*reader, call.monitor());
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
        if (result->own >= 0) options.waiting = ended_by_caller(result.get());
        result->sink = std::make_unique<ipc::StreamSink>(result->own >= 0 ? result->own : descriptor, options);
        *writer = result.release();
    });
}

vkt_status vkt_stream_put(vkt_stream_writer* writer, vkt_volume const* volume) {
    return ipc::guarded([&](Call& call) {
        need(writer, "writer");
        need(volume, "volume");
        if (writer->closed) throw Error(ErrorKind::usage, "the stream is closed");
        Calling const calling(*writer, call.monitor());
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
        Calling const calling(*writer, call.monitor());
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
