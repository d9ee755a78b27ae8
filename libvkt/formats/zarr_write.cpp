// Zarr stores, level by level and layer by layer of chunks.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_write.h"

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/text.h"
#include "libvkt/core/wide.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/series_axes.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/zarr_image.h"
#include "libvkt/formats/zarr_level.h"
#include "libvkt/formats/zarr_region.h"
#include "libvkt/formats/zip_archive.h"
#include "libvkt/io/output_directory.h"
#include "libvkt/kernel/numeric.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

namespace vkt {
namespace {

using OrderedJson = nlohmann::ordered_json;
using zarr::LevelWriter, zarr::make_directory, zarr::write_json;

constexpr std::int64_t coarsest = 64; ///< voxels along the longest axis of the last level

std::int64_t half(std::int64_t n) { return (n + 1) / 2; }

/// Means of up to eight voxels, rounded half to even.
template <class T> void add_means(std::byte const* a, std::byte const* b, Index3 dims, std::byte* out) {
    using Sum = std::conditional_t<sizeof(T) == 8 && std::is_integral_v<T>, Int128,
                                   std::conditional_t<std::is_integral_v<T>, std::int64_t, double>>;
    auto const at = [&](std::byte const* slice, std::int64_t x, std::int64_t y) {
        T v;
        std::memcpy(&v, slice + static_cast<std::size_t>(y * dims.x + x) * sizeof(T), sizeof(T));
        if constexpr (std::is_integral_v<T>)
            return static_cast<Sum>(v);
        else
            return std::is_same_v<T, double> ? static_cast<Sum>(v) : static_cast<Sum>(static_cast<float>(v));
    };
    for (std::int64_t y = 0; y < half(dims.y); ++y)
        for (std::int64_t x = 0; x < half(dims.x); ++x) {
            Sum sum = 0;
            int n = 0;
            for (std::byte const* const slice : {a, b})
                for (std::int64_t v = 2 * y; slice != nullptr && v < std::min(2 * y + 2, dims.y); ++v)
                    for (std::int64_t u = 2 * x; u < std::min(2 * x + 2, dims.x); ++u, ++n) sum += at(slice, u, v);
            T mean;
            if constexpr (std::is_integral_v<T>) {
                Sum quotient = sum / n, rest = sum % n;
                if (rest < 0) rest += n, --quotient; // towards minus infinity
                if (2 * rest > n || (2 * rest == n && quotient % 2 != 0)) ++quotient;
                mean = static_cast<T>(quotient);
            } else {
                mean = static_cast<T>(sum / n);
            }
            std::memcpy(out + static_cast<std::size_t>(y * half(dims.x) + x) * sizeof(T), &mean, sizeof(T));
        }
}

/// The unit that an attribute lists for so many axes, by the first of them, as OME-NGFF spells it; empty for what is
/// not among these.
std::string ome_unit(Header const& header, char const* attribute, std::size_t axes,
                     std::span<std::pair<char const*, char const*> const> known) {
    auto const found = header.attributes.find(attribute);
    auto const units = found == header.attributes.end() ? std::nullopt : quoted_entries(found->second);
    for (auto const& [sign, name] : known)
        if (units && units->size() == axes && units->front() == text("\"", sign, "\"")) return name;
    return "";
}

/// How viewers show channels: by their names, white, in the range of their type. Null where only their numbers are
/// known.
OrderedJson omero(SeriesAxis const& axis, DataType type) {
    std::vector<std::string> const names = channels_of(axis);
    OrderedJson channels = OrderedJson::array();
    bool named = false;
    for (std::size_t i = 0; i < names.size(); ++i) {
        named = named || names[i] != to_text(static_cast<std::int64_t>(i));
        OrderedJson range = with_type(type, [&]<class T>(T) {
            if constexpr (std::is_integral_v<T>)
                return std::array<OrderedJson, 2>{std::numeric_limits<T>::min(), std::numeric_limits<T>::max()};
            else
                return std::array<OrderedJson, 2>{0.0, 1.0};
        });
        channels.push_back(
            {{"label", names[i]},
             {"color", "FFFFFF"},
             {"active", true},
             {"window", {{"min", range[0]}, {"max", range[1]}, {"start", range[0]}, {"end", range[1]}}}});
    }
    return named ? OrderedJson{{"channels", channels}} : OrderedJson(nullptr);
}

/// Numbers with dots between them, as chunks are called, perhaps behind "c.".
bool is_chunk_name(std::string_view name) {
    if (name.starts_with("c.")) name.remove_prefix(2);
    bool const ends = !name.empty() && name.front() != '.' && name.back() != '.';
    return ends && name.find_first_not_of("0123456789.") == std::string_view::npos;
}

/// True for a folder below an array that has chunks in it, and folders of them, and nothing else.
bool holds_only_chunks(std::filesystem::path const& folder, int depth) {
    for (auto const& entry : std::filesystem::directory_iterator(folder)) {
        std::string const name = entry.path().filename().string();
        if (!is_chunk_name(name) || entry.is_symlink()) return false;
        if (entry.is_directory() ? depth == 0 || !holds_only_chunks(entry.path(), depth - 1) : !entry.is_regular_file())
            return false;
    }
    return true;
}

/// True for an array or group whose files all are metadata and chunks, and those of the arrays and groups in it.
bool holds_only_zarr(std::filesystem::path const& folder, int depth = 16) {
    bool array = false, node = false;
    std::vector<std::filesystem::directory_entry> others;
    for (auto const& entry : std::filesystem::directory_iterator(folder)) {
        std::string const name = entry.path().filename().string();
        bool const metadata =
            name == ".zarray" || name == ".zgroup" || name == ".zattrs" || name == ".zmetadata" || name == "zarr.json";
        if (!metadata || !entry.is_regular_file() || entry.is_symlink()) {
            others.push_back(entry);
            continue;
        }
        array = array || name == ".zarray" || name == "zarr.json"; // which may be a group's
        node = node || array || name == ".zgroup";
    }
    if (!node) return false;
    for (auto const& entry : others) {
        std::string const name = entry.path().filename().string();
        bool const chunks = array && (is_chunk_name(name) || name == "c"); // a file "c" of no dimensions
        if (entry.is_symlink() || (!entry.is_directory() && !(chunks && entry.is_regular_file()))) return false;
        if (!entry.is_directory()) continue;
        if (depth == 0 ||
            !(holds_only_zarr(entry.path(), depth - 1) || (chunks && holds_only_chunks(entry.path(), depth - 1))))
            return false;
    }
    return true;
}

bool in_zip(std::string const& path) { return lower_case(path).ends_with(".zip"); }

/// A store in a ZIP file is made in a directory beside it first, since chunks come from several threads.
class ZarrWriter : public VolumeWriter {
public:
    ZarrWriter(std::string const& path, WriteOptions const& options)
        : options_(options), directory_(
                                 in_zip(path) ? path + ".parts" : path, options.force && !in_zip(path),
                                 [](std::string const& folder) { return holds_only_zarr(folder); }, "Zarr stores") {
        if (in_zip(path)) zip_.emplace(path, options.force);
    }

    void begin(Header const& header) override;
    void write(std::byte const* voxels, std::size_t n) override;
    void close() override;

private:
    /// A level, and what is held of it until a slice of the next can be made.
    struct Level {
        LevelWriter writer;
        std::vector<std::byte> slice, before;
        std::int64_t slices = 0;
    };

    void take(std::size_t level, std::byte const* voxels, std::size_t n);
    void make_slice(std::size_t level, std::byte const* a, std::byte const* b);
    void open_levels();
    std::vector<SeriesAxis> axes() const;
    OrderedJson image() const;
    OrderedJson about() const;
    OrderedJson dimensions() const;
    void pack();

    WriteOptions options_;
    OutputDirectory directory_;
    std::optional<OutputFile> zip_;
    SeriesAxes series_{"Zarr array", ".zarr"};
    Header header_;
    std::vector<Level> levels_;
};

void ZarrWriter::begin(Header const& header) {
    refuse_bricks(header, "Zarr arrays");
    series_.add(header);
    if (levels_.empty()) {
        header_ = series_.header();
        open_levels();
    }
    for (Level& level : levels_) {
        if (series_.volumes() > 1) level.writer.next_volume();
        level.slices = 0;
    }
    // Chunks of zeros are left out, but how many there will be is not known.
    std::size_t bytes = 0;
    for (Level const& level : levels_) bytes += level.writer.bytes().value_or(0);
    directory_.expect(bytes, "write it compressed, of which the size is not known before: --compress");
}

void ZarrWriter::open_levels() {
    std::vector<Index3> dims{header_.dims};
    while (options_.pyramid && std::max({dims.back().x, dims.back().y, dims.back().z}) > coarsest)
        dims.push_back({half(dims.back().x), half(dims.back().y), half(dims.back().z)});
    std::size_t const budget = options_.memory.value_or(default_memory()) / 8;
    std::size_t const slice = static_cast<std::size_t>(header_.dims.x * header_.dims.y) * size_of(header_.dtype);
    if (dims.size() > 1 && slice > 2 * budget)
        throw Error(ErrorKind::resources, text("--pyramid holds slices of ", bytes_text(static_cast<double>(slice)),
                                               ", which is beyond --memory"));
    std::size_t share = budget;
    for (std::size_t i = 0; i < dims.size(); ++i) {
        std::string const folder =
            options_.pyramid ? directory_.file(text(static_cast<std::int64_t>(i))) : directory_.file("");
        if (options_.pyramid) make_directory(folder);
        levels_.push_back({LevelWriter(options_.pyramid ? folder : folder.substr(0, folder.size() - 1), dims[i],
                                       header_.dtype, options_, share),
                           {},
                           {}});
        share = std::max<std::size_t>(share / 2, 1);
    }
}

void ZarrWriter::write(std::byte const* voxels, std::size_t n) { take(0, voxels, n); }

/// The next rows of a level; whole slices go on to the next one, two by two.
void ZarrWriter::take(std::size_t level, std::byte const* voxels, std::size_t n) {
    Level& l = levels_[level];
    l.writer.write(voxels, n);
    if (level + 1 == levels_.size()) return;
    Index3 const dims = l.writer.dims();
    std::size_t const size = static_cast<std::size_t>(dims.x * dims.y) * size_of(header_.dtype);
    while (n > 0) {
        std::size_t const count = std::min(n, size - l.slice.size());
        l.slice.insert(l.slice.end(), voxels, voxels + count);
        voxels += count;
        n -= count;
        if (l.slice.size() < size) return;
        ++l.slices;
        if (l.slices % 2 == 1 && l.slices < dims.z) {
            l.before.swap(l.slice);
        } else {
            bool const pair = l.slices % 2 == 0;
            make_slice(level, pair ? l.before.data() : l.slice.data(), pair ? l.slice.data() : nullptr);
        }
        l.slice.clear();
    }
}

void ZarrWriter::make_slice(std::size_t level, std::byte const* a, std::byte const* b) {
    Index3 const dims = levels_[level].writer.dims();
    std::vector<std::byte> out(static_cast<std::size_t>(half(dims.x) * half(dims.y)) * size_of(header_.dtype));
    with_type(header_.dtype, [&]<class T>(T) { add_means<T>(a, b, dims, out.data()); });
    take(level + 1, out.data(), out.size());
}

/// Slowest first; of OME-Zarr times come before channels, in whatever order the volumes came.
std::vector<SeriesAxis> ZarrWriter::axes() const {
    std::vector<SeriesAxis> result = series_.axes();
    if (options_.pyramid && result.size() == 2 && !result[0].time) std::swap(result[0], result[1]);
    return result;
}

/// What xarray looks for; version 3 names dimensions itself.
OrderedJson ZarrWriter::dimensions() const {
    if (options_.zarr.version != 2) return OrderedJson::object();
    OrderedJson names = OrderedJson::array();
    for (SeriesAxis const& axis : axes()) names.push_back(axis.name());
    for (char const* const axis : {"z", "y", "x"}) names.push_back(axis);
    return {{"_ARRAY_DIMENSIONS", names}};
}

/// Of the finest array: besides, all of the header.
OrderedJson ZarrWriter::about() const {
    OrderedJson result = dimensions();
    if (header_.values != ValueMap{}) {
        result["scale_factor"] = header_.values.slope;
        result["add_offset"] = header_.values.intercept;
    }
    if (!header_.units.empty()) result["units"] = header_.units;
    result["vkt"] = zarr::kept_header(header_);
    for (SeriesAxis const& axis : axes()) result[zarr::series_attribute][axis.name()] = axis.places;
    return result;
}

/// OME-NGFF 0.4, or 0.5 in version 3 of Zarr. A voxel of a coarser level lies in the middle of those that it is the
/// mean of.
OrderedJson ZarrWriter::image() const {
    Geometry const& g = header_.geometry;
    constexpr std::pair<char const*, char const*> units_of_space[] = {
        {"um", "micrometer"}, {"mm", "millimeter"}, {"nm", "nanometer"}, {"m", "meter"}, {"angstrom", "angstrom"}};
    std::string const length = ome_unit(header_, "space units", 3, units_of_space);
    std::vector<SeriesAxis> const series = axes();
    OrderedJson axes = OrderedJson::array();
    OrderedJson before = OrderedJson::array(),
                first = OrderedJson::array(); // scales and translations of dimensions before z
    OrderedJson channels;
    for (SeriesAxis const& axis : series) {
        OrderedJson entry{{"name", axis.name()}, {"type", axis.time ? "time" : "channel"}};
        auto const steps = axis.time ? steps_of(axis, header_) : std::nullopt;
        std::string const unit = steps ? ome_unit(header_, "sequence units", 1, zarr::units_of_time) : "";
        if (!unit.empty()) entry["unit"] = unit;
        axes.push_back(entry);
        before.push_back(steps ? steps->step : 1.0);
        first.push_back(steps ? steps->first : 0.0);
        if (!axis.time) channels = omero(axis, header_.dtype);
    }
    for (char const* const axis : {"z", "y", "x"}) {
        OrderedJson entry{{"name", axis}, {"type", "space"}};
        if (!length.empty()) entry["unit"] = length;
        axes.push_back(entry);
    }
    OrderedJson datasets = OrderedJson::array();
    for (std::size_t i = 0; i < levels_.size(); ++i) {
        OrderedJson scale = before, translation = first;
        for (int a = 2; a >= 0; --a) {
            // Axes of one voxel are not halved any more.
            double width = 1;
            std::int64_t n = header_.dims[a];
            for (std::size_t k = 0; k < i; ++k, n = half(n)) width *= n > 1 ? 2 : 1;
            scale.push_back(g.spacing[a] * width);
            translation.push_back(g.origin[a] + (width - 1) / 2 * g.spacing[a]);
        }
        datasets.push_back(
            {{"path", text(static_cast<std::int64_t>(i))},
             {"coordinateTransformations",
              {{{"type", "scale"}, {"scale", scale}}, {{"type", "translation"}, {"translation", translation}}}}});
    }
    bool const second = options_.zarr.version == 2;
    OrderedJson about{{"axes", axes}, {"datasets", datasets}, {"type", "mean"}};
    OrderedJson result = second ? OrderedJson::object() : OrderedJson{{"version", "0.5"}};
    if (second) about["version"] = "0.4";
    result["multiscales"] = OrderedJson::array({about});
    if (!channels.is_null()) result["omero"] = channels;
    return second ? result : OrderedJson{{"ome", result}};
}

void ZarrWriter::close() {
    if (levels_.empty()) throw Error(ErrorKind::data, "there is no volume to write");
    series_.finish();
    header_ = series_.header();
    if (!series_.differing().empty() && options_.notice)
        options_.notice(text("one Zarr array does not hold attributes that differ between its volumes (",
                             join(series_.differing(), ", "), "): not kept"));
    zarr::Leading leading;
    for (SeriesAxis const& axis : axes()) {
        leading.names.push_back(axis.name());
        leading.extents.push_back(axis.size());
    }
    leading.turned = leading.names.size() == 2 && leading.names[0] != series_.axes()[0].name();
    for (std::size_t i = 0; i < levels_.size(); ++i) levels_[i].writer.finish(leading, i == 0 ? about() : dimensions());
    if (options_.pyramid && options_.zarr.version == 2) {
        write_json(directory_.file(".zgroup"), {{"zarr_format", 2}});
        write_json(directory_.file(".zattrs"), image());
    } else if (options_.pyramid) {
        write_json(directory_.file("zarr.json"), {{"zarr_format", 3}, {"node_type", "group"}, {"attributes", image()}});
    }
    if (zip_) return pack();
    directory_.commit();
}

/// Metadata come first, by which readers know what the file is; then all in the order of names.
void ZarrWriter::pack() {
    namespace fs = std::filesystem;
    std::string const root = directory_.file("");
    std::vector<std::string> names;
    for (auto const& entry : fs::recursive_directory_iterator(root))
        if (entry.is_regular_file()) names.push_back(entry.path().string().substr(root.size()));
    auto const rank = [](std::string const& name) {
        std::string const file = name.substr(name.rfind('/') + 1);
        bool const about = file == "zarr.json" || file.starts_with('.');
        return std::pair(!about, name);
    };
    std::sort(names.begin(), names.end(), [&](auto const& a, auto const& b) { return rank(a) < rank(b); });
    ZipWriter zip(*zip_);
    for (std::string const& name : names) {
        zip.add(name, *open_bytes(root + name));
        fs::remove(root + name); // so that not all of it lies there twice
    }
    zip.finish();
    for (auto const& entry : fs::directory_iterator(root)) fs::remove_all(entry.path());
    zip_->commit();
}

} // namespace

std::unique_ptr<Sink> create_zarr(std::string const& path, WriteOptions const& options) {
    if (options.at) return slab_sink(zarr_region_writer(path, options));
    if (path == "-" || !file_part(path).part.empty())
        throw Error(ErrorKind::usage, text("'", path, "': a Zarr store is a directory"), "name it: -o out.zarr");
    return slab_sink(std::make_unique<ZarrWriter>(path, options));
}

} // namespace vkt
