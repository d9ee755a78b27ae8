// Times the hand-over of a volume in GPU memory from one process to the next, and looks for memory that stays behind.
// SPDX-License-Identifier: MIT
#include "ipc/stream.h"
#include "libvkt/core/buffer.h"
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/cut.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace {

using namespace vkt;
using Clock = std::chrono::steady_clock;

constexpr int volumes = 12;
constexpr double most_ms = 3;

Header one_gigabyte() {
    Header header;
    header.dims = {1024, 1024, 256};
    header.dtype = DataType::float32;
    return header;
}

double ms_since(Clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

double median(std::vector<double> times) {
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
}

/// A stage that fills slabs; what it would take alone.
void produce(int descriptor, std::shared_ptr<ipc::GpuMemory> gpu) {
    ipc::StreamOptions options;
    options.transport = ipc::Transport::gpu;
    options.gpu = std::move(gpu);
    options.notice = [](std::string const& message) { std::printf("FAILED: %s\n", message.c_str()); };
    ipc::StreamSink sink(descriptor, options);
    Header const header = one_gigabyte();
    std::vector<double> times;
    for (int i = 0; i < volumes; ++i) {
        auto const begin = Clock::now();
        sink.begin(header);
        Cut const cut = cut_of(header, sink.natural_slab(), default_execution());
        for_each_piece(box_of(header.dims), cut, [&](Box const& box) {
            AnyView const to = sink.acquire(box);
            device_clear(to.data, to.bytes());
            sink.commit();
        });
        sink.end();
        times.push_back(ms_since(begin));
    }
    sink.close();
    Buffer alone(header.bytes());
    device_clear(alone.write(Space::device), header.bytes());
    device_synchronize();
    auto const begin = Clock::now();
    device_clear(alone.write(Space::device), header.bytes());
    device_synchronize();
    double const fill = ms_since(begin);
    double const handed = median({times.begin() + 2, times.end()});
    std::printf(
        "1 GiB filled and handed over in %.2f ms, filled alone in %.2f ms: %.2f ms for the hand-over (bar: at most "
        "%.0f): %s\n",
        handed, fill, handed - fill, most_ms, handed - fill <= most_ms ? "within" : "FAILED");
}

void consume(int descriptor, bool copies) {
    ipc::StreamOptions options;
    options.gpu = ipc::cuda_memory(0, "--device gpu");
    ipc::StreamSource source(std::make_unique<ByteSource>(descriptor, "pipe"), options);
    Buffer own;
    while (source.next_volume()) {
        Box const all = box_of(source.header().dims);
        source.expect(all);
        for_each_piece(all, {source.natural_slab(), all.dims().y}, [&](Box const& box) {
            auto const lent = source.borrow(box);
            if (!lent || lent->space != Space::device) throw Error(ErrorKind::failure, "the slab is not on the GPU");
            if (!copies) return;
            own.reserve(lent->bytes());
            copy_region(*lent, dense_view(own.write(Space::device), lent->type, box, Space::device), {});
        });
        source.finish();
    }
}

void run(bool copies) {
    int ends[2];
    if (::pipe(ends) != 0) throw Error(ErrorKind::failure, "no pipe");
    std::printf("%s\n", copies ? "The reader copies every slab:" : "The reader looks at slabs in place:");
    std::fflush(stdout);
    auto const child = [&](auto const& body) {
        pid_t const process = ::fork(); // before anybody has hold of a GPU
        if (process != 0) return process;
        int code = 0;
        try {
            body();
        } catch (std::exception const& e) {
            std::printf("FAILED: %s\n", e.what());
            code = 1;
        }
        std::fflush(stdout);
        ::_exit(code);
    };
    pid_t const reader = child([&] {
        ::close(ends[1]);
        consume(ends[0], copies);
    });
    pid_t const writer = child([&] {
        ::close(ends[0]);
        produce(ends[1], ipc::cuda_memory(0, "--transport gpu"));
    });
    ::close(ends[0]);
    ::close(ends[1]);
    for (pid_t const process : {reader, writer}) {
        int status = 0;
        ::waitpid(process, &status, 0);
        if (status != 0) std::printf("FAILED: a process ended with status %d\n", status);
    }
}

} // namespace

int main() {
    pid_t const look = ::fork();
    if (look == 0) ::_exit(vkt::device_count() > 0 ? 0 : 77);
    int status = 0;
    ::waitpid(look, &status, 0);
    if (status != 0) {
        std::puts("skipped: no GPU");
        return 77;
    }
    for (bool const copies : {false, true}) run(copies);
    return 0;
}
