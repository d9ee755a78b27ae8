// NumPy's .npz: arrays in a ZIP file (https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT), stored or deflated.
// SPDX-License-Identifier: MIT
#include "libvkt/core/collect.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/choices.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/numpy.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/series_axes.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/zip_archive.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>

#include <zlib.h>

namespace vkt {
namespace {

using namespace zip;

constexpr std::string_view suffix = ".npy";

ZipMember const& named(std::vector<ZipMember> const& arrays, std::string const& variable, std::string const& file) {
    auto const names = collect(arrays, [](ZipMember const& m) { return m.name; });
    auto const found = std::find(names.begin(), names.end(), variable);
    if (found != names.end()) return arrays[static_cast<std::size_t>(found - names.begin())];
    std::string const near = nearest_name(variable, names);
    throw Error(ErrorKind::usage, text("'", file, "' holds no array '", variable, "', but ", join(names, ", ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

/// The first member's name tells arrays from documents and programs, which are ZIP files too.
bool is_npz(std::span<std::byte const> head) { return zip_first_name(head).ends_with(suffix); }

/// Its arrays, without ".npy" behind their names.
std::vector<ZipMember> arrays_of(ByteSource const& bytes) {
    std::vector<ZipMember> arrays = zip_members(bytes);
    std::erase_if(arrays, [](ZipMember const& m) { return !m.name.ends_with(suffix); });
    for (ZipMember& m : arrays) m.name.resize(m.name.size() - suffix.size());
    return arrays;
}

/// What was deflated, in order. `bytes` outlives it.
std::unique_ptr<ByteSource> inflated_bytes(std::shared_ptr<ByteSource const> bytes, ZipMember const& member) {
    std::string const name = bytes->name();
    std::int64_t const at = zip_begin(*bytes, member);
    auto const inflated = std::make_shared<Inflated>(std::move(bytes), at, member);
    return std::make_unique<ByteSource>(name,
                                        [inflated](std::byte* to, std::size_t n) { return inflated->read(to, n); });
}

/// The header of an array alone.
RawLayout layout_of(ByteSource& bytes, ZipMember const& member) {
    if (member.method == deflated) return read_numpy_header(*inflated_bytes({std::shared_ptr<void>(), &bytes}, member));
    bytes.seek(zip_begin(bytes, member));
    return read_numpy_header(bytes);
}

std::unique_ptr<Source> open_array(std::unique_ptr<ByteSource> bytes, ZipMember const& member,
                                   std::string const& file) {
    std::int64_t const at = zip_begin(*bytes, member);
    if (member.method == deflated)
        bytes = inflated_bytes(std::move(bytes), member);
    else
        bytes->seek(at);
    RawLayout layout = read_numpy_header(*bytes);
    layout.header.attributes["variable"] = member.name;
    std::int64_t const header = bytes->position() - (member.method == stored ? at : 0);
    check(layout.header);
    // Each factor is below 2^62; their product need not be.
    auto const room = static_cast<std::int64_t>(std::min<std::uint64_t>(member.bytes, std::uint64_t{1} << 62)) - header;
    if (layout.volumes > room / layout.components.count / static_cast<std::int64_t>(layout.header.bytes()))
        throw Error(ErrorKind::data, text("'", file, "': the array '", member.name, "' ended early: ", room,
                                          " bytes cannot hold its voxels"));
    return raw_source(std::move(bytes), std::move(layout));
}

/// Of several arrays without a name: the only one that can be a volume. Lists of numbers count only where there is
/// nothing else.
std::unique_ptr<Source> open_without_name(std::unique_ptr<ByteSource> bytes, std::vector<ZipMember> const& arrays,
                                          std::string const& file) {
    struct Readable {
        ZipMember const* member;
        std::string about;
        bool image;
    };
    std::vector<Readable> all;
    Choices choices;
    std::optional<Error> first;
    for (ZipMember const& member : arrays) try {
            RawLayout const layout = layout_of(*bytes, member);
            Index3 const dims = layout.header.dims;
            std::vector<std::int64_t> extents{dims.x, dims.y, dims.z};
            if (layout.volumes > 1) extents.push_back(layout.volumes);
            bool const image = std::count_if(extents.begin(), extents.end(), [](std::int64_t n) { return n > 1; }) > 1;
            all.push_back({&member, about_array(layout.header.dtype, extents), image});
        } catch (Error const& error) {
            if (!first) first = error;
            choices.not_read.push_back(text("array '", member.name, "'"));
        }
    if (all.empty()) throw Error(*first);
    if (std::any_of(all.begin(), all.end(), [](Readable const& r) { return r.image; }))
        std::erase_if(all, [](Readable const& r) { return !r.image; });
    std::unique_ptr<Source> source = open_array(std::move(bytes), *all.front().member, file);
    if (all.size() == 1) return beside_others(std::move(source), std::move(choices.not_read));
    std::vector<std::string> names;
    for (Readable const& r : all) {
        names.push_back(r.member->name);
        choices.names.emplace_back(r.member->name, r.about);
    }
    return unchosen(std::move(source), std::move(choices),
                    Error(ErrorKind::usage, text("'", file, "' holds several arrays: ", join(names, ", ")),
                          text("name one: ", file, ":", names.front())));
}

std::unique_ptr<Source> open_npz(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    bytes = seekable_bytes(std::move(bytes));
    FilePart const part = file_part(bytes->name());
    if (!part.part.empty() && !options.variable.empty())
        throw Error(ErrorKind::usage, text("'", bytes->name(), "' names an array, and --variable another one"));
    std::vector<ZipMember> const arrays = arrays_of(*bytes);
    if (arrays.empty()) throw Error(ErrorKind::data, text("'", part.file, "' holds no array"));
    std::string const wanted = part.part.empty() ? options.variable : part.part;
    if (wanted.empty() && arrays.size() > 1) return open_without_name(std::move(bytes), arrays, part.file);
    return open_array(std::move(bytes), wanted.empty() ? arrays.front() : named(arrays, wanted, part.file), part.file);
}

/// One array, as numpy.savez writes it: sizes in 64 bits. With force and a name, others that are there stay.
class NpzWriter : public VolumeWriter {
public:
    NpzWriter(std::string const& path, WriteOptions const& options)
        : options_(options), name_(part_to_write(path, "array", "name")), file_(file_part(path).file, options.force),
          zip_(file_) {
        if (file_.in_place())
            throw Error(ErrorKind::usage, text("'", path, "': NumPy archives cannot be written to a pipe"),
                        "write .npy, or name a file: -o out.npz");
        keeps_others_ = options.force && !name_.empty();
        if (name_.empty()) name_ = "arr_0";
        name_ += suffix;
        if (constexpr std::size_t longest = 65535; name_.size() > longest)
            throw Error(ErrorKind::usage,
                        text("a name of ", name_.size(), " bytes: archives hold names of at most ", longest),
                        "say a shorter one");
    }

    void begin(Header const& header) override {
        refuse_bricks(header, "NumPy");
        if (volumes_ > 0) check_lattice(first_, header, "array", "write one file each: name it like out_%04d.npz");
        file_.expect(options_.compress ? least_deflated(header.bytes()) : header.bytes());
        if (volumes_++ > 0) return;
        first_ = in_utf8(header);
        if (keeps_others_) copy_others();
        begin_ = zip_.begin(name_, options_.compress ? deflated : stored);
        std::string const head = array_header();
        header_length_ = head.size();
        if (options_.compress) {
            deflate_.emplace(file_, DeflateWriter::Wrapper::none, options_, begin_);
            deflate_->store(head);
        } else {
            file_.write(head.data(), head.size());
        }
    }
    void write(std::byte const* voxels, std::size_t n) override {
        bytes_ += n;
        if (deflate_) return deflate_->write(voxels, n);
        checksum_ = crc32_z(checksum_, reinterpret_cast<Bytef const*>(voxels), n);
        file_.write(voxels, n);
    }
    void close() override {
        if (volumes_ == 0) throw Error(ErrorKind::data, "there is no volume to write");
        std::string const head = array_header();
        std::uint64_t packed = bytes_ += head.size();
        if (deflate_) {
            if (volumes_ > 1) deflate_->restore(head);
            deflate_->finish();
            packed = static_cast<std::uint64_t>(deflate_->bytes_written());
            checksum_ = deflate_->checksum();
        } else {
            unsigned long const first = crc32_z(0, reinterpret_cast<Bytef const*>(head.data()), head.size());
            checksum_ = crc32_combine(first, checksum_, static_cast<z_off_t>(bytes_ - head.size()));
        }
        zip_.end(bytes_, packed, checksum_);
        if (!deflate_ && volumes_ > 1) file_.write_at(begin_, head.data(), head.size());
        zip_.finish();
        file_.commit();
    }

private:
    std::string array_header() const { return numpy_bytes({first_, volumes_, -1, no_file_, header_length_, false}); }

    /// Of the archive that is there, all but what has this array's name.
    void copy_others() {
        std::error_code failed;
        if (!std::filesystem::exists(file_.target(), failed)) return;
        auto const archive = open_bytes(file_.target());
        if (archive->size() > 0) file_.expect(static_cast<std::size_t>(archive->size()));
        try {
            for (ZipMember const& member : zip_members(*archive))
                if (member.name != name_) zip_.copy(*archive, member);
        } catch (Error const& e) {
            if (e.kind() != ErrorKind::data) throw;
            throw Error(ErrorKind::data, text(e.what(), ": what else the archive holds cannot be kept"),
                        text("to replace all of it, name no array: -o ", shell_quoted(file_.path()), " --force"));
        }
    }

    WriteOptions options_;
    std::string name_, no_file_;
    OutputFile file_;
    ZipWriter zip_;
    bool keeps_others_ = false;
    std::int64_t begin_ = 0; ///< of the array in the file
    Header first_;
    std::int64_t volumes_ = 0;
    std::size_t header_length_ = 0;
    std::uint64_t bytes_ = 0; ///< of the array
    unsigned long checksum_ = 0;
    std::optional<DeflateWriter> deflate_;
};

std::unique_ptr<Sink> create_npz(std::string const& path, WriteOptions const& options) {
    return slab_sink(std::make_unique<NpzWriter>(path, options));
}

} // namespace

Format npz_format() {
    return {"npz", "NumPy arrays in a ZIP file: FILE.npz:NAME", {".npz"}, is_npz, open_npz, create_npz};
}

} // namespace vkt
