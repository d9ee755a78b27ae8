// Looking for arrays in groups of groups, and OME-Zarr's metadata of images.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_image.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <set>
#include <utility>

namespace vkt::zarr {

using Json = nlohmann::json;

Json const* member(Json const& object, char const* name) {
    auto const found = object.is_object() ? object.find(name) : object.end();
    return !object.is_object() || found == object.end() ? nullptr : &*found;
}

std::string words(Json const& object, char const* name) {
    Json const* const found = member(object, name);
    return found != nullptr && found->is_string() ? found->get<std::string>() : "";
}

namespace {

constexpr int deepest_group = 8;

std::vector<double> numbers(Json const& list) {
    std::vector<double> result;
    if (!list.is_array() || list.size() > most_dimensions) return result;
    for (auto const& n : list) {
        if (!n.is_number()) return {};
        result.push_back(n.get<double>());
    }
    return result;
}

/// Scales multiply, and scale translations that were made before them.
void apply_transformations(Json const* list, Level& level) {
    if (list == nullptr || !list->is_array()) return;
    for (auto const& step : *list) {
        std::string const type = words(step, "type");
        Json const* const values = member(step, type.c_str());
        if (values == nullptr) continue;
        std::vector<double> const v = numbers(*values);
        if (type == "scale") {
            if (level.scale.empty()) level.scale.assign(v.size(), 1);
            for (std::size_t i = 0; i < std::min(v.size(), level.scale.size()); ++i) level.scale[i] *= v[i];
            for (std::size_t i = 0; i < std::min(v.size(), level.translation.size()); ++i) level.translation[i] *= v[i];
        } else if (type == "translation") {
            if (level.translation.empty()) level.translation.assign(v.size(), 0);
            for (std::size_t i = 0; i < std::min(v.size(), level.translation.size()); ++i) level.translation[i] += v[i];
        }
    }
}

/// Names by which channels can be told apart; none if there are no such.
std::vector<std::string> labels_in(Json const* omero) {
    Json const* const channels = omero == nullptr ? nullptr : member(*omero, "channels");
    std::vector<std::string> result;
    if (channels == nullptr || !channels->is_array()) return result;
    for (auto const& channel : *channels) result.push_back(words(channel, "label"));
    std::set<std::string> const different(result.begin(), result.end());
    return different.size() < result.size() || different.contains("") ? std::vector<std::string>{} : result;
}

/// What the attributes of a group say of an image; none if they say nothing.
std::optional<Multiscale> multiscale_in(std::string const& attributes) {
    Json const json = Json::parse(attributes, nullptr, false);
    Json const *list = member(json, "multiscales"), *omero = member(json, "omero");
    if (Json const* const ome = member(json, "ome"); list == nullptr && ome != nullptr) {
        list = member(*ome, "multiscales");
        omero = member(*ome, "omero");
    }
    if (list == nullptr || !list->is_array() || list->empty()) return std::nullopt;
    Json const& image = list->front();
    Multiscale result;
    result.channels = labels_in(omero);
    if (Json const* const axes = member(image, "axes"); axes != nullptr && axes->is_array())
        for (auto const& axis : *axes) {
            result.names.push_back(axis.is_string() ? axis.get<std::string>() : words(axis, "name"));
            result.kinds.push_back(words(axis, "type"));
            result.units.push_back(words(axis, "unit"));
        }
    Json const* const datasets = member(image, "datasets");
    if (datasets == nullptr || !datasets->is_array()) return std::nullopt;
    for (auto const& dataset : *datasets) {
        Level level{words(dataset, "path"), {}, {}};
        apply_transformations(member(dataset, "coordinateTransformations"), level);
        apply_transformations(member(image, "coordinateTransformations"), level);
        if (!level.path.empty()) result.levels.push_back(std::move(level));
    }
    if (result.levels.empty()) return std::nullopt;
    return result;
}

/// Where arrays are looked for: a store, and how messages name what lies in it.
class Search {
public:
    Search(Store const& store, std::string shown) : store_(store), shown_(std::move(shown)) {}
    /// The array at `inside` below a folder; without a name, the only one, or the finest of an image.
    Found array(std::string const& folder, std::string const& inside, int depth) const;

private:
    std::string below(std::string const& folder, std::string path) const;
    std::vector<std::string> candidates(std::string const& folder) const;
    void add_coordinates(Found& found, std::string const& folder) const;
    Found with_image_around(Array array, std::string const& folder) const;
    Found first_of(std::string const& folder, std::vector<std::string> const& names, int depth) const;
    [[noreturn]] void no_array(std::string const& folder, std::string const& inside) const;

    Store const& store_;
    std::string shown_;
};

/// Names in metadata lead to what lies below, and nowhere else.
std::string Search::below(std::string const& folder, std::string path) const {
    while (path.starts_with('/')) path.erase(0, 1);
    while (path.ends_with('/')) path.pop_back();
    for (auto const& part : split(path, '/'))
        if (part == ".." || part == "." || part.empty())
            throw Error(ErrorKind::data, text("'", shown_, "': '", path.substr(0, 200), "' is no path below it"));
    return key_of(folder, path);
}

/// Arrays of two dimensions or more and groups; but not the limits of cells, which coordinates name, nor the metadata
/// that bioformats2raw puts beside its images. Where there is nothing else, all of them.
std::vector<std::string> Search::candidates(std::string const& folder) const {
    std::vector<std::string> names = store_.nodes_below(folder);
    if (names.size() < 2) return names;
    std::vector<std::string> result, limits;
    Json const own = Json::parse(read_attributes(store_, folder), nullptr, false);
    Json const* const ome = member(own, "ome");
    bool const converted = member(own, "bioformats2raw.layout") != nullptr ||
                           (ome != nullptr && member(*ome, "bioformats2raw.layout") != nullptr);
    for (std::string const& name : names) {
        std::string const path = below(folder, name);
        auto const rank = rank_of_array(store_, path);
        if (rank && *rank < 2) {
            Json const attributes = Json::parse(read_attributes(store_, path), nullptr, false);
            limits.push_back(words(attributes, "bounds"));
        } else if (!converted || name != "OME") {
            result.push_back(name);
        }
    }
    std::erase_if(
        result, [&](std::string const& name) { return std::find(limits.begin(), limits.end(), name) != limits.end(); });
    return result.empty() ? names : result;
}

/// Of dimensions that have arrays of their names beside this one.
void Search::add_coordinates(Found& found, std::string const& folder) const {
    std::size_t const slash = folder.rfind('/');
    std::string const parent = folder.substr(0, slash == std::string::npos ? 0 : slash);
    found.coordinates.resize(found.array.shape.size());
    if (found.array.names.size() != found.array.shape.size()) return;
    for (std::size_t k = 0; k < found.array.names.size(); ++k) {
        std::string const& name = found.array.names[k];
        if (name.empty() || name.find('/') != std::string::npos || name == "." || name == "..") continue;
        std::string const path = key_of(parent, name);
        if (path == folder || rank_of_array(store_, path) != std::size_t{1}) continue;
        auto const array = read_array(store_, path);
        if (array && array->shape.front() == found.array.shape[k]) found.coordinates[k] = array;
    }
}

/// A level of an image that was named itself.
Found Search::with_image_around(Array array, std::string const& folder) const {
    Found found{std::move(array), {}, 0, {}, {}};
    add_coordinates(found, folder);
    std::size_t const slash = folder.rfind('/');
    std::string const own = folder.substr(slash == std::string::npos ? 0 : slash + 1);
    std::string const parent = folder.substr(0, slash == std::string::npos ? 0 : slash);
    if (folder.empty() || !store_.is_node(parent)) return found;
    found.image = multiscale_in(read_attributes(store_, parent));
    if (!found.image) return found;
    auto const& levels = found.image->levels;
    auto const level = std::find_if(levels.begin(), levels.end(), [&](Level const& l) { return l.path == own; });
    if (level == levels.end())
        found.image.reset();
    else
        found.level = static_cast<std::size_t>(level - levels.begin());
    return found;
}

void Search::no_array(std::string const& folder, std::string const& inside) const {
    auto const names = store_.nodes_below(folder);
    std::string const near = nearest_name(inside, names);
    throw Error(ErrorKind::usage,
                text("'", shown_, "' holds no array '", inside, "', but ", names.empty() ? "none" : join(names, ", ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

Found Search::array(std::string const& folder, std::string const& inside, int depth) const {
    if (depth == 0) throw Error(ErrorKind::data, text("'", shown_, "': groups in groups, too many"));
    if (auto array = read_array(store_, folder)) {
        if (!inside.empty())
            throw Error(ErrorKind::usage, text("'", shown_, "' is an array, and holds no '", inside, "'"));
        return with_image_around(std::move(*array), folder);
    }
    if (!inside.empty()) {
        std::string const path = below(folder, inside);
        if (!store_.is_node(path)) no_array(folder, inside);
        return array(path, "", depth - 1);
    }
    if (auto image = multiscale_in(read_attributes(store_, folder))) {
        auto array = read_array(store_, below(folder, image->levels.front().path));
        if (!array)
            throw Error(ErrorKind::data,
                        text("'", shown_, "': the array '", image->levels.front().path, "' of its image is missing"));
        return {std::move(*array), std::move(image), 0, {}, {}};
    }
    auto const names = candidates(folder);
    if (names.empty()) throw Error(ErrorKind::data, text("'", shown_, "' is a group that holds no array"));
    return first_of(folder, names, depth);
}

/// The first array of these, with the names of all that could be meant.
Found Search::first_of(std::string const& folder, std::vector<std::string> const& names, int depth) const {
    std::optional<Found> first;
    std::optional<Error> failed;
    Choices all;
    for (std::string const& name : names) try {
            Found found = array(below(folder, name), "", depth - 1);
            Position const extents(found.array.shape.rbegin(), found.array.shape.rend());
            if (found.choices.names.empty()) all.names.emplace_back(name, about_array(found.array.dtype, extents));
            for (auto const& [inside, about] : found.choices.names)
                all.names.emplace_back(text(name, "/", inside), about);
            all.not_read.insert(all.not_read.end(), found.choices.not_read.begin(), found.choices.not_read.end());
            if (!first) first = std::move(found);
        } catch (Error const& error) {
            if (!failed) failed = error;
            all.not_read.push_back(text("array '", name, "'"));
        }
    if (!first) throw Error(*failed);
    if (all.names.size() == 1) all.names.clear();
    first->choices = std::move(all);
    return std::move(*first);
}

} // namespace

Found find_array(Store const& store, std::string const& shown, std::string const& folder, std::string const& inside) {
    return Search(store, shown).array(folder, inside, deepest_group);
}

} // namespace vkt::zarr
