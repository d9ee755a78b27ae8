// A stage of a pipeline whose GPU is a stand-in, so that its transport can be killed on machines without one:
// vkt_gpu_stage pass|copy.
// SPDX-License-Identifier: MIT
#include "ipc/descriptor.h"
#include "ipc/stream.h"
#include "libvkt/core/error.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/engine/pipeline.h"
#include "tests/unit/file_gpu.h"

#include <csignal>
#include <cstdio>
#include <string_view>

namespace {

using namespace vkt;

/// Hands nothing through: its voxels have to be copied.
class Copied : public SourceDecorator {
public:
    using SourceDecorator::SourceDecorator;
    std::shared_ptr<Lease> lease(Box const&) override { return nullptr; }
};

int run(bool copies) {
    auto const gpu = std::make_shared<test::FileGpu>();
    ipc::StreamOptions options;
    options.stage = "vkt_gpu_stage";
    options.transport = ipc::Transport::gpu;
    options.gpu = gpu;
    options.notice = [](std::string const& message) { std::fprintf(stderr, "vkt_gpu_stage: %s\n", message.c_str()); };
    ipc::StreamSink sink(STDOUT_FILENO, options);
    try {
        std::unique_ptr<Source> source =
            std::make_unique<ipc::StreamSource>(std::make_unique<ByteSource>(STDIN_FILENO, "standard input"), options);
        if (copies) source = std::make_unique<Copied>(std::move(source));
        drain(*source, sink, {});
        return 0;
    } catch (ipc::BrokenPipe const&) {
        std::raise(SIGPIPE);
        return 141;
    } catch (UpstreamError const& e) {
        sink.fail("upstream", e.what());
        return 3;
    } catch (Error const& e) {
        std::fprintf(stderr, "vkt_gpu_stage: %s\n", e.what());
        sink.fail("vkt_gpu_stage", e.what());
        return static_cast<int>(e.kind());
    }
}

} // namespace

int main(int count, char** words) {
    try {
        return run(count > 1 && std::string_view(words[1]) == "copy");
    } catch (vkt::ipc::BrokenPipe const&) { // nobody can be told
        return 141;
    }
}
