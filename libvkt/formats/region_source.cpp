// Regions as sources.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/region_source.h"

#include "libvkt/amr/edit.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"

#include <optional>
#include <utility>

namespace vkt {

namespace {

class RegionSource : public SourceDecorator {
public:
    RegionSource(std::unique_ptr<Source> source, Roi roi, WorldRoi world_roi, std::function<void(Box const&)> on_region)
        : SourceDecorator(std::move(source)), roi_(std::move(roi)), world_roi_(std::move(world_roi)),
          on_region_(std::move(on_region)), narrowed_(inner().narrow(roi_, world_roi_)) {}

    bool next_volume() override;
    Header const& header() const override { return header_; }
    void read(AnyView out) override { inner().read(out.moved_to(out.box.lower + box_.lower)); }
    std::optional<ConstView> borrow(Box const& region) override {
        auto view = inner().borrow(in_whole(region));
        if (view) view = view->moved_to(region.lower);
        return view;
    }
    std::shared_ptr<Lease> lease(Box const& region) override { return inner().lease(in_whole(region)); }
    std::optional<Volume> take_whole() override { return std::nullopt; } // the whole is not what was asked for
    void expect(Box const& region) override { inner().expect(in_whole(region)); }
    BrickSequence take_bricks() override { return tree_ ? std::move(*tree_) : inner().take_bricks(); }

private:
    Box in_whole(Box const& region) const { return {region.lower + box_.lower, region.upper + box_.lower}; }

    Roi roi_;
    WorldRoi world_roi_;
    std::function<void(Box const&)> on_region_;
    Header header_;
    Box box_;
    bool narrowed_;                     ///< hierarchical volumes come with the region's bricks only
    std::optional<BrickSequence> tree_; ///< cropped here
};

bool RegionSource::next_volume() {
    if (!inner().next_volume()) return false;
    header_ = inner().header();
    tree_.reset();
    box_ = world_roi_.empty() ? roi_.resolve(header_.dims) : world_roi_.resolve(header_.geometry, header_.dims);
    std::optional<History> history = header_.history;
    if (history) history = folded({{"crop", "--roi", to_text(box_)}, {*history}});
    if (on_region_) on_region_(box_);
    if (header_.kind == Kind::hierarchical) {
        if (!narrowed_ && !header_.dry_run) {
            tree_ = crop_tree(inner().take_bricks(), box_);
            header_ = tree_->header();
        }
        header_.history = std::move(history);
        return true;
    }
    header_.dims = box_.dims();
    header_.geometry = cropped(header_.geometry, box_.lower);
    header_.history = std::move(history);
    // What depends on the whole lattice is true no longer.
    header_.part.reset();
    return true;
}

} // namespace

std::unique_ptr<Source> region_of(std::unique_ptr<Source> source, Roi roi, WorldRoi world_roi,
                                  std::function<void(Box const&)> on_region) {
    if (roi.empty() && world_roi.empty()) return source;
    return std::make_unique<RegionSource>(std::move(source), std::move(roi), std::move(world_roi),
                                          std::move(on_region));
}

} // namespace vkt
