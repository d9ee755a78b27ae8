// Merging: which bricks there are, whether they fit, and their voxels without ghosts.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/bricks/merge_bricks.h"

#include "libvkt/core/buffer.h"
#include "libvkt/core/collect.h"
#include "libvkt/core/frame.h"
#include "libvkt/formats/raw_source.h"
#include "libvkt/io/whole_text.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <tuple>
#include <unistd.h>
#include <utility>

namespace vkt {
namespace {

Error data_error(std::string const& message, std::string hint = {}) {
    return Error(ErrorKind::data, message, std::move(hint));
}

struct PlacedBrick {
    std::string name; ///< for messages
    BrickPlace place;
    std::string path{};
};

/// What all bricks of a volume have in common, from the first one that is seen.
class Common {
public:
    Common() = default;
    Common(Header const& header, PlacedBrick const& brick)
        : first_(brick), header_(without_place(header)),
          geometry_(cropped(header.geometry, Index3{} - brick.place.stored().lower)) {}

    /// Throws Error{data} unless the brick is one of the same volume.
    void check(Header const& header, PlacedBrick const& brick) const {
        auto const differ = [&](std::string const& what, auto const& here, auto const& there) {
            return data_error(text("'", brick.name, "' is no brick of this volume: its ", what, " is ", here,
                                   ", that of '", first_.name, "' ", there));
        };
        if (!(brick.place.whole == first_.place.whole))
            throw differ("whole volume", brick.place.whole, first_.place.whole);
        if (header.dtype != header_.dtype) throw differ("type", header.dtype, header_.dtype);
        if (!(header.values == header_.values))
            throw differ("value map", text(header.values.slope, " * stored + ", header.values.intercept),
                         text(header_.values.slope, " * stored + ", header_.values.intercept));
        if (header.units != header_.units) throw differ("unit", header.units, header_.units);
        Header expected = header_;
        expected.dims = header.dims;
        expected.geometry = cropped(geometry_, brick.place.stored().lower);
        if (!same_place(header, expected))
            throw data_error(text("'", brick.name, "' does not lie where its brick belongs: its origin is ",
                                  header.geometry.origin, " and its spacing ", header.geometry.spacing,
                                  ", which should be ", expected.geometry.origin, " and ", expected.geometry.spacing),
                             "what is done to bricks must keep their place: compare them with vkt info");
        history_ = history_ && header.history == header_.history;
        if (header.error == header_.error) return;
        // Of bricks that come one after another the header has gone out when the second is seen.
        if (told_ && header_.error.exact())
            throw data_error(text("'", brick.name,
                                  "' is no brick of this volume: its voxels are not exact, as those of '", first_.name,
                                  "' are"),
                             "write the bricks to files, and merge those");
        header_.error = VolumeError::lost("bricks of a volume differ in it");
    }

    /// The header of the whole. Bricks with the same past hand it on.
    Header whole(StageInfo const& info, bool all_seen) const {
        told_ = !all_seen;
        Header whole = header_;
        if (told_ && !whole.error.exact())
            whole.error = VolumeError::lost("bricks that come one by one may differ in it");
        if (told_) whole.error.values.reset();
        whole.dims = first_.place.whole;
        whole.geometry = geometry_;
        if (whole.part) {
            whole.part->offset = whole.part->offset - first_.place.stored().lower;
            whole.part->halo = {};
            if (whole.part->global_dims == whole.dims) whole.part.reset();
        }
        if (info.words.empty()) return whole;
        if (history_ && whole.history) {
            whole.history = folded({{"merge"}, {*whole.history}});
        } else {
            whole.history = History{{"merge"}, {}};
            for (auto const& name : info.input_names) whole.history->command.push_back(name);
        }
        return whole;
    }

private:
    PlacedBrick first_;
    mutable Header header_;
    Geometry geometry_; ///< of the whole
    mutable bool history_ = true;
    mutable bool told_ = false; ///< the header of the whole
};

/// Throws Error{data} unless the bricks, in order, hold every voxel of their layer, or of the volume, once.
class Cover {
public:
    Cover(std::vector<PlacedBrick> const& bricks, Index3 whole) : bricks_(bricks), whole_(whole) {
        Index3 at;
        for (std::int64_t upper_z = 0; at.z < whole_.z; at.z = upper_z) {
            upper_z = next(at).upper.z;
            std::int64_t upper_y = 0;
            for (at.y = 0; at.y < whole_.y; at.y = upper_y) {
                upper_y = next(at).upper.y;
                for (at.x = 0; at.x < whole_.x; ++next_) {
                    Box const& core = next(at);
                    if (core.upper.y != upper_y || core.upper.z != upper_z) throw overlap();
                    at.x = core.upper.x;
                }
                at.x = 0;
            }
            at.y = 0;
        }
        if (next_ < bricks_.size()) throw overlap();
    }

private:
    /// The next brick, which must begin at a voxel.
    Box const& next(Index3 at) {
        auto const order = [](Index3 i) { return std::tuple(i.z, i.y, i.x); };
        if (next_ == bricks_.size())
            throw data_error(text("a brick is missing: no brick holds the voxel ", at, " and what follows '",
                                  bricks_.back().name, "'"));
        Box const& core = bricks_[next_].place.core;
        if (order(core.lower) > order(at))
            throw data_error(text("a brick is missing before '", bricks_[next_].name, "': none holds the voxel ", at));
        if (!(core.lower == at)) throw overlap();
        return core;
    }
    Error overlap() const {
        auto const& brick = bricks_[next_];
        std::string other = "others";
        for (std::size_t i = 0; i < bricks_.size(); ++i)
            if (i != next_ && !intersect(bricks_[i].place.core, brick.place.core).empty())
                other = text("'", bricks_[i].name, "'");
        return data_error(
            text("'", brick.name, "' holds the voxels ", brick.place.core, ", which overlap those of ", other));
    }

    std::vector<PlacedBrick> const& bricks_;
    Index3 whole_;
    std::size_t next_ = 0;
};

/// The place that a brick's header states. Throws Error{data} with its name.
BrickPlace stated_place(Header const& header, std::string const& name, std::optional<BrickPlace> const& known) {
    std::optional<BrickPlace> place;
    try {
        place = place_in(header);
    } catch (Error const& e) {
        throw data_error(text("'", name, "': ", e.what()), e.hint());
    }
    if (known && place && !(*place == *known))
        throw data_error(text("'", name, "' is a foreign brick: it holds the voxels ", place->core, " of a volume of ",
                              place->whole, ", its place is ", known->core, " of ", known->whole));
    if (!place) place = known;
    if (!place)
        throw data_error(text("'", name, "' is no brick: it does not say where it belongs"),
                         "vkt brick says so in the attributes brick-whole, brick-core and brick-ghost");
    if (!(place->stored().dims() == header.dims))
        throw data_error(text("'", name, "' has ", header.dims, " voxels, its place ", place->stored().dims()),
                         "what is done to a brick must keep its extent");
    return *place;
}

void refuse_tree(Header const& header, std::string const& name) {
    if (header.kind != Kind::structured) throw data_error(text("'", name, "' is hierarchical, and no brick"));
}

class MergedFiles : public Source {
public:
    MergedFiles(std::vector<BrickFile> files, OpenBrick open, Execution const& execution, StageInfo const& info);

    bool next_volume() override { return !std::exchange(begun_, true); }
    Header const& header() const override { return header_; }
    Access access() const override { return access_; }
    void read(AnyView out) override;
    void finish() override { close_all(); }

private:
    struct Opened {
        std::unique_ptr<Source> source;
        std::int64_t used = 0;
    };

    Source& opened(std::size_t brick);
    void close_all() {
        for (auto& [brick, file] : open_files_) file.source->finish();
        open_files_.clear();
    }

    std::vector<PlacedBrick> bricks_; ///< in order
    OpenBrick open_;
    std::size_t most_open_; ///< each has buffers of its own
    Header header_;
    Access access_ = Access::random;
    std::map<std::size_t, Opened> open_files_;
    std::int64_t uses_ = 0;
    bool begun_ = false;
};

MergedFiles::MergedFiles(std::vector<BrickFile> files, OpenBrick open, Execution const& execution,
                         StageInfo const& info)
    : open_(std::move(open)), most_open_(std::clamp<std::size_t>(execution.memory >> 18, 8, 256)) {
    Common common;
    for (std::size_t i = 0; i < files.size(); ++i) {
        std::string const& path = files[i].path;
        auto const source = open_(path);
        if (!source->next_volume()) throw data_error(text("'", path, "' holds no volume"));
        Header const& header = source->header();
        refuse_tree(header, path);
        bricks_.push_back({path, stated_place(header, path, files[i].place), path});
        if (i == 0) common = Common(header, bricks_.front());
        common.check(header, bricks_.back());
        if (source->access() == Access::forward) access_ = Access::forward;
    }
    std::sort(bricks_.begin(), bricks_.end(), [](PlacedBrick const& a, PlacedBrick const& b) {
        Index3 const i = a.place.core.lower, j = b.place.core.lower;
        return std::tuple(i.z, i.y, i.x) < std::tuple(j.z, j.y, j.x);
    });
    Cover(bricks_, bricks_.front().place.whole);
    header_ = common.whole(info, true);
}

Source& MergedFiles::opened(std::size_t brick) {
    auto found = open_files_.find(brick);
    if (found == open_files_.end()) {
        if (open_files_.size() >= most_open_) {
            auto const oldest =
                std::min_element(open_files_.begin(), open_files_.end(),
                                 [](auto const& a, auto const& b) { return a.second.used < b.second.used; });
            open_files_.erase(oldest);
        }
        PlacedBrick const& b = bricks_[brick];
        auto source = open_(b.path);
        bool const same = source->next_volume() && source->header().kind == Kind::structured &&
                          source->header().dtype == header_.dtype && source->header().dims == b.place.stored().dims();
        if (!same) throw data_error(text("'", b.path, "' was changed meanwhile"));
        found = open_files_.emplace(brick, Opened{std::move(source), 0}).first;
    }
    found->second.used = ++uses_;
    return *found->second.source;
}

void MergedFiles::read(AnyView out) {
    // Bricks of one layer follow each other.
    auto const above = [](std::int64_t z, PlacedBrick const& b) { return z < b.place.core.upper.z; };
    auto const first = std::upper_bound(bricks_.begin(), bricks_.end(), out.box.lower.z, above);
    for (auto i = first; i != bricks_.end() && i->place.core.lower.z < out.box.upper.z; ++i) {
        Box const part = intersect(i->place.core, out.box);
        if (part.empty()) continue;
        auto const brick = static_cast<std::size_t>(i - bricks_.begin());
        Source& source = opened(brick);
        source.read(out.part(part).moved_to(part.lower - i->place.stored().lower));
        // What was read to its end is proven whole, and need not stay open.
        if (access_ == Access::forward && part.upper == i->place.core.upper) {
            source.finish();
            open_files_.erase(brick);
        }
    }
}

class MergedStream : public Source {
public:
    MergedStream(std::unique_ptr<Source> source, std::string name, Execution execution, StageInfo info)
        : source_(std::move(source)), name_(std::move(name)), execution_(std::move(execution)), info_(std::move(info)) {
    }

    bool next_volume() override;
    Header const& header() const override { return header_; }
    Access access() const override { return Access::forward; }
    void read(AnyView out) override;
    void finish() override;

private:
    bool next_brick();
    void load_layer();

    std::unique_ptr<Source> source_;
    std::string name_;
    Execution execution_;
    StageInfo info_;
    std::int64_t count_ = 0; ///< bricks seen
    PlacedBrick brick_;      ///< the current one
    Common common_;
    Header header_;
    Buffer buffer_;
    AnyView layer_;
    std::int64_t layer_end_ = 0; ///< slices that were put together
};

/// Moves to the next brick of the source.
bool MergedStream::next_brick() {
    if (!source_->next_volume()) return false;
    Header const& header = source_->header();
    brick_.name = text(name_, ", brick ", ++count_);
    refuse_tree(header, brick_.name);
    brick_.place = stated_place(header, brick_.name, std::nullopt);
    return true;
}

bool MergedStream::next_volume() {
    if (!next_brick()) {
        if (count_ == 0) throw data_error(text("'", name_, "' holds no bricks"));
        return false;
    }
    common_ = Common(source_->header(), brick_);
    header_ = common_.whole(info_, false);
    layer_end_ = 0;
    if (header_.dry_run) { // only headers follow
        std::int64_t voxels = brick_.place.core.voxels();
        for (source_->finish(); voxels < box_of(header_.dims).voxels() && next_brick(); source_->finish())
            voxels += brick_.place.core.voxels();
    }
    return true;
}

/// Reads the bricks of the next layer, of which the first one is current unless it follows another layer.
void MergedStream::load_layer() {
    if (layer_end_ > 0 && !next_brick())
        throw data_error(text("a brick is missing: '", name_, "' ends after ", count_,
                              " bricks, none of which holds the voxel ", Index3{0, 0, layer_end_}));
    Box const core = brick_.place.core;
    Box const slices{{0, 0, layer_end_}, {header_.dims.x, header_.dims.y, core.upper.z}};
    if (!(core.lower == slices.lower))
        throw data_error(text("'", brick_.name, "' holds the voxels ", core, ", but ", slices.lower,
                              " is the voxel that should follow"),
                         "a stream has bricks in order, x fastest; of files the order does not matter");
    std::size_t const bytes = static_cast<std::size_t>(slices.voxels()) * size_of(header_.dtype);
    check_budget(bytes, execution_);
    buffer_.reserve(bytes);
    layer_ = dense_view(buffer_.write(Space::host), header_.dtype, slices);
    Index3 at = core.lower;
    std::int64_t row_end = core.upper.y;
    for (bool more = true; more;) {
        common_.check(source_->header(), brick_);
        Box const box = brick_.place.core;
        if (!(box.lower == at) || box.upper.z != slices.upper.z || (at.x > 0 && box.upper.y != row_end))
            throw data_error(text("'", brick_.name, "' holds the voxels ", box, ", but ", at,
                                  " is the voxel that should follow: a brick is missing, or there twice"));
        source_->read(layer_.part(box).moved_to(box.lower - brick_.place.stored().lower));
        source_->finish();
        row_end = box.upper.y;
        at.x = box.upper.x;
        if (at.x == header_.dims.x) at = {0, row_end, at.z};
        more = at.y < header_.dims.y;
        if (more && !next_brick())
            throw data_error(text("a brick is missing: '", name_, "' ends after ", count_,
                                  " bricks, none of which holds the voxel ", at));
    }
    layer_end_ = slices.upper.z;
}

void MergedStream::read(AnyView out) {
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z;) {
        while (z >= layer_end_) load_layer();
        Box part = out.box;
        part.lower.z = z;
        part.upper.z = z = std::min(out.box.upper.z, layer_end_);
        copy_region(layer_.part(part), out.part(part), execution_);
    }
}

void MergedStream::finish() {
    while (!header_.dry_run && layer_end_ < header_.dims.z) load_layer();
}

} // namespace

std::vector<BrickFile> bricks_of(std::string const& path, bool trusted) {
    namespace fs = std::filesystem;
    bool const directory = fs::is_directory(path);
    fs::path const folder = directory ? fs::path(path) : fs::path(path).parent_path();
    fs::path const manifest_path = directory ? folder / manifest_name : fs::path(path);
    std::vector<std::string> names;
    for (auto const& entry : fs::directory_iterator(folder.empty() ? fs::path(".") : folder)) {
        std::string const name = entry.path().filename().string();
        if (name.front() != '.' && !format_of_name(name).empty()) names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    auto const in_folder = [&](std::string const& name) { return (folder / name).string(); };
    std::string const lister = directory ? (folder / "").string() : path;
    if (directory && !fs::exists(manifest_path)) {
        if (names.empty())
            throw data_error(text("'", path, "' holds no bricks: neither ", manifest_name, " nor volumes"));
        return collect(names, [&](std::string const& name) { return BrickFile{beside(lister, name, trusted), {}}; });
    }
    if (directory) beside(lister, std::string(manifest_name), trusted);
    constexpr std::size_t most = std::size_t{1} << 30;
    std::string const json = whole_text(manifest_path.string(), most);
    BrickManifest const manifest = manifest_from_json(json, manifest_path.string());
    std::vector<BrickFile> files;
    std::vector<std::string> listed;
    for (auto const& entry : manifest.bricks) {
        files.push_back({beside(manifest_path.string(), entry.file, trusted), entry.place});
        listed.push_back(entry.file);
        if (::access(files.back().path.c_str(), F_OK) != 0)
            throw data_error(text("the brick '", files.back().path, "' is missing"));
    }
    std::sort(listed.begin(), listed.end());
    for (auto const& name : names)
        if (directory && !std::binary_search(listed.begin(), listed.end(), name))
            throw data_error(text("'", in_folder(name), "' is a foreign brick: ", manifest_name, " does not list it"),
                             "move it away, or merge the files by their names");
    return files;
}

std::unique_ptr<Source> merged_files(std::vector<BrickFile> files, OpenBrick open, Execution const& execution,
                                     StageInfo const& info) {
    return std::make_unique<MergedFiles>(std::move(files), std::move(open), execution, info);
}

std::unique_ptr<Source> merged_stream(std::unique_ptr<Source> source, std::string name, Execution const& execution,
                                      StageInfo const& info) {
    return std::make_unique<MergedStream>(std::move(source), std::move(name), execution, info);
}

} // namespace vkt
