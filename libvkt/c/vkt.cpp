// The C API: each function is a guarded call of the library.
// SPDX-License-Identifier: MIT
#include "libvkt/c/vkt.h"

#include "libvkt/c/volume_of_header.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/core/pool.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/operation_help.h"
#include "libvkt/engine/registry.h"
#include "libvkt/formats/request.h"
#include "libvkt/io/system_error.h"
#include "libvkt/operations/transform_each.h"
#include "libvkt/render/cost.h"
#include "libvkt/render/settings.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <system_error>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

struct vkt_volume {
    vkt::Volume volume;
    std::string dtype, remarks{};
    mutable std::mutex reporting{};
    mutable std::unique_ptr<vkt::Operation> reporter{}; ///< until it is asked
    mutable std::string report{};
};

struct vkt_picture {
    int width = 0, height = 0;
    std::vector<unsigned char> bytes{};
    std::vector<float> light{};
    std::vector<std::byte> png{};
    std::string remarks{}, report{};
};

namespace {

using namespace vkt;

static_assert(static_cast<int>(ErrorKind::failure) == VKT_FAILURE && static_cast<int>(ErrorKind::usage) == VKT_USAGE &&
              static_cast<int>(ErrorKind::data) == VKT_DATA && static_cast<int>(ErrorKind::io) == VKT_IO &&
              static_cast<int>(ErrorKind::resources) == VKT_RESOURCES);

struct LastError {
    std::string message, hint;
    vkt_status status = VKT_OK;
};
thread_local LastError last_error;

LastError failed(vkt_status status, char const* message, char const* hint = "") noexcept {
    LastError error;
    error.status = status;
    try {
        error.message = printable(message); // what files and arguments say is in it
        error.hint = printable(hint);
    } catch (std::exception const&) { // no memory for the text; the status remains
        error.message.clear();
        error.hint.clear();
    }
    return error;
}

template <class F> LastError attempt(F const& body) noexcept {
    try {
        body();
        return {};
    } catch (Error const& e) {
        return failed(static_cast<vkt_status>(e.kind()), e.what(), e.hint().c_str());
    } catch (std::bad_alloc const&) {
        return failed(VKT_RESOURCES, "out of memory");
    } catch (std::system_error const& e) {
        return failed(is_shortage(e) ? VKT_RESOURCES : VKT_FAILURE, e.what());
    } catch (std::exception const& e) {
        return failed(VKT_FAILURE, e.what());
    } catch (...) {
        return failed(VKT_FAILURE, "unknown failure");
    }
}

/// What an operation holds and what it leaves to the next is within one budget.
Execution keeping_blocks(Execution execution) {
    keep_blocks(execution.memory);
    return execution;
}

pid_t const loaded_by = ::getpid();

template <class F> vkt_status guarded(F const& body) noexcept {
    LastError error;
    if (::getpid() == loaded_by) {
        error = attempt(body);
    } else {
        // After fork(), as Python's multiprocessing does it, this thread would wait forever for the OpenMP threads that
        // it had in the parent. A new thread gets new ones.
        LastError outer = attempt([&] { std::thread([&] { error = attempt(body); }).join(); });
        if (outer.status != VKT_OK) error = std::move(outer);
    }
    vkt_status const status = error.status;
    if (status != VKT_OK) last_error = std::move(error);
    return status;
}

/// Other languages pass null where an object is missing.
void need(void const* pointer, char const* argument) {
    if (pointer == nullptr) throw Error(ErrorKind::usage, text("argument '", argument, "' is null"));
}

std::vector<std::string> words_of(char const* const* words, size_t count) {
    if (count > 0) need(words, "words");
    std::vector<std::string> result;
    for (size_t i = 0; i < count; ++i) {
        need(words[i], text("words[", i, "]").c_str());
        result.emplace_back(words[i]);
    }
    return result;
}

/// For functions whose words are options only.
void read_options(char const* const* words, size_t count, std::vector<Parameters*> const& lists) {
    auto const left = read_words(words_of(words, count), lists);
    if (!left.empty()) throw Error(ErrorKind::usage, text("unexpected argument '", left.front(), "'"));
}

vkt_volume* wrapped(Volume volume) {
    std::string dtype = to_text(volume.header().dtype);
    return new vkt_volume{std::move(volume), std::move(dtype)};
}

char* copied(std::string const& text) {
    auto* const copy = static_cast<char*>(std::malloc(text.size() + 1));
    if (copy == nullptr) throw std::bad_alloc();
    std::memcpy(copy, text.c_str(), text.size() + 1);
    return copy;
}

Header header_of(vkt_description const& d) {
    Header header;
    need(d.dtype, "description->dtype");
    header.dims = {d.dims[0], d.dims[1], d.dims[2]};
    header.dtype = parse_data_type(d.dtype);
    for (int axis = 0; axis < 3; ++axis) {
        header.geometry.origin[axis] = d.origin[axis];
        header.geometry.spacing[axis] = d.spacing[axis];
        for (int i = 0; i < 3; ++i)
            header.geometry.direction[static_cast<std::size_t>(axis)][i] = d.direction[3 * axis + i];
    }
    header.values = {d.slope, d.intercept};
    header.units = d.units == nullptr ? "" : d.units;
    if (d.space != nullptr && *d.space != 0) header.attributes["space"] = d.space;
    mark_as_given(header);
    if (d.hierarchical != 0) throw Error(ErrorKind::usage, "only structured volumes can be created from voxels");
    return header;
}

/// The volume of that index; -1 takes the first and insists that there is no other.
Volume read_one(Source& source, std::string const& path, std::int64_t index, Execution const& execution) {
    auto const next = [&](std::int64_t i) {
        if (!source.next_volume())
            throw Error(ErrorKind::usage, text("'", path, "' holds ", i, " volumes; --index counts from 0"));
    };
    for (std::int64_t i = 0; i < index; ++i) {
        next(i);
        source.finish();
    }
    next(std::max<std::int64_t>(index, 0));
    Volume volume = load(source, execution);
    if (index < 0 && source.next_volume())
        throw Error(ErrorKind::usage, text("'", path, "' holds several volumes"), "say --index N, counted from 0");
    return volume;
}

std::vector<Volume> volumes_of(vkt_volume const* const* inputs, size_t count) {
    if (count > 0) need(inputs, "inputs");
    std::vector<Volume> volumes;
    for (size_t i = 0; i < count; ++i) {
        need(inputs[i], text("inputs[", i, "]").c_str());
        volumes.push_back(inputs[i]->volume);
    }
    return volumes;
}

/// Takes what was lost, one remark a line.
Listener into(std::string& remarks) {
    return [&remarks](std::string const&, std::string const& message, bool lossy) {
        if (lossy) remarks += (remarks.empty() ? "" : "\n") + printable(message);
    };
}

} // namespace

char const* vkt_version(void) { return VKT_VERSION; }

char const* vkt_error(void) { return last_error.message.c_str(); }
char const* vkt_error_hint(void) { return last_error.hint.c_str(); }
vkt_status vkt_error_status(void) { return last_error.status; }

char const* const* vkt_operations(void) {
    static std::vector<char const*> const names = [] {
        std::vector<char const*> list;
        for (auto const& operation : operations()) list.push_back(operation.name.data()); // literals, ended by a zero
        list.push_back(nullptr);
        return list;
    }();
    return names.data();
}

int vkt_measures(char const* name) {
    auto const& list = operations();
    return std::any_of(list.begin(), list.end(), [&](RegisteredOperation const& entry) {
        return name != nullptr && entry.name == name && entry.make()->shape() == Shape::reduction;
    });
}

vkt_status vkt_operation_help(char const* name, char** json) {
    return guarded([&] {
        need(name, "name");
        need(json, "json");
        *json = copied(operation_help(name));
    });
}

vkt_status vkt_read(char const* path, char const* const* words, size_t count, vkt_volume** volume) {
    return guarded([&] {
        need(path, "path");
        need(volume, "volume");
        ReadRequest request;
        ExecutionOptions options;
        Parameters parameters, own, shared;
        std::int64_t index = -1;
        bool trust_paths = false;
        request.declare(parameters);
        ReadRequest::declare_trust(own, trust_paths);
        own.option("index", index, "N", "which volume of a file that holds several, counted from 0");
        options.declare(shared);
        read_options(words, count, {&parameters, &own, &shared});
        request.check();
        request.trust(trust_paths);
        if (own.given("index") && index < 0) throw Error(ErrorKind::usage, text("--index ", index, " is negative"));
        auto const source = request.region_of(request.open(path));
        Volume result = read_one(*source, path, index, keeping_blocks(options.execution()));
        if (!result.header().history) {
            std::vector<std::string> step{"read", path};
            for (auto& word : parameters.words()) step.push_back(std::move(word));
            result.header().history = History{std::move(step), {}};
        }
        *volume = wrapped(std::move(result));
    });
}

void vkt_default_description(vkt_description* description) {
    *description = {{1, 1, 1}, "uint8", {0, 0, 0}, {1, 1, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 1}, 1, 0, "", 0, ""};
}

vkt_status vkt_create(vkt_description const* description, void const* voxels, vkt_volume** volume) {
    return guarded([&] {
        need(description, "description");
        need(volume, "volume");
        Volume result(header_of(*description));
        AnyView const view = result.mutable_view();
        if (voxels == nullptr)
            std::memset(view.data, 0, view.bytes());
        else
            std::memcpy(view.data, voxels, view.bytes());
        *volume = wrapped(std::move(result));
    });
}

vkt_status vkt_create_from_header(char const* json, void const* voxels, size_t bytes, vkt_release_function release,
                                  void* user, vkt_volume** volume) {
    return guarded([&] {
        need(json, "json");
        need(voxels, "voxels");
        need(volume, "volume");
        auto const owner = release == nullptr ? nullptr : std::make_shared<VoxelOwner>();
        *volume = wrapped(volume_of_header(json, voxels, bytes, owner));
        if (owner) {
            owner->release = release;
            owner->user = user;
        }
    });
}

void vkt_free(vkt_volume* volume) { delete volume; }

vkt_status vkt_describe(vkt_volume const* volume, vkt_description* description) {
    return guarded([&] {
        need(volume, "volume");
        need(description, "description");
        Header const& header = volume->volume.header();
        vkt_description& d = *description;
        for (int axis = 0; axis < 3; ++axis) {
            d.dims[axis] = header.dims[axis];
            d.origin[axis] = header.geometry.origin[axis];
            d.spacing[axis] = header.geometry.spacing[axis];
            for (int i = 0; i < 3; ++i)
                d.direction[3 * axis + i] = header.geometry.direction[static_cast<std::size_t>(axis)][i];
        }
        d.dtype = volume->dtype.c_str();
        d.slope = header.values.slope;
        d.intercept = header.values.intercept;
        d.units = header.units.c_str();
        d.hierarchical = header.kind == Kind::hierarchical ? 1 : 0;
        auto const space = header.attributes.find("space");
        d.space = space == header.attributes.end() ? "" : space->second.c_str();
    });
}

vkt_status vkt_voxels(vkt_volume const* volume, void const** voxels, size_t* bytes) {
    return guarded([&] {
        need(volume, "volume");
        need(voxels, "voxels");
        if (volume->volume.header().kind == Kind::hierarchical)
            throw Error(ErrorKind::usage, "a hierarchical volume is no box of voxels",
                        "make a grid of it: resample --cells 50M");
        ConstView const view = volume->volume.view();
        *voxels = view.data;
        if (bytes != nullptr) *bytes = view.bytes();
    });
}

vkt_status vkt_header(vkt_volume const* volume, char** json) {
    return guarded([&] {
        need(volume, "volume");
        need(json, "json");
        *json = copied(to_json(volume->volume.header()));
    });
}

vkt_status vkt_write(vkt_volume const* volume, char const* path, char const* const* words, size_t count) {
    return guarded([&] {
        need(volume, "volume");
        need(path, "path");
        WriteRequest request;
        Parameters parameters;
        request.declare(parameters);
        read_options(words, count, {&parameters});
        request.check(path);
        auto const sink = create_volume(path, request.options());
        auto const source = volume_source({volume->volume});
        drain(*source, *sink, ExecutionOptions().execution());
    });
}

vkt_status vkt_apply(char const* const* words, size_t count, vkt_volume const* const* inputs, size_t input_count,
                     vkt_volume** result) {
    return guarded([&] {
        auto const volumes = volumes_of(inputs, input_count);
        need(result, "result");
        std::string remarks;
        std::unique_ptr<Operation> reporter;
        Volume volume = apply(words_of(words, count), volumes, into(remarks), &reporter);
        *result = wrapped(std::move(volume));
        (*result)->remarks = std::move(remarks);
        (*result)->reporter = std::move(reporter);
    });
}

vkt_status vkt_transform(vkt_volume const* volume, vkt_voxel_function function, void* user, char const* const* words,
                         size_t count, vkt_volume** result) {
    return guarded([&] {
        need(volume, "volume");
        if (function == nullptr) need(nullptr, "function");
        need(result, "result");
        TransformEach transform([&](Index3 p, double value) { return function(p.x, p.y, p.z, value, user); });
        Parameters own, shared;
        ExecutionOptions options;
        transform.parameters(own);
        options.declare(shared);
        read_options(words, count, {&own, &shared});
        std::string remarks;
        StageInfo info;
        info.name = transform.name();
        info.words = history_words(info.name, own, {"-"}, false);
        info.words.insert(info.words.begin() + 1, "(a function of the program)");
        info.input_names = {"-"};
        info.listener = into(remarks);
        std::vector<std::unique_ptr<Source>> sources;
        sources.push_back(volume_source({volume->volume}));
        Execution const execution = keeping_blocks(options.execution());
        auto const source = attach(std::move(sources), transform, execution, std::move(info));
        source->next_volume();
        Volume transformed = load(*source, execution);
        *result = wrapped(std::move(transformed));
        (*result)->remarks = std::move(remarks);
    });
}

char const* vkt_remarks(vkt_volume const* volume) { return volume == nullptr ? "" : volume->remarks.c_str(); }

char const* vkt_report(vkt_volume const* volume) {
    if (volume == nullptr) return "";
    std::lock_guard const lock(volume->reporting);
    if (volume->reporter != nullptr) {
        LastError error = attempt([&] { volume->report = volume->reporter->report().json(); });
        if (error.status != VKT_OK) {
            last_error = std::move(error);
            return "";
        }
        volume->reporter.reset();
    }
    return volume->report.c_str();
}

vkt_status vkt_measure(char const* const* words, size_t count, vkt_volume const* const* inputs, size_t input_count,
                       char** json) {
    return guarded([&] {
        auto const volumes = volumes_of(inputs, input_count);
        need(json, "json");
        *json = copied(Report::json(measure(words_of(words, count), volumes)));
    });
}

vkt_status vkt_statistics(vkt_volume const* volume, char const* const* words, size_t count, char** json) {
    return guarded([&] {
        need(volume, "volume");
        need(json, "json");
        auto all = words_of(words, count);
        all.insert(all.begin(), {"stats", "-"});
        *json = copied(Report::json(measure(std::move(all), {volume->volume})));
    });
}

namespace {

vkt_picture drawn(Volume const& volume, std::vector<std::string> const& words) {
    render::SettingsParameters options;
    Parameters own, shared;
    ExecutionOptions for_execution;
    options.declare(own);
    for_execution.declare(shared);
    auto const left = read_words(words, {&own, &shared});
    if (!left.empty()) throw Error(ErrorKind::usage, text("unexpected argument '", left.front(), "'"));
    options.check();
    Execution const execution = keeping_blocks(for_execution.execution());
    render::RenderSettings const settings = options.settings();
    render::check_memory(volume.header(), execution);
    render::RenderReport report;
    render::Image image = render::render(volume, settings, execution, &report);
    vkt_picture picture{image.width, image.height};
    std::vector<unsigned char> const shown = render::to_bytes(image, settings.background);
    std::size_t const pixels = image.pixels.size() / 4, channels = shown.size() / pixels;
    picture.bytes.resize(4 * pixels, 255);
    for (std::size_t i = 0; i < pixels; ++i) std::copy_n(&shown[channels * i], channels, &picture.bytes[4 * i]);
    StageInfo info;
    info.name = "render";
    info.words = history_words(info.name, own, {"-"}, false);
    info.input_names = {"-"};
    History const history = folded(history_step(info, {volume.header()}));
    std::vector<std::pair<std::string, std::string>> texts{{"Software", "vkt " VKT_VERSION},
                                                           {"History", history_as_shell(history)}};
    for (auto& entry : render::texts_of(report, settings.goal)) texts.push_back(std::move(entry));
    picture.png = render::to_png(image, settings.background, texts);
    picture.light = std::move(image.pixels);
    for (std::size_t i = 3; i < picture.light.size(); i += 4) picture.light[i] = 1 - picture.light[i];
    picture.remarks = printable(join(render::remarks_of(report, settings.goal), "; "));
    picture.report = render::report_text(report);
    return picture;
}

} // namespace

vkt_status vkt_render(vkt_volume const* volume, char const* const* words, size_t count, vkt_picture** picture) {
    return guarded([&] {
        need(volume, "volume");
        need(picture, "picture");
        *picture = new vkt_picture(drawn(volume->volume, words_of(words, count)));
    });
}
int vkt_picture_width(vkt_picture const* picture) { return picture == nullptr ? 0 : picture->width; }
int vkt_picture_height(vkt_picture const* picture) { return picture == nullptr ? 0 : picture->height; }
unsigned char const* vkt_picture_bytes(vkt_picture const* picture) {
    return picture == nullptr ? nullptr : picture->bytes.data();
}
float const* vkt_picture_light(vkt_picture const* picture) {
    return picture == nullptr ? nullptr : picture->light.data();
}
char const* vkt_picture_remarks(vkt_picture const* picture) {
    return picture == nullptr ? "" : picture->remarks.c_str();
}
char const* vkt_picture_report(vkt_picture const* picture) { return picture == nullptr ? "" : picture->report.c_str(); }
vkt_status vkt_picture_png(vkt_picture const* picture, void const** bytes, size_t* size) {
    return guarded([&] {
        need(picture, "picture");
        need(bytes, "bytes");
        need(size, "size");
        *bytes = picture->png.data();
        *size = picture->png.size();
    });
}
void vkt_free_picture(vkt_picture* picture) { delete picture; }

size_t vkt_trim(void) { return release_blocks(); }

void vkt_free_text(char* text) { std::free(text); }
