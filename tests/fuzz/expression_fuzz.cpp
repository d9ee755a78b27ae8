// Fuzzes expressions: parser, folding, instructions, intervals, and a few voxels computed.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/voxels/transform.h"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    std::string const text(reinterpret_cast<char const*>(data), size);
    try {
        vkt::Transform transform;
        transform.expression = text;
        transform.check();
        vkt::Header header;
        header.dims = {5, 3, 2};
        header.dtype = size % 2 == 0 ? vkt::DataType::uint8 : vkt::DataType::float64;
        std::vector<vkt::Volume> inputs;
        for (int i = 0; i < transform.inputs(); ++i) {
            vkt::Volume volume(header);
            vkt::AnyView const view = volume.mutable_view();
            std::memset(view.data, i + 3, view.bytes());
            inputs.push_back(std::move(volume));
        }
        vkt::Execution execution;
        execution.threads = 1;
        vkt::Volume const result = vkt::apply(transform, inputs, execution);
        if (!(result.header().dims == header.dims)) std::abort();
    } catch (vkt::Error const&) {
    } // the only thing that may come out
    return 0;
}
