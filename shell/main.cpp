// Where the process begins: words in, exit code out.
// SPDX-License-Identifier: MIT
#include "ipc/descriptor.h"
#include "libvkt/core/error.h"
#include "libvkt/io/temporaries.h"
#include "shell/help.h"
#include "shell/run/run.h"
#include "shell/version.h"

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <malloc.h>
#include <new>
#include <string>
#include <unistd.h>
#include <vector>

namespace {

/// OpenMP's threads spin before they sleep, which starves the other stages of a pipeline, and the runtime reads its
/// settings before main() begins. So the program starts itself once more with the setting made. Without neighbours a
/// few microseconds of spinning are allowed, which most waits at the ends of slabs take no longer than: to wake a
/// thread takes longer than what it has to do in a thin slab.
void make_threads_sleep(char** argv) {
    if (std::getenv("OMP_WAIT_POLICY") != nullptr) return;
    ::setenv("OMP_WAIT_POLICY", "passive", 1);
    if (!vkt::ipc::is_pipe(STDIN_FILENO) && !vkt::ipc::is_pipe(STDOUT_FILENO)) ::setenv("GOMP_SPINCOUNT", "1000", 0);
    ::execv("/proc/self/exe", argv);
    // Where that is impossible the threads spin; results are the same.
}

/// GPUs are used in one stream. The driver prepares for eight, which takes longer than all the rest of a context: three
/// times as long where the stages of a pipeline, each with a context of its own, begin at once.
void use_one_stream() { ::setenv("CUDA_DEVICE_MAX_CONNECTIONS", "1", 0); }

/// The allocator would put blocks of up to 32 MiB into its heap once it has seen some freed, where what is freed
/// between others stays resident: memory that is in no plan. A fixed limit turns that off.
void return_large_blocks() {
#ifdef M_MMAP_THRESHOLD
    ::mallopt(M_MMAP_THRESHOLD, 128 << 10);
#endif
}

extern "C" void clean_up_and_die(int signal) {
    vkt::remove_temporaries();
    std::signal(signal, SIG_DFL);
    std::raise(signal); // whoever waits for this process sees what ended it
}

/// A standard stream that is closed must not become the next file that is opened: what uses it fails as before.
void occupy_standard_streams() {
    for (int const descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (::fcntl(descriptor, F_GETFD) < 0)
            static_cast<void>(::open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY));
}

/// Temporary files that have names do not outlive the process, unless it is killed by force.
void handle_signals() {
    for (int const signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction action {};
        if (::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_DFL)
            std::signal(signal, clean_up_and_die);
    }
    // Files that grow beyond the limit are an error like a full disk.
    std::signal(SIGXFSZ, SIG_IGN);
}

/// Memory that is missing where no exception may leave (destructors of libraries allocate, too) is no crash.
[[noreturn]] void end_without_memory() {
    try {
        if (std::exception_ptr const failure = std::current_exception()) std::rethrow_exception(failure);
    } catch (std::bad_alloc const&) {
        vkt::shell::write_out_of_memory();
        vkt::remove_temporaries();
        ::_exit(static_cast<int>(vkt::ErrorKind::resources));
    } catch (...) {
        // A fault of the program, which a core dump should show.
    }
    __gnu_cxx::__verbose_terminate_handler();
    std::abort();
}

/// OpenMP's runtime ends the program where it cannot start a thread, with a line of its own and exit code 1. What was
/// missing is a resource.
void watch_for_foreign_exits(bool& finished) {
    ::on_exit(
        [](int, void* ended_by_us) {
            if (*static_cast<bool*>(ended_by_us)) return;
            vkt::remove_temporaries();
            ::_exit(static_cast<int>(vkt::ErrorKind::resources));
        },
        &finished);
}

} // namespace

int main(int argc, char** argv) {
    static bool finished = false; // looked at after main() has returned
    occupy_standard_streams();
    use_one_stream();
    make_threads_sleep(argv);
    return_large_blocks();
    handle_signals();
    std::set_terminate(end_without_memory);
    watch_for_foreign_exits(finished);
    std::vector<std::string> const words(argv + 1, argv + argc);
    int code = 0;
    if (words.empty() || words.front() == "--help" || words.front() == "-h") {
        std::fputs(vkt::shell::overview().c_str(), words.empty() ? stderr : stdout);
        code = words.empty() ? 2 : 0;
    } else if (words.front() == "--version") {
        code = vkt::shell::guarded("vkt", [] {
            std::fputs(vkt::shell::version_text().c_str(), stdout);
            return 0;
        });
    } else {
        code = vkt::shell::guarded("vkt " + words.front(), [&] { return vkt::shell::run_words(words); });
    }
    if (code == 0 && std::fflush(stdout) != 0) {
        std::perror("vkt: cannot write to standard output");
        code = static_cast<int>(vkt::ErrorKind::io);
    }
    finished = true;
    return code;
}
