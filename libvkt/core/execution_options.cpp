// Options over environment over what the machine has.
// SPDX-License-Identifier: MIT
#include "libvkt/core/execution_options.h"

#include "libvkt/core/error.h"

#include <algorithm>
#include <cstdlib>

namespace vkt {

void ExecutionOptions::declare(Parameters& p) {
    p.option("device", device, "D", "auto, cpu, gpu, gpu:N or gpu:all (VKT_DEVICE)").not_in_history();
    p.option("threads", threads, "N", "threads to compute with (VKT_THREADS)").not_in_history();
    p.option("memory", memory, "SIZE", "memory a stage may hold before it spools, e.g. 2GiB (VKT_MEMORY)")
        .not_in_history();
    p.option("slab", slab, "N", "slices per slab; results do not depend on it").not_in_history();
}

Execution ExecutionOptions::execution() const {
    Execution execution = default_execution();
    char const* const variable = std::getenv("VKT_DEVICE");
    bool const from_variable = device == "auto" && variable != nullptr && *variable != 0;
    std::string const asked = from_variable ? variable : device;
    std::string const what = from_variable ? "VKT_DEVICE" : "--device";
    std::string const name = asked.substr(0, asked.find(':'));
    execution.device = parse_enum<Device>(name, what);
    if (name != asked) {
        if (execution.device != Device::gpu)
            throw Error(ErrorKind::usage, text(what, ": '", asked, "': only GPUs are numbered"),
                        "gpu:0, gpu:1, …, or gpu:all");
        std::string const number = asked.substr(name.size() + 1);
        if (number == "all")
            execution.gpus = std::max(1, gpu_count());
        else
            execution.gpu = ValueText<int>::read({number}, what);
    }
    if (execution.device == Device::gpu) {
        execution.only_gpu = !from_variable;
        int const n = gpu_count();
        if (!built_with_cuda())
            throw Error(ErrorKind::resources, "this vkt was built without CUDA",
                        "use --device cpu, or build with -DVKT_CUDA=ON");
        if (execution.gpu < 0 || execution.gpu >= n)
            throw Error(ErrorKind::resources, text("there is no GPU ", execution.gpu, " (", n, " found)"),
                        "use --device cpu");
    }
    if (threads) {
        if (*threads < 1 || *threads > 4096)
            throw Error(ErrorKind::usage, text("--threads ", *threads, " is not between 1 and 4096"));
        execution.threads = *threads;
    }
    if (memory) try {
            execution.memory = parse_size(*memory);
        } catch (Error const& e) {
            throw Error(e.kind(), text("--memory: ", e.what()), e.hint());
        }
    if (slab < 0) throw Error(ErrorKind::usage, text("--slab ", slab, " is negative"));
    execution.slab = slab;
    return execution;
}

} // namespace vkt
