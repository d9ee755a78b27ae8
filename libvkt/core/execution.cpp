// What this machine offers: instruction sets, CPUs in the affinity mask, memory within the cgroup.
// SPDX-License-Identifier: MIT
#include "libvkt/core/execution.h"

#include "libvkt/core/cgroup.h"
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <sched.h>
#include <string>
#include <sys/resource.h>
#include <unistd.h>

namespace vkt {
namespace {

/// Read once: every stage asks several times, and files lie behind the answer.
CgroupLimits const& own_limits() {
    static CgroupLimits const limits = cgroup_limits();
    return limits;
}

std::optional<std::string> environment(char const* name) {
    char const* const value = std::getenv(name);
    if (value == nullptr || *value == 0) return std::nullopt;
    return std::string(value);
}

std::optional<int> threads_from(char const* name) {
    auto const value = environment(name);
    if (!value) return std::nullopt;
    // OMP_NUM_THREADS may be a list for nested regions; the first entry counts.
    try {
        std::int64_t const n = parse_integer(split(*value, ',').front());
        if (n >= 1 && n <= 4096) return static_cast<int>(n);
    } catch (Error const&) {
    }
    throw Error(ErrorKind::usage, text(name, "='", *value, "' is not a number of threads"));
}

/// How many threads have room in the address space, if that is limited (ulimit -v): a quarter of it may be their
/// stacks. OpenMP ends the program where it cannot start those that it is asked for.
int threads_with_room() {
    rlimit space{};
    if (::getrlimit(RLIMIT_AS, &space) != 0 || space.rlim_cur == RLIM_INFINITY) return std::numeric_limits<int>::max();
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    std::size_t const used = pages * static_cast<std::size_t>(std::max(1L, sysconf(_SC_PAGESIZE)));
    rlimit stack{};
    bool const stated = ::getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur != RLIM_INFINITY;
    std::size_t const each = std::max<std::size_t>(stated ? stack.rlim_cur : 0, std::size_t{1} << 20);
    std::size_t const room = space.rlim_cur > used ? (space.rlim_cur - used) / 4 / each : 0;
    return static_cast<int>(std::clamp<std::size_t>(room, 1, 1 << 20));
}

} // namespace

InstructionSet best_instruction_set() {
    auto best = InstructionSet::baseline;
#ifdef VKT_X86_BACKENDS
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2"))
        best = InstructionSet::avx2;
    if (best == InstructionSet::avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512cd"))
        best = InstructionSet::avx512;
#endif
    if (auto const asked = environment("VKT_INSTRUCTION_SET")) {
        for (auto set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512})
            if (*asked == name_of(set)) return std::min(best, set);
        throw Error(ErrorKind::usage, text("VKT_INSTRUCTION_SET='", *asked, "' is not baseline, avx2 or avx512"));
    }
    return best;
}

std::string_view name_of(InstructionSet set) {
    switch (set) {
    case InstructionSet::avx2:
        return "avx2";
    case InstructionSet::avx512:
        return "avx512";
    case InstructionSet::baseline:
        break;
    }
    return "baseline";
}

int default_threads() {
    for (char const* name : {"VKT_THREADS", "OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK"})
        if (auto const n = threads_from(name)) return *n;
    cpu_set_t set;
    int n =
        sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
    if (double const quota = own_limits().cpus; quota > 0 && quota < n) n = static_cast<int>(quota);
    return std::max(1, std::min(n, threads_with_room()));
}

std::size_t default_memory() {
    if (auto const asked = environment("VKT_MEMORY")) try {
            return parse_size(*asked);
        } catch (Error const& e) {
            throw Error(e.kind(), text("VKT_MEMORY: ", e.what()), e.hint());
        }
    auto const pages = static_cast<std::size_t>(std::max(1L, sysconf(_SC_PHYS_PAGES)));
    auto const page = static_cast<std::size_t>(std::max(1L, sysconf(_SC_PAGESIZE)));
    std::size_t total = pages * page;
    if (std::size_t const limit = own_limits().memory; limit > 0) total = std::min(total, limit);
    return total / 4; // stages of one pipeline share the machine
}

Execution default_execution() {
    Execution execution;
    execution.threads = default_threads();
    execution.memory = default_memory();
    execution.instructions = best_instruction_set();
    execution.temporary_directory = environment("TMPDIR").value_or("/tmp");
    return execution;
}

void select_gpu(Execution const& execution) {
    if (execution.device == Device::gpu) device_select(execution.gpu);
}

int gpu_count() { return device_count(); }

bool built_with_cuda() {
#ifdef VKT_CUDA
    return true;
#else
    return false;
#endif
}

} // namespace vkt
