// Errors of stages that share a process: each begins with the name of the stage whose work it was, as remarks do.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/engine/decorator.h"

#include <memory>
#include <string>
#include <utility>

namespace vkt::shell {

/// An error that begins with the name of its stage.
class StageError : public Error {
public:
    StageError(std::string const& stage, Error const& error)
        : Error(error.kind(), text(stage, ": ", error.what()), error.hint()) {}
};

/// Does a part of the work of a stage. What goes wrong in it is the stage's, unless another one has said so already. An
/// empty name changes nothing: the process has one stage.
template <class F> auto in_stage(std::string const& stage, F const& work) {
    if (stage.empty()) return work();
    try {
        return work();
    } catch (StageError const&) {
        throw;
    } catch (UpstreamError const&) { // it was printed where it happened
        throw;
    } catch (Error const& e) {
        throw StageError(stage, e);
    }
}

/// What a stage yields: what goes wrong while others ask for it is the stage's.
class StageSource : public SourceDecorator {
public:
    StageSource(std::unique_ptr<Source> source, std::string stage)
        : SourceDecorator(std::move(source)), stage_(std::move(stage)) {}

    bool next_volume() override {
        return in_stage(stage_, [&] { return inner().next_volume(); });
    }
    void read(AnyView out) override {
        in_stage(stage_, [&] { inner().read(out); });
    }
    BrickSequence take_bricks() override {
        BrickSequence bricks = in_stage(stage_, [&] { return inner().take_bricks(); });
        if (bricks.in_memory()) return bricks;
        auto const all = std::make_shared<BrickSequence>(std::move(bricks));
        auto const read = [all, stage = stage_](std::size_t first, std::size_t count, std::byte* to) {
            in_stage(stage, [&] { all->read(first, count, to); });
        };
        BrickSequence named(all->header(), all->bricks(), read, all->order());
        named.set_group_bytes(all->group_bytes());
        return named;
    }
    std::optional<Volume> take_whole() override {
        return in_stage(stage_, [&] { return inner().take_whole(); });
    }
    void finish() override {
        in_stage(stage_, [&] { inner().finish(); });
    }

private:
    std::string stage_;
};

} // namespace vkt::shell
