// How work runs: device, threads, memory budget, instruction set. Passed explicitly; nothing here is global.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/view.h"

#include <cstddef>
#include <cstdint>
#include <string>

namespace vkt {

enum class Device : std::uint8_t { automatic, cpu, gpu };

/// Instruction sets for which kernels are compiled; each is a namespace of the same name.
enum class InstructionSet : std::uint8_t { baseline, avx2, avx512 };

class ProgressMonitor;

struct Execution {
    Device device = Device::cpu; ///< resolved: never `automatic` when an operation sees it
    int gpu = 0;                 ///< index of the GPU
    int gpus = 1;                ///< of the host that work at once, `gpu` and those after it, where work can be divided
    bool only_gpu = false;       ///< what does not run on a GPU is refused instead of done on the CPU
    int threads = 1;
    std::size_t memory = std::size_t{1} << 30; ///< bytes one stage may hold before it spools
    std::int64_t slab = 0;                     ///< slices per slab; 0 lets the engine choose
    InstructionSet instructions = InstructionSet::baseline;
    std::string temporary_directory = "/tmp";
    ProgressMonitor* monitor = nullptr; ///< is told how far the work is and may end it; whoever calls keeps it alive

    Space space() const { return device == Device::gpu ? Space::device : Space::host; }
};

/// All that the machine offers to this process: CPU affinity and cgroup limits are respected, VKT_* and
/// OMP_NUM_THREADS, SLURM_CPUS_PER_TASK and TMPDIR are read.
Execution default_execution();

InstructionSet best_instruction_set(); ///< what this CPU runs, lowered by VKT_INSTRUCTION_SET
std::string_view name_of(InstructionSet set);
int default_threads();
/// What work that memory alone slows down takes of so many threads: a quarter, at least one. More gain little, and the
/// other stages of a pipeline need them.
inline int share_of_threads(int threads) { return threads / 4 > 1 ? threads / 4 : 1; }
std::size_t default_memory();

/// Makes an execution's GPU the current one of this thread, as each thread has to for itself; nothing where work runs
/// on the CPU. Throws Error{resources}.
void select_gpu(Execution const& execution);
/// Number of usable CUDA devices; 0 without CUDA or driver.
int gpu_count();
/// True if the library was built with CUDA.
bool built_with_cuda();

} // namespace vkt
