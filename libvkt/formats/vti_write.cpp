// VTK's XML images, written: .vti whole, .pvti in pieces.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/vti.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/series_axes.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/vti_structure.h"
#include "libvkt/io/output_directory.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>

#include <fcntl.h>
#include <omp.h>
#include <unistd.h>

namespace vkt {
namespace {

char const* vtk_type(DataType type) {
    switch (type) {
    case DataType::uint8:
        return "UInt8";
    case DataType::int8:
        return "Int8";
    case DataType::uint16:
        return "UInt16";
    case DataType::int16:
        return "Int16";
    case DataType::uint32:
        return "UInt32";
    case DataType::int32:
        return "Int32";
    case DataType::uint64:
        return "UInt64";
    case DataType::int64:
        return "Int64";
    case DataType::float32:
        return "Float32";
    case DataType::float64:
        return "Float64";
    case DataType::float16:
        break;
    }
    return nullptr;
}

std::string extent_text(Index3 dims, std::int64_t lower) {
    return text("0 ", dims.x - 1, " 0 ", dims.y - 1, " ", lower, " ", lower + dims.z - 1);
}

std::string place_text(Geometry const& g, Vec3 origin) {
    auto const vector = [](Vec3 v) { return text(to_text(v.x), " ", to_text(v.y), " ", to_text(v.z)); };
    auto const& d = g.direction;
    return text("Origin=\"", vector(origin), "\" Spacing=\"", vector(g.spacing), "\" Direction=\"",
                vector({d[0].x, d[1].x, d[2].x}), " ", vector({d[0].y, d[1].y, d[2].y}), " ",
                vector({d[0].z, d[1].z, d[2].z}), "\"");
}

std::string array_name(Header const& h) {
    auto const found = h.attributes.find("variable");
    return xml_escaped(found == h.attributes.end() || found->second.empty() ? "values" : found->second);
}

/// All of the header, as VTK writes strings: the codes of their letters.
std::string kept_text(Header kept) {
    kept.timing = kept.dry_run = false;
    std::string letters;
    for (char const c : one_line(to_json(kept))) letters += text(static_cast<int>(static_cast<unsigned char>(c)), " ");
    return text("    <FieldData>\n      <Array type=\"String\" Name=\"vkt_header\" NumberOfTuples=\"1\" "
                "format=\"ascii\">\n        ",
                letters, "0\n      </Array>\n    </FieldData>\n");
}

/// What is written side by side on one lattice.
struct WrittenArray {
    std::string name; ///< escaped
    std::int64_t components = 1;
};

/// Appended raw data, in blocks of zlib if compressed, behind a header whose length is known before. Several arrays lie
/// one after another.
class VtiWriter : public VolumeWriter {
public:
    /// `lower`: the extent's first slice, of a piece whose whole begins at `origin`.
    VtiWriter(std::string const& path, WriteOptions const& options, std::int64_t lower = 0,
              std::optional<Vec3> origin = std::nullopt)
        : lower_(lower), origin_(origin), file_(path, options.force), compress_(options.compress),
          threads_(options.threads.value_or(default_threads())) {
        if (compress_ && file_.in_place())
            throw Error(ErrorKind::usage, "a compressed .vti cannot go to a pipe, since its sizes come first",
                        "write a file");
    }

    OutputFile const& file() const { return file_; }

    void begin(Header const& header) override { begin(header, {{array_name(header)}}); }

    /// write() takes the voxels of all arrays, one array after another.
    void begin(Header const& header, std::vector<WrittenArray> arrays) {
        header_ = in_utf8(header);
        arrays_ = std::move(arrays);
        offsets_.assign(arrays_.size(), 0);
        std::size_t const bytes = header.bytes() * arrays_.size() * static_cast<std::size_t>(arrays_[0].components);
        file_.expect(compress_ ? bytes / 1032 : bytes);
        put(head());
        begin_ = written_;
        start_array();
    }

    void write(std::byte const* voxels, std::size_t n) override {
        while (n > 0) {
            if (left_ == 0) {
                end_array();
                ++array_;
                start_array();
            }
            std::size_t const count = std::min(n, static_cast<std::size_t>(left_));
            left_ -= static_cast<std::int64_t>(count);
            if (compress_) {
                held_.insert(held_.end(), voxels, voxels + count);
                if (std::ssize(held_) >= block * 4 * threads_) pack(false);
            } else {
                write_bytes(voxels, count);
            }
            voxels += count;
            n -= count;
        }
    }

    void end() override {
        end_array();
        put("\n  </AppendedData>\n</VTKFile>\n");
    }

    void close() override {
        if (arrays_.size() > 1) {
            std::string const words = head();
            file_.write_at(0, words.data(), words.size());
        }
        file_.commit();
    }

private:
    static constexpr std::int64_t block = std::int64_t{1} << 20;

    void write_bytes(void const* bytes, std::size_t n) {
        file_.write(bytes, n);
        written_ += static_cast<std::int64_t>(n);
    }
    void put(std::string const& words) { write_bytes(words.data(), words.size()); }

    void start_array() {
        offsets_[array_] = written_ - begin_;
        left_ = static_cast<std::int64_t>(header_.bytes()) * arrays_[array_].components;
        if (!compress_) {
            auto const size = static_cast<std::uint64_t>(left_);
            return write_bytes(&size, sizeof size);
        }
        std::int64_t const blocks = (left_ + block - 1) / block;
        table_.assign(static_cast<std::size_t>(blocks) + 3, 0);
        table_[0] = static_cast<std::uint64_t>(blocks);
        table_[1] = static_cast<std::uint64_t>(block);
        table_[2] = static_cast<std::uint64_t>(left_ % block);
        table_at_ = written_;
        done_ = 0;
        write_bytes(table_.data(), table_.size() * 8);
    }

    void end_array() {
        if (!compress_) return;
        pack(true);
        file_.write_at(table_at_, table_.data(), table_.size() * 8);
    }

    std::string head() const {
        std::string const extent = extent_text(header_.dims, lower_);
        bool const little = std::endian::native == std::endian::little;
        std::string result = text(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"",
            little ? "LittleEndian" : "BigEndian", "\" header_type=\"UInt64\"",
            compress_ ? " compressor=\"vtkZLibDataCompressor\"" : "", ">\n  <ImageData WholeExtent=\"", extent, "\" ",
            place_text(header_.geometry, origin_.value_or(header_.geometry.origin)), ">\n", kept_text(header_),
            "    <Piece Extent=\"", extent, "\">\n      <PointData Scalars=\"", arrays_[0].name, "\">\n");
        for (std::size_t i = 0; i < arrays_.size(); ++i) {
            // Known at the end: the header's length must not depend on it.
            std::string const offset = to_text(offsets_[i]);
            result += text("        <DataArray type=\"", vtk_type(header_.dtype), "\" Name=\"", arrays_[i].name, "\"",
                           arrays_[i].components > 1 ? text(" NumberOfComponents=\"", arrays_[i].components, "\"") : "",
                           " format=\"appended\" offset=\"", offset, "\"",
                           i > 0 ? std::string(20 - offset.size(), ' ') : "", "/>\n");
        }
        return result + "      </PointData>\n    </Piece>\n  </ImageData>\n  <AppendedData encoding=\"raw\">\n   _";
    }

    /// Compresses whole blocks, or all that is held.
    void pack(bool all) {
        std::int64_t const blocks = all ? (std::ssize(held_) + block - 1) / block : std::ssize(held_) / block;
        std::vector<std::vector<Bytef>> packed(static_cast<std::size_t>(blocks));
        std::vector<int> failed(static_cast<std::size_t>(blocks), Z_OK);
#pragma omp parallel for num_threads(threads_) schedule(dynamic)
        for (std::int64_t i = 0; i < blocks; ++i) {
            auto const k = static_cast<std::size_t>(i);
            auto const n = static_cast<uLong>(std::min(block, std::ssize(held_) - i * block));
            uLongf size = compressBound(n);
            packed[k].resize(size);
            failed[k] =
                compress2(packed[k].data(), &size, reinterpret_cast<Bytef const*>(held_.data() + i * block), n, 5);
            packed[k].resize(size);
        }
        for (std::size_t i = 0; i < packed.size(); ++i) {
            if (failed[i] != Z_OK) throw Error(ErrorKind::resources, "no memory for deflate");
            table_[3 + done_++] = packed[i].size();
            write_bytes(packed[i].data(), packed[i].size());
        }
        held_.erase(held_.begin(), held_.begin() + std::min(blocks * block, std::ssize(held_)));
    }

    std::int64_t lower_;
    std::optional<Vec3> origin_;
    OutputFile file_;
    bool compress_;
    int threads_;
    Header header_;
    std::vector<WrittenArray> arrays_;
    std::vector<std::int64_t> offsets_; ///< where arrays begin, behind begin_
    std::int64_t written_ = 0, begin_ = 0, table_at_ = 0;
    std::size_t array_ = 0;
    std::int64_t left_ = 0; ///< bytes of this array to come
    std::vector<std::uint64_t> table_;
    std::size_t done_ = 0;
    std::vector<std::byte> held_;
};

void refuse_type(Header const& header) {
    if (vtk_type(header.dtype) == nullptr)
        throw Error(ErrorKind::usage, text(".vti files cannot hold ", header.dtype),
                    "convert first: vkt convert --dtype float32");
}

/// One volume is written as it comes. Of several, which are channels of one, each goes to a file without a name first,
/// since how many arrays there are stands at the file's beginning: numbered ones become the components of one array,
/// others an array each.
class VtiVolumesWriter : public VolumeWriter {
public:
    VtiVolumesWriter(std::string path, WriteOptions const& options) : path_(std::move(path)), options_(options) {
        parts_.push_back(std::make_unique<VtiWriter>(path_, options_));
    }

    void begin(Header const& header) override {
        refuse_bricks(header, ".vti files");
        refuse_type(header);
        series_.add(header);
        if (series_.volumes() == 1) {
            tell_private_values(options_, header, "VTI");
        } else {
            std::vector<SeriesAxis> const axes = series_.axes();
            if (axes.size() > 1 || axes.front().time)
                throw Error(ErrorKind::usage, "a .vti file holds channels, no times",
                            "write one file for each time: name it like out_%04d.vti");
            if (parts_.front()->file().in_place())
                throw Error(ErrorKind::usage,
                            ".vti on a pipe cannot hold several volumes, since their number comes first",
                            "write a file");
            WriteOptions plain = options_;
            plain.compress = false; // it is read again
            parts_.push_back(std::make_unique<VtiWriter>(path_, plain));
        }
        parts_.back()->begin(header);
    }
    void write(std::byte const* voxels, std::size_t n) override { parts_.back()->write(voxels, n); }
    void end() override { parts_.back()->end(); }

    void close() override {
        if (series_.volumes() == 0) throw Error(ErrorKind::data, "there is no volume to write");
        if (parts_.size() == 1) return parts_.front()->close();
        series_.finish();
        if (!series_.differing().empty() && options_.notice)
            options_.notice(text("one .vti file does not hold attributes that differ between its volumes (",
                                 join(series_.differing(), ", "), "): not kept"));
        put_together();
    }

private:
    void put_together() {
        Header const& header = series_.header();
        SeriesAxis const channels = series_.axes().front();
        bool numbered = true;
        for (std::int64_t i = 0; i < channels.size(); ++i)
            numbered = numbered && channels.places[static_cast<std::size_t>(i)] == to_text(i);
        std::vector<WrittenArray> arrays;
        if (numbered)
            arrays.push_back({array_name(header), channels.size()});
        else
            for (std::string const& name : channels_of(channels)) arrays.push_back({xml_escaped(name)});
        std::vector<std::unique_ptr<Source>> sources;
        for (auto const& part : parts_) sources.push_back(written(part->file()));
        VtiWriter whole(path_, options_);
        whole.begin(header, std::move(arrays));
        std::size_t const n = numbered ? sources.size() : 1;
        for (std::size_t first = 0; first < sources.size(); first += n)
            interleave(std::span(sources).subspan(first, n), header, whole);
        whole.end();
        parts_.clear();
        whole.close();
    }

    std::unique_ptr<Source> written(OutputFile const& file) const {
        int const descriptor = ::fcntl(file.descriptor(), F_DUPFD_CLOEXEC, 3);
        if (descriptor < 0) throw Error(ErrorKind::resources, "too many channels: no more files can be open");
        ::lseek(descriptor, 0, SEEK_SET);
        auto source = open_vti(std::make_unique<ByteSource>(descriptor, path_), ReadOptions{});
        source->next_volume();
        return source;
    }

    /// Row by row, the voxels of all sources side by side.
    static void interleave(std::span<std::unique_ptr<Source>> sources, Header const& header, VtiWriter& to) {
        std::size_t const size = size_of(header.dtype), row = static_cast<std::size_t>(header.dims.x) * size,
                          n = sources.size();
        std::vector<std::byte> one(row), all(row * n);
        for (std::int64_t z = 0; z < header.dims.z; ++z)
            for (std::int64_t y = 0; y < header.dims.y; ++y) {
                Box const box{{0, y, z}, {header.dims.x, y + 1, z + 1}};
                for (std::size_t i = 0; i < n; ++i) {
                    sources[i]->read(dense_view(one.data(), header.dtype, box));
                    for (std::size_t x = 0; x * size < row; ++x)
                        std::memcpy(all.data() + (x * n + i) * size, one.data() + x * size, size);
                }
                to.write(all.data(), all.size());
            }
    }

    std::string path_;
    WriteOptions options_;
    SeriesAxes series_{".vti file", ".vti"};
    std::vector<std::unique_ptr<VtiWriter>> parts_;
};

/// Pieces of some slices each, which share a slice with the next as VTK's do, in a folder NAME beside NAME.pvti.
class PvtiWriter : public VolumeWriter {
public:
    PvtiWriter(std::string const& path, WriteOptions const& options)
        : options_(options), file_(path, options.force), folder_(folder_beside(file_.target(), ".pvti")) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': images in parts cannot go to a pipe"), "write .vti");
        directory_.emplace(folder_, options.force, holds_only_vti, "pieces of VTK images");
        options_.force = false;
    }

    void begin(Header const& header) override {
        refuse_bricks_and_series(header, begun_, ".pvti files", "a .pvti file", ".pvti");
        refuse_type(header);
        tell_private_values(options_, header, "VTI");
        header_ = in_utf8(header);
        slice_ = static_cast<std::int64_t>(header_.bytes()) / header_.dims.z;
        std::int64_t const n = std::clamp<std::int64_t>(header_.dims.z - 1, 1, most);
        for (std::int64_t i = 0; i < n; ++i) {
            Piece piece;
            piece.first = (header_.dims.z - 1) * i / n;
            piece.end = (header_.dims.z - 1) * (i + 1) / n + 1;
            pieces_.push_back(std::move(piece));
        }
    }

    void write(std::byte const* voxels, std::size_t n) override {
        std::int64_t const begin = written_, end = written_ += static_cast<std::int64_t>(n);
        for (std::int64_t i = 0; i < std::ssize(pieces_); ++i) {
            Piece& piece = pieces_[static_cast<std::size_t>(i)];
            std::int64_t const from = std::max(begin, piece.first * slice_), to = std::min(end, piece.end * slice_);
            if (from >= to) continue;
            if (!piece.writer) open(piece, i);
            piece.writer->write(voxels + (from - begin), static_cast<std::size_t>(to - from));
            if (to < piece.end * slice_) continue;
            piece.writer->end();
            piece.writer->close();
            piece.writer.reset();
        }
    }

    void close() override {
        if (!begun_) throw Error(ErrorKind::data, "there is no volume to write");
        std::string const name = array_name(header_), folder = xml_escaped(name_of(folder_));
        std::string words = text(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PImageData\" version=\"1.0\">\n  <PImageData WholeExtent=\"",
            extent_text(header_.dims, 0), "\" GhostLevel=\"0\" ", place_text(header_.geometry, header_.geometry.origin),
            ">\n", kept_text(header_), "    <PPointData Scalars=\"", name, "\">\n      <PDataArray type=\"",
            vtk_type(header_.dtype), "\" Name=\"", name, "\"/>\n    </PPointData>\n");
        for (std::int64_t i = 0; i < std::ssize(pieces_); ++i) {
            Piece const& p = pieces_[static_cast<std::size_t>(i)];
            Index3 const dims{header_.dims.x, header_.dims.y, p.end - p.first};
            words += text("    <Piece Extent=\"", extent_text(dims, p.first), "\" Source=\"", folder, "/", folder, "_",
                          i, ".vti\"/>\n");
        }
        words += "  </PImageData>\n</VTKFile>\n";
        file_.write(words.data(), words.size());
        // What names the pieces appears after them.
        directory_->commit();
        file_.commit();
    }

private:
    static constexpr std::int64_t most = 8;
    struct Piece {
        std::int64_t first = 0, end = 0; ///< slices
        std::unique_ptr<VtiWriter> writer;
    };

    static std::string name_of(std::string const& path) { return std::filesystem::path(path).filename().string(); }
    void open(Piece& piece, std::int64_t i) {
        Header part = header_;
        part.dims.z = piece.end - piece.first;
        part.geometry.origin = index_to_world(header_.geometry, {0, 0, static_cast<double>(piece.first)});
        piece.writer = std::make_unique<VtiWriter>(directory_->file(text(name_of(folder_), "_", i, ".vti")), options_,
                                                   piece.first, header_.geometry.origin);
        piece.writer->begin(part);
    }

    WriteOptions options_;
    OutputFile file_;
    std::string folder_;
    std::optional<OutputDirectory> directory_;
    Header header_;
    bool begun_ = false;
    std::int64_t slice_ = 0, written_ = 0; ///< bytes
    std::vector<Piece> pieces_;
};

} // namespace

std::string xml_escaped(std::string const& words) {
    std::string result;
    for (char const c : words) {
        if (c == '&')
            result += "&amp;";
        else if (c == '<')
            result += "&lt;";
        else if (c == '>')
            result += "&gt;";
        else if (c == '"')
            result += "&quot;";
        else if (static_cast<unsigned char>(c) < ' ')
            result += ' ';
        else
            result += c;
    }
    return result;
}

std::string folder_beside(std::string const& file, std::string const& extension) {
    return lower_case(file).ends_with(extension) ? file.substr(0, file.size() - extension.size()) : file + ".pieces";
}

bool holds_only_vti(std::string const& folder) {
    std::error_code error;
    for (auto const& entry : std::filesystem::directory_iterator(folder, error))
        if (!entry.is_regular_file(error) || entry.path().extension() != ".vti") return false;
    return !error;
}

std::unique_ptr<VolumeWriter> vti_writer(std::string const& path, WriteOptions const& options) {
    return std::make_unique<VtiVolumesWriter>(path, options);
}

std::unique_ptr<Sink> create_vti(std::string const& path, WriteOptions const& options) {
    if (lower_case(path).ends_with(".pvti")) return slab_sink(std::make_unique<PvtiWriter>(path, options));
    return slab_sink(vti_writer(path, options));
}

} // namespace vkt
