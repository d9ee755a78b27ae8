// Signatures of files that other tools make.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/foreign.h"

#include "libvkt/core/text.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace vkt {
namespace {

using namespace std::string_view_literals;

struct Signature {
    std::size_t at;
    std::string_view bytes;
    std::string_view what;
};

constexpr Signature signatures[] = {
    {128, "DICM"sv, "a DICOM file"},
    {0, "II*\0"sv, "a TIFF file"},
    {0, "MM\0*"sv, "a TIFF file"},
    {0, "II+\0"sv, "a BigTIFF file"},
    {0, "MM\0+"sv, "a BigTIFF file"},
    {0, "# vtk DataFile"sv, "a VTK legacy file"},
    {0, "\xff\xd8\xff"sv, "a JPEG picture"},
    {0, "GIF8"sv, "a GIF picture"},
    {8, "WEBP"sv, "a WebP picture"},
    {0, "\0\0\0\x0cjP  \r\n\x87\n"sv, "a JPEG 2000 picture"},
    {0, "\xff\x4f\xff\x51\0"sv, "a JPEG 2000 picture"},
    {0, "v/1\x01"sv, "an OpenEXR picture"},
    {0, "PF\n"sv, "a PFM picture"},
    {0, "Pf\n"sv, "a PFM picture"},
    {0, "\x89HDF\r\n\x1a\n"sv, "an HDF5 file"},
    {0, "CDF\x01"sv, "a NetCDF file of version 3"},
    {0, "CDF\x02"sv, "a NetCDF file of version 3"},
    {0, "CDF\x05"sv, "a NetCDF file of version 3"},
    {0, "MATLAB 5.0 MAT-file"sv, "a MATLAB file before 7.3"},
    {0, "SIMPLE  ="sv, "a FITS file"},
    {0, "\x0e\x03\x13\x01"sv, "an HDF4 file"},
    {0, "NanoVDB"sv, "a NanoVDB file"},
    {0, "# AmiraMesh"sv, "an Amira mesh"},
    {0, "# Avizo"sv, "an Amira mesh"},
    {0, "ZISRAWFILE"sv, "a Zeiss image"},
    {0, "\xda\xce\xbe\x0a"sv, "a Nikon image"},
    {0, "ply\n"sv, "a mesh (PLY)"},
    {0, "ply\r\n"sv, "a mesh (PLY)"},
    {0, "8BPS"sv, "a Photoshop picture"},
    {0, "PK\x03\x04"sv, "a ZIP archive"},
    {257, "ustar"sv, "a tar archive"},
    {0, "7z\xbc\xaf\x27\x1c"sv, "a 7-Zip archive"},
    {0, "Rar!\x1a\x07"sv, "a RAR archive"},
    {0, "\x04\x22\x4d\x18"sv, "an LZ4 file"},
    {0, "BZh"sv, "a bzip2 file"},
    {0, "\x28\xb5\x2f\xfd"sv, "a Zstandard file"},
    {0,
     "\xfd"
     "7zXZ\0"sv,
     "an xz file"},
    {0, "%PDF"sv, "a PDF document"},
    {0,
     "\x7f"
     "ELF"sv,
     "a program"},
};

struct Ending {
    std::string_view end;
    ForeignName name;
};

constexpr ForeignName freesurfer{"a FreeSurfer volume", "make NIfTI of it: mri_convert in.mgz out.nii.gz"};
constexpr ForeignName afni{"a part of an AFNI dataset", "make NIfTI of it: 3dAFNItoNIFTI -prefix out.nii.gz in+orig"};
constexpr ForeignName philips{"a Philips PAR/REC pair", "make NIfTI of it: dcm2niix in.PAR"};
constexpr std::string_view bioformats = "make OME-Zarr of it: bioformats2raw in out.zarr";
constexpr Ending endings[] = {
    {".mgz", freesurfer},
    {".mgh", freesurfer},
    {".mnc", {"a MINC volume", "make NIfTI of it: mnc2nii in.mnc out.nii"}},
    {".mif", {"an MRtrix image", "make NIfTI of it: mrconvert in.mif out.nii.gz"}},
    {".head", afni},
    {".brik", afni},
    {".par", philips},
    {".rec", philips},
    {".gipl", {"a GIPL volume", "make NIfTI of it: c3d in.gipl -o out.nii.gz"}},
    {".am", {"an Amira mesh", "in Amira or Avizo: save it as NRRD"}},
    {".czi", {"a Zeiss image", bioformats}},
    {".lif", {"a Leica image", bioformats}},
    {".nd2", {"a Nikon image", bioformats}},
    {".oib", {"an Olympus image", bioformats}},
    {".oir", {"an Olympus image", bioformats}},
    {".vsi", {"an Olympus image", bioformats}},
    {".dm3", {"a DigitalMicrograph image", "make MRC of it: dm2mrc in.dm3 out.mrc"}},
    {".dm4", {"a DigitalMicrograph image", "make MRC of it: dm2mrc in.dm4 out.mrc"}},
    {".vtr", {"a VTK XML file of a rectilinear grid", "in ParaView: Resample To Image, saved as .vti"}},
    {".vts", {"a VTK XML file of a structured grid", "in ParaView: Resample To Image, saved as .vti"}},
    {".vtu", {"a VTK XML file of an unstructured grid", "in ParaView: Resample To Image, saved as .vti"}},
    {".fits", {"a FITS file", "in Python: numpy.save(\"out.npy\", astropy.io.fits.getdata(\"in.fits\"))"}},
    {".fit", {"a FITS file", "in Python: numpy.save(\"out.npy\", astropy.io.fits.getdata(\"in.fit\"))"}},
};

bool is_at(std::span<std::byte const> head, std::size_t at, std::string_view bytes) {
    return head.size() >= at + bytes.size() && std::memcmp(head.data() + at, bytes.data(), bytes.size()) == 0;
}

/// Two letters alone may be voxels: reserved zeros follow, and the size of one of the headers that there are.
bool is_bitmap(std::span<std::byte const> head) {
    if (!is_at(head, 0, "BM"sv) || !is_at(head, 6, "\0\0\0\0"sv) || !is_at(head, 15, "\0\0\0"sv)) return false;
    auto const size = std::to_integer<int>(head[14]);
    return size == 12 || size == 40 || size == 52 || size == 56 || size == 64 || size == 108 || size == 124;
}

/// Lines of what can be read. The head may end within a character.
bool is_text(std::span<std::byte const> head) {
    std::string_view rest(reinterpret_cast<char const*>(head.data()), head.size());
    if (rest.find('\n') == std::string_view::npos) return false;
    while (!rest.empty()) {
        Character const next = first_character(rest);
        bool const blank = rest.front() == '\n' || rest.front() == '\r' || rest.front() == '\t';
        if (!blank && !(next.valid && next.visible())) return !next.valid && rest.size() < 4;
        rest.remove_prefix(next.bytes);
    }
    return true;
}

} // namespace

std::string foreign_format(std::span<std::byte const> head) {
    for (auto const& [at, bytes, what] : signatures)
        if (is_at(head, at, bytes)) return std::string(what);
    if (is_at(head, 0, "\x1f\x8b"sv)) return "a gzip file";
    if (is_at(head, 0, "<?xml"sv) || is_at(head, 0, "<VTKFile"sv)) {
        std::string_view const all(reinterpret_cast<char const*>(head.data()), head.size());
        return all.find("<VTKFile") != std::string_view::npos ? "a VTK XML file" : "an XML document";
    }
    if (is_bitmap(head)) return "a BMP picture";
    if (is_text(head)) return "plain text";
    return {};
}

ForeignName stand_in(std::span<std::byte const> head) {
    if (is_at(head, 0, "version https://git-lfs.github.com/spec/"sv))
        return {"a pointer of Git LFS, not the file itself", "git lfs pull fetches it"};
    if (is_at(head, 0, "/annex/objects/"sv))
        return {"a pointer of git-annex, not the file itself", "git annex get fetches it"};
    std::string const begin =
        lower_case(std::string(reinterpret_cast<char const*>(head.data()), std::min<std::size_t>(head.size(), 15)));
    if (begin.starts_with("<!doctype html") || begin.starts_with("<html"))
        return {"a page of the web, perhaps what a server said instead of sending the file", "fetch it once more"};
    return {};
}

ForeignName foreign_name(std::string const& path) {
    std::string const lower = lower_case(path);
    std::string_view name = lower;
    for (std::string_view const wrapper : {".gz"sv, ".bz2"sv, ".xz"sv, ".zst"sv})
        if (name.ends_with(wrapper)) name.remove_suffix(wrapper.size());
    auto const found =
        std::find_if(std::begin(endings), std::end(endings), [&](Ending const& e) { return name.ends_with(e.end); });
    return found == std::end(endings) ? ForeignName{} : found->name;
}

bool names_foreign_picture(std::string const& path) {
    std::string const lower = lower_case(path);
    return std::ranges::any_of(std::array{".jpg", ".jpeg", ".gif", ".bmp", ".webp", ".svg"},
                               [&](char const* suffix) { return lower.ends_with(suffix); });
}

} // namespace vkt
