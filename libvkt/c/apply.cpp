// Operations of the C API: by words, by a function of the program, and what they report.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/c/volume.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/registry.h"
#include "libvkt/operations/voxels/transform_each.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

using namespace vkt;
using namespace vkt::c;

char const* const* vkt_operations(void) {
    static std::vector<char const*> const names = [] {
        std::vector<char const*> list;
        for (auto const& operation : operations()) list.push_back(operation.name.data()); // literals, ended by a zero
        for (auto const& alias : operation_aliases()) list.push_back(alias.name.data());
        list.push_back(nullptr);
        return list;
    }();
    return names.data();
}

int vkt_measures(char const* name) {
    auto const& list = operations();
    return std::any_of(list.begin(), list.end(), [&](RegisteredOperation const& entry) {
        return name != nullptr && entry.name == operation_name(name) && entry.make()->shape() == Shape::reduction;
    });
}

vkt_status vkt_apply(char const* const* words, size_t count, vkt_volume const* const* inputs, size_t input_count,
                     vkt_volume** result) {
    return guarded([&](Call& call) {
        auto const volumes = volumes_of(inputs, input_count);
        need(result, "result");
        std::string remarks;
        std::unique_ptr<Operation> reporter;
        Volume volume = apply(
            words_of(words, count), volumes,
            {.execution = call.policy(), .monitor = call.monitor(), .listener = into(remarks), .reporter = &reporter});
        *result = wrapped(std::move(volume));
        (*result)->remarks = std::move(remarks);
        (*result)->reporter = std::move(reporter);
    });
}

vkt_status vkt_transform(vkt_volume const* volume, vkt_voxel_function function, void* user, char const* const* words,
                         size_t count, vkt_volume** result) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        if (function == nullptr) need(nullptr, "function");
        need(result, "result");
        TransformEach transform([&](Index3 p, double value) { return function(p.x, p.y, p.z, value, user); });
        Parameters own, shared;
        ExecutionOptions options = call.policy();
        transform.parameters(own);
        options.declare(shared);
        read_options(words, count, {&own, &shared});
        std::string remarks;
        StageInfo info;
        info.name = transform.name();
        auto const said = history_words(info.name, own, {"-"}, false);
        info.words = {said.front(), "(a function of the program)"};
        info.words.insert(info.words.end(), said.begin() + 1, said.end());
        info.input_names = {"-"};
        info.listener = into(remarks);
        std::vector<std::unique_ptr<Source>> sources;
        sources.push_back(volume_source({volume->volume}));
        Execution const execution = call.execution(options);
        auto const source = attach(std::move(sources), transform, execution, std::move(info));
        source->next_volume();
        Volume transformed = load(*source, execution);
        *result = wrapped(std::move(transformed));
        (*result)->remarks = std::move(remarks);
    });
}

vkt_status vkt_measure(char const* const* words, size_t count, vkt_volume const* const* inputs, size_t input_count,
                       char** json) {
    return guarded([&](Call& call) {
        auto const volumes = volumes_of(inputs, input_count);
        need(json, "json");
        *json = copied(Report::json(
            measure(words_of(words, count), volumes, {.execution = call.policy(), .monitor = call.monitor()})));
    });
}

vkt_status vkt_statistics(vkt_volume const* volume, char const* const* words, size_t count, char** json) {
    return guarded([&](Call& call) {
        need(volume, "volume");
        need(json, "json");
        auto all = words_of(words, count);
        all.insert(all.begin(), {"stats", "-"});
        *json = copied(Report::json(
            measure(std::move(all), {volume->volume}, {.execution = call.policy(), .monitor = call.monitor()})));
    });
}
