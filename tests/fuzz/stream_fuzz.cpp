// Fuzzes the stream reader: any bytes either are a whole stream or end in an Error; nothing else.
// SPDX-License-Identifier: MIT
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/pipeline.h"

#include <sys/mman.h>
#include <unistd.h>

extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    int const descriptor = ::memfd_create("fuzz", 0);
    if (::write(descriptor, data, size) != static_cast<ssize_t>(size)) return 0;
    ::lseek(descriptor, 0, SEEK_SET);
    vkt::Execution execution;
    execution.memory = std::size_t{16} << 20;
    try {
        vkt::ipc::StreamSource source(std::make_unique<vkt::ByteSource>(descriptor, "fuzz"), {});
        for (int volumes = 0; volumes < 4 && source.next_volume(); ++volumes) {
            if (source.header().kind == vkt::Kind::hierarchical)
                source.load_hierarchical();
            else if (source.header().bytes() <= execution.memory)
                vkt::load(source, execution);
            else
                source.finish();
        }
    } catch (vkt::Error const&) {
    }
    return 0;
}
