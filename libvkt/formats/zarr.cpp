// Zarr arrays and OME-Zarr images as volumes: what the dimensions of an array mean, regions chunk by chunk.
// SPDX-License-Identifier: MIT
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"
#include "libvkt/core/type_dispatch.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/chunk_part.h"
#include "libvkt/formats/coordinates.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/zarr_image.h"
#include "libvkt/formats/zarr_layout.h"
#include "libvkt/formats/zarr_write.h"
#include "libvkt/formats/zip_archive.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <utility>

#include <omp.h>

namespace vkt {
namespace {

using Json = nlohmann::json;
using zarr::Array;
using zarr::Found;
using zarr::Level;
using zarr::member;
using zarr::Position;
using zarr::words;

constexpr std::int64_t most_places = std::int64_t{1} << 24; ///< that are listed
constexpr std::size_t most_open = 256;                      ///< files of chunks

/// As NRRD and NIfTI spell them; as they stand where those have none.
std::string unit_of_time(std::string const& unit) {
    for (auto const& [sign, name] : zarr::units_of_time)
        if (unit == name) return sign;
    return unit.find('"') == std::string::npos ? unit : "";
}

bool is_time(std::string const& name) { return name == "t" || name == "time"; }

char const* short_unit(std::string const& unit) {
    constexpr std::pair<char const*, char const*> known[] = {{"micrometer", "um"}, {"millimeter", "mm"},
                                                             {"nanometer", "nm"},  {"meter", "m"},
                                                             {"centimeter", "cm"}, {"angstrom", "angstrom"}};
    for (auto const& [name, sign] : known)
        if (unit == name || unit == sign) return sign;
    return nullptr;
}

class ZarrSource : public Source {
public:
    ZarrSource(std::shared_ptr<zarr::Store const> store, Found found, std::string name, ReadOptions const& options);

    bool next_volume() override;
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    void read(AnyView out) override;
    std::int64_t natural_slab() const override;
    void finish() override {}

private:
    void describe(Found const& found);
    void use_image_places(zarr::Multiscale const& image, Level const& level);
    void use_ours(Json const& attributes);
    void use_our_places(Json const& series);
    void use_coordinates(Found const& found, std::shared_ptr<zarr::Store const> store);
    /// What a thread keeps from chunk to chunk.
    struct Held {
        LargeVector<std::byte> chunk;
        zarr::Scratch scratch;
        std::vector<std::byte> rows;
    };
    using Key = std::array<std::int64_t, 3>; ///< of a chunk of the current volume
    bool read_part(Index3 at, Box const& whole, AnyView const& out, Held& held);
    std::shared_ptr<zarr::Chunks::Place const> opened(Key const& key);
    void read_chunk(Index3 at, AnyView const& out, Held& held);
    void drop(Key const& key);
    void place(std::byte const* chunk, Box const& box, Index3 first, AnyView const& out) const;

    std::string name_;
    zarr::Chunks chunks_;
    zarr::Layout layout_;
    std::vector<std::string> leading_names_;
    std::vector<std::vector<std::map<std::string, std::string>>> leading_places_; ///< as metadata tell; may be empty
    std::map<std::string, std::string> shared_attributes_;
    std::int64_t index_ = -1;
    zarr::Layout::Place volume_; ///< the current one
    Header header_;
    int threads_ = 1;
    std::size_t most_kept_;
    std::mutex mutex_;
    std::vector<Held> held_; ///< one a thread
    std::map<Key, std::shared_ptr<LargeVector<std::byte>>> kept_;
    std::deque<Key> kept_order_;
    bool parts_ = false;                                             ///< any part of a chunk can be read by itself
    std::map<Key, std::shared_ptr<zarr::Chunks::Place const>> open_; ///< chunks of which a part was read
    std::vector<LargeVector<std::byte>> spare_;                      ///< memory of chunks that are not kept any more
};

ZarrSource::ZarrSource(std::shared_ptr<zarr::Store const> store, Found found, std::string name,
                       ReadOptions const& options)
    : name_(std::move(name)), chunks_(store, found.array), layout_(found) {
    Array const& array = chunks_.array();
    std::size_t const memory = options.memory.value_or(default_memory()), chunk = array.inner_bytes();
    if (chunk > memory)
        throw Error(ErrorKind::resources, text("'", name_, "': a chunk of ", bytes_text(static_cast<double>(chunk)),
                                               " is beyond --memory, ", bytes_text(static_cast<double>(memory))));
    threads_ =
        static_cast<int>(std::clamp<std::size_t>(memory / 4 / chunk, 1, static_cast<std::size_t>(default_threads())));
    most_kept_ = memory / 8 / chunk;
    held_.resize(static_cast<std::size_t>(threads_));
    parts_ = chunks_.plain() && layout_.dense();
    for (std::size_t const dimension : layout_.leading()) {
        bool const named = found.image && found.image->names.size() == array.shape.size();
        leading_names_.push_back(named                            ? found.image->names[dimension]
                                 : dimension < array.names.size() ? array.names[dimension]
                                                                  : "");
    }
    use_coordinates(found, std::move(store));
    describe(found);
    check(header_);
}

/// All numbers of an array of one dimension; empty if it is too long for a list of coordinates.
std::vector<double> coordinates_in(std::shared_ptr<zarr::Store const> store, Array const& array) {
    std::int64_t const n = array.shape.front(), step = array.inner.front();
    if (n > most_places || step > most_places) return {};
    std::vector<double> result(static_cast<std::size_t>(n));
    zarr::Chunks const chunks(std::move(store), array);
    zarr::Scratch scratch;
    std::size_t const size = size_of(array.dtype);
    LargeVector<std::byte> chunk;
    chunk.resize(array.inner_bytes());
    for (std::int64_t first = 0; first < n; first += step) {
        bool const there = chunks.read({first / step}, {chunk.data(), chunk.size()}, scratch);
        for (std::int64_t i = first; i < std::min(n, first + step); ++i) {
            std::byte const* const from =
                there ? chunk.data() + static_cast<std::size_t>(i - first) * size : array.fill.data();
            result[static_cast<std::size_t>(i)] = with_type(array.dtype, [&]<class T>(T) {
                T value;
                std::memcpy(&value, from, sizeof value);
                return static_cast<double>(value);
            });
        }
    }
    return result;
}

/// Places from arrays of the names of dimensions, as NetCDF and xarray have them.
void ZarrSource::use_coordinates(Found const& found, std::shared_ptr<zarr::Store const> store) {
    leading_places_.resize(layout_.leading().size());
    std::array<std::string, 3> units;
    for (std::size_t k = 0; k < found.coordinates.size(); ++k) {
        if (!found.coordinates[k]) continue;
        std::vector<double> const at = coordinates_in(store, *found.coordinates[k]);
        if (at.empty()) continue;
        std::string const unit = words(Json::parse(found.coordinates[k]->attributes, nullptr, false), "units");
        if (auto const a = std::find(layout_.axes().begin(), layout_.axes().end(), static_cast<int>(k));
            a != layout_.axes().end()) {
            place_axis(header_, static_cast<int>(a - layout_.axes().begin()), at);
            units[static_cast<std::size_t>(a - layout_.axes().begin())] = unit;
        } else if (auto const i = std::find(layout_.leading().begin(), layout_.leading().end(), k);
                   i != layout_.leading().end()) {
            auto const number = static_cast<std::size_t>(i - layout_.leading().begin());
            if (is_time(leading_names_[number])) leading_places_[number] = sequence_places(at, unit);
        }
    }
    if (!units[0].empty() && units[0].find('"') == std::string::npos && units[0] == units[1] && units[0] == units[2])
        header_.attributes["space units"] = text("\"", units[0], "\" \"", units[0], "\" \"", units[0], "\"");
}

void ZarrSource::describe(Found const& found) {
    Array const& array = chunks_.array();
    header_.dtype = array.dtype;
    for (int a = 0; a < 3; ++a)
        if (int const k = layout_.axes()[static_cast<std::size_t>(a)]; k >= 0)
            header_.dims[a] = array.shape[static_cast<std::size_t>(k)];
    if (found.image) {
        Level const& level = found.image->levels[found.level];
        use_image_places(*found.image, level);
        for (int a = 0; a < 3; ++a) {
            auto const k = static_cast<std::size_t>(layout_.axes()[static_cast<std::size_t>(a)]);
            if (layout_.axes()[static_cast<std::size_t>(a)] < 0) continue;
            if (k < level.scale.size() && level.scale[k] > 0 && std::isfinite(level.scale[k]))
                header_.geometry.spacing[a] = level.scale[k];
            if (k < level.translation.size() && std::isfinite(level.translation[k]))
                header_.geometry.origin[a] = level.translation[k];
        }
        auto const x = static_cast<std::size_t>(layout_.axes()[0]);
        if (x < found.image->units.size())
            if (char const* const unit = short_unit(found.image->units[x]))
                header_.attributes["space units"] = text("\"", unit, "\" \"", unit, "\" \"", unit, "\"");
        if (found.image->levels.size() > 1) {
            std::string levels;
            for (Level const& l : found.image->levels) levels += text(levels.empty() ? "" : " ", l.path);
            header_.attributes["levels"] = levels;
        }
        header_.attributes["variable"] = level.path;
    }
    Json const attributes = Json::parse(array.attributes, nullptr, false);
    auto const number = [&](char const* name, double otherwise) {
        Json const* const found_number = member(attributes, name);
        double const value =
            found_number != nullptr && found_number->is_number() ? found_number->get<double>() : otherwise;
        return std::isfinite(value) ? value : otherwise;
    };
    if (double const slope = number("scale_factor", 1); slope != 0) header_.values = {slope, number("add_offset", 0)};
    header_.units = words(attributes, "units");
    use_ours(attributes);
    header_ = in_utf8(std::move(header_));
    mark_as_given(header_);
    shared_attributes_ = header_.attributes;
}

/// Times and channels of an image.
void ZarrSource::use_image_places(zarr::Multiscale const& image, Level const& level) {
    for (std::size_t i = 0; i < layout_.leading().size(); ++i) {
        std::size_t const k = layout_.leading()[i];
        auto const n = static_cast<std::size_t>(chunks_.array().shape[k]);
        auto& places = leading_places_[i];
        if (is_time(leading_names_[i]) && k < level.scale.size() && level.scale[k] > 0 &&
            chunks_.array().shape[k] <= most_places) {
            double const first = k < level.translation.size() ? level.translation[k] : 0;
            std::vector<double> at(n);
            for (std::size_t t = 0; t < n; ++t) at[t] = first + static_cast<double>(t) * level.scale[k];
            if (n > 1 && even_steps(at))
                places = sequence_places(at, k < image.units.size() ? unit_of_time(image.units[k]) : "");
            for (auto& said : places) said["sequence step"] = to_text(level.scale[k]); // not as differences round it
        }
        if (leading_names_[i] == "c" && image.channels.size() == n) {
            places.clear();
            for (std::string const& label : image.channels) places.push_back({{"channel", label}});
        }
    }
}

/// What vkt wrote has all of the header, and counts as long as the array still is what was written with it.
void ZarrSource::use_ours(Json const& attributes) {
    Json const* const kept = member(attributes, "vkt");
    if (kept == nullptr || !kept->is_object()) return;
    try {
        Header ours = header_from_json(kept->dump());
        check(ours);
        bool const placed = header_.attributes.contains("variable"); // by an image around it
        if (ours.kind != Kind::structured || !(ours.dims == header_.dims) || ours.dtype != header_.dtype ||
            ours.values != header_.values ||
            (placed &&
             !(ours.geometry.spacing == header_.geometry.spacing && ours.geometry.origin == header_.geometry.origin)))
            return;
        for (char const* const key : {"levels", "variable"})
            if (auto const found = header_.attributes.find(key); found != header_.attributes.end())
                ours.attributes[key] = found->second;
        ours.dry_run = ours.timing = false;
        header_ = std::move(ours);
        if (Json const* const series = member(attributes, zarr::series_attribute)) use_our_places(*series);
    } catch (Error const&) { // a damaged one is none
    }
}

/// As the volumes said them, which may be nothing.
void ZarrSource::use_our_places(Json const& series) {
    for (std::size_t i = 0; i < layout_.leading().size(); ++i) {
        Json const* const said = member(series, leading_names_[i].c_str());
        bool const time = is_time(leading_names_[i]);
        if ((!time && leading_names_[i] != "c") || said == nullptr || !said->is_array() ||
            std::ssize(*said) != chunks_.array().shape[layout_.leading()[i]])
            continue;
        leading_places_[i].clear();
        for (Json const& place : *said) {
            auto& places = leading_places_[i].emplace_back();
            if (place.is_string() && !place.get_ref<std::string const&>().empty())
                places[time ? "sequence position" : "channel"] = place.get<std::string>();
        }
    }
}

bool ZarrSource::next_volume() {
    if (index_ + 1 >= layout_.volumes()) {
        index_ = layout_.volumes();
        return false;
    }
    ++index_;
    kept_.clear();
    kept_order_.clear();
    open_.clear();
    Array const& array = chunks_.array();
    header_.attributes = shared_attributes_;
    volume_ = layout_.place(index_);
    std::int64_t rest = index_;
    for (std::size_t i = layout_.leading().size(); i-- > 0;) {
        std::int64_t const n = array.shape[layout_.leading()[i]], at = rest % n;
        rest /= n;
        if (n == 1 || leading_names_[i].empty()) continue;
        std::string const& name = leading_names_[i];
        if (!leading_places_[i].empty())
            for (auto const& [key, value] : leading_places_[i][static_cast<std::size_t>(at)])
                header_.attributes[key] = value;
        else
            header_.attributes[name == "c" ? "channel" : is_time(name) ? "sequence position" : name] = to_text(at);
    }
    return true;
}

/// Copies the part of a chunk, or of none, that lies in `box` of the volume.
void ZarrSource::place(std::byte const* chunk, Box const& box, Index3 first, AnyView const& out) const {
    std::size_t const size = size_of(out.type);
    std::int64_t const sx = layout_.stride(0), sy = layout_.stride(1), sz = layout_.stride(2), n = box.dims().x;
    auto const& fill = chunks_.array().fill;
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
        for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
            std::byte* const to = out.at(box.lower.x, y, z);
            if (chunk == nullptr) {
                for (std::int64_t x = 0; x < n; ++x)
                    std::memcpy(to + static_cast<std::size_t>(x) * size, fill.data(), size);
                continue;
            }
            std::byte const* const from =
                chunk + static_cast<std::size_t>(volume_.offset + (box.lower.x - first.x) * sx + (y - first.y) * sy +
                                                 (z - first.z) * sz) *
                            size;
            if (sx == 1) {
                std::memcpy(to, from, static_cast<std::size_t>(n) * size);
                continue;
            }
            for (std::int64_t x = 0; x < n; ++x)
                std::memcpy(to + static_cast<std::size_t>(x) * size, from + static_cast<std::size_t>(x * sx) * size,
                            size);
        }
}

std::int64_t ZarrSource::natural_slab() const {
    if (layout_.axes()[2] < 0) return 0;
    if (!parts_) return layout_.chunk().z;
    return slices_together(layout_.chunk().z,
                           header_.dims.x * header_.dims.y * static_cast<std::int64_t>(size_of(header_.dtype)));
}

/// The file of a chunk, which stays open for its other parts.
std::shared_ptr<zarr::Chunks::Place const> ZarrSource::opened(Key const& key) {
    {
        std::lock_guard const lock(mutex_);
        if (auto const found = open_.find(key); found != open_.end()) return found->second;
    }
    auto place =
        std::make_shared<zarr::Chunks::Place const>(chunks_.place(layout_.position(volume_, {key[0], key[1], key[2]})));
    if (place->file && !place->file->checks_whole())
        chunks_.check_size(*place, place->size, chunks_.array().inner_bytes());
    std::lock_guard const lock(mutex_);
    if (open_.size() >= most_open) open_.erase(open_.begin());
    return open_.try_emplace(key, std::move(place)).first->second;
}

/// Rows of a chunk straight from its file. False where all of it must be read: its checksum is of the whole.
bool ZarrSource::read_part(Index3 at, Box const& whole, AnyView const& out, Held& held) {
    Key const key{at.x, at.y, at.z};
    auto const place = opened(key);
    Box const box = intersect(whole, out.box);
    if (place->file && place->file->checks_whole()) return false;
    if (place->file) {
        std::uint64_t const begin = place->begin + static_cast<std::uint64_t>(volume_.offset) * size_of(out.type);
        read_chunk_part(whole.lower, layout_.chunk(), out.part(box), held.rows,
                        [&](std::int64_t from, std::byte* to, std::size_t n) {
                            place->file->read(begin + static_cast<std::uint64_t>(from), {to, n});
                        });
        if (chunks_.array().big_endian)
            for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
                for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
                    swap_bytes(out.at(box.lower.x, y, z), static_cast<std::size_t>(box.dims().x), size_of(out.type));
    } else {
        this->place(nullptr, box, whole.lower, out);
    }
    // Who reads in order does not come back to it.
    if (box.upper == whole.upper) {
        std::lock_guard const lock(mutex_);
        open_.erase(key);
    }
    return true;
}

void ZarrSource::read_chunk(Index3 at, AnyView const& out, Held& held) {
    Index3 const extent = layout_.chunk();
    Index3 const first{at.x * extent.x, at.y * extent.y, at.z * extent.z};
    Box const whole = intersect({first, first + extent}, box_of(header_.dims));
    if (parts_ && read_part(at, whole, out, held)) return;
    Box const box = intersect(whole, out.box);
    Key const key{at.x, at.y, at.z};
    std::shared_ptr<LargeVector<std::byte>> known;
    {
        std::lock_guard const lock(mutex_);
        if (auto const found = kept_.find(key); found != kept_.end()) known = found->second;
    }
    if (known) {
        place(known->empty() ? nullptr : known->data(), box, first, out);
        // Who reads in order does not come back to it.
        bool const last = box.upper == whole.upper && box.lower.x == whole.lower.x && box.lower.y == whole.lower.y;
        known.reset();
        if (last) drop(key);
        return;
    }
    held.chunk.resize(chunks_.array().inner_bytes());
    bool const there = chunks_.read(layout_.position(volume_, at), held.chunk, held.scratch);
    place(there ? held.chunk.data() : nullptr, box, first, out);
    if (box == whole || most_kept_ == 0) return;
    // The rest of it is going to be asked for next.
    auto kept = std::make_shared<LargeVector<std::byte>>();
    std::unique_lock lock(mutex_);
    if (kept_.contains(key)) return;
    if (there) {
        kept->swap(held.chunk);
        if (!spare_.empty()) {
            held.chunk.swap(spare_.back());
            spare_.pop_back();
        }
    }
    kept_.emplace(key, std::move(kept));
    kept_order_.push_back(key);
    if (kept_order_.size() <= most_kept_) return;
    Key const oldest = kept_order_.front();
    lock.unlock();
    drop(oldest);
}

/// Memory that was just written costs less than new memory: it goes to the next chunk.
void ZarrSource::drop(Key const& key) {
    std::lock_guard const lock(mutex_);
    auto const found = kept_.find(key);
    if (found == kept_.end()) return;
    bool const in_use = found->second.use_count() > 1;
    if (!in_use && !found->second->empty()) spare_.push_back(std::move(*found->second));
    kept_.erase(found);
    std::erase(kept_order_, key);
}

void ZarrSource::read(AnyView out) {
    if (out.box.empty()) return;
    if (!box_of(header_.dims).contains(out.box) || index_ < 0 || index_ >= layout_.volumes())
        throw Error(ErrorKind::failure, text("region ", out.box, " is outside of '", name_, "'"));
    Box chunks;
    for (int a = 0; a < 3; ++a) {
        std::int64_t const n = layout_.chunk()[a];
        chunks.lower[a] = out.box.lower[a] / n;
        chunks.upper[a] = (out.box.upper[a] - 1) / n + 1;
    }
    Index3 const count = chunks.dims();
    FirstFailure failure;
#pragma omp parallel num_threads(static_cast <int>(std::min <std::int64_t>(threads_, chunks.voxels())))
    {
        Held& held = held_[static_cast<std::size_t>(omp_get_thread_num())];
#pragma omp for schedule(dynamic)
        for (std::int64_t i = 0; i < chunks.voxels(); ++i) {
            failure.catch_from([&] {
                Index3 const at{i % count.x, i / count.x % count.y, i / count.x / count.y};
                read_chunk(chunks.lower + at, out, held);
            });
        }
    }
    failure.rethrow();
}

/// The folder in a ZIP file that the store begins in: its root, or the only folder there, as archivers make it.
std::string root_of(zarr::Store const& zip) {
    if (zip.is_node("")) return "";
    auto const names = zip.nodes_below("");
    return names.size() == 1 ? names.front() : "";
}

std::unique_ptr<Source> open_zarr(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    std::string const name = bytes->name();
    auto [file, inside] = file_part(name);
    if (!inside.empty() && !options.variable.empty())
        throw Error(ErrorKind::usage, text("'", name, "' names an array, and --variable another one"));
    std::shared_ptr<zarr::Store const> store;
    std::string folder = file;
    if (!bytes->directory() && !zip_first_name(bytes->peek(4096)).empty()) {
        store = zarr::zip_file(seekable_bytes(std::move(bytes)), file);
        folder = root_of(*store);
    } else {
        store = zarr::directories();
        // The metadata themselves stand for their folder.
        for (char const* const own : {"/zarr.json", "/.zarray", "/.zgroup", "/.zattrs", "/.zmetadata"})
            if (folder.ends_with(own)) folder.erase(folder.rfind('/'));
        while (folder.size() > 1 && folder.ends_with('/')) folder.pop_back();
        file = folder;
    }
    if (!store->is_node(folder))
        throw Error(ErrorKind::data,
                    text("'", file, "' is no Zarr store: it holds neither zarr.json nor .zarray nor .zgroup"));
    Found found = zarr::find_array(*store, file, folder, inside.empty() ? options.variable : inside);
    Choices choices = std::move(found.choices);
    auto source = std::make_unique<ZarrSource>(std::move(store), std::move(found), name, options);
    if (choices.names.empty()) return beside_others(std::move(source), std::move(choices.not_read));
    auto const names = collect(choices.names, [](auto const& choice) { return choice.first; });
    return unchosen(std::move(source), std::move(choices),
                    Error(ErrorKind::usage, text("'", file, "' holds several arrays: ", join(names, ", ")),
                          text("name one: --variable ", names.front())));
}

/// The first member's name tells stores from other ZIP files.
bool is_zarr_zip(std::span<std::byte const> head) {
    std::string const first = zip_first_name(head);
    std::string const name = first.substr(first.rfind('/') + 1);
    return name == "zarr.json" || name == ".zarray" || name == ".zgroup" || name == ".zattrs" || name == ".zmetadata" ||
           first.find(".zarr/") != std::string::npos;
}

} // namespace

Format zarr_format() {
    return {
        "zarr",     "Zarr arrays and OME-Zarr images, versions 2 and 3", {".zarr", ".zarr.zip"}, is_zarr_zip, open_zarr,
        create_zarr};
}

} // namespace vkt
