// What this build and this machine can do, and how fast.
// SPDX-License-Identifier: MIT
#include "shell/machine/inventory.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/cgroup.h"
#include "libvkt/core/device.h"
#include "libvkt/core/device_sharing.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "libvkt/io/module.h"
#include "shell/picture/plot.h"
#include "shell/short_number.h"

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace vkt::shell {
namespace {

/// "loads", or why it does not.
std::string module_state(std::string const& name) {
    try {
        if (name == "window" || name == "openexr" || name == "freetype")
            module_functions(name, "nothing");
        else
            module_parser(name, "nothing");
        return "there";
    } catch (Error const& e) {
        return text("missing: ", e.what());
    }
}

std::string rate_text(double bytes) { return text(bytes_text(bytes), "/s"); }

/// Bytes a second of work on so many bytes: the best of some runs.
template <class F> double rate_of(std::size_t bytes, F const& work) {
    double best = 1e9;
    for (int run = 0; run < 4; ++run) {
        auto const begin = std::chrono::steady_clock::now();
        work();
        device_synchronize();
        double const seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        if (run > 0) best = std::min(best, seconds);
    }
    return static_cast<double>(bytes) / best;
}

/// Whether its memory can be handed to other processes, as --transport gpu does.
std::string sharing_text(int index) {
    try {
        try_device_sharing(index);
        return "; its memory can be shared (--transport gpu)";
    } catch (Error const& e) {
        return text("; its memory cannot be shared: ", e.what());
    }
}

/// What a GPU is and how fast it copies: in its memory, and from and to that of the host.
InventoryLine gpu_line(int index) {
    DeviceFacts const facts = device_facts(index);
    constexpr std::size_t bytes = std::size_t{256} << 20;
    std::string line = text(facts.name, ", capability ", facts.major, ".", facts.minor, ", ",
                            bytes_text(static_cast<double>(facts.free)), " of ",
                            bytes_text(static_cast<double>(facts.memory)), " free");
    if (facts.free > 4 * bytes) {
        Buffer host(bytes), one(bytes), other(bytes);
        std::byte *const h = host.write(Space::host), *const a = one.write(Space::device),
                         *const b = other.write(Space::device);
        std::fill_n(h, bytes, std::byte{1});
        line += text("; copies ", rate_text(2 * rate_of(bytes, [&] { copy_on_device(b, a, bytes); })),
                     ", from the host ", rate_text(rate_of(bytes, [&] { copy_to_device(a, h, bytes); })), ", to it ",
                     rate_text(rate_of(bytes, [&] { copy_to_host(h, a, bytes); })));
    }
    for (std::size_t i = 0; i < facts.reaches.size(); ++i)
        line += text(i == 0 ? "; reaches GPU " : ", ", facts.reaches[i]);
    line += sharing_text(index);
    return {text("GPU ", index), line};
}

} // namespace

std::vector<InventoryLine> machine_inventory() {
    std::vector<InventoryLine> lines;
    CgroupLimits const limits = cgroup_limits();
    lines.push_back({"version", VKT_VERSION});
    lines.push_back({"processor", processor_name()});
    lines.push_back({"threads", to_text(default_threads())});
    lines.push_back({"instructions", std::string(name_of(best_instruction_set()))});
    lines.push_back({"memory", text(bytes_text(static_cast<double>(default_memory())), " a stage by default",
                                    limits.memory > 0 ? text(", the control group allows ",
                                                             bytes_text(static_cast<double>(limits.memory)))
                                                      : std::string())});
    int const gpus = gpu_count();
    lines.push_back({"GPUs", !built_with_cuda() ? std::string("none: built without CUDA")
                             : gpus == 0        ? std::string("none found")
                                                : to_text(gpus)});
    for (int i = 0; i < gpus; ++i) lines.push_back(gpu_line(i));
    std::string reads, writes;
    for (Format const& format : formats()) {
        if (format.open != nullptr) reads += text(reads.empty() ? "" : " ", format.name);
        if (format.create != nullptr) writes += text(writes.empty() ? "" : " ", format.name);
    }
    lines.push_back({"reads", reads});
    lines.push_back({"writes", writes});
    for (char const* const name : {"hdf5", "openvdb", "tiff", "gdcm", "blosc", "kissfft", "openexr", "freetype"})
        lines.push_back({name, module_state(name)});
    lines.push_back({"gnuplot", can_plot() ? "there" : "missing: vkt chart writes tables only"});
    return lines;
}

namespace {

/// The beginning of a plan's method, up to its last whole word.
std::string shown(std::string const& method) {
    std::string const radius = ", radius ";
    std::string const words = method.ends_with(radius) ? method.substr(0, method.size() - radius.size()) : method;
    return words.substr(0, words.find_last_not_of(", ") + 1);
}

} // namespace

std::vector<InventoryLine> speed_inventory(Calibration const& c) {
    std::vector<InventoryLine> lines;
    auto const both = [&](ByThreads const& rate) {
        return text(rate_text(rate[0]), " one thread, ", rate_text(rate[1]), " ", c.threads);
    };
    lines.push_back({"copy", both(c.copy)});
    lines.push_back({"scan", both(c.scan)});
    lines.push_back({"file", text(rate_text(c.file_read), " read from the page cache, ", rate_text(c.file_write),
                                  " written to it, with checksums")});
    lines.push_back({"start", text(short_number(1e3 * c.start), " ms until the program has begun and ended")});
    for (auto const& rate : c.rates) {
        std::string const cost =
            rate.cost > 0 ? text(", ", short_number(rate.cost), " multiply-adds a voxel") : std::string();
        lines.push_back({text(rate.operation, rate.bytes == 2 ? " uint16" : " float32"),
                         text(short_number(1e9 * rate.seconds[0]), " ns a voxel, ", c.threads, " threads: ",
                              short_number(1e9 * rate.seconds[1]), " ns (", shown(rate.method), cost, ")")});
    }
    return lines;
}

} // namespace vkt::shell
