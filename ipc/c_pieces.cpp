// Pieces of volumes in the C API: slices and bricks, and what they make together.
// SPDX-License-Identifier: MIT
#include "ipc/c_call.h"
#include "ipc/c_series.h"

#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/formats/stack.h"
#include "libvkt/operations/bricks/merge_bricks.h"

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

using namespace vkt;
using namespace vkt::c;

namespace {

/// How the history tells it.
StageInfo told(std::string name, Parameters const& parameters, std::size_t inputs) {
    StageInfo info;
    info.input_names.assign(inputs, "-");
    info.words = history_words(name, parameters, info.input_names, false);
    info.name = std::move(name);
    return info;
}

/// Volumes of the program, opened by names that messages can say.
class Named {
public:
    Named(std::vector<Volume> volumes, char const* what) {
        for (Volume& volume : volumes) {
            names_.push_back(text(what, " ", static_cast<std::uint64_t>(names_.size())));
            volumes_.emplace(names_.back(), std::move(volume));
        }
    }
    std::vector<std::string> const& names() const { return names_; }
    std::function<std::unique_ptr<Source>(std::string const&)> open() const {
        return [this](std::string const& name) { return volume_source({volumes_.at(name)}); };
    }

private:
    std::vector<std::string> names_;
    std::map<std::string, Volume> volumes_;
};

Volume only_volume(Source& source, Execution const& execution) {
    source.next_volume();
    return load(source, execution);
}

} // namespace

vkt_status vkt_stack(vkt_volume const* const* volumes, size_t volume_count, char const* const* words, size_t count,
                     vkt_volume** result) {
    return ipc::guarded([&](Call& call) {
        Named const inputs(volumes_of(volumes, volume_count), "volume");
        need(result, "result");
        if (volume_count == 0) throw Error(ErrorKind::usage, "there are no volumes to stack");
        Parameters parameters;
        bool force_uniform = false;
        parameters.flag("force-uniform", force_uniform, "in the order given, wherever the volumes lie in the world");
        read_options(words, count, {&parameters});
        StageInfo info = told("stack", parameters, volume_count);
        info.words.insert(info.words.end(), {"--along", "z"});
        auto const source = stacked(inputs.names(), inputs.open(), StackAxis::z, force_uniform, info);
        *result = wrapped(only_volume(*source, call.execution()));
    });
}

vkt_status vkt_split(vkt_volume const* volume, vkt_series_reader** slices) {
    return ipc::guarded([&](Call& call) {
        need(volume, "volume");
        need(slices, "slices");
        auto reader = std::make_unique<vkt_series_reader>();
        reader->options = call.policy();
        reader->source = slices_of(volume_source({volume->volume}), told("split", {}, 1));
        *slices = reader.release();
    });
}

vkt_status vkt_brick(vkt_volume const* volume, char const* const* words, size_t count, vkt_series_reader** bricks) {
    return ipc::guarded([&](Call& call) {
        need(volume, "volume");
        need(bricks, "bricks");
        BrickOptions options;
        Parameters parameters;
        options.declare(parameters);
        read_options(words, count, {&parameters});
        Execution execution = call.execution();
        execution.monitor = nullptr; // of this call; those that read a brick have their own
        auto reader = std::make_unique<vkt_series_reader>();
        reader->options = call.policy();
        reader->source =
            brick_source(volume_source({volume->volume}), options, execution, told("brick", parameters, 1));
        *bricks = reader.release();
    });
}

vkt_status vkt_merge(vkt_volume const* const* bricks, size_t count, vkt_volume** result) {
    return ipc::guarded([&](Call& call) {
        Named const inputs(volumes_of(bricks, count), "brick");
        need(result, "result");
        if (count == 0) throw Error(ErrorKind::usage, "there are no bricks to merge");
        std::vector<BrickFile> files;
        for (std::string const& name : inputs.names()) files.push_back({name, {}});
        Execution const execution = call.execution();
        auto const source = merged_files(std::move(files), inputs.open(), execution, told("merge", {}, count));
        *result = wrapped(only_volume(*source, execution));
    });
}
