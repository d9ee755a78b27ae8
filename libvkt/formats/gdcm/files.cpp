// Finding DICOM's slices.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/gdcm/files.h"

#include "libvkt/core/products.h"
#include "libvkt/formats/dicom.h"
#include "libvkt/formats/gdcm/elements.h"
#include "libvkt/formats/gdcm/pixels.h"
#include "libvkt/formats/gdcm/stream.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/raw_source.h"

#include <gdcmReader.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <set>
#include <span>
#include <tuple>

namespace vkt::dicom {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_files = std::size_t{1} << 20;

class SliceFinder {
public:
    explicit SliceFinder(Input& input) : input_(input) {}

    void list_files(bool trust_paths, std::vector<std::string>& not_read);
    void read_listed(std::vector<std::string> const& files, std::vector<std::string>& not_read);
    std::vector<Slice> found() && { return std::move(all_); }

private:
    bool read_file(std::string const& file);
    bool note_records(gdcm::DataSet const& set);
    void list_records(bool trust_paths, std::vector<std::string>& not_read);
    void read_files(std::vector<std::string> const& names, std::vector<std::string>& not_read);

    Input& input_;
    std::vector<std::string> records_; ///< the files that a DICOMDIR names
    std::vector<Slice> all_;           ///< found
};

bool SliceFinder::read_file(std::string const& file) {
    FileStream stream(input_.full(file));
    if (input_.folder) { // GDCM takes much for DICOM that is not: other files of a folder are left alone.
        std::array<char, dicom_head_bytes> head{};
        stream.read(head.data(), head.size());
        auto const got = static_cast<std::size_t>(stream.gcount());
        if (!begins_as_dicom(std::as_bytes(std::span(head.data(), got)))) return false;
        stream.clear();
    }
    ElementsFound const elements = look_at_elements(stream);
    if (!elements.whole)
        throw Error(ErrorKind::data, text("'", input_.full(file), "': ended early: it has no whole header"),
                    input_.folder ? "copy it again, or " + input_.removal() : "");
    gdcm::Reader reader;
    reader.SetStream(stream);
    // Anything but the pixels.
    if (!reader.ReadUpToTag(pixel_data, {pixel_data})) {
        if (input_.folder) input_.fail(text("'", file, "' is damaged, or no DICOM file"), input_.removal());
        input_.fail("damaged: GDCM cannot read it");
    }
    gdcm::DataSet const& set = reader.GetFile().GetDataSet();
    Slice s;
    s.file = file;
    s.columns = element_short(set, 0x0028, 0x0011, 0);
    s.rows = element_short(set, 0x0028, 0x0010, 0);
    if (s.columns == 0 || s.rows == 0) return note_records(set); // a report, a directory
    s.samples = element_short(set, 0x0028, 0x0002, 1);
    s.bits = element_short(set, 0x0028, 0x0100, 16);
    s.is_signed = element_short(set, 0x0028, 0x0103, 0) == 1;
    s.planar = element_short(set, 0x0028, 0x0006, 0) == 1;
    s.stored = element_short(set, 0x0028, 0x0101, s.bits);
    std::int64_t const stored = s.stored, high = element_short(set, 0x0028, 0x0102, stored - 1);
    if (stored <= high && high < s.bits) // GDCM masks the lowest bits all the same
        input_.fail(text(input_.folder ? text("'", file, "': ") : "",
                         "its values do not end with the lowest bit (Bits Stored is ", stored, ", High Bit ", high,
                         "), which is not read"));
    for (std::uint16_t const element : {std::uint16_t{0x0008}, std::uint16_t{0x0009}})
        if (set.FindDataElement(gdcm::Tag(0x7fe0, element)))
            input_.fail(text(input_.folder ? text("'", file, "': ") : "",
                             "its values are floats ((Double) Float Pixel Data), "
                             "which are not read"));
    s.series = element_text(set, 0x0020, 0x000e);
    s.series_number = std::string(trimmed(element_text(set, 0x0020, 0x0011)));
    s.modality = element_text(set, 0x0008, 0x0060);
    s.photometric = element_text(set, 0x0028, 0x0004);
    s.units = element_text(set, 0x0054, 0x1001);
    s.uid = element_text(set, 0x0008, 0x0018);
    s.table = first_item(set, 0x0028, 0x3000).has_value();
    s.mosaic = element_text(set, 0x0008, 0x0008).find("MOSAIC") != std::string::npos;
    auto const whole = [&](std::uint16_t group, std::uint16_t element) {
        auto const v = element_numbers(set, group, element);
        return v.size() == 1 ? static_cast<std::int64_t>(std::clamp(v[0], -1e15, 1e15)) : std::int64_t{0};
    };
    s.instance = whole(0x0020, 0x0013);
    s.time = whole(0x0020, 0x0100);                  // temporal position
    if (s.time == 0) s.time = whole(0x0020, 0x0012); // acquisition number
    s.frames = std::clamp<std::int64_t>(whole(0x0028, 0x0008), 1, std::int64_t{1} << 24);
    if (all_.size() + static_cast<std::size_t>(s.frames) > most_files)
        input_.fail("holds more images than vkt reads at once");
    check_pixels(stream, reader.GetFile(), input_, elements.pixels, s);
    read_plane(set, s);
    if (!s.placed) // of nuclear medicine, where the frames of a detector lie
        if (auto const detector = first_item(set, 0x0054, 0x0022)) read_plane(*detector, s);
    // Doses have a slope and places of frames of their own: distances from the first, or, if that is not 0, along z.
    if (auto const v = element_numbers(set, 0x3004, 0x000e); v.size() == 1 && v[0] != 0) s.slope = v[0];
    if (s.units.empty()) s.units = element_text(set, 0x3004, 0x0002);
    auto const offsets = element_numbers(set, 0x3004, 0x000c);
    if (auto const shared = first_item(set, 0x5200, 0x9229)) read_group(*shared, s);
    auto const frames = sequence(set, 0x5200, 0x9230);
    std::vector<Dimension> const dimensions = dimensions_of(set);
    Vec3 const normal = cross(s.across, s.down);
    for (std::int64_t f = 0; f < s.frames; ++f) {
        Slice one = s;
        one.frame = f;
        bool grouped = false;
        if (frames != nullptr && static_cast<std::int64_t>(frames->GetNumberOfItems()) > f) {
            auto const& group = frames->GetItem(static_cast<gdcm::SequenceOfItems::SizeType>(f) + 1).GetNestedDataSet();
            read_group(group, one);
            read_membership(group, dimensions, one);
            grouped = one.placed;
        }
        // Frames without places of their own follow one another.
        if (!grouped && s.frames > 1 && std::ssize(offsets) == s.frames)
            one.position = s.position + (offsets[0] == 0 ? normal : Vec3{0, 0, 1}) *
                                            (offsets[static_cast<std::size_t>(f)] - offsets[0]);
        else if (!grouped && s.frames > 1)
            one.position = s.position + normal * (static_cast<double>(f) * s.spacing_slices.value_or(1));
        if (s.frames > 1) one.placed = true;
        all_.push_back(one);
    }
    return true;
}

/// Of a DICOMDIR, the files that it names. It is no image itself.
bool SliceFinder::note_records(gdcm::DataSet const& set) {
    auto const records = sequence(set, 0x0004, 0x1220);
    for (std::size_t i = 1; records != nullptr && i <= records->GetNumberOfItems(); ++i) {
        gdcm::DataSet const& record = records->GetItem(i).GetNestedDataSet();
        std::string const name = element_text(record, 0x0004, 0x1500);
        std::vector<std::string> parts = split(name, '\\');
        for (std::string& part : parts) part = std::string(trimmed(part));
        if (!name.empty() && records_.size() < most_files) records_.push_back(join(parts, "/"));
    }
    return false;
}

void SliceFinder::list_files(bool trust_paths, std::vector<std::string>& not_read) {
    if (!input_.folder) {
        if (read_file("")) return;
        if (records_.empty()) input_.fail("holds no image");
        std::error_code error;
        fs::path const place = fs::read_symlink(input_.path, error); // it is handed over open
        input_.base = (error ? fs::path(input_.path) : place).parent_path().string();
        if (input_.base.empty()) input_.base = std::string(".");
        input_.folder = true;
        return list_records(trust_paths, not_read);
    }
    std::vector<std::string> names;
    std::error_code error;
    for (auto const& entry : fs::directory_iterator(input_.path, error))
        if (entry.is_regular_file(error)) names.push_back(entry.path().filename());
    if (names.size() > most_files) input_.fail("holds more files than vkt reads at once");
    std::sort(names.begin(), names.end());
    read_files(names, not_read);
    if (all_.empty() && !records_.empty()) {
        not_read.clear();
        list_records(trust_paths, not_read);
    }
    if (all_.empty()) input_.fail("holds no DICOM images");
}

void SliceFinder::read_listed(std::vector<std::string> const& files, std::vector<std::string>& not_read) {
    if (files.size() > most_files) input_.fail("and others are more files than vkt reads at once");
    read_files(files, not_read);
    if (all_.empty()) input_.fail("and those that were named with it hold no DICOM images");
}

/// Names are those of a disc, whose files may have got small letters since.
void SliceFinder::list_records(bool trust_paths, std::vector<std::string>& not_read) {
    std::vector<std::string> names;
    std::int64_t absent = 0;
    std::error_code error;
    for (std::string const& name : records_) {
        bool found = false;
        for (std::string const& spelt : {name, lower_case(name)}) {
            if (found || !fs::exists(beside(input_.base + "/DICOMDIR", spelt, trust_paths), error)) continue;
            names.push_back(spelt);
            found = true;
        }
        if (!found) ++absent;
    }
    read_files(names, not_read);
    if (absent > 0)
        not_read.push_back(text(absent, absent == 1 ? " file" : " files", " named by the DICOMDIR, but not there"));
    if (all_.empty())
        input_.fail("its DICOMDIR names no image that is there", "read the folder with the images itself");
}

void SliceFinder::read_files(std::vector<std::string> const& names, std::vector<std::string>& not_read) {
    std::int64_t others = 0, copies = 0;
    std::set<std::tuple<std::string, std::string, std::int64_t>> seen;
    for (std::string const& name : names) {
        std::size_t const before = all_.size();
        if (!read_file(name)) {
            ++others;
            continue;
        }
        Slice const& image = all_[before];
        if (image.uid.empty() || seen.insert({image.uid, image.series, image.instance}).second) continue;
        all_.resize(before);
        ++copies;
    }
    if (copies > 0)
        not_read.push_back(text(copies, copies == 1 ? " copy" : " copies", " of images that are there already"));
    if (others > 0) not_read.push_back(text(others, " files that are no DICOM images"));
}

} // namespace

std::vector<Slice> find_slices(Input& input, std::vector<std::string> const& files, bool trust_paths,
                               std::vector<std::string>& not_read) {
    SliceFinder finder(input);
    if (files.empty())
        finder.list_files(trust_paths, not_read);
    else
        finder.read_listed(files, not_read);
    return std::move(finder).found();
}

} // namespace vkt::dicom
