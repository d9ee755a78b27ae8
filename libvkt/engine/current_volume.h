// The current volume of a source that stays in other hands, as a sequence of its own.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <utility>

namespace vkt {

/// The source has to outlive it, and its next_volume() to have been called.
class CurrentVolume : public Source {
public:
    explicit CurrentVolume(Source& source) : source_(source) {}
    bool next_volume() override { return !std::exchange(begun_, true); }
    Header const& header() const override { return source_.header(); }
    Access access() const override { return source_.access(); }
    void read(AnyView out) override { source_.read(out); }
    std::optional<ConstView> borrow(Box const& region) override { return source_.borrow(region); }
    void expect(Box const& region) override { source_.expect(region); }
    std::int64_t natural_slab() const override { return source_.natural_slab(); }
    Space space() const override { return source_.space(); }
    void finish() override { source_.finish(); }
    BrickSequence take_bricks() override { return source_.take_bricks(); }

private:
    Source& source_;
    bool begun_ = false;
};

} // namespace vkt
