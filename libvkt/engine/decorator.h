// A source around a source: forwards everything, so that a wrapper overrides only what it changes.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/source.h"

#include <functional>
#include <memory>
#include <utility>

namespace vkt {

class SourceDecorator : public Source {
public:
    explicit SourceDecorator(std::unique_ptr<Source> source) : source_(std::move(source)) {}

    bool next_volume() override { return source_->next_volume(); }
    bool rewind() override { return source_->rewind(); }
    Header const& header() const override { return source_->header(); }
    Access access() const override { return source_->access(); }
    void read(AnyView out) override { source_->read(out); }
    std::optional<ConstView> borrow(Box const& region) override { return source_->borrow(region); }
    std::shared_ptr<Lease> lease(Box const& region) override { return source_->lease(region); }
    bool narrow(Roi const& roi, WorldRoi const& world_roi) override { return source_->narrow(roi, world_roi); }
    BrickSequence take_bricks() override { return source_->take_bricks(); }
    std::vector<std::string> not_read() const override { return source_->not_read(); }
    std::int64_t parts_to_come() const override { return source_->parts_to_come(); }
    std::optional<Volume> take_whole() override { return source_->take_whole(); }
    void expect(Box const& region) override { source_->expect(region); }
    bool divisible(bool ascending) const override { return source_->divisible(ascending); }
    void count_only(std::int64_t begin, std::int64_t end) override { source_->count_only(begin, end); }
    std::int64_t natural_slab() const override { return source_->natural_slab(); }
    Space space() const override { return source_->space(); }
    void finish() override { source_->finish(); }

protected:
    Source& inner() const { return *source_; }
    void replace(std::unique_ptr<Source> source) { source_ = std::move(source); }

private:
    std::unique_ptr<Source> source_;
};

/// A source that can be opened again, such as a file.
class ReopenedSource : public SourceDecorator {
public:
    explicit ReopenedSource(std::function<std::unique_ptr<Source>()> open)
        : SourceDecorator(open()), open_(std::move(open)) {}

    bool rewind() override {
        replace(open_());
        return true;
    }

private:
    std::function<std::unique_ptr<Source>()> open_;
};

} // namespace vkt
