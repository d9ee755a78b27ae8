// Sources over volumes in memory, and a sink that keeps nothing.
// SPDX-License-Identifier: MIT
#include "shell/machine/measured_pass.h"

#include "libvkt/core/collect.h"
#include "libvkt/engine/registry.h"

#include <algorithm>
#include <ctime>

namespace vkt::shell {
namespace {

/// Takes slabs into the same memory again and again, as the buffers of pipes and files do.
class Discard final : public Sink {
public:
    void begin(Header const& header) override { header_ = header; }
    AnyView acquire(Box const& slab) override {
        bytes_.resize(static_cast<std::size_t>(slab.voxels()) * size_of(header_.dtype));
        return dense_view(bytes_.data(), header_.dtype, slab);
    }
    void commit() override {}
    void end() override {}
    void close() override {}

private:
    Header header_;
    std::vector<std::byte> bytes_;
};

} // namespace

std::unique_ptr<Operation> configured(std::string const& name, std::vector<std::string> const& words) {
    auto operation = make_operation(name);
    Parameters parameters;
    operation->parameters(parameters);
    auto const count = static_cast<std::size_t>(std::count(name.begin(), name.end(), ' ')) + 1;
    read_words({words.begin() + static_cast<std::ptrdiff_t>(std::min(count, words.size())), words.end()},
               {&parameters});
    operation->check();
    return operation;
}

void pass_through(Operation& operation, std::vector<Volume> const& inputs, std::size_t times, int threads,
                  StageInfo const& info) {
    Execution execution = default_execution();
    execution.threads = threads;
    auto sources = collect(inputs, [&](Volume const& v) { return volume_source(std::vector<Volume>(times, v)); });
    if (operation.shape() == Shape::reduction) {
        Measurement of{sources, execution, info, ReportForm::json, [](Report const&) {}, [](std::string_view) {}};
        operation.measure(of);
    } else {
        Discard nowhere;
        drain(*attach(std::move(sources), operation, execution, info), nowhere, execution);
    }
}

double processor_seconds() {
    timespec now{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

} // namespace vkt::shell
