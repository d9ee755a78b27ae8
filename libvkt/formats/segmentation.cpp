// Segmentations: what is said of labels, where they lie, and the file.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/segmentation.h"

#include "libvkt/amr/cells.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/spool.h"
#include "libvkt/formats/encode.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/labels.h"
#include "libvkt/io/output_file.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace vkt {
namespace {

constexpr std::size_t most_labels = 32767;
constexpr std::string_view segment_prefix = "Segment", segmentation_prefix = "Segmentation_";

/// What the pairs SegmentN_… of one N say, by what follows N and the underscore.
using Segment = std::map<std::string, std::string>;

std::int64_t label_of(Segment const& segment) {
    auto const value = segment.find("LabelValue");
    return value == segment.end() ? 0 : integer_in(trimmed(value->second)).value_or(0);
}

std::string extent_text(std::optional<Box> const& box) {
    if (!box) return "0 -1 0 -1 0 -1";
    return text(box->lower.x, " ", box->upper.x - 1, " ", box->lower.y, " ", box->upper.y - 1, " ", box->lower.z, " ",
                box->upper.z - 1);
}

/// Red, green and blue in 0…1.
std::string colour_text(std::int64_t label) {
    auto const [red, green, blue] = label_color(label);
    return text(red, " ", green, " ", blue);
}

/// Finds the boxes of labels in voxels that come in the order in which they lie in memory.
class LabelScanner {
public:
    LabelScanner(Index3 dims, DataType type) : dims_(dims), type_(type) {}

    void scan(std::byte const* voxels, std::size_t bytes) {
        with_type(type_, [&]<class T>(T) {
            if constexpr (std::is_integral_v<T>) scan_as<T>(voxels, bytes);
        });
    }
    LabelBoxes const& boxes() const { return boxes_; }

private:
    template <class T> void scan_as(std::byte const* voxels, std::size_t bytes) {
        auto const* row = reinterpret_cast<T const*>(voxels);
        for (auto rows = static_cast<std::int64_t>(bytes / sizeof(T)) / dims_.x; rows-- > 0; row += dims_.x, ++row_)
            for (std::int64_t begin = 0, end; begin < dims_.x; begin = end) {
                end = std::find_if(row + begin + 1, row + dims_.x, [&](T v) { return v != row[begin]; }) - row;
                if (row[begin] != 0) add(label_from(row[begin]), begin, end);
            }
    }
    template <class T> static std::int64_t label_from(T value) {
        if constexpr (std::is_signed_v<T>) {
            if (value < 0)
                throw Error(ErrorKind::usage, text("a segmentation has no label ", static_cast<std::int64_t>(value)),
                            "labels are positive: write .nrrd, or make them so with vkt arith or vkt label");
        } else if (value > static_cast<std::uint64_t>(std::numeric_limits<std::int32_t>::max())) {
            throw Error(ErrorKind::usage,
                        text("a segmentation has no label ", static_cast<std::uint64_t>(value), " beyond 2^31"),
                        "write .nrrd");
        }
        return static_cast<std::int64_t>(value);
    }
    void add(std::int64_t label, std::int64_t begin, std::int64_t end) {
        if (last_ == nullptr || label != last_label_) {
            Index3 const none = dims_;
            last_ = &boxes_.try_emplace(label, Box{none, {0, 0, 0}}).first->second;
            last_label_ = label;
            if (boxes_.size() > most_labels)
                throw Error(ErrorKind::usage,
                            text("a segmentation has no more than ", to_text(std::int64_t{most_labels}), " labels"),
                            "write .nrrd, which has any number");
        }
        std::int64_t const y = row_ % dims_.y, z = row_ / dims_.y;
        last_->lower = {std::min(last_->lower.x, begin), std::min(last_->lower.y, y), std::min(last_->lower.z, z)};
        last_->upper = {std::max(last_->upper.x, end), std::max(last_->upper.y, y + 1),
                        std::max(last_->upper.z, z + 1)};
    }

    Index3 dims_;
    DataType type_;
    LabelBoxes boxes_;
    std::int64_t row_ = 0, last_label_ = 0;
    Box* last_ = nullptr;
};

class SegmentationWriter : public VolumeWriter {
public:
    SegmentationWriter(std::string const& path, WriteOptions const& options,
                       std::string (*header_text)(Header const&, bool gzip))
        : options_(options), header_text_(header_text), file_(path, options.force) {}

    void begin(Header const& header) override {
        if (scanner_)
            throw Error(ErrorKind::usage, "a segmentation is one volume", "write one file each: NAME_%04d.seg.nrrd");
        if (header.kind != Kind::structured)
            throw Error(ErrorKind::usage, "NRRD cannot hold bricks", "make a grid of them first: vkt resample");
        if (!is_integer(header.dtype))
            throw Error(ErrorKind::usage, text("a segmentation has labels, not ", header.dtype),
                        "vkt convert --dtype uint8, or write .nrrd");
        header_ = in_utf8(header);
        scanner_.emplace(header.dims, header.dtype);
        spool_.emplace(header, options_.memory.value_or(default_memory()) / 4, default_execution(), StageInfo{});
    }

    void write(std::byte const* voxels, std::size_t n) override {
        scanner_->scan(voxels, n);
        auto const rows = static_cast<std::int64_t>(n / size_of(header_.dtype)) / header_.dims.x;
        std::int64_t const y = rows_ % header_.dims.y, z = rows_ / header_.dims.y;
        // Whole slices, or rows of one.
        std::int64_t const last_y = rows > header_.dims.y - y ? header_.dims.y : y + rows;
        Box const box{{0, y, z}, {header_.dims.x, last_y, z + std::max<std::int64_t>(1, rows / header_.dims.y)}};
        AnyView const place = spool_->place(box);
        copy(dense_view(voxels, header_.dtype, box), place);
        spool_->store(place);
        rows_ += rows;
    }

    void close() override {
        if (!scanner_) throw Error(ErrorKind::data, "there is no volume to write");
        header_.attributes = segment_attributes(std::move(header_.attributes), scanner_->boxes());
        std::string const head = header_text_(header_, options_.compress);
        if (!options_.compress) file_.expect(head.size() + header_.bytes());
        file_.write(head.data(), head.size());
        std::optional<DeflateWriter> deflate;
        if (options_.compress) deflate.emplace(file_, DeflateWriter::Wrapper::gzip, options_);
        Buffer slice(header_.bytes() / static_cast<std::size_t>(header_.dims.z));
        for (std::int64_t z = 0; z < header_.dims.z; ++z) {
            Box const box{{0, 0, z}, {header_.dims.x, header_.dims.y, z + 1}};
            AnyView const view = dense_view(slice.write(Space::host), header_.dtype, box);
            spool_->read(view);
            if (deflate)
                deflate->write(view.data, slice.bytes());
            else
                file_.write(view.data, slice.bytes());
        }
        if (deflate) deflate->finish();
        file_.commit();
    }

private:
    WriteOptions options_;
    std::string (*header_text_)(Header const&, bool gzip);
    OutputFile file_;
    Header header_;
    std::optional<LabelScanner> scanner_;
    std::optional<Spool> spool_;
    std::int64_t rows_ = 0;
};

} // namespace

bool is_segmentation_name(std::string const& path) { return lower_case(path).ends_with(".seg.nrrd"); }

std::map<std::string, std::string> segment_attributes(std::map<std::string, std::string> attributes,
                                                      LabelBoxes const& boxes) {
    std::map<std::int64_t, Segment> stated;
    for (auto i = attributes.begin(); i != attributes.end();) {
        if (auto const key = segment_key(i->first)) {
            stated[key->number][key->field] = i->second;
            i = attributes.erase(i);
        } else {
            ++i;
        }
    }
    std::vector<Segment> segments;
    std::set<std::int64_t> labels;
    std::set<std::string> ids;
    for (auto& [number, segment] : stated) {
        std::int64_t const label = label_of(segment);
        if (label <= 0 || !labels.insert(label).second) continue;
        segments.push_back(std::move(segment));
    }
    for (auto const& [label, box] : boxes)
        if (labels.insert(label).second) segments.push_back({{"LabelValue", to_text(label)}});
    std::int64_t number = 0;
    for (Segment& segment : segments) {
        std::int64_t const label = label_of(segment);
        std::string const standard = text("Segment_", label);
        if (segment.try_emplace("Name", standard).second) segment["NameAutoGenerated"] = "1";
        if (segment.try_emplace("Color", colour_text(label)).second) segment["ColorAutoGenerated"] = "1";
        std::string& id = segment.try_emplace("ID", standard).first->second;
        while (!ids.insert(id).second) id += "_";
        auto const box = boxes.find(label);
        segment["LabelValue"] = to_text(label);
        segment["Layer"] = "0";
        segment["Extent"] = extent_text(box == boxes.end() ? std::nullopt : std::optional(box->second));
        for (auto const& [field, value] : segment) attributes[text(segment_prefix, number, "_", field)] = value;
        ++number;
    }
    std::string const prefix(segmentation_prefix);
    attributes.try_emplace(prefix + "ContainedRepresentationNames", "Binary labelmap|");
    // The second is how Slicer called the first before 5.2.
    attributes[prefix + "SourceRepresentation"] = "Binary labelmap";
    attributes[prefix + "MasterRepresentation"] = "Binary labelmap";
    attributes[prefix + "ReferenceImageExtentOffset"] = "0 0 0";
    return attributes;
}

std::unique_ptr<VolumeWriter> segmentation_writer(std::string const& path, WriteOptions const& options,
                                                  std::string (*header_text)(Header const&, bool gzip)) {
    return std::make_unique<SegmentationWriter>(path, options, header_text);
}

} // namespace vkt
