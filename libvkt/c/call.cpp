// Calls: errors of a thread, its policy, who watches it.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"
#include "libvkt/io/system_error.h"

#include <cstdlib>
#include <cstring>
#include <new>
#include <system_error>
#include <thread>
#include <unistd.h>
#include <utility>

namespace vkt::c {
namespace {

static_assert(static_cast<int>(ErrorKind::failure) == VKT_FAILURE && static_cast<int>(ErrorKind::usage) == VKT_USAGE &&
              static_cast<int>(ErrorKind::data) == VKT_DATA && static_cast<int>(ErrorKind::io) == VKT_IO &&
              static_cast<int>(ErrorKind::resources) == VKT_RESOURCES &&
              static_cast<int>(ErrorKind::cancelled) == VKT_CANCELLED);

struct LastError {
    std::string message, hint;
    vkt_status status = VKT_OK;
};

/// What a thread asked of its calls.
struct Wishes {
    ExecutionOptions policy;
    vkt_progress_function progress = nullptr;
    void* user = nullptr;
};

thread_local LastError last_error;
thread_local Wishes wishes;
thread_local std::string device_in_force; // what vkt_get_policy() points to

LastError failed(vkt_status status, char const* message, char const* hint = "") noexcept {
    LastError error;
    error.status = status;
    try {
        error.message = printable(message); // what files and arguments say is in it
        error.hint = printable(hint);
    } catch (std::exception const&) { // no memory for the text; the status remains
        error.message.clear();
        error.hint.clear();
    }
    return error;
}

template <class F> LastError attempt(F const& body) noexcept {
    try {
        body();
        return {};
    } catch (Error const& e) {
        return failed(static_cast<vkt_status>(e.kind()), e.what(), e.hint().c_str());
    } catch (std::bad_alloc const&) {
        return failed(VKT_RESOURCES, "out of memory");
    } catch (std::system_error const& e) {
        return failed(is_shortage(e) ? VKT_RESOURCES : VKT_FAILURE, e.what());
    } catch (std::exception const& e) {
        return failed(VKT_FAILURE, e.what());
    } catch (...) {
        return failed(VKT_FAILURE, "unknown failure");
    }
}

pid_t const loaded_by = ::getpid();

ProgressMonitor::Listener listener_of(Wishes const& asked) {
    if (asked.progress == nullptr) return {};
    return [function = asked.progress, user = asked.user](double done) { return function(done, user) != 0; };
}

} // namespace

Call::Call(ExecutionOptions policy, ProgressMonitor::Listener listener) : policy_(std::move(policy)) {
    if (listener) monitor_.emplace(std::move(listener));
}

Execution Call::execution(ExecutionOptions const& options) {
    Execution execution = options.execution();
    keep_blocks(execution.memory);
    execution.monitor = monitor();
    return execution;
}

vkt_status guarded(std::function<void(Call&)> const& body) noexcept {
    LastError error;
    Wishes const& asked = wishes;
    auto const work = [&] {
        Call call(asked.policy, listener_of(asked));
        body(call);
    };
    if (::getpid() == loaded_by) {
        error = attempt(work);
    } else {
        // After fork(), as Python's multiprocessing does it, this thread would wait forever for the OpenMP threads that
        // it had in the parent. A new thread gets new ones.
        LastError outer = attempt([&] { std::thread([&] { error = attempt(work); }).join(); });
        if (outer.status != VKT_OK) error = std::move(outer);
    }
    vkt_status const status = error.status;
    if (status != VKT_OK) last_error = std::move(error);
    return status;
}

bool attempted(std::function<void()> const& body) noexcept {
    LastError error = attempt(body);
    if (error.status == VKT_OK) return true;
    last_error = std::move(error);
    return false;
}

void need(void const* pointer, char const* argument) {
    if (pointer == nullptr) throw Error(ErrorKind::usage, text("argument '", argument, "' is null"));
}

std::vector<std::string> words_of(char const* const* words, size_t count) {
    if (count > 0) need(words, "words");
    std::vector<std::string> result;
    for (size_t i = 0; i < count; ++i) {
        need(words[i], text("words[", i, "]").c_str());
        result.emplace_back(words[i]);
    }
    return result;
}

void read_options(char const* const* words, size_t count, std::vector<Parameters*> const& lists) {
    auto const left = read_words(words_of(words, count), lists);
    if (!left.empty()) throw Error(ErrorKind::usage, text("unexpected argument '", left.front(), "'"));
}

char* copied(std::string const& text) {
    auto* const copy = static_cast<char*>(std::malloc(text.size() + 1));
    if (copy == nullptr) throw std::bad_alloc();
    std::memcpy(copy, text.c_str(), text.size() + 1);
    return copy;
}

} // namespace vkt::c

using namespace vkt;
using namespace vkt::c;

char const* vkt_version(void) { return VKT_VERSION; }

char const* vkt_error(void) { return last_error.message.c_str(); }
char const* vkt_error_hint(void) { return last_error.hint.c_str(); }
vkt_status vkt_error_status(void) { return last_error.status; }

vkt_status vkt_set_policy(vkt_policy const* policy) {
    ExecutionOptions asked;
    vkt_status const status = guarded([&](Call&) {
        if (policy == nullptr) return;
        if (policy->device != nullptr) asked.device = policy->device;
        if (policy->threads != 0) asked.threads = policy->threads;
        if (policy->memory != 0) asked.memory = text(static_cast<std::uint64_t>(policy->memory));
        asked.execution(); // throws for what cannot be
    });
    if (status == VKT_OK) wishes.policy = std::move(asked);
    return status;
}

vkt_status vkt_get_policy(vkt_policy* policy) {
    return guarded([&](Call& call) {
        need(policy, "policy");
        Execution const execution = call.policy().execution();
        device_in_force = enum_name(execution.device);
        if (execution.device == Device::gpu) device_in_force += execution.gpus > 1 ? ":all" : text(":", execution.gpu);
        *policy = {device_in_force.c_str(), execution.threads, execution.memory};
    });
}

void vkt_set_progress(vkt_progress_function function, void* user) {
    wishes.progress = function;
    wishes.user = user;
}

size_t vkt_trim(void) { return release_blocks(); }

void vkt_free_text(char* text) { std::free(text); }
