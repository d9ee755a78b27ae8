// Zarr stores, level by level and layer by layer of chunks.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_write.h"

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/first_failure.h"
#include "libvkt/core/text.h"
#include "libvkt/core/wide.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/zarr_array.h"
#include "libvkt/io/output_directory.h"
#include "libvkt/io/system_error.h"
#include "libvkt/kernel/numeric.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vkt {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t chunk_edge = 64;
constexpr std::int64_t coarsest = 64; ///< voxels along the longest axis of the last level
constexpr std::size_t most_history = std::size_t{256} << 10;

/// In a directory that has no name yet, and goes if anything fails.
void write_file(std::string const& path, void const* data, std::size_t n) {
    int const file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (file < 0) throw system_error(text("cannot write '", path, "'"));
    auto const* next = static_cast<std::byte const*>(data);
    int code = 0;
    while (n > 0 && code == 0) {
        ssize_t const done = ::write(file, next, n);
        if (done < 0 && errno == EINTR) continue;
        if (done < 0) {
            code = errno;
        } else {
            next += done;
            n -= static_cast<std::size_t>(done);
        }
    }
    if (::close(file) != 0 && code == 0) code = errno;
    if (code != 0) throw system_error(text("cannot write '", path, "'"), code);
}

void write_json(std::string const& path, Json const& json) {
    std::string const lines = json.dump(1) + "\n";
    write_file(path, lines.data(), lines.size());
}

void make_directory(std::string const& path) {
    if (::mkdir(path.c_str(), 0777) != 0 && errno != EEXIST) throw system_error(text("cannot write '", path, "'"));
}

std::string type_name(DataType type) {
    bool const real = !is_integer(type);
    return text(size_of(type) == 1 ? "|" : "<",
                real              ? "f"
                : is_signed(type) ? "i"
                                  : "u",
                static_cast<std::int64_t>(size_of(type)));
}

/// Slices of one level as they come, in whole rows.
class LevelWriter {
public:
    LevelWriter(std::string folder, Index3 dims, DataType dtype, WriteOptions const& options, std::size_t memory);

    void write(std::byte const* voxels, std::size_t n);
    void write_metadata(Json const& attributes) const;
    Index3 dims() const { return dims_; }

private:
    void flush();
    void write_chunk(Index3 at, std::int64_t row, std::int64_t rows, std::int64_t slices) const;

    std::string folder_;
    Index3 dims_, chunk_;
    DataType dtype_;
    std::optional<zarr::Codec> codec_;
    int threads_;
    std::size_t row_, layer_;
    std::int64_t rows_ = 0; ///< that were written
    std::vector<std::byte> held_;
};

LevelWriter::LevelWriter(std::string folder, Index3 dims, DataType dtype, WriteOptions const& options,
                         std::size_t memory)
    : folder_(std::move(folder)), dims_(dims), dtype_(dtype),
      threads_(std::max(1, options.threads.value_or(default_threads()))),
      row_(static_cast<std::size_t>(dims.x) * size_of(dtype)) {
    if (options.compress) {
#if defined VKT_HAVE_BLOSC
        codec_ = zarr::Codec::blosc;
#elif defined VKT_HAVE_ZSTD
        codec_ = zarr::Codec::zstd;
#else
        codec_ = zarr::Codec::zlib;
#endif
        zarr::require(*codec_, "writing Zarr");
    }
    // A layer of chunks is held; of slices beyond the budget, some rows.
    std::size_t const slice = row_ * static_cast<std::size_t>(dims.y);
    bool const by_rows = slice > memory;
    std::int64_t const depth =
        by_rows ? 1
                : std::clamp<std::int64_t>(static_cast<std::int64_t>(memory / slice), 1, std::min(chunk_edge, dims.z));
    std::int64_t const rows =
        std::clamp<std::int64_t>(static_cast<std::int64_t>(memory / row_), 1, std::min(chunk_edge, dims.y));
    chunk_ = {std::min(chunk_edge, dims.x), by_rows ? rows : std::min(chunk_edge, dims.y), depth};
    layer_ = by_rows ? row_ * static_cast<std::size_t>(rows) : slice * static_cast<std::size_t>(depth);
}

void LevelWriter::write(std::byte const* voxels, std::size_t n) {
    std::size_t const slice = row_ * static_cast<std::size_t>(dims_.y), all = slice * static_cast<std::size_t>(dims_.z);
    while (n > 0) {
        std::size_t const done = static_cast<std::size_t>(rows_) * row_ + held_.size();
        std::size_t room = layer_ - held_.size();
        if (layer_ < slice) room = std::min(room, slice - done % slice);
        std::size_t const count = std::min(n, room);
        held_.insert(held_.end(), voxels, voxels + count);
        voxels += count;
        n -= count;
        bool const slice_ends = layer_ < slice && (done + count) % slice == 0;
        if (held_.size() == layer_ || slice_ends || done + count == all) flush();
    }
}

void LevelWriter::flush() {
    std::int64_t const rows = static_cast<std::int64_t>(held_.size() / row_);
    bool const whole = rows % dims_.y == 0;
    std::int64_t const z = rows_ / dims_.y, first = rows_ % dims_.y;
    std::int64_t const slices = whole ? rows / dims_.y : 1, height = whole ? dims_.y : rows;
    Index3 const at{0, first / chunk_.y, z / chunk_.z};
    std::int64_t const across = (dims_.x - 1) / chunk_.x + 1, down = (height - 1) / chunk_.y + 1;
    make_directory(text(folder_, "/", at.z));
    for (std::int64_t y = 0; y < down; ++y) make_directory(text(folder_, "/", at.z, "/", at.y + y));
    FirstFailure failure;
#pragma omp parallel for num_threads(threads_) schedule(dynamic)
    for (std::int64_t i = 0; i < across * down; ++i) {
        failure.catch_from([&] { write_chunk({i % across, at.y + i / across, at.z}, first, height, slices); });
    }
    failure.rethrow();
    rows_ += rows;
    held_.clear();
}

/// From what is held: rows from `row` on of some slices. Chunks at the end are whole all the same.
void LevelWriter::write_chunk(Index3 at, std::int64_t row, std::int64_t rows, std::int64_t slices) const {
    std::size_t const size = size_of(dtype_), width = static_cast<std::size_t>(chunk_.x) * size;
    std::vector<std::byte> chunk(width * static_cast<std::size_t>(chunk_.y * chunk_.z));
    std::int64_t const x = at.x * chunk_.x, y = at.y * chunk_.y;
    auto const count = static_cast<std::size_t>(std::min(chunk_.x, dims_.x - x)) * size;
    std::int64_t const end = std::min({y + chunk_.y, dims_.y, row + rows});
    for (std::int64_t s = 0; s < slices; ++s)
        for (std::int64_t r = y; r < end; ++r)
            std::memcpy(chunk.data() + static_cast<std::size_t>(s * chunk_.y + r - y) * width,
                        held_.data() + static_cast<std::size_t>(s * rows + r - row) * row_ +
                            static_cast<std::size_t>(x) * size,
                        count);
    if (std::all_of(chunk.begin(), chunk.end(), [](std::byte b) { return b == std::byte{0}; })) return;
    if (codec_) chunk = zarr::encode(*codec_, chunk, size);
    write_file(text(folder_, "/", at.z, "/", at.y, "/", at.x), chunk.data(), chunk.size());
}

void LevelWriter::write_metadata(Json const& attributes) const {
    Json compressor = nullptr;
    if (codec_ == zarr::Codec::blosc)
        compressor = {{"id", "blosc"},
                      {"cname", "zstd"},
                      {"clevel", 2},
                      {"shuffle", size_of(dtype_) > 1 ? 1 : 0},
                      {"blocksize", 0}};
    else if (codec_ == zarr::Codec::zstd)
        compressor = {{"id", "zstd"}, {"level", 3}};
    else if (codec_)
        compressor = {{"id", "zlib"}, {"level", 4}};
    write_json(folder_ + "/.zarray", {{"zarr_format", 2},
                                      {"shape", {dims_.z, dims_.y, dims_.x}},
                                      {"chunks", {chunk_.z, chunk_.y, chunk_.x}},
                                      {"dtype", type_name(dtype_)},
                                      {"compressor", compressor},
                                      {"fill_value", 0},
                                      {"order", "C"},
                                      {"filters", nullptr},
                                      {"dimension_separator", "/"}});
    write_json(folder_ + "/.zattrs", attributes);
}

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

class ZarrWriter : public VolumeWriter {
public:
    ZarrWriter(std::string const& path, WriteOptions const& options)
        : options_(options), directory_(path, options.force, zarr::is_zarr, "Zarr stores") {}

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
    Json image() const;
    Json about() const;

    WriteOptions options_;
    OutputDirectory directory_;
    Header header_;
    std::vector<Level> levels_;
    bool begun_ = false;
};

void ZarrWriter::begin(Header const& header) {
    if (header.kind != Kind::structured)
        throw Error(ErrorKind::usage, "Zarr arrays cannot hold bricks", "make a grid of them first: vkt resample");
    if (std::exchange(begun_, true))
        throw Error(ErrorKind::usage, "the input holds several volumes, a Zarr array of vkt holds one",
                    "write one each: name it like out_%04d.zarr");
    header_ = in_utf8(header);
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
    VKT_BACKEND::for_each_type(header_.dtype, [&]<class T>(T) { add_means<T>(a, b, dims, out.data()); });
    take(level + 1, out.data(), out.size());
}

/// Of the finest array: what xarray looks for, and all of the header.
Json ZarrWriter::about() const {
    Json result{{"_ARRAY_DIMENSIONS", {"z", "y", "x"}}};
    if (header_.values != ValueMap{}) {
        result["scale_factor"] = header_.values.slope;
        result["add_offset"] = header_.values.intercept;
    }
    if (!header_.units.empty()) result["units"] = header_.units;
    Header kept = header_;
    kept.timing = kept.dry_run = false;
    if (kept.history) kept.history = parse_history(history_text(*kept.history, most_history));
    result["vkt"] = Json::parse(to_json(kept));
    return result;
}

/// OME-NGFF 0.4. A voxel of a coarser level lies in the middle of those that it is the mean of.
Json ZarrWriter::image() const {
    Geometry const& g = header_.geometry;
    auto const found = header_.attributes.find("space units");
    auto const units = found == header_.attributes.end() ? std::nullopt : quoted_entries(found->second);
    constexpr std::pair<char const*, char const*> names[] = {{"\"um\"", "micrometer"},
                                                             {"\"mm\"", "millimeter"},
                                                             {"\"nm\"", "nanometer"},
                                                             {"\"m\"", "meter"},
                                                             {"\"angstrom\"", "angstrom"}};
    Json axes = Json::array();
    for (char const* const axis : {"z", "y", "x"}) {
        Json entry{{"name", axis}, {"type", "space"}};
        for (auto const& [sign, name] : names)
            if (units && units->size() == 3 && units->front() == sign) entry["unit"] = name;
        axes.push_back(entry);
    }
    Json datasets = Json::array();
    for (std::size_t i = 0; i < levels_.size(); ++i) {
        Json scale = Json::array(), translation = Json::array();
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
    return {{"multiscales", {{{"version", "0.4"}, {"axes", axes}, {"datasets", datasets}, {"type", "mean"}}}}};
}

void ZarrWriter::close() {
    if (!begun_) throw Error(ErrorKind::data, "there is no volume to write");
    for (std::size_t i = 0; i < levels_.size(); ++i)
        levels_[i].writer.write_metadata(i == 0 ? about() : Json{{"_ARRAY_DIMENSIONS", {"z", "y", "x"}}});
    if (options_.pyramid) {
        write_json(directory_.file(".zgroup"), {{"zarr_format", 2}});
        write_json(directory_.file(".zattrs"), image());
    }
    directory_.commit();
}

} // namespace

std::unique_ptr<Sink> create_zarr(std::string const& path, WriteOptions const& options) {
    if (path == "-" || !file_part(path).part.empty())
        throw Error(ErrorKind::usage, text("'", path, "': a Zarr store is a directory"), "name it: -o out.zarr");
    return slab_sink(std::make_unique<ZarrWriter>(path, options));
}

} // namespace vkt
