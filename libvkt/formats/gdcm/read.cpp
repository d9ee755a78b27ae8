// Reading DICOM with GDCM: the series that are there, and the voxels of their slices.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/dicom_module.h"
#include "libvkt/formats/gdcm/elements.h"
#include "libvkt/formats/gdcm/files.h"
#include "libvkt/formats/gdcm/input.h"
#include "libvkt/formats/gdcm/pixels.h"
#include "libvkt/formats/gdcm/slice.h"
#include "libvkt/formats/gdcm/stacks.h"
#include "libvkt/formats/gdcm/stream.h"
#include "libvkt/formats/header_text.h"

#include <gdcmReader.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <type_traits>

namespace vkt::dicom {
namespace {

class DicomFiles : public GridsParser {
public:
    explicit DicomFiles(std::string const& path) {
        gdcm::Trace::DebugOff();
        gdcm::Trace::WarningOff();
        gdcm::Trace::ErrorOff();
        std::error_code error;
        input_ = {path, path, std::filesystem::is_directory(path, error)};
    }

    ParsedGrids open(GridsChoice const& choice) override;
    void read(std::int64_t volume, Box const& box, std::byte* to) override;

private:
    void tell_personal(std::string const& file, ParsedGrids& grids) const;
    template <class T>
    void copy_rows(Slice const& slice, char const* frame, Box const& box, std::int64_t sample, std::byte* to) const;

    Input input_;
    std::vector<Slice> slices_; ///< of the volumes, one volume after another
    Index3 dims_;
    std::int64_t samples_ = 1;
    bool physical_ = false; ///< slopes differ between slices: values are made physical
    FrameDecoder decoder_;
};

ParsedGrids DicomFiles::open(GridsChoice const& choice) {
    std::string const& variable = choice.variable;
    ParsedGrids grids;
    if (!choice.together.empty()) {
        input_.base.clear();
        input_.folder = input_.listed = true;
    }
    std::vector<std::vector<Slice>> series =
        groups(find_slices(input_, choice.together, choice.trust_paths, grids.not_read));
    // Named by the number of the series; what has none, or shares it, by place.
    std::vector<std::string> names;
    for (auto const& group : series) {
        std::string name = group.front().series_number.empty() ? "series" : group.front().series_number;
        std::string const base = name;
        for (int k = 2; std::find(names.begin(), names.end(), name) != names.end(); ++k) name = text(base, "-", k);
        names.push_back(name);
    }
    std::size_t chosen = 0;
    if (!variable.empty()) {
        auto const found = std::find(names.begin(), names.end(), variable);
        if (found == names.end())
            throw Error(ErrorKind::usage,
                        text("'", input_.path, "' has no series '", variable, "'; it holds ", join(names, ", ")));
        chosen = static_cast<std::size_t>(found - names.begin());
    } else if (series.size() > 1) {
        for (std::size_t i = 0; i < series.size(); ++i)
            grids.choices.emplace_back(names[i], text(series[i].front().modality, stack_text(series[i]), ", ",
                                                      std::ssize(series[i]), " images of ", series[i].front().columns,
                                                      " by ", series[i].front().rows));
    }
    Slice const first = series[chosen].front();
    physical_ = std::any_of(series[chosen].begin(), series[chosen].end(),
                            [&](Slice const& s) { return s.slope != first.slope || s.intercept != first.intercept; });
    // Of several nobody chose yet, the first stands for all, whatever its slices are like.
    slices_ = arrange(input_, series[chosen], choice.force_uniform || !grids.choices.empty(), grids);
    Header& header = grids.header;
    dims_ = header.dims;
    samples_ = first.samples;
    if (first.bits != 1 && first.bits != 8 && first.bits != 12 && first.bits != 16 && first.bits != 32)
        input_.fail(text("its values have ", first.bits, " bits, which vkt does not read"));
    header.dtype = first.bits <= 8    ? (first.is_signed ? DataType::int8 : DataType::uint8)
                   : first.bits <= 16 ? (first.is_signed ? DataType::int16 : DataType::uint16)
                                      : (first.is_signed ? DataType::int32 : DataType::uint32);
    if (physical_) {
        bool const wide = first.bits > 16; // whose values float32 does not hold
        header.dtype = wide ? DataType::float64 : DataType::float32;
        double largest = 0;
        for (Slice const& s : series[chosen])
            largest =
                std::max(largest, std::ldexp(std::abs(s.slope), static_cast<int>(s.bits)) + std::abs(s.intercept));
        header.error.kind = largest < 1e38 ? Certainty::bound : Certainty::unknown; // of rounding to that
        header.error.at_most = largest < 1e38 ? largest * (wide ? 0x1p-52 : 0x1p-23) : 0;
    } else {
        header.values = {first.slope, first.intercept};
    }
    if (!first.modality.empty()) header.attributes["modality"] = first.modality;
    if (first.photometric == "MONOCHROME1") header.attributes["photometric"] = "min is white";
    if (first.photometric == "PALETTE COLOR") header.attributes["photometric"] = "palette";
    if (first.table) grids.not_read.push_back("the modality LUT, which says what its values mean: they are as stored");
    if (first.mosaic)
        grids.not_read.push_back(
            "the places of slices in a mosaic: they stand side by side, dcm2niix takes them apart");
    header.units = first.table                   ? ""
                   : !first.rescale_type.empty() ? (first.rescale_type == "US" ? "" : first.rescale_type)
                   : first.modality == "CT"      ? "HU"
                                                 : first.units;
    if (choice.personal) tell_personal(first.file, grids);
    header = in_utf8(std::move(header));
    return grids;
}

/// What the first image says of the patient and the examination.
void DicomFiles::tell_personal(std::string const& file, ParsedGrids& grids) const {
    FileStream stream(input_.full(file));
    gdcm::Reader reader;
    reader.SetStream(stream);
    if (!reader.ReadUpToTag(pixel_data, {pixel_data})) input_.fail("changed while it was read");
    gdcm::DataSet const& set = reader.GetFile().GetDataSet();
    std::string const characters = element_text(set, 0x0008, 0x0005);
    bool const known =
        characters.empty() || characters == "ISO_IR 6" || characters == "ISO_IR 100" || characters == "ISO_IR 192";
    struct Element {
        std::uint16_t group, element;
        char const* name;
    };
    static constexpr Element elements[] = {
        {0x0010, 0x0010, "patient name"},       {0x0010, 0x0020, "patient id"},
        {0x0010, 0x0030, "patient birth date"}, {0x0010, 0x0040, "patient sex"},
        {0x0010, 0x1010, "patient age"},        {0x0010, 0x1030, "patient weight"},
        {0x0008, 0x0020, "study date"},         {0x0008, 0x0030, "study time"},
        {0x0008, 0x1030, "study description"},  {0x0008, 0x103e, "series description"},
        {0x0018, 0x0015, "body part"},          {0x0018, 0x1030, "protocol"},
        {0x0008, 0x0070, "manufacturer"},       {0x0008, 0x1090, "model"},
        {0x0008, 0x0080, "institution"},        {0x0008, 0x0090, "referring physician"},
        {0x0008, 0x0050, "accession number"},   {0x0020, 0x000d, "study uid"},
        {0x0020, 0x000e, "series uid"},         {0x0020, 0x0052, "frame of reference uid"},
    };
    for (auto const& [group, element, name] : elements) {
        std::string words = element_text(set, group, element);
        std::replace_if(
            words.begin(), words.end(), [](unsigned char c) { return c < ' ' || c == 127; }, ' ');
        bool const plain = std::all_of(words.begin(), words.end(), [](unsigned char c) { return c < 128; });
        if (words.empty()) continue;
        if (known || plain)
            grids.header.attributes[name] = words;
        else
            grids.not_read.push_back(text(name, ", which is written in ", printable(characters)));
    }
}

template <class T>
void DicomFiles::copy_rows(Slice const& slice, char const* frame, Box const& box, std::int64_t sample,
                           std::byte* to) const {
    Index3 const size = box.dims();
    // The sign stands in the highest bit that is stored, above which anything may be.
    auto const width = static_cast<std::int64_t>(8 * sizeof(T));
    int const unused = slice.stored > 0 && slice.stored < width ? static_cast<int>(width - slice.stored) : 0;
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
        for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
            std::int64_t const pixel = y * slice.columns + x;
            std::int64_t const at =
                decoder_.planar() ? sample * slice.columns * slice.rows + pixel : pixel * samples_ + sample;
            T value{};
            std::memcpy(&value, frame + static_cast<std::size_t>(at) * sizeof(T), sizeof(T));
            // Shifted out at the top and back: with the sign, or with zeros instead of what else was there (overlays).
            value = static_cast<T>(static_cast<T>(value << unused) >> unused);
            std::int64_t const place = (y - box.lower.y) * size.x + (x - box.lower.x);
            if (physical_) {
                using Real = std::conditional_t<(sizeof(T) > 2), double, float>;
                auto const real = static_cast<Real>(slice.slope * static_cast<double>(value) + slice.intercept);
                std::memcpy(to + place * static_cast<std::int64_t>(sizeof real), &real, sizeof real);
            } else {
                std::memcpy(to + static_cast<std::size_t>(place) * sizeof(T), &value, sizeof(T));
            }
        }
}

void DicomFiles::read(std::int64_t volume, Box const& box, std::byte* to) {
    Index3 const size = box.dims();
    std::int64_t const sample = volume % samples_;
    for (std::int64_t z = box.lower.z; z < box.upper.z; ++z) {
        Slice const& slice = slices_[static_cast<std::size_t>(volume / samples_ * dims_.z + z)];
        auto const bytes = static_cast<std::size_t>(slice.bits <= 8 ? 1 : slice.bits <= 16 ? 2 : 4);
        char const* const frame = decoder_.frame_of(input_, slice).data();
        std::byte* const there =
            to + static_cast<std::size_t>((z - box.lower.z) * size.x * size.y) * (!physical_  ? bytes
                                                                                  : bytes > 2 ? 8
                                                                                              : 4);
        if (bytes == 1)
            slice.is_signed ? copy_rows<std::int8_t>(slice, frame, box, sample, there)
                            : copy_rows<std::uint8_t>(slice, frame, box, sample, there);
        else if (bytes == 2)
            slice.is_signed ? copy_rows<std::int16_t>(slice, frame, box, sample, there)
                            : copy_rows<std::uint16_t>(slice, frame, box, sample, there);
        else
            slice.is_signed ? copy_rows<std::int32_t>(slice, frame, box, sample, there)
                            : copy_rows<std::uint32_t>(slice, frame, box, sample, there);
    }
}

} // namespace

std::unique_ptr<GridsParser> open(std::string const& path) { return std::make_unique<DicomFiles>(path); }

} // namespace vkt::dicom

namespace vkt {
namespace {
DicomFunctions const functions{dicom::writer};
ParserHandler parse(std::string const& path) {
    return answer_about_grids([path] { return dicom::open(path); });
}
} // namespace
} // namespace vkt

extern "C" {
__attribute__((visibility("default"))) extern vkt::ModuleExport const vkt_module_gdcm;
vkt::ModuleExport const vkt_module_gdcm{VKT_VERSION, &vkt::functions, &vkt::parse};
}
