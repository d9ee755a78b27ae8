// Rows of whole voxels are read, and every so many values are taken out of them.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/components.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/core/volume.h"
#include "libvkt/engine/spool.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace vkt {

namespace {

/// Values that are read at once, of all components.
constexpr std::int64_t portion = std::int64_t{1} << 18;

template <std::size_t size> void take_each(std::byte const* from, std::size_t step, std::byte* to, std::int64_t n) {
    for (std::int64_t i = 0; i < n; ++i, from += step, to += size) std::memcpy(to, from, size);
}

/// n values of `size` bytes that lie `step` bytes apart.
void take_each(std::byte const* from, std::size_t step, std::byte* to, std::int64_t n, std::size_t size) {
    if (size == 1) take_each<1>(from, step, to, n);
    if (size == 2) take_each<2>(from, step, to, n);
    if (size == 4) take_each<4>(from, step, to, n);
    if (size == 8) take_each<8>(from, step, to, n);
}

class ComponentSource : public Source {
public:
    ComponentSource(std::unique_ptr<Source> wide, Components components)
        : wide_(std::move(wide)), components_(components) {
        take_header();
    }

    bool next_volume() override {
        if (index_ < 0 || index_ + 1 == components_.count) {
            kept_.reset();
            if (!wide_->next_volume()) return false;
            take_header();
            index_ = -1;
        }
        ++index_;
        if (components_.along)
            header_.attributes["sequence position"] =
                to_text(components_.along->origin + static_cast<double>(index_) * components_.along->step);
        else
            header_.attributes["channel"] = to_text(index_);
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::random; }
    std::vector<std::string> not_read() const override { return wide_->not_read(); }

    void finish() override {
        if (index_ + 1 == components_.count && !kept_) wide_->finish();
    }

    void read(AnyView out) override {
        if (out.box.empty()) return;
        if (!box_of(header_.dims).contains(out.box))
            throw Error(ErrorKind::failure, text("region ", out.box, " is outside of the volume"));
        if (wide_->access() != Access::random && !kept_) kept_ = spooled(*wide_, 1, default_execution(), StageInfo{});
        Source& from = kept_ ? *kept_ : *wide_;
        std::int64_t const n = components_.count, width = out.dims().x;
        std::size_t const size = size_of(header_.dtype);
        // Of long rows a part, of short ones several.
        std::int64_t const part = std::clamp<std::int64_t>(portion / n, 1, width);
        std::int64_t const rows = std::clamp<std::int64_t>(portion / (part * n), 1, out.dims().y);
        Header some = wide_->header();
        for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z)
            for (std::int64_t y = out.box.lower.y; y < out.box.upper.y; y += rows)
                for (std::int64_t x = out.box.lower.x; x < out.box.upper.x; x += part) {
                    some.dims = {std::min(part, out.box.upper.x - x) * n, std::min(rows, out.box.upper.y - y), 1};
                    if (!values_ || values_->header().dims != some.dims) values_.emplace(some);
                    AnyView const all = values_->mutable_view().moved_to({x * n, y, z});
                    from.read(all);
                    for (std::int64_t r = y; r < all.box.upper.y; ++r)
                        take_each(all.at(x * n, r, z) + static_cast<std::size_t>(index_) * size,
                                  static_cast<std::size_t>(n) * size, out.at(x, r, z), some.dims.x / n, size);
                }
    }

private:
    /// The header of one component from that of all.
    void take_header() {
        header_ = wide_->header();
        if (components_.count < 1 || header_.dims.x % components_.count != 0)
            throw Error(ErrorKind::data, text("rows of ", header_.dims.x, " values do not hold ", components_.count,
                                              " components a voxel"));
        header_.dims.x /= components_.count;
        if (components_.along) header_.attributes["sequence step"] = to_text(components_.along->step);
    }

    std::unique_ptr<Source> wide_;
    Components components_;
    Header header_;
    std::int64_t index_ = -1;      ///< component
    std::unique_ptr<Source> kept_; ///< the current volume of wide_ once it is read, of what can only be read forward
    std::optional<Volume> values_;
};

} // namespace

std::unique_ptr<Source> component_source(std::unique_ptr<Source> wide, Components components) {
    return std::make_unique<ComponentSource>(std::move(wide), components);
}

} // namespace vkt
