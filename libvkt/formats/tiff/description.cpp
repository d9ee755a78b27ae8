// Descriptions of TIFF stacks.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/tiff/description.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/tiff_module.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#ifdef VKT_HAVE_EXPAT
#include <expat.h>
#endif

namespace vkt {
namespace {

constexpr std::int64_t most_planes = std::int64_t{1} << 24;

/// Units as NRRD and NIfTI write them.
std::string plain_unit(std::string unit) {
    static std::map<std::string, std::string> const names{
        {"micron", "um"},         {"\\u00B5m", "um"},   {"\xC2\xB5m", "um"},   {"\xCE\xBCm", "um"}, {"\xB5m", "um"},
        {"microns", "um"},        {"millimeter", "mm"}, {"millimeters", "mm"}, {"inch", "inch"},    {"in", "inch"},
        {"\xC3\x85", "angstrom"}, {"pixel", ""},        {"pixels", ""}};
    auto const found = names.find(unit);
    return found == names.end() ? unit : found->second;
}

/// Units of time as NIfTI and OME write them. What cannot be a unit is taken for the seconds that both mean by none.
std::string time_unit(std::string const& unit) {
    static std::map<std::string, std::string> const names{
        {"", "s"},          {"sec", "s"},        {"second", "s"},     {"seconds", "s"}, {"msec", "ms"},
        {"\\u00B5s", "us"}, {"\xC2\xB5s", "us"}, {"\xCE\xBCs", "us"}, {"usec", "us"},   {"minute", "min"},
        {"minutes", "min"}, {"hour", "h"},       {"hours", "h"},      {"day", "d"},     {"days", "d"}};
    auto const found = names.find(unit);
    if (found != names.end()) return found->second;
    return unit.find('"') == std::string::npos ? unit : "s";
}

std::optional<double> positive(std::string_view word) {
    auto const value = number_in(word);
    return value && *value > 0 && std::isfinite(*value) ? value : std::nullopt;
}

void read_imagej(std::string const& description, TiffDescription& result) {
    result.kind = TiffDescription::Kind::imagej;
    std::map<std::string, std::string> pairs;
    for (std::string const& line : split(description, '\n'))
        if (std::size_t const at = line.find('='); at != std::string::npos)
            pairs.emplace(line.substr(0, at), std::string(trimmed(line.substr(at + 1))));
    auto const count = [&](char const* key, std::int64_t otherwise) {
        auto const found = pairs.find(key);
        auto const value = found == pairs.end() ? std::nullopt : integer_in(found->second);
        return value && *value >= 1 && *value <= most_planes ? *value : otherwise;
    };
    result.images = count("images", 1);
    result.slices = count("slices", 0);
    result.channels = count("channels", 1);
    result.frames = count("frames", 1);
    if (result.slices == 0) {
        result.slices = 1;
        if (result.channels * result.frames == 1) result.slices = result.images;
    }
    if (pairs.count("spacing") > 0)
        if (auto const value = number_in(pairs["spacing"]); value && *value != 0 && std::isfinite(*value))
            result.spacing_z = std::abs(*value); // ImageJ writes negative ones for stacks that were turned over
    result.unit = plain_unit(pairs["unit"]);
    result.interval = positive(pairs["finterval"]);
    result.interval_unit = time_unit(pairs["tunit"]);
    if (pairs["cf"] == "0") { // a straight line
        auto const c0 = number_in(pairs["c0"]), c1 = number_in(pairs["c1"]);
        if (c0 && c1 && *c1 != 0 && std::isfinite(*c0) && std::isfinite(*c1)) result.values = ValueMap{*c1, *c0};
        result.value_unit = plain_unit(pairs["vunit"]);
    }
    if (auto const found = pairs.find("vkt"); found != pairs.end()) {
        try {
            result.ours = header_from_json(found->second);
        } catch (Error const&) { // another program has cut it
        }
    }
}

/// Arrays of tifffile's own files, whose last axes are y and x: z, or the one before them, enumerates slices, c
/// channels, others frames.
bool read_shaped(std::string const& description, std::int64_t pages, std::int64_t samples, TiffDescription& result) {
    auto const json = nlohmann::json::parse(description, nullptr, false);
    if (!json.is_object() || !json.contains("shape") || !json["shape"].is_array()) return false;
    std::vector<std::int64_t> shape;
    std::int64_t planes = 1;
    for (auto const& entry : json["shape"]) {
        if (!entry.is_number_integer() || entry.get<std::int64_t>() < 1) return false;
        shape.push_back(std::min(entry.get<std::int64_t>(), most_planes));
    }
    std::string axes = json.contains("axes") && json["axes"].is_string() ? json["axes"].get<std::string>() : "";
    if (axes.size() != shape.size()) axes.assign(shape.size(), '?');
    if (samples > 1) { // within the pixels, or as planes of a page
        std::size_t at = axes.find('S');
        if (at == std::string::npos) at = shape.back() == samples ? shape.size() - 1 : shape.size() - 3;
        if (at >= shape.size() || shape[at] != samples) return false;
        shape.erase(shape.begin() + static_cast<std::ptrdiff_t>(at));
        axes.erase(at, 1);
    }
    if (shape.size() < 3) return false;
    shape.resize(shape.size() - 2);
    axes.resize(shape.size());
    for (std::int64_t const extent : shape) {
        planes *= extent;
        if (planes > most_planes) return false;
    }
    // Only the first page is described, and the others follow it.
    bool const one_block = pages == 1 && planes > 1 && json.value("truncated", nlohmann::json()) == true;
    if (planes != pages && !one_block) return false;
    std::size_t z = axes.rfind('Z');
    if (z == std::string::npos) z = axes.find_last_not_of("TC");
    std::size_t const c = axes.rfind('C');
    auto const extent_of = [&](std::size_t axis) { return axis == std::string::npos ? 1 : shape[axis]; };
    result.kind = TiffDescription::Kind::shaped;
    result.slices = extent_of(z);
    result.channels = extent_of(c);
    result.frames = planes / result.slices / result.channels;
    if (one_block) result.images = planes;
    result.pages.resize(static_cast<std::size_t>(planes));
    for (std::int64_t page = 0; page < planes; ++page) {
        std::int64_t rest = page, slice = 0, channel = 0, frame = 0, step = 1;
        for (std::size_t axis = shape.size(); axis-- > 0; rest /= shape[axis]) {
            std::int64_t const index = rest % shape[axis];
            if (axis == z)
                slice = index;
            else if (axis == c)
                channel = index;
            else {
                frame += index * step;
                step *= shape[axis];
            }
        }
        result.pages[static_cast<std::size_t>((frame * result.channels + channel) * result.slices + slice)] = page;
    }
    return true;
}

#ifdef VKT_HAVE_EXPAT
/// An Image of an OME document.
class OmeReader {
public:
    OmeReader(TiffDescribed const& about, bool first, TiffDescription& result)
        : file_(about.file), own_name_(about.own_name), file_pages_(about.all_pages), samples_(about.samples),
          wanted_(about.image), take_first_(first), result_(result) {}

    bool read(std::string const& text) {
        XML_Parser const parser = XML_ParserCreate(nullptr);
        if (parser == nullptr) throw std::bad_alloc();
        XML_SetUserData(parser, this);
        XML_SetElementHandler(
            parser,
            [](void* self, XML_Char const* name, XML_Char const** attributes) {
                static_cast<OmeReader*>(self)->begin(name, attributes);
            },
            [](void* self, XML_Char const* name) { static_cast<OmeReader*>(self)->end(name); });
        XML_SetCharacterDataHandler(parser, [](void* self, XML_Char const* characters, int n) {
            auto& reader = *static_cast<OmeReader*>(self);
            if (reader.in_ours_) reader.ours_.append(characters, static_cast<std::size_t>(n));
        });
        // Nothing that a document may define is needed.
        XML_SetStartDoctypeDeclHandler(parser, [](void* self, XML_Char const*, XML_Char const*, XML_Char const*, int) {
            static_cast<OmeReader*>(self)->ok_ = false;
        });
        bool const parsed = XML_Parse(parser, text.data(), static_cast<int>(text.size()), 1) == XML_STATUS_OK;
        XML_ParserFree(parser);
        if (!parsed || !ok_ || !seen_) return false;
        place();
        if (ours_.empty() || images_ != 1) return true;
        try {
            result_.ours = header_from_json(std::string(trimmed(ours_)));
        } catch (Error const&) { // another program has changed it
        }
        return true;
    }

private:
    using Attributes = std::map<std::string, std::string>;
    struct Data {
        std::int64_t ifd = -1, first_z = 0, first_c = 0, first_t = 0, planes = -1;
        bool elsewhere = false;
    };

    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", file_, "': its OME description ", what), hint);
    }

    static std::string local(std::string name) {
        std::size_t const colon = name.rfind(':');
        return colon == std::string::npos ? name : name.substr(colon + 1);
    }

    std::int64_t integer(Attributes const& a, char const* key, std::int64_t otherwise) const {
        auto const found = a.find(key);
        if (found == a.end()) return otherwise;
        auto const value = integer_in(found->second);
        if (!value || *value < 0 || *value > most_planes)
            fail(text("says ", key, "=\"", found->second.substr(0, 40), "\""));
        return *value;
    }

    void begin(std::string const& full, XML_Char const** list) try {
        if (failure_) return;
        Attributes a;
        for (; list[0] != nullptr; list += 2) a.emplace(list[0], list[1]);
        std::string const name = local(full);
        if (name == "CommentAnnotation") in_ours_ = ours_.empty() && a["Namespace"] == tiff_header_namespace;
        if (name == "Image") {
            std::string const called = a["Name"].empty() ? text("image ", images_) : a["Name"];
            in_wanted_ = !seen_ && (take_first_ || called == wanted_);
            if (!in_wanted_) result_.not_read.push_back(text("image '", called, "'"));
            ++images_;
        }
        if (!in_wanted_) return;
        if (name == "Pixels") pixels(a);
        if (name == "Channel" && channel_names_.size() < 4096) {
            channel_names_.push_back(a["Name"]);
        }
        if (name == "TiffData" && data_.size() < static_cast<std::size_t>(most_planes)) {
            Data d;
            d.ifd = integer(a, "IFD", -1);
            d.first_z = integer(a, "FirstZ", 0);
            d.first_c = integer(a, "FirstC", 0);
            d.first_t = integer(a, "FirstT", 0);
            d.planes = integer(a, "PlaneCount", -1);
            data_.push_back(d);
        }
        if (name == "UUID" && !data_.empty() && a.count("FileName") > 0) {
            files_.insert(a["FileName"]);
            data_file_.resize(data_.size());
            data_file_.back() = a["FileName"];
        }
    } catch (Error const&) {
        failure_ = std::current_exception(); // C code is between here and who catches it
    }
    void end(std::string const& full) {
        if (local(full) == "CommentAnnotation") in_ours_ = false;
    }

    void pixels(Attributes& a) {
        seen_ = true;
        z_ = std::max<std::int64_t>(integer(a, "SizeZ", 1), 1);
        c_ = std::max<std::int64_t>(integer(a, "SizeC", 1), 1);
        t_ = std::max<std::int64_t>(integer(a, "SizeT", 1), 1);
        if (z_ * c_ > most_planes || z_ * c_ * t_ > most_planes) fail("counts more planes than a file can hold");
        order_ = a["DimensionOrder"];
        physical_size(a, "PhysicalSizeX", result_.spacing_x);
        physical_size(a, "PhysicalSizeY", result_.spacing_y);
        physical_size(a, "PhysicalSizeZ", result_.spacing_z);
        result_.interval = positive(a["TimeIncrement"]);
        result_.interval_unit = time_unit(a["TimeIncrementUnit"]);
    }

    /// Sizes along all axes are in the unit of the first.
    void physical_size(Attributes& a, std::string const& key, std::optional<double>& size) {
        size = positive(a[key]);
        if (!size) return;
        auto const stated = a.find(key + "Unit");
        std::string const unit = stated == a.end() ? "um" : plain_unit(stated->second);
        if (!sized_) result_.unit = unit;
        sized_ = true;
        if (unit == result_.unit) return;
        static std::map<std::string, double> const metres{{"pm", 1e-12}, {"nm", 1e-9}, {"um", 1e-6}, {"mm", 1e-3},
                                                          {"cm", 1e-2},  {"dm", 1e-1}, {"m", 1},     {"km", 1e3}};
        auto const from = metres.find(unit), to = metres.find(result_.unit);
        if (from == metres.end() || to == metres.end())
            fail("gives sizes in different units along its axes", "make them equal: tiffcomment");
        // Powers of ten: multiplied or divided by whole ones, so that 500 nm are 0.5 um.
        *size = from->second > to->second ? *size * std::round(from->second / to->second)
                                          : *size / std::round(to->second / from->second);
    }

    /// Which page each plane is.
    void place() {
        if (failure_) std::rethrow_exception(failure_);
        std::int64_t const per_page = samples_ > 1 && c_ % samples_ == 0 ? samples_ : 1;
        std::int64_t const c = c_ / per_page, planes = z_ * c * t_;
        if (order_.size() != 5 || !order_.starts_with("XY")) order_ = "XYZCT";
        std::array<std::int64_t, 3> sizes{}; // in the order of the file
        for (std::size_t i = 0; i < 3; ++i) sizes[i] = order_[i + 2] == 'Z' ? z_ : order_[i + 2] == 'C' ? c : t_;
        // Position in the order of the file from that of the plane, and back.
        auto const linear = [&](std::int64_t z, std::int64_t ch, std::int64_t t) {
            std::int64_t result = 0;
            for (std::size_t i = 3; i-- > 0;)
                result = result * sizes[i] + (order_[i + 2] == 'Z' ? z : order_[i + 2] == 'C' ? ch : t);
            return result;
        };
        struct Place {
            std::size_t file = 0;
            std::int64_t page = -1;
        };
        std::vector<Place> by_order(static_cast<std::size_t>(planes));
        if (data_.empty()) data_.push_back({});
        data_file_.resize(data_.size());
        std::string const here = own_name();
        std::int64_t next = 0;
        result_.files.clear();
        for (std::size_t d = 0; d < data_.size(); ++d) {
            Data const& one = data_[d];
            std::string const& file = data_file_[d];
            std::size_t number = 0;
            if (!file.empty() && files_.size() > 1 && file != here) {
                auto const found = std::find(result_.files.begin(), result_.files.end(), file);
                number = static_cast<std::size_t>(found - result_.files.begin()) + 1;
                if (found == result_.files.end()) result_.files.push_back(file);
            }
            std::int64_t const first = linear(one.first_z, one.first_c / per_page, one.first_t);
            std::int64_t const ifd = one.ifd >= 0 ? one.ifd : one.first_z + one.first_c + one.first_t > 0 ? next : 0;
            std::int64_t const count = one.planes >= 0 ? one.planes : one.ifd >= 0 ? 1 : planes;
            for (std::int64_t i = 0; i < count && first + i < planes && (number > 0 || ifd + i < file_pages_); ++i)
                by_order[static_cast<std::size_t>(first + i)] = {number, ifd + i};
            next = ifd + count;
        }
        result_.kind = TiffDescription::Kind::ome;
        result_.slices = z_;
        result_.channels = c;
        result_.frames = t_;
        result_.pages.clear();
        result_.file_of.clear();
        for (std::int64_t t = 0; t < t_; ++t)
            for (std::int64_t ch = 0; ch < c; ++ch)
                for (std::int64_t z = 0; z < z_; ++z) {
                    auto const [file, page] = by_order[static_cast<std::size_t>(linear(z, ch, t))];
                    if (page < 0)
                        fail(text("has no page for slice ", z, " of channel ", ch, ", frame ", t, "; the file holds ",
                                  file_pages_, " pages"));
                    if (!result_.files.empty()) result_.file_of.push_back(file);
                    result_.pages.push_back(page);
                }
        if (per_page == 1) result_.channel_names = channel_names_;
    }

    /// Planes are said to be in the file by its name; of one that was given another the first that is met stands for
    /// it.
    std::string own_name() const {
        return files_.count(own_name_) > 0 || files_.empty() ? own_name_ : data_file_.front();
    }

    std::string const &file_, &own_name_;
    std::int64_t file_pages_, samples_;
    std::string const& wanted_;
    bool take_first_;
    TiffDescription& result_;
    bool ok_ = true, seen_ = false, sized_ = false, in_wanted_ = false, in_ours_ = false;
    std::string ours_;
    std::int64_t images_ = 0, z_ = 1, c_ = 1, t_ = 1;
    std::string order_;
    std::vector<Data> data_;
    std::vector<std::string> data_file_;
    std::set<std::string> files_;
    std::vector<std::string> channel_names_;
    std::exception_ptr failure_;
};
#endif

} // namespace

TiffDescription tiff_description(std::string const& description, TiffDescribed const& about) {
    TiffDescription result;
    if (description.starts_with("ImageJ=")) {
        read_imagej(description, result);
    } else if (description.find("<OME") != std::string::npos || description.find(":OME") != std::string::npos) {
#ifdef VKT_HAVE_EXPAT
        if (!about.image.empty()) result.image_found = OmeReader(about, false, result).read(description);
        if (!result.image_found) {
            result = {};
            if (!OmeReader(about, true, result).read(description)) result = {};
        }
#else
        throw Error(ErrorKind::data, text("'", about.file, "' is OME-TIFF, for which this build lacks expat"),
                    "build vkt with libexpat1-dev");
#endif
    } else if (description.starts_with("{")) {
        read_shaped(description, about.pages, about.samples, result);
    }
    return result;
}

} // namespace vkt
