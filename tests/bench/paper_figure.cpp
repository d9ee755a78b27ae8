// Seconds of six algorithms on five volumes with one thread, all threads or the GPU, as a CSV table: what the figure of
// tests/bench/paper_figure.sh shows.
// SPDX-License-Identifier: MIT
//
//   vkt_paper_figure THREADS|gpu [MOST-BYTES [trees]]      trees: these alone
//
// Inputs and results lie in the memory of the device; the best of some runs after one that warms.
#include "libvkt/amr/make_amr.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/buffer.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/kernel/numeric.h"

#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

namespace {

using namespace vkt;

struct Named {
    char const* name;
    Index3 dims;
    DataType type;
};
constexpr char const* tree_name = "SILCC-like tree";

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Seconds of the best of up to five runs that together take no more than some seconds, after one that warms.
template <class F> double best_of(Execution const& execution, F const& f) {
    double best = 1e30, all = 0;
    for (int run = 0; run < 6 && (run < 2 || all < 3); ++run) {
        double const begin = now();
        f();
        if (execution.device == Device::gpu) device_synchronize();
        double const seconds = now() - begin;
        all += seconds;
        if (run > 0) best = std::min(best, seconds);
    }
    return best;
}

void line(std::string const& operation, std::string const& volume, std::string const& policy, double seconds) {
    std::printf("%s,\"%s\",%s,%.6g\n", operation.c_str(), volume.c_str(), policy.c_str(), seconds);
    std::fflush(stdout);
}

std::unique_ptr<Operation> configured(std::string const& words) {
    std::vector<std::string> list = split(words, ' ');
    std::string name = list.front();
    std::size_t used = 1;
    if (name == "filter") name += " " + list[used++];
    auto operation = make_operation(name);
    Parameters parameters;
    operation->parameters(parameters);
    (void)read_words({list.begin() + static_cast<std::ptrdiff_t>(used), list.end()}, {&parameters});
    operation->check();
    return operation;
}

/// Voxels from 0 to 199 in no order.
void fill(Buffer& memory, DataType type, Space space) {
    constexpr std::size_t most = std::size_t{1} << 24;
    std::vector<std::byte> part(std::min(most, memory.bytes()));
    for (std::size_t i = 0; i < part.size(); i += size_of(type)) {
        VoxelBytes const voxel = baseline::voxel_bytes(type, static_cast<double>((i * 2654435761u >> 13) % 200));
        std::memcpy(part.data() + i, voxel.data(), size_of(type));
    }
    std::byte* const to = memory.write(space);
    for (std::size_t at = 0; at < memory.bytes(); at += part.size()) {
        std::size_t const n = std::min(part.size(), memory.bytes() - at);
        if (space == Space::device)
            copy_to_device(to + at, part.data(), n);
        else
            std::memcpy(to + at, part.data(), n);
    }
}

void time_on_grid(Named const& volume, std::string const& name, std::string const& words, std::string const& policy,
                  Execution const& execution) {
    auto const operation = configured(words);
    Header header;
    header.dims = volume.dims;
    header.dtype = volume.type;
    Header const output = begun(*operation, std::vector<Header>{header}).output;
    Box const box = box_of(output.dims), need = operation->footprint(box, 0);
    Space const space = execution.space();
    Buffer in_memory(static_cast<std::size_t>(need.voxels()) * size_of(volume.type)), out_memory(output.bytes());
    fill(in_memory, volume.type, space);
    fill(out_memory, output.dtype, space);
    ConstView const in = dense_view(in_memory.read(space), volume.type, need, space);
    AnyView const out = dense_view(out_memory.update(space), output.dtype, box, space);
    line(name, volume.name, policy, best_of(execution, [&] {
             (void)begun(*operation, std::vector<Header>{header}); // forgets what an earlier run left behind
             operation->fit(output.dims, execution);
             operation->run({&in, 1}, out, execution);
         }));
}

/// The reconstruction into memory that is there.
void time_gridding(Volume const& tree, std::string const& policy, Execution const& execution) {
    GridRequest request;
    request.cells = 50'000'000;
    SampleGrid const grid = plan_grid(tree.header(), request);
    Reconstructor const reconstructor(tree, grid, Reconstruction::basis);
    Header const output = reconstructor.header();
    Buffer memory(output.bytes());
    fill(memory, output.dtype, execution.space());
    AnyView const out =
        dense_view(memory.update(execution.space()), output.dtype, box_of(output.dims), execution.space());
    line("AMR to grid", tree_name, policy, best_of(execution, [&] { reconstructor.run(out, execution); }));
}

void time_on_tree(Volume const& tree, std::string const& name, std::string const& words, std::string const& policy,
                  Execution const& execution) {
    auto const operation = configured(words);
    line(name, tree_name, policy, best_of(execution, [&] { (void)apply(*operation, {tree}, execution); }));
}

/// A dense kernel of 3^3 weights.
std::string kernel_file() {
    std::string const name = "paper_figure_kernel.txt";
    std::ofstream file(name);
    file << "3 3 3";
    for (int i = 0; i < 27; ++i) file << ' ' << static_cast<double>(1 + i * i % 7) / 100;
    return name;
}

int run(std::string const& policy, double most, bool grids) {
    Execution execution = default_execution();
    execution.device = policy == "gpu" ? Device::gpu : Device::cpu;
    if (policy != "gpu") execution.threads = static_cast<int>(parse_integer(policy));
    execution.memory = std::size_t{64} << 30;
    if (policy == "gpu" && device_count() == 0) {
        std::fprintf(stderr, "vkt_paper_figure: this machine has no CUDA device\n");
        return 77;
    }
    std::string const kernel = kernel_file();
    for (Named const& volume : {Named{"302^3 uint8", {302, 302, 302}, DataType::uint8},
                                Named{"1280x960x192 float32", {1280, 960, 192}, DataType::float32},
                                Named{"2560x1920x384 float32", {2560, 1920, 384}, DataType::float32},
                                Named{"2048x2048x1920 uint8", {2048, 2048, 1920}, DataType::uint8}}) {
        double const bytes =
            static_cast<double>(box_of(volume.dims).voxels()) * static_cast<double>(size_of(volume.type));
        if (!grids) continue;
        if (bytes > most) {
            std::fprintf(stderr, "left out: %s is beyond the limit\n", volume.name);
            continue;
        }
        time_on_grid(volume, "Resample", "resample --scale 0.5 --method linear", policy, execution);
        time_on_grid(volume, "FillRange", "fill --value 7 --roi 25%:75%,25%:75%,25%:75%", policy, execution);
        time_on_grid(volume, "ApplyFilter", "filter kernel " + kernel, policy, execution);
        time_on_grid(volume, "Crop", "crop --roi 20%:80%,20%:80%,20%:80%", policy, execution);
        time_on_grid(volume, "Flip", "flip x", policy, execution);
    }
    std::remove(kernel.c_str());
    Execution const building = default_execution();
    Volume const tree = make_amr(silcc_like(), building);
    if (static_cast<double>(tree.header().bytes()) > most) return 0;
    time_gridding(tree, policy, execution);
    if (policy == "gpu")
        std::fprintf(stderr, "left out: trees are not cropped on a GPU\n");
    else
        time_on_tree(tree, "Crop AMR", "crop --roi 20%:80%,20%:80%,20%:80%", policy, execution);
    return 0;
}

} // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 2) throw Error(ErrorKind::usage, "vkt_paper_figure THREADS|gpu [MOST-BYTES]");
        return run(argv[1], argc > 2 ? std::stod(argv[2]) : 1e300, argc < 4);
    } catch (std::exception const& error) {
        std::fprintf(stderr, "vkt_paper_figure: %s\n", error.what());
        return 1;
    }
}
