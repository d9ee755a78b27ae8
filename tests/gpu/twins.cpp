// Volumes in both memories, and operations by their words.
// SPDX-License-Identifier: MIT
#include "tests/gpu/twins.h"

#include "libvkt/core/half.h"
#include "libvkt/core/text.h"

#include <algorithm>
#include <cstring>
#include <random>

namespace vkt::gpu_test {

std::vector<std::string>& wanted_words() {
    static std::vector<std::string> words;
    return words;
}
bool is_wanted(std::string const& what) {
    std::vector<std::string> const& words = wanted_words();
    return words.empty() || std::any_of(words.begin(), words.end(),
                                        [&](std::string const& word) { return what.find(word) != std::string::npos; });
}

Execution cpu() {
    Execution execution = default_execution();
    execution.device = Device::cpu;
    return execution;
}
Execution gpu() {
    Execution execution = default_execution();
    execution.device = Device::gpu;
    return execution;
}

void randomise(Twin& volume, unsigned seed) {
    std::mt19937 random(seed);
    AnyView const view = volume.view(Space::host);
    Index3 const n = view.dims();
    for (std::int64_t z = 0; z < n.z; ++z)
        for (std::int64_t y = 0; y < n.y; ++y)
            for (std::int64_t x = 0; x < n.x; ++x) {
                std::byte* const at = view.at(view.box.lower.x + x, view.box.lower.y + y, view.box.lower.z + z);
                auto const r = static_cast<std::uint32_t>(random());
                double const v = static_cast<double>(r) * 100 / 4294967296.0;
                auto const f = static_cast<float>(v);
                Half const h(f);
                std::uint64_t const i = r % 101;
                switch (volume.type) {
                case DataType::float64:
                    std::memcpy(at, &v, 8);
                    break;
                case DataType::float32:
                    std::memcpy(at, &f, 4);
                    break;
                case DataType::float16:
                    std::memcpy(at, &h, 2);
                    break;
                default:
                    std::memcpy(at, &i, size_of(volume.type)); // little-endian
                }
            }
    volume.upload();
}

/// The voxels that an operation wants to see first, so many slices at a time.
void scan(Operation& operation, ConstView in, std::int64_t slab, Execution const& execution) {
    Box const all = operation.scanned(in.box);
    std::int64_t const height = slab > 0 ? slab : all.dims().z;
    do {
        for (std::int64_t z = all.lower.z; z < all.upper.z; z += height) {
            Box part = all;
            part.lower.z = z;
            part.upper.z = std::min(z + height, all.upper.z);
            operation.scan(in.part(part), execution);
        }
        operation.scan_end();
    } while (operation.scans_again());
}

std::unique_ptr<Operation> operation_of(std::vector<std::string> words) {
    std::string name = words.front();
    std::size_t taken = 1;
    if (name == "filter") name += " " + words[taken++];
    words.erase(words.begin(), words.begin() + static_cast<std::ptrdiff_t>(taken));
    auto operation = make_operation(name);
    Parameters parameters;
    operation->parameters(parameters);
    (void)read_words(words, {&parameters});
    operation->check();
    return operation;
}
std::vector<std::string> words_of(std::string const& line) { return split(line, ' '); }

} // namespace vkt::gpu_test
