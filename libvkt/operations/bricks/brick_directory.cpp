// A directory of bricks and its manifest.
// SPDX-License-Identifier: MIT
#include "libvkt/core/collect.h"
#include "libvkt/io/output_directory.h"
#include "libvkt/io/output_file.h"
#include "libvkt/operations/bricks/merge_bricks.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <utility>

namespace vkt {
namespace {

using Json = nlohmann::ordered_json;

constexpr char mark[] = "vkt bricks 1";

Json list(Index3 i) { return {i.x, i.y, i.z}; }
Json list(Vec3 v) { return {v.x, v.y, v.z}; }

/// Members of the manifest, each of which must be what it is asked to be.
class Reader {
public:
    explicit Reader(std::string name) : name_(std::move(name)) {}

    Error malformed(std::string const& what) const {
        return Error(ErrorKind::data, text("'", name_, "' is no manifest of bricks: ", what));
    }
    Json const& member(Json const& object, char const* key) const {
        if (!object.is_object() || !object.contains(key)) throw malformed(text("it has no \"", key, "\""));
        return object[key];
    }
    std::string word(Json const& object, char const* key) const {
        Json const& value = member(object, key);
        if (!value.is_string()) throw malformed(text("\"", key, "\" is no text"));
        return value.get<std::string>();
    }
    /// Three numbers from `least` on.
    Index3 index(Json const& object, char const* key, std::int64_t least) const {
        Json const& value = member(object, key);
        if (!value.is_array() || value.size() != 3) throw malformed(text("\"", key, "\" is not three numbers"));
        Index3 i;
        for (int axis = 0; axis < 3; ++axis) {
            Json const& n = value[static_cast<std::size_t>(axis)];
            if (!n.is_number_integer() || n.get<double>() < static_cast<double>(least) ||
                n.get<double>() > static_cast<double>(max_extent))
                throw malformed(text("\"", key, "\" holds ", n.dump()));
            i[axis] = n.get<std::int64_t>();
        }
        return i;
    }
    Vec3 vector(Json const& value, char const* key) const {
        if (!value.is_array() || value.size() != 3) throw malformed(text("\"", key, "\" is not three numbers"));
        Vec3 v;
        for (int axis = 0; axis < 3; ++axis) {
            Json const& n = value[static_cast<std::size_t>(axis)];
            if (!n.is_number()) throw malformed(text("\"", key, "\" holds ", n.dump()));
            v[axis] = n.get<double>();
        }
        return v;
    }

private:
    std::string name_;
};

class BrickDirectory : public Sink {
public:
    BrickDirectory(std::string const& path, bool force, std::string extension, BrickOptions const& options,
                   std::function<std::unique_ptr<Sink>(std::string const&)> create)
        : directory_(path, force, is_directory_of_bricks), extension_(std::move(extension)),
          create_(std::move(create)) {
        manifest_.options = options;
    }

    void begin(Header const& header) override;
    AnyView acquire(Box const& slab) override { return current_->acquire(slab); }
    void commit() override { current_->commit(); }
    void end() override {
        current_->end();
        current_->close();
        current_.reset();
    }
    void close() override {
        OutputFile file(directory_.file(std::string(manifest_name)), false);
        std::string const json = to_json(manifest_);
        file.write(json.data(), json.size());
        file.commit();
        directory_.commit();
    }
    std::int64_t natural_slab() const override { return current_ ? current_->natural_slab() : 0; }

private:
    static bool is_directory_of_bricks(std::string const& path);

    OutputDirectory directory_;
    std::string extension_;
    std::function<std::unique_ptr<Sink>(std::string const&)> create_;
    BrickManifest manifest_;
    std::unique_ptr<Sink> current_;
};

/// Whether the directory holds a manifest, what it lists, and nothing else.
bool BrickDirectory::is_directory_of_bricks(std::string const& path) {
    try {
        std::vector<std::string> names{(std::filesystem::path(path) / manifest_name).string()};
        for (auto const& brick : bricks_of(names.front(), true)) names.push_back(brick.path);
        for (auto const& entry : std::filesystem::directory_iterator(path))
            if (std::find(names.begin(), names.end(), entry.path().string()) == names.end()) return false;
        return true;
    } catch (std::exception const&) { // what cannot be read is somebody else's
        return false;
    }
}

void BrickDirectory::begin(Header const& header) {
    BrickPlace const place = place_in(header).value();
    if (manifest_.bricks.empty()) {
        manifest_.whole = place.whole;
        manifest_.dtype = header.dtype;
        manifest_.geometry = cropped(header.geometry, Index3{} - place.stored().lower);
    } else if (place.core.lower == Index3{}) {
        throw Error(ErrorKind::usage, "the input holds several volumes, a directory the bricks of one",
                    "name files, -o 'brick%04d.nrrd', or cut them one by one");
    }
    BrickLattice const lattice{place.whole, manifest_.options.size.dims, {}, false};
    std::string number = text(std::ssize(manifest_.bricks));
    std::size_t const width = std::max<std::size_t>(3, text(lattice.count() - 1).size());
    number.insert(0, width - number.size(), '0');
    manifest_.bricks.push_back({text("brick_", number, extension_), place});
    current_ = create_(directory_.file(manifest_.bricks.back().file));
    current_->begin(header);
}

} // namespace

std::string to_json(BrickManifest const& m) {
    Json json;
    json["format"] = mark;
    json["dims"] = list(m.whole);
    json["dtype"] = std::string(name_of(m.dtype));
    json["size"] = list(m.options.size.dims);
    json["ghost"] = {{"below", list(m.options.ghost.below)}, {"above", list(m.options.ghost.above)}};
    json["boundary"] = nullptr; // ghosts end at the faces of the whole
    if (m.options.boundary) json["boundary"] = ValueText<BoundaryRule>::write(*m.options.boundary).front();
    json["origin"] = list(m.geometry.origin);
    json["spacing"] = list(m.geometry.spacing);
    json["direction"] = Json::array();
    for (Vec3 const& axis : m.geometry.direction) json["direction"].push_back(list(axis));
    std::string text = json.dump(1);
    text.resize(text.size() - 2); // the object goes on: without its "\n}"
    text += ",\n \"bricks\": [";
    char const* separator = "\n  ";
    for (auto const& brick : m.bricks) { // a line each
        Json const entry{{"file", brick.file},
                         {"lower", list(brick.place.core.lower)},
                         {"upper", list(brick.place.core.upper)},
                         {"ghost_below", list(brick.place.ghost.below)},
                         {"ghost_above", list(brick.place.ghost.above)}};
        text += separator + entry.dump();
        separator = ",\n  ";
    }
    return text + "\n ]\n}\n";
}

BrickManifest manifest_from_json(std::string_view json, std::string const& name) {
    Reader const read(name);
    Json const root = Json::parse(json, nullptr, false);
    if (root.is_discarded()) throw read.malformed("it is no JSON");
    if (read.word(root, "format") != mark) throw read.malformed(text("its format is not \"", mark, "\""));
    BrickManifest m;
    m.whole = read.index(root, "dims", 1);
    Json const& bricks = read.member(root, "bricks");
    if (!bricks.is_array() || bricks.empty()) throw read.malformed("it lists no bricks");
    m.geometry.origin = read.vector(read.member(root, "origin"), "origin");
    m.geometry.spacing = read.vector(read.member(root, "spacing"), "spacing");
    Json const& direction = read.member(root, "direction");
    if (!direction.is_array() || direction.size() != 3) throw read.malformed("\"direction\" is not three vectors");
    for (std::size_t axis = 0; axis < 3; ++axis) m.geometry.direction[axis] = read.vector(direction[axis], "direction");
    for (Json const& entry : bricks) {
        BrickManifest::Entry brick{read.word(entry, "file"),
                                   {m.whole,
                                    {read.index(entry, "lower", 0), read.index(entry, "upper", 1)},
                                    {read.index(entry, "ghost_below", 0), read.index(entry, "ghost_above", 0)}}};
        if (brick.file.empty() || brick.file.find('/') != std::string::npos || brick.file == "..")
            throw read.malformed(text("'", brick.file, "' is no file in its directory"));
        if (brick.place.core.empty() || !box_of(m.whole).contains(brick.place.core))
            throw read.malformed(text("'", brick.file, "' does not lie in the whole"));
        m.bricks.push_back(std::move(brick));
    }
    return m;
}

std::unique_ptr<Sink> brick_directory(std::string const& path, bool force, std::string const& extension,
                                      BrickOptions const& options,
                                      std::function<std::unique_ptr<Sink>(std::string const&)> create) {
    return std::make_unique<BrickDirectory>(path, force, extension, options, std::move(create));
}

} // namespace vkt
