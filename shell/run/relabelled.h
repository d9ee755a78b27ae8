// Sources that change or announce the headers of the volumes that pass through them.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/decorator.h"
#include "shell/command.h"

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace vkt::shell {

/// A source whose headers are changed on the way.
class Relabelled : public SourceDecorator {
public:
    using SourceDecorator::SourceDecorator;
    bool next_volume() override {
        if (!inner().next_volume()) return false;
        header_ = inner().header();
        relabel(header_);
        return true;
    }
    Header const& header() const override { return header_; }

private:
    virtual void relabel(Header& header) const = 0;
    Header header_;
};

/// Marks the volumes of a source as planned only; gives no voxels.
class PlanOnly : public Relabelled {
public:
    using Relabelled::Relabelled;
    void read(AnyView) override { throw PlannedOnly(); }
    std::optional<ConstView> borrow(Box const&) override { throw PlannedOnly(); }
    BrickSequence take_bricks() override { throw PlannedOnly(); }
    std::optional<Volume> take_whole() override { throw PlannedOnly(); }
    void finish() override {
        if (inner().header().dry_run) inner().finish();
    }

private:
    void relabel(Header& header) const override {
        if (header.dry_run) return;
        header.dry_run = true;
        header.planned.reset();
    }
};

/// Adds a step to what headers tell of a dry run, or, without words, forgets that; leaves other headers alone.
class WithPlannedStep : public Relabelled {
public:
    WithPlannedStep(std::unique_ptr<Source> source, std::vector<std::string> words)
        : Relabelled(std::move(source)), words_(std::move(words)) {}

private:
    void relabel(Header& header) const override {
        if (!header.dry_run) return;
        if (words_.empty()) return header.planned.reset();
        History step{words_, {}};
        if (header.planned) step.inputs.push_back(*header.planned);
        header.planned = step;
    }
    std::vector<std::string> words_;
};

/// Tells of each volume of a source, for --dry-run, --explain and --verbose; of the parts of a whole only with the
/// first, and how many there are.
class Announced : public SourceDecorator {
public:
    using Tell = std::function<void(Header const& header, std::int64_t parts)>;

    Announced(std::unique_ptr<Source> source, Tell tell) : SourceDecorator(std::move(source)), tell_(std::move(tell)) {}
    bool next_volume() override {
        if (!inner().next_volume()) return false;
        if (to_come_ > 0) {
            --to_come_;
            return true;
        }
        to_come_ = inner().parts_to_come();
        tell_(inner().header(), to_come_ + 1);
        return true;
    }

private:
    Tell tell_;
    std::int64_t to_come_ = 0;
};

/// Asks the stages downstream for their times.
class Timed : public Relabelled {
public:
    using Relabelled::Relabelled;

private:
    void relabel(Header& header) const override { header.timing = true; }
};

/// Adds the first step to the history of volumes that come from an opener (read).
class WithHistory : public Relabelled {
public:
    WithHistory(std::unique_ptr<Source> source, std::vector<std::string> words)
        : Relabelled(std::move(source)), words_(std::move(words)) {}

private:
    void relabel(Header& header) const override {
        // A file that knows its own past needs no step that says it was read.
        if (header.history) return;
        mark_as_given(header);
        header.history = History{words_, {}};
    }
    std::vector<std::string> words_;
};

/// Whose losses are errors, before anybody takes what came of them for whole.
class StrictSource : public SourceDecorator {
public:
    StrictSource(std::unique_ptr<Source> source, std::function<void()> refuse)
        : SourceDecorator(std::move(source)), refuse_(std::move(refuse)) {}

    void finish() override {
        inner().finish();
        refuse_();
    }

private:
    std::function<void()> refuse_;
};

} // namespace vkt::shell
