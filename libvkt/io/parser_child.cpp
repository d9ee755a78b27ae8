// The loop of a child that parses. Whatever its library does to it, the process that asks goes on.
// SPDX-License-Identifier: MIT
#include "libvkt/io/parser_child.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <exception>
#include <new>
#include <thread>

#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace vkt {
namespace {

void limit(__rlimit_resource_t resource, rlim_t most) {
    rlimit both{};
    if (::getrlimit(resource, &both) != 0) return;
    both.rlim_cur = std::min(both.rlim_cur, most);
    both.rlim_max = std::min(both.rlim_max, most);
    ::setrlimit(resource, &both);
}

/// True if somebody set a tighter limit than ours: what does not fit then is no fault of the file.
bool limited_from_outside(std::size_t memory) {
    for (auto const resource : {RLIMIT_AS, RLIMIT_DATA}) {
        rlimit both{};
        if (::getrlimit(resource, &both) == 0 && both.rlim_cur < memory) return true;
    }
    return false;
}

void take_limits(ParserTask const& task) {
    // One byte rather than none: a dump that would be handed to a program is suppressed only by this.
    limit(RLIMIT_CORE, 1);
    limit(RLIMIT_CPU, static_cast<rlim_t>(task.seconds));
    // Memory of its own, the heap and what is mapped for writing; sanitizers map terabytes that they never touch.
    if (!sanitized_build) limit(RLIMIT_DATA, task.memory);
}

/// Ends this process when the parent ends. Not PR_SET_PDEATHSIG, which watches the thread that started us and not its
/// process. Nothing here needs memory or locks.
void watch_parent(int descriptor, int parent) {
    for (;;) {
        pollfd ends[] = {{parser_socket, POLLRDHUP, 0}, {descriptor, POLLIN, 0}};
        bool const notified = descriptor >= 0; // else, on old kernels, we look
        int const n = ::poll(ends, notified ? 2 : 1, notified ? -1 : 1000);
        if (n > 0 || ::getppid() != parent) ::_exit(0);
    }
}

/// Where messages name the file as the library knows it, its own name.
std::string renamed(std::string message, std::string const& from, std::string const& to) {
    for (std::size_t at = 0; (at = message.find(from, at)) != std::string::npos; at += to.size())
        message.replace(at, from.size(), to);
    return message;
}

class Child {
public:
    explicit Child(ParserTask const& task) : task_(task), path_(text("/dev/fd/", parser_file)) {}

    /// What this throws is the answer to everything that needs the library.
    void load(std::function<ParserOpen()> const& load) {
        unloaded_ = guarded([&] {
            open_ = load();
            return Message();
        });
    }

    Message answer(Received received) {
        return guarded([&] {
            if (received.descriptor >= 0) return share(received.descriptor);
            if (open_ == nullptr) return unloaded_;
            if (!handler_) handler_ = open_(path_);
            Message result;
            result.put(std::int64_t{0});
            handler_(received.message, window_, result);
            return result;
        });
    }

private:
    /// What `work` returns, or as a message what it throws.
    template <class F> Message guarded(F const& work) const {
        try {
            return work();
        } catch (Error const& e) {
            return error(e.kind(), renamed(e.what(), path_, task_.name), renamed(e.hint(), path_, task_.name));
        } catch (std::bad_alloc const&) {
            return out_of_memory();
        } catch (std::exception const& e) {
            return error(ErrorKind::data, renamed(text("'", path_, "': damaged: ", e.what()), path_, task_.name),
                         "copy it again from where it came from");
        }
    }

    static Message error(ErrorKind kind, std::string const& message, std::string const& hint) {
        Message result;
        result.put(static_cast<std::int64_t>(kind));
        result.put(message);
        result.put(hint);
        return result;
    }

    Message out_of_memory() const {
        std::string const most = bytes_text(static_cast<double>(task_.memory));
        if (limited_from_outside(task_.memory))
            return error(ErrorKind::resources, text("'", task_.name, "': not enough memory"),
                         "the limits of this shell or job are tight (ulimit -a)");
        return error(ErrorKind::data, text("'", task_.name, "': damaged: it asks for more than ", most, " of memory"),
                     "a whole file may be given more: --memory SIZE");
    }

    Message share(int descriptor) {
        struct stat status {};
        void* mapping = MAP_FAILED;
        if (::fstat(descriptor, &status) == 0)
            mapping = ::mmap(nullptr, static_cast<std::size_t>(status.st_size), PROT_READ | PROT_WRITE, MAP_SHARED,
                             descriptor, 0);
        ::close(descriptor);
        if (mapping == MAP_FAILED) throw Error(ErrorKind::resources, text(path_, ": cannot map shared memory"));
        window_ = {static_cast<std::byte*>(mapping), static_cast<std::size_t>(status.st_size)};
        Message result;
        result.put(std::int64_t{0});
        return result;
    }

    ParserTask const& task_;
    std::string path_;
    ParserOpen open_ = nullptr;
    Message unloaded_; ///< why there is none
    ParserHandler handler_;
    std::span<std::byte> window_;
};

} // namespace

int run_parser(ParserTask const& task, std::function<ParserOpen()> const& load) {
    take_limits(task);
    auto const parent = static_cast<int>(::syscall(SYS_pidfd_open, task.parent, 0));
    if (::getppid() != task.parent) return 0; // gone already
    std::thread(watch_parent, parent, task.parent).detach();
    Child child(task);
    child.load(load);
    Message ready;
    ready.put(parser_ready);
    static_cast<void>(send_message(parser_socket, ready)); // who has gone is noticed below
    while (auto received = receive_message(parser_socket))
        if (!send_message(parser_socket, child.answer(std::move(*received)))) break;
    // The kernel takes everything back faster than the libraries would, and without their complaints.
    ::_exit(0);
}

} // namespace vkt
