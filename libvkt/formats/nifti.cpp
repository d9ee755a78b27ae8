// NIfTI files: .nii, .nii.gz, and pairs of .hdr and .img. Parsed here and not by a library, since regions shall be read
// where they lie, streams in order, and damaged headers refused: all of which voxels behind a header have already.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/all_formats.h"
#include "libvkt/formats/analyze.h"
#include "libvkt/formats/header_and_voxels.h"
#include "libvkt/formats/nifti_header.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/formats/wrapper.h"

#include <filesystem>
#include <utility>

namespace vkt {

namespace {

/// Who names the voxels of a pair means both.
std::unique_ptr<ByteSource> header_beside(std::unique_ptr<ByteSource> bytes) {
    std::string const lower = lower_case(bytes->name());
    std::size_t const end = lower.ends_with(".img.gz") ? 7 : lower.ends_with(".img") ? 4 : 0;
    if (end == 0 || is_nifti(bytes->peek(352)) || is_analyze(bytes->peek(analyze_size))) return bytes;
    std::string const header = bytes->name().substr(0, bytes->name().size() - end) + ".hdr", packed = header + ".gz";
    std::error_code error;
    if (std::filesystem::exists(header, error) || !std::filesystem::exists(packed, error)) return open_bytes(header);
    return unwrapped(open_bytes(packed), Wrapper::gzip);
}

std::unique_ptr<Source> open_nifti(std::unique_ptr<ByteSource> bytes, ReadOptions const& options) {
    bytes = header_beside(std::move(bytes));
    RawLayout layout = is_analyze(bytes->peek(analyze_size))
                           ? read_analyze(*bytes, options.trust_paths)
                           : nifti_layout(read_nifti_header(*bytes), options.trust_paths);
    return raw_source(std::move(bytes), std::move(layout));
}

std::unique_ptr<Sink> create_nifti(std::string const& path, WriteOptions const& options) {
    if (lower_case(path).ends_with(".img"))
        throw Error(ErrorKind::usage, "a NIfTI pair is written by the name of its header",
                    text("write ", path.substr(0, path.size() - 4), ".hdr"));
    HeaderFormat format{"NIfTI", ".nii",          ".hdr",     ".img", "", DeflateWriter::Wrapper::gzip,
                        false,   nifti_type_name, nifti_bytes};
    return slab_sink(std::make_unique<HeaderAndVoxelsWriter>(std::move(format), path, options));
}

} // namespace

Format nifti_format() {
    return {"nifti",
            "NIfTI-1 and NIfTI-2, one file or a pair",
            {".nii", ".hdr", ".img"},
            is_nifti,
            open_nifti,
            create_nifti,
            true};
}

} // namespace vkt
