// Stacking: whether inputs fit on one another, and which one holds a slice.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/stack.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/formats/amrex.h"
#include "libvkt/formats/dicom.h"
#include "libvkt/formats/series.h"
#include "libvkt/formats/zarr_array.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

namespace vkt {
namespace {

constexpr std::size_t most_open = 64, most_histories = 16;
/// Positions of slices are written with few digits.
constexpr double tolerance = 1e-3;

/// Inputs that can be opened more than once are; those that cannot stay open.
class Inputs {
public:
    Inputs(std::vector<std::string> paths, OpenInput open) : paths_(std::move(paths)), open_(std::move(open)) {}

    std::vector<std::string> const& paths() const { return paths_; }
    /// For its header. Keeps what cannot be opened again.
    std::unique_ptr<Source> look_at(std::string const& path) {
        auto source = open_(path);
        if (!source->next_volume()) throw Error(ErrorKind::data, text("'", path, "' holds no volume"));
        return source;
    }
    /// Hands an input back that was looked at: it is kept if it cannot be opened again.
    void put_back(std::string const& path, std::unique_ptr<Source> source) {
        if (!opens_again(path)) kept_[path] = std::move(source);
    }
    static bool opens_again(std::string const& path) {
        std::error_code failed;
        return std::filesystem::is_regular_file(path, failed) || std::filesystem::is_directory(path, failed);
    }
    /// At its first volume.
    std::unique_ptr<Source> take(std::string const& path) {
        if (auto found = kept_.find(path); found != kept_.end()) {
            auto source = std::move(found->second);
            kept_.erase(found);
            return source;
        }
        return look_at(path);
    }

private:
    std::vector<std::string> paths_;
    OpenInput open_;
    std::map<std::string, std::unique_ptr<Source>> kept_;
};

/// Proves an input whole, and that nothing is left out of it.
void finish_only(Source& source, std::string const& path) {
    source.finish();
    if (source.next_volume())
        throw Error(ErrorKind::data, text("'", path, "' holds several volumes, of which one can be stacked along z"),
                    "--along series keeps them apart; vkt split makes a file of each: -o 'slice%03d.nrrd'");
}

struct Layer {
    std::string path;
    std::int64_t first = 0, slices = 0; ///< along z of the whole
};

Error misfit(std::string const& path, std::string const& first, std::string const& what, std::string const& hint) {
    return Error(ErrorKind::data, text("'", path, "' does not fit on '", first, "': ", what), hint);
}

double length_along(Vec3 v, Vec3 axis) { return v.x * axis.x + v.y * axis.y + v.z * axis.z; }

bool near(Vec3 a, Vec3 b, double within) {
    return std::abs(a.x - b.x) <= within && std::abs(a.y - b.y) <= within && std::abs(a.z - b.z) <= within;
}

/// What all inputs have in common, and where they lie.
class Common {
public:
    void add(Header const& header, std::string const& path) {
        if (header.kind != Kind::structured)
            throw Error(ErrorKind::usage, text("'", path, "' is hierarchical, and cannot be stacked along z"),
                        "make a grid of it first, or give --along series");
        if (layers_.empty()) {
            header_ = header;
        } else {
            check(header, path);
            std::erase_if(header_.attributes, [&](auto const& entry) {
                auto const found = header.attributes.find(entry.first);
                return found == header.attributes.end() || found->second != entry.second;
            });
            if (!(header_.error == header.error)) header_.error = VolumeError::lost("stacked volumes differ in it");
            header_.dry_run = header_.dry_run || header.dry_run;
        }
        if (headers_.size() <= most_histories) headers_.push_back(header);
        origins_.push_back(header.geometry.origin);
        layers_.push_back({path, slices_, header.dims.z});
        slices_ += header.dims.z;
    }

    Header whole(bool force_uniform, StageInfo const& info) {
        place(force_uniform);
        Header whole = header_;
        whole.dims.z = slices_;
        whole.part.reset();
        if (info.words.empty()) { // whoever reads says so
            bool const one = std::all_of(headers_.begin(), headers_.end(),
                                         [&](Header const& h) { return h.history == header_.history; });
            if (!one) whole.history.reset();
            return whole;
        }
        if (headers_.size() <= most_histories) {
            whole.history = folded(history_step(info, headers_));
        } else {
            whole.history = folded(history_step(info, std::vector<Header>(info.input_names.size())));
        }
        return whole;
    }
    std::vector<Layer> const& layers() const { return layers_; }

private:
    void check(Header const& header, std::string const& path) const {
        std::string const& first = layers_.front().path;
        if (header.dims.x != header_.dims.x || header.dims.y != header_.dims.y)
            throw misfit(path, first,
                         text("its slices have ", header.dims.x, " by ", header.dims.y, " voxels, not ", header_.dims.x,
                              " by ", header_.dims.y),
                         "vkt crop, pad and resample change extents");
        if (header.dtype != header_.dtype)
            throw misfit(path, first, text("its type is ", header.dtype, ", not ", header_.dtype),
                         "vkt convert --dtype makes types equal");
        if (header.values != header_.values || header.units != header_.units)
            throw misfit(path, first, "its values have another slope, intercept or unit", "vkt set changes them");
        Geometry const &a = header_.geometry, &b = header.geometry;
        bool same =
            std::abs(a.spacing.x / b.spacing.x - 1) < tolerance && std::abs(a.spacing.y / b.spacing.y - 1) < tolerance;
        for (std::size_t axis = 0; axis < 3; ++axis)
            same = same && near(a.direction[axis], b.direction[axis], tolerance);
        if (!same) throw misfit(path, first, "its axes or the spacing along them differ", "compare them with vkt info");
    }

    /// Along z: by the inputs' places if they have any.
    void place(bool force_uniform) {
        Geometry& g = header_.geometry;
        bool const placed = std::any_of(origins_.begin(), origins_.end(), [&](Vec3 o) { return !(o == g.origin); });
        if (!placed || force_uniform) return;
        Vec3 const axis = g.direction[2];
        bool const single = slices_ == std::ssize(layers_);
        double spacing = g.spacing.z;
        auto const offset = [&](std::size_t i) {
            Vec3 const o = origins_[i];
            return Vec3{o.x - g.origin.x, o.y - g.origin.y, o.z - g.origin.z};
        };
        if (single) {
            double const stated = spacing;
            for (std::size_t i = 1; i < origins_.size(); ++i)
                if (!(length_along(origins_[i] - origins_[i - 1], axis) > 0))
                    throw Error(ErrorKind::data,
                                text("'", layers_[i].path, "' does not lie above '", layers_[i - 1].path, "'"),
                                "name the slices in ascending order");
            spacing = length_along(offset(origins_.size() - 1), axis) / static_cast<double>(slices_ - 1);
            if (std::abs(spacing / stated - 1) < 1e-6) spacing = stated; // but for rounding
        }
        auto const lies = [&](std::size_t i, double distance) {
            double const at = distance * static_cast<double>(layers_[i].first);
            return near(offset(i), {at * axis.x, at * axis.y, at * axis.z}, tolerance * distance);
        };
        bool even = true;
        for (std::size_t i = 0; i < layers_.size(); ++i) even = even && lies(i, spacing);
        if (!even) { // the first one that leaves the distance of the first two
            double const first = single ? length_along(offset(1), axis) : spacing;
            std::size_t i = 1;
            while (first > 0 && i + 1 < layers_.size() && lies(i, first)) ++i;
            throw misfit(layers_[i].path, layers_.front().path,
                         text("its origin is ", origins_[i], ", which is not ", layers_[i].first, " times ", first,
                              " along z from ", g.origin),
                         "--force-uniform stacks them in the order named, wherever they lie");
        }
        g.spacing.z = spacing;
    }

    std::vector<Layer> layers_;
    std::vector<Vec3> origins_;
    std::vector<Header> headers_; ///< the first ones, for their histories
    Header header_;
    std::int64_t slices_ = 0;
};

class StackedSource : public Source {
public:
    StackedSource(Inputs inputs, std::vector<Layer> layers, Header header, Access access)
        : inputs_(std::move(inputs)), layers_(std::move(layers)), header_(std::move(header)), access_(access) {}

    bool next_volume() override { return !std::exchange(begun_, true); }
    Header const& header() const override { return header_; }
    Access access() const override { return access_; }
    void read(AnyView out) override;
    void finish() override {
        if (header_.dry_run) return;
        // What was not read to its end has to be proven whole too.
        for (std::size_t i = 0; i < layers_.size() && access_ == Access::forward; ++i)
            if (!finished_.contains(i)) finish_only(opened(i), layers_[i].path);
        for (auto& [layer, source] : open_) source->finish();
        open_.clear();
    }

private:
    Source& opened(std::size_t layer) {
        if (auto found = open_.find(layer); found != open_.end()) return *found->second;
        if (open_.size() >= most_open && access_ == Access::random) open_.erase(open_.begin());
        auto source = inputs_.take(layers_[layer].path);
        Header const& header = source->header();
        Index3 const dims{header_.dims.x, header_.dims.y, layers_[layer].slices};
        if (!(header.dims == dims) || header.dtype != header_.dtype)
            throw Error(ErrorKind::data, text("'", layers_[layer].path, "' was changed meanwhile"));
        return *open_.emplace(layer, std::move(source)).first->second;
    }

    Inputs inputs_;
    std::vector<Layer> layers_;
    Header header_;
    Access access_;
    std::map<std::size_t, std::unique_ptr<Source>> open_;
    std::map<std::size_t, bool> finished_;
    bool begun_ = false;
};

void StackedSource::read(AnyView out) {
    auto layer = std::upper_bound(layers_.begin(), layers_.end(), out.box.lower.z,
                                  [](std::int64_t z, Layer const& l) { return z < l.first + l.slices; });
    for (; layer != layers_.end() && layer->first < out.box.upper.z; ++layer) {
        Box part = out.box;
        part.lower.z = std::max(part.lower.z, layer->first);
        part.upper.z = std::min(part.upper.z, layer->first + layer->slices);
        auto const index = static_cast<std::size_t>(layer - layers_.begin());
        Source& source = opened(index);
        source.read(out.part(part).moved_to(part.lower - Index3{0, 0, layer->first}));
        bool const last = part.upper.z == layer->first + layer->slices && part.upper.y == header_.dims.y;
        if (access_ == Access::random || !last) continue;
        finish_only(source, layers_[index].path);
        open_.erase(index);
        finished_[index] = true;
    }
}

/// The volumes of the inputs as they are.
std::unique_ptr<Source> series(Inputs inputs) {
    std::vector<std::string> const paths = inputs.paths();
    auto const shared = std::make_shared<Inputs>(std::move(inputs));

    /// At its first volume already.
    class Begun : public SourceDecorator {
    public:
        using SourceDecorator::SourceDecorator;
        bool next_volume() override { return !std::exchange(begun_, true) || inner().next_volume(); }

    private:
        bool begun_ = false;
    };
    return series_source(paths, [shared](std::string const& path) -> std::unique_ptr<Source> {
        return std::make_unique<Begun>(shared->take(path));
    });
}

class SlicesSource : public SourceDecorator {
public:
    SlicesSource(std::unique_ptr<Source> source, StageInfo info)
        : SourceDecorator(std::move(source)), info_(std::move(info)) {}

    bool next_volume() override {
        if (!open_ || ++slice_ == inner().header().dims.z) {
            if (std::exchange(open_, false)) inner().finish();
            if (!inner().next_volume()) return false;
            if (inner().header().kind != Kind::structured)
                throw Error(ErrorKind::usage, "the volume is hierarchical, and has no slices",
                            "make a grid of it first: vkt resample --cells 50M");
            open_ = true;
            slice_ = 0;
        }
        Header const& whole = inner().header();
        header_ = whole;
        header_.dims.z = 1;
        header_.geometry = cropped(whole.geometry, {0, 0, slice_});
        header_.part.reset();
        if (!info_.words.empty()) header_.history = folded(history_step(info_, {whole}));
        return true;
    }
    Header const& header() const override { return header_; }
    void read(AnyView out) override { inner().read(out.moved_to(in_whole(out.box).lower)); }
    std::optional<ConstView> borrow(Box const& region) override {
        auto view = inner().borrow(in_whole(region));
        if (view) view = view->moved_to(region.lower);
        return view;
    }
    std::shared_ptr<Lease> lease(Box const& region) override { return inner().lease(in_whole(region)); }
    std::optional<Volume> take_whole() override { return std::nullopt; }
    void expect(Box const&) override {}
    std::int64_t natural_slab() const override { return 0; }
    void finish() override {} // the whole is, after its last slice

private:
    Box in_whole(Box region) const {
        region.lower.z += slice_;
        region.upper.z += slice_;
        return region;
    }

    StageInfo info_;
    Header header_;
    std::int64_t slice_ = 0;
    bool open_ = false; ///< within a volume
};

/// With a step of its history.
class RecordedSource : public SourceDecorator {
public:
    RecordedSource(std::unique_ptr<Source> source, StageInfo info)
        : SourceDecorator(std::move(source)), info_(std::move(info)) {}

    bool next_volume() override {
        if (!inner().next_volume()) return false;
        header_ = inner().header();
        // The files are named, whatever is known of their past.
        if (!info_.words.empty())
            header_.history = folded(history_step(info_, std::vector<Header>(info_.input_names.size())));
        return true;
    }
    Header const& header() const override { return header_; }
    bool narrow(Roi const& /*roi*/, WorldRoi const& /*world_roi*/) override { return false; }
    std::optional<Volume> take_whole() override { return std::nullopt; }

private:
    StageInfo info_;
    Header header_;
};

/// The slices in a folder, in the order of their numbers; none if it is something else.
std::vector<std::string> slices_in(std::string const& path) {
    namespace fs = std::filesystem;
    std::error_code failed;
    std::vector<std::string> kinds;
    if (!fs::is_directory(path, failed) || is_amrex(path) || zarr::is_zarr(path) || is_dicom_folder(path)) return {};
    for (auto const& entry : fs::directory_iterator(path, failed)) {
        std::string const extension = lower_case(entry.path().extension().string());
        bool const slice = extension == ".png" || extension == ".tif" || extension == ".tiff";
        if (slice && entry.path().filename().string().front() != '.' &&
            std::count(kinds.begin(), kinds.end(), entry.path().extension().string()) == 0)
            kinds.push_back(entry.path().extension().string());
    }
    if (kinds.empty()) return {};
    if (kinds.size() > 1)
        throw Error(ErrorKind::data, text("the directory '", path, "' holds files ", join(kinds, " and ")),
                    text("name those of one kind: '", path, "/*", kinds.front(), "'"));
    return matching_files((fs::path(path) / ("*" + kinds.front())).string());
}

/// By how much the number in which two names differ grows; none if they differ in something else.
std::optional<std::int64_t> distance_of(std::string const& a, std::string const& b) {
    auto const is_digit = [](char c) { return c >= '0' && c <= '9'; };
    auto begin = static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
    while (begin > 0 && is_digit(a[begin - 1])) --begin;
    auto const end_of = [&](std::string const& name) {
        std::size_t end = begin;
        while (end < name.size() && is_digit(name[end])) ++end;
        return end;
    };
    std::size_t const of_a = end_of(a), of_b = end_of(b);
    if (of_a == begin || of_b == begin || std::max(of_a, of_b) - begin > 18) return std::nullopt;
    if (a.substr(of_a) != b.substr(of_b)) return std::nullopt;
    return parse_integer(b.substr(begin, of_b - begin)) - parse_integer(a.substr(begin, of_a - begin));
}

/// Where the names of slices do not go on as they began; empty where they do.
std::string gap_in(std::vector<std::string> const& paths) {
    std::optional<std::int64_t> step;
    for (std::size_t i = 1; i < paths.size(); ++i) {
        std::string const a = std::filesystem::path(paths[i - 1]).filename().string(),
                          b = std::filesystem::path(paths[i]).filename().string();
        std::optional<std::int64_t> const apart = distance_of(a, b);
        if (apart && *apart == step.value_or(*apart))
            step = apart;
        else
            return text(apart ? "a slice may be missing" : "files of several names make one volume", ": ", b,
                        " follows ", a);
    }
    return {};
}

} // namespace

std::unique_ptr<Source> open_path(std::string const& path, OpenInput const& open, Notice const& notice) {
    std::error_code failed;
    bool const numbered =
        path.find('%') != std::string::npos && !std::filesystem::exists(path, failed) && is_numbered(path);
    auto const paths = numbered ? matching_files(path) : slices_in(path);
    if (std::string const gap = gap_in(paths); notice && !gap.empty()) notice(text("'", path, "': ", gap));
    if (!paths.empty()) return stacked(paths, open, std::nullopt, false, {});
    auto const files = matching_files(path);
    return files.size() == 1 ? open(files.front()) : series_source(files, open);
}

std::unique_ptr<Source> stacked(std::vector<std::string> paths, OpenInput open, std::optional<StackAxis> along,
                                bool force_uniform, StageInfo const& info) {
    Inputs inputs(std::move(paths), std::move(open));
    if (along == StackAxis::series) return series(std::move(inputs));
    Common common;
    Access access = Access::random;
    bool single = true, thick = true; // all of them
    for (auto const& path : inputs.paths()) {
        auto source = inputs.look_at(path);
        Header const header = source->header();
        bool const slice = header.kind == Kind::structured && header.dims.z == 1;
        single = single && slice;
        thick = thick && !slice;
        if (!along && !single && !thick)
            throw Error(ErrorKind::usage,
                        text("'", path, "' has ", slice ? "one slice" : "several slices", ", others do not"),
                        "--along z makes one volume of them, --along series keeps each");
        if (along || single) {
            common.add(header, path);
            if (source->access() == Access::forward) access = Access::forward;
            // What is read forwards is looked at when it ends.
            else if (Inputs::opens_again(path) && !header.dry_run)
                finish_only(*source, path);
        }
        inputs.put_back(path, std::move(source));
    }
    if (!along && !single) return series(std::move(inputs));
    Header header = common.whole(force_uniform, info);
    return std::make_unique<StackedSource>(std::move(inputs), common.layers(), std::move(header), access);
}

std::unique_ptr<Source> stacked_dicom(std::vector<std::string> const& paths, OpenTogether const& open,
                                      std::string const& variable, bool force_uniform, StageInfo const& info) {
    if (paths.size() < 2 || !are_dicom_files(paths)) return nullptr;
    // Files of several frames are volumes already.
    auto const first = open(paths.front(), {});
    if (!first->next_volume() || first->header().dims.z != 1) return nullptr;
    ReadOptions together;
    together.together = paths;
    together.variable = variable;
    together.force_uniform = force_uniform;
    return std::make_unique<RecordedSource>(open(paths.front(), together), info);
}

std::unique_ptr<Source> slices_of(std::unique_ptr<Source> source, StageInfo info) {
    return std::make_unique<SlicesSource>(std::move(source), std::move(info));
}

} // namespace vkt
