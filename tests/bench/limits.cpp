// What this machine can do at best: copy bandwidth, fresh memory, pipes. Prints "name value unit" lines.
// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <sys/mman.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace {

constexpr std::size_t mebibyte = std::size_t{1} << 20;

double seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Shortest of `runs` times of a piece of work.
template <class Work> double best_of(int runs, Work work) {
    double best = 1e30;
    for (int i = 0; i < runs; ++i) {
        double const begin = seconds();
        work();
        best = std::min(best, seconds() - begin);
    }
    return best;
}

struct Unmap {
    std::size_t bytes;
    void operator()(char* p) const { munmap(p, bytes); }
};
using Pages = std::unique_ptr<char, Unmap>;

Pages map(std::size_t bytes, int advice) {
    void* p = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (p == MAP_FAILED) {
        std::perror("limits: mmap");
        std::exit(5);
    }
    madvise(p, bytes, advice);
    return {static_cast<char*>(p), Unmap{bytes}};
}

void report(char const* name, double bytes, double time) {
    std::printf("%-28s %8.2f GB/s\n", name, bytes / time * 1e-9);
}

/// Counts the bytes copied, once, as users of a copy do.
void copy_with(unsigned threads, char const* name) {
    std::size_t const bytes = 512 * mebibyte, share = bytes / threads;
    Pages const from = map(bytes, MADV_HUGEPAGE), to = map(bytes, MADV_HUGEPAGE);
    std::memset(from.get(), 1, bytes);
    std::memset(to.get(), 2, bytes);
    report(name, static_cast<double>(bytes), best_of(7, [&] {
               std::vector<std::thread> workers;
               for (unsigned i = 0; i < threads; ++i)
                   workers.emplace_back([&, i] { std::memcpy(to.get() + i * share, from.get() + i * share, share); });
               for (auto& worker : workers) worker.join();
           }));
}

void touch(int advice, char const* name) {
    std::size_t const bytes = 256 * mebibyte;
    report(name, static_cast<double>(bytes), best_of(3, [&] {
               Pages const pages = map(bytes, advice);
               std::memset(pages.get(), 1, bytes);
           }));
}

/// One process writes from a buffer in cache, or maps its pages into the pipe, this one reads into another buffer,
/// through a pipe of this capacity.
void pipe_with(int capacity, std::size_t chunk, bool map_pages, char const* name) {
    std::size_t const bytes = 2048 * mebibyte;
    report(name, static_cast<double>(bytes), best_of(3, [&] {
               int ends[2];
               if (pipe2(ends, O_CLOEXEC) != 0) std::exit(4);
               if (capacity > 0) fcntl(ends[1], F_SETPIPE_SZ, capacity);
               Pages const pages = map(chunk, MADV_HUGEPAGE);
               std::memset(pages.get(), 1, chunk);
               pid_t const child = fork();
               if (child == 0) {
                   for (std::size_t sent = 0; sent < bytes;) {
                       iovec part{pages.get(), std::min(chunk, bytes - sent)};
                       ssize_t const n =
                           map_pages ? vmsplice(ends[1], &part, 1, 0) : write(ends[1], part.iov_base, part.iov_len);
                       if (n <= 0) _exit(1);
                       sent += static_cast<std::size_t>(n);
                   }
                   _exit(0);
               }
               close(ends[1]);
               while (read(ends[0], pages.get(), chunk) > 0) {
               }
               close(ends[0]);
               waitpid(child, nullptr, 0);
           }));
}

} // namespace

int main() {
    copy_with(1, "memcpy, 1 thread");
    copy_with(std::max(1U, std::thread::hardware_concurrency()), "memcpy, all threads");
    touch(MADV_NOHUGEPAGE, "fresh pages, 4 KiB");
    touch(MADV_HUGEPAGE, "fresh pages, huge");
    pipe_with(0, 64 << 10, false, "pipe, 64 KiB");
    pipe_with(1 << 20, 1 << 20, false, "pipe, 1 MiB");
    pipe_with(1 << 20, 1 << 20, true, "pipe, 1 MiB, mapped pages");
}
