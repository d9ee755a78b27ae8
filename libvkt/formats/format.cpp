// Which format a file has, and which one it shall get.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/format.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/amrex.h"
#include "libvkt/formats/analyze.h"
#include "libvkt/formats/dicom.h"
#include "libvkt/formats/foreign.h"
#include "libvkt/formats/hdf5.h"
#include "libvkt/formats/metaimage_header.h"
#include "libvkt/formats/nifti_header.h"
#include "libvkt/formats/nrrd_header.h"
#include "libvkt/formats/parsed_grids.h"
#include "libvkt/formats/refusals.h"
#include "libvkt/formats/stream_reader.h"
#include "libvkt/formats/whole_of.h"
#include "libvkt/formats/wrapper.h"
#include "libvkt/formats/zarr_array.h"
#include "libvkt/io/shared_memory.h"

#include <filesystem>
#include <utility>

namespace vkt {

namespace {

constexpr std::size_t head_bytes = 4096;
/// What a compressed file must be looked at to know that much: Zstandard and bzip2 decode whole blocks.
constexpr std::size_t packed_head_bytes = std::size_t{1} << 20;

/// A volume is one file, which may be compressed as a whole.
bool is_one_file(Format const& format) {
    return format.name != "amrex" && format.name != "shm" && format.name != "zarr";
}

/// Names lead to what lies in a file: FILE:/GROUP/DATASET, FILE.npz:NAME.
bool holds_parts(Format const& format) {
    return format.name == "hdf5" || format.name == "npz" || format.name == "zarr";
}

Format const& by_format_name(std::string const& name) {
    std::vector<std::string> names;
    std::string near;
    for (auto const& format : formats()) {
        if (format.name == lower_case(name)) return format;
        names.push_back(format.name);
        auto const& ends = format.extensions;
        if (std::find(ends.begin(), ends.end(), "." + lower_case(name)) != ends.end()) near = format.name;
    }
    if (near.empty()) near = nearest_name(lower_case(name), names);
    throw Error(ErrorKind::usage, text("'", name, "' is not a format; known are ", join(names, " ")),
                near.empty() ? "" : text("did you mean '", near, "'?"));
}

/// The format with the longest extension that `name` ends in.
Format const* by_name(std::string const& name) {
    std::string const lower = lower_case(file_part(name).file);
    Format const* best = nullptr;
    std::size_t longest = 0;
    if (is_segment(name)) return &by_format_name("shm");
    if (is_plotfile_name(name)) return &by_format_name("amrex");
    for (auto const& format : formats())
        for (auto const& extension : format.extensions)
            if (lower.size() > extension.size() && lower.ends_with(extension) && extension.size() > longest) {
                best = &format;
                longest = extension.size();
            }
    // A folder of slices, but not where the name of what lies in a file is left out.
    if (name.ends_with('/') && !lower.ends_with(".zarr/") && !(best != nullptr && holds_parts(*best)))
        return &by_format_name("dicom");
    if (best == nullptr && wrapper_of_name(name) != Wrapper::none)
        if (Format const* const inner = by_name(without_wrapper(name)); inner != nullptr && is_one_file(*inner))
            return inner;
    return best;
}

/// Says of bare voxels what else is lost.
class BareVoxels : public Sink {
public:
    BareVoxels(std::unique_ptr<Sink> sink, WriteOptions options, Format const& format)
        : sink_(std::move(sink)), options_(std::move(options)), what_(format.name + " files") {
        kept_.history = format.name == "png" || format.name == "exr";
    }

    void begin(Header const& header) override {
        sink_->begin(header);
        if (!std::exchange(told_, true)) tell_losses(options_, header, what_, kept_);
    }
    AnyView acquire(Box const& slab) override { return sink_->acquire(slab); }
    void commit() override { sink_->commit(); }
    bool pass_on(Box const& slab, std::shared_ptr<Lease> const& lease) override { return sink_->pass_on(slab, lease); }
    void end() override { sink_->end(); }
    void close() override { sink_->close(); }
    void put_bricks(BrickSequence bricks) override { sink_->put_bricks(std::move(bricks)); }
    std::int64_t natural_slab() const override { return sink_->natural_slab(); }
    Space space() const override { return sink_->space(); }
    void fail(std::string const& stage, std::string const& message) override { sink_->fail(stage, message); }

private:
    std::unique_ptr<Sink> sink_;
    WriteOptions options_;
    std::string what_;
    Kept kept_ = nothing_kept;
    bool told_ = false;
};

bool holds_bare_voxels(Format const& format) {
    return format.slices || format.name == "raw" || format.name == "numpy" || format.name == "npz";
}

bool is_detached_name(std::string const& name) {
    std::string const lower = lower_case(name);
    return lower.ends_with(".nhdr") || lower.ends_with(".mhd") || lower.ends_with(".hdr") || lower.ends_with(".img");
}

/// What a file is compressed with as a whole, and the format does not see to itself. Bare voxels begin with anything:
/// of them only names tell.
Wrapper wrapper_around(ByteSource& bytes, Format const& format) {
    if (!is_one_file(format) || bytes.directory()) return Wrapper::none;
    if (format.name != "raw") return wrapper_of(bytes.peek(16));
    Wrapper const named = wrapper_of_name(bytes.name());
    return named == Wrapper::gzip ? Wrapper::none : named;
}

/// The user describes bare voxels; that beats what the bytes look like.
bool describes_raw(ReadOptions const& options) {
    return options.dims || options.dtype || options.skip != 0 || options.big_endian.has_value();
}

std::string writable_extensions() {
    std::vector<std::string> all;
    for (auto const& format : formats())
        if (format.create) all.insert(all.end(), format.extensions.begin(), format.extensions.end());
    std::sort(all.begin(), all.end()); // some share one
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return join(all, " ");
}

[[noreturn]] void refuse_part(std::string const& name, std::string const& whole) {
    throw Error(ErrorKind::data, text("'", name, "' is a part of '", whole, "'"),
                text("name that: ", shell_quoted(whole)));
}

/// Options that describe bare voxels, of a file that says itself what it holds.
void refuse_description(std::string const& name, std::span<std::byte const> head) {
    for (auto const& format : formats())
        if (format.open && format.recognise && format.name != "raw" && format.recognise(head))
            throw Error(ErrorKind::usage, text("'", name, "' is ", format.name, ", which says itself what it holds"),
                        "leave out --dtype, --skip and --endian; with --dims they describe it as bare voxels");
}

Format const& format_of(ByteSource& bytes, ReadOptions const& options) {
    if (bytes.directory() && options.format.empty()) {
        if (is_amrex(bytes.name())) return by_format_name("amrex");
        if (zarr::is_zarr(file_part(bytes.name()).file)) return by_format_name("zarr");
        if (is_dicom_folder(bytes.name())) return by_format_name("dicom");
        if (std::string const whole = whole_of(bytes.name()); !whole.empty()) refuse_part(bytes.name(), whole);
        std::string const within = dicom_folder_within(bytes.name());
        throw Error(ErrorKind::io,
                    text("cannot read '", bytes.name(),
                         "': it is a directory, and holds neither DICOM files nor slices (.png .tif .tiff)"),
                    within.empty() ? text("name a file in it, or several: '", bytes.name(), "/*.tif'")
                                   : text("DICOM files lie in a folder within: ", shell_quoted(within)));
    }
    if (bytes.directory() && options.format != "amrex" && options.format != "dicom" && options.format != "zarr")
        throw Error(ErrorKind::io, text("cannot read '", bytes.name(), "': it is a directory"), "name a file in it");
    if (is_segment(bytes.name())) {
        if (describes_raw(options) || (!options.format.empty() && options.format != "shm"))
            throw Error(ErrorKind::usage, text("'", bytes.name(), "' says itself what it holds"),
                        "leave out --format, --dims, --dtype, --skip and --endian");
        return by_format_name("shm");
    }
    if (!options.format.empty()) {
        Format const& format = by_format_name(options.format);
        if (!format.open) throw Error(ErrorKind::usage, text("format ", format.name, " can only be written"));
        if (format.name != "raw" && describes_raw(options))
            throw Error(ErrorKind::usage, text("dims, dtype, skip and endian describe raw files, not ", format.name));
        return format;
    }
    auto head = bytes.peek(head_bytes);
    if (describes_raw(options)) {
        if (!options.dims) refuse_description(bytes.name(), head); // with dims it is what the user says
        return by_format_name("raw");
    }
    std::vector<std::byte> unpacked;
    if (wrapper_of(head) != Wrapper::none) {
        unpacked = unwrapped_head(bytes.peek(packed_head_bytes), head_bytes);
        head = bytes.peek(head_bytes);
        for (auto const& candidate : formats())
            if (is_one_file(candidate) && candidate.recognise && candidate.recognise(unpacked) &&
                candidate.name != "flash")
                return candidate;
    }
    for (auto const& candidate : formats())
        if (candidate.open && candidate.recognise && candidate.recognise(head) &&
            (candidate.name != "flash" || is_flash(bytes)))
            return candidate;
    if (auto const [what, how] = stand_in(head); !what.empty())
        throw Error(ErrorKind::data, text("'", bytes.name(), "' is ", what), std::string(how));
    // A file whose name promises a format that would have been recognised is damaged: its reader says how.
    if (Format const* const named = by_name(bytes.name()); named != nullptr && named->open) return *named;
    if (head.empty()) throw Error(ErrorKind::data, text("'", bytes.name(), "' is empty"));
    if (std::string const whole = whole_of(bytes.name()); !whole.empty()) refuse_part(bytes.name(), whole);
    if (auto const [foreign, how] = foreign_name(bytes.name()); !foreign.empty())
        throw Error(ErrorKind::data, text("'", bytes.name(), "' is ", foreign, ", a format that vkt does not read"),
                    std::string(how));
    std::string what = foreign_format(unpacked);
    bool const packed = wrapper_of(head) != Wrapper::none;
    what = !what.empty() ? text(what, ", compressed as a whole") : packed ? what : foreign_format(head);
    if (!what.empty())
        throw Error(ErrorKind::data, text("'", bytes.name(), "' is ", what, ", a format that vkt does not read"),
                    what.ends_with("archive") ? "unpack it: what is in it may be what vkt reads"
                                              : "other tools turn it into NRRD or MetaImage, which vkt reads");
    throw Error(
        ErrorKind::data, text("'", bytes.name(), packed ? "', unpacked," : "'", " has no format that vkt knows"),
        text("if it is bare voxels, say ", raw_description(bytes.name(), options, "--dims X Y Z --dtype TYPE")));
}

} // namespace

bool ReadOptions::describes() const { return describes_raw(*this) || spacing || !format.empty() || !variable.empty(); }

std::vector<std::string> detached_files(std::string const& path) {
    std::string const lower = lower_case(path);
    std::error_code failed;
    if (!std::filesystem::is_regular_file(path, failed)) return {}; // a pipe can be read only once
    try {
        if (lower.ends_with(".nhdr") || lower.ends_with(".nrrd")) {
            auto const bytes = open_bytes(path);
            return nrrd_layout(read_nrrd_header(*bytes), true).files;
        }
        if (lower.ends_with(".hdr")) {
            auto const bytes = open_bytes(path);
            if (is_analyze(bytes->peek(analyze_size))) return read_analyze(*bytes, true).files;
            return nifti_layout(read_nifti_header(*bytes), true).files;
        }
        if (lower.ends_with(".mhd") || lower.ends_with(".mha")) {
            auto const bytes = open_bytes(path);
            return metaimage_layout(read_metaimage_header(*bytes), true).files;
        }
    } catch (Error const&) { // who reads it will say what is wrong
    }
    return {};
}

std::string format_of_name(std::string const& name) {
    Format const* const format = by_name(name);
    return format == nullptr ? "" : format->name;
}

bool holds_slices(std::string const& name, std::string const& format) {
    Format const* const found = format.empty() ? by_name(name) : &by_format_name(format);
    return found != nullptr && found->slices;
}

std::string format_name(ByteSource& bytes, ReadOptions const& options) { return format_of(bytes, options).name; }

std::vector<Format> const& formats() {
    static std::vector<Format> const list{
        nrrd_format(),  metaimage_format(), raw_format(),   nifti_format(), analyze_format(), mrc_format(),
        numpy_format(), npz_format(),       flash_format(), vdb_format(),   amrex_format(),   segment_format(),
        tiff_format(),  vti_format(),       pvd_format(),   vtk_format(),   zarr_format(),    dicom_format(),
        hdf5_format(),  png_format(),       pgm_format(),   pfm_format(),   exr_format()};
    return list;
}

bool holds_stream(std::unique_ptr<ByteSource>& bytes) {
    if (bytes->directory() || is_segment(bytes->name())) return false;
    if (begins_stream(bytes->peek(stream_magic_bytes))) return true;
    Wrapper const wrapper = wrapper_of(bytes->peek(16));
    if (wrapper == Wrapper::none) return false;
    std::vector<std::byte> const head = unwrapped_head(bytes->peek(packed_head_bytes), stream_magic_bytes);
    // Of a damaged beginning the name tells what it was to be.
    bool const named = head.empty() && lower_case(without_wrapper(bytes->name())).ends_with(".vkt");
    if (!named && !begins_stream(head)) return false;
    bytes = unwrapped(std::move(bytes), wrapper);
    return true;
}

std::unique_ptr<Source> open_volume(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    if (!options.describes() && holds_stream(bytes)) return open_stream(std::move(bytes));
    Format const* format = &format_of(*bytes, options);
    bool const one_only = format->name == "raw" || format->name == "shm" || format->in_gzip; // headers with voxels
    if (!options.variable.empty() && (one_only || (format->slices && !format->planes)))
        throw Error(ErrorKind::usage,
                    text("'", bytes->name(), "': --variable: ", format->name, " files hold one unnamed variable"));
    if (options.spacing && format->name != "raw" && !format->slices)
        throw Error(ErrorKind::usage, text("'", bytes->name(), "' states its spacing"),
                    text("change it afterwards: vkt set --spacing ", options.spacing->x, ",", options.spacing->y, ",",
                         options.spacing->z));
    if (Wrapper const wrapper = wrapper_around(*bytes, *format); wrapper != Wrapper::none) {
        bytes = unwrapped(std::move(bytes), wrapper);
        // Who reads here and there needs a file; only then can be seen whether HDF5 is FLASH.
        if (!format->in_gzip && format->name != "raw") {
            bytes = seekable_bytes(std::move(bytes));
            if (options.format.empty()) format = &format_of(*bytes, options);
        }
    }
    return format->open(std::move(bytes), options);
}

std::unique_ptr<Sink> create_volume(std::string const& path, WriteOptions const& options) {
    Format const* const format = options.format.empty() ? by_name(path) : &by_format_name(options.format);
    if (format != nullptr && holds_bare_voxels(*format) && (options.notice || options.remark)) {
        WriteOptions own = options, tell = options;
        own.notice = own.remark = nullptr;
        if (format->slices) tell.notice = tell.remark;
        return std::make_unique<BareVoxels>(create_volume(path, own), tell, *format);
    }
    if (!format)
        throw Error(ErrorKind::usage, text("cannot tell the format of '", path, "' from its name"),
                    names_foreign_picture(path) ? std::string("pictures are written as .png, .pgm, .pfm and .exr")
                                                : text("use one of ", writable_extensions(),
                                                       "; vkt write and vkt convert take others with --format"));
    if (is_segment(path) && format->name != "shm")
        throw Error(ErrorKind::usage, text("--format ", format->name, ": '", path, "' is shared memory and no file"),
                    text("a file of that name is ./", path));
    if (!format->create) throw Error(ErrorKind::usage, text("format ", format->name, " can only be read"));
    Wrapper const wrapper = path == "-" || !is_one_file(*format) ? Wrapper::none : wrapper_of_name(path);
    if (std::string const name = lower_case(without_wrapper(path));
        wrapper != Wrapper::none && (name.ends_with(".pvti") || name.ends_with(".pvd")))
        throw Error(
            ErrorKind::usage,
            text("'", path, "': ", name.ends_with(".pvd") ? "a collection" : "an image in parts", " is several files"),
            "write .vti, or --compress");
    // Those that are written in order see to gzip themselves, without a temporary file.
    if (wrapper == Wrapper::none || (wrapper == Wrapper::gzip && (format->in_gzip || format->name == "raw")))
        return format->create(path, options);
    if (std::string const name = without_wrapper(path); is_detached_name(name))
        throw Error(ErrorKind::usage, text("'", path, "': a header with its voxels in another file is not compressed"),
                    text("write one file: NAME", format->extensions.front(), path.substr(name.size())));
    return wrapping_sink(path, wrapper, options, [format, options](std::string const& inner) {
        WriteOptions own = options;
        own.force = false;
        own.one_file = true;
        own.files = 1; // the others will not be there as this one is before it is compressed
        return format->create(inner, own);
    });
}

} // namespace vkt
