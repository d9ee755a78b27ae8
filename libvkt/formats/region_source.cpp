// Regions as sources.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/region_source.h"

#include "libvkt/amr/edit.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/buffer.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"
#include "libvkt/kernel/border.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace vkt {

namespace {

constexpr std::size_t most_scratch = std::size_t{4} << 20;

class RegionSource : public SourceDecorator {
public:
    RegionSource(std::unique_ptr<Source> source, Roi roi, WorldRoi world_roi,
                 std::function<void(SteppedBox const&)> on_region)
        : SourceDecorator(std::move(source)), roi_(std::move(roi)), world_roi_(std::move(world_roi)),
          on_region_(std::move(on_region)), narrowed_(inner().narrow(roi_, world_roi_)) {}

    bool next_volume() override;
    Header const& header() const override { return header_; }
    void read(AnyView out) override {
        if (!region_.dense()) return read_steps(out);
        inner().read(out.moved_to(out.box.lower + region_.box.lower));
    }
    std::optional<ConstView> borrow(Box const& region) override {
        if (!region_.dense()) return std::nullopt;
        auto view = inner().borrow(in_whole(region));
        if (view) view = view->moved_to(region.lower);
        return view;
    }
    std::shared_ptr<Lease> lease(Box const& region) override {
        return region_.dense() ? inner().lease(in_whole(region)) : nullptr;
    }
    std::int64_t natural_slab() const override { return region_.dense() ? inner().natural_slab() : 0; }
    std::optional<Volume> take_whole() override { return std::nullopt; } // the whole is not what was asked for
    void expect(Box const& region) override { inner().expect(in_whole(region)); }
    BrickSequence take_bricks() override { return tree_ ? std::move(*tree_) : inner().take_bricks(); }

private:
    Box in_whole(Box const& region) const { return region_.source(region); }
    void read_steps(AnyView const& out);

    Roi roi_;
    WorldRoi world_roi_;
    std::function<void(SteppedBox const&)> on_region_;
    Header header_;
    SteppedBox region_;
    Buffer scratch_;                    ///< rows of the source that have steps
    bool narrowed_;                     ///< hierarchical volumes come with the region's bricks only
    std::optional<BrickSequence> tree_; ///< cropped here
};

bool RegionSource::next_volume() {
    if (!inner().next_volume()) return false;
    header_ = inner().header();
    tree_.reset();
    bool const tree = header_.kind == Kind::hierarchical;
    if (tree)
        region_ = {world_roi_.empty() ? resolve_in_tree(roi_, header_) : resolve_in_tree(world_roi_, header_)};
    else if (!world_roi_.empty())
        region_ = {world_roi_.resolve(header_.geometry, header_.dims)};
    else
        region_ = roi_.resolve_steps(header_.dims);
    std::optional<History> history = header_.history;
    if (history) history = folded({{"crop", "--roi", to_text(region_)}, {*history}});
    if (on_region_) on_region_(region_);
    if (tree) {
        if (!narrowed_ && !header_.dry_run) {
            tree_ = crop_tree(inner().take_bricks(), region_.box);
            header_ = tree_->header();
        }
        header_.history = std::move(history);
        return true;
    }
    header_.dims = region_.dims();
    header_.geometry = region_.geometry(header_.geometry);
    header_.history = std::move(history);
    // What depends on the whole lattice is true no longer.
    header_.part.reset();
    return true;
}

/// A slice of the source at a time, or some rows of it, where the source has them.
void RegionSource::read_steps(AnyView const& out) {
    std::size_t const row = static_cast<std::size_t>(in_whole(out.box).dims().x) * size_of(out.type);
    std::int64_t const rows = std::max<std::int64_t>(1, static_cast<std::int64_t>(most_scratch / row) / region_.step.y);
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
        for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; y += rows) {
            Box part = out.box;
            part.lower.y = y;
            part.upper.y = std::min(out.box.upper.y, y + rows);
            part.lower.z = z;
            part.upper.z = z + 1;
            Box const box = in_whole(part);
            scratch_.reserve(static_cast<std::size_t>(box.voxels()) * size_of(out.type));
            AnyView const held = dense_view(scratch_.write(out.space), out.type, box, out.space);
            inner().read(held);
            copy_every(held, region_.step, out.part(part));
        }
}

} // namespace

std::unique_ptr<Source> region_of(std::unique_ptr<Source> source, Roi roi, WorldRoi world_roi,
                                  std::function<void(SteppedBox const&)> on_region) {
    if (roi.empty() && world_roi.empty()) return source;
    return std::make_unique<RegionSource>(std::move(source), std::move(roi), std::move(world_roi),
                                          std::move(on_region));
}

} // namespace vkt
