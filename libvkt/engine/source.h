// Source and Sink: where voxels come from and where they go, slab by slab. Files, pipes, operations are all of this
// shape.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/brick_sequence.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/header.h"
#include "libvkt/core/roi.h"
#include "libvkt/core/view.h"
#include "libvkt/core/volume.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt {

/// Whether regions may be asked for in any order, or only moving forward: with z, and within one slice with y (skipping
/// is allowed, going back is not).
enum class Access : std::uint8_t { forward, random };

/// Thrown by who is asked for the voxels of a volume that is only planned (a dry run).
struct PlannedOnly {};

/// Keeps the voxels of a slab where they lie, unchanged, for as long as it exists.
class Lease {
public:
    Lease() = default;
    virtual ~Lease() = default;
    Lease(Lease const&) = delete;
    Lease& operator=(Lease const&) = delete;
};

/// A sequence of volumes, each read region by region. Call order: next_volume, header, read…, finish, next_volume, …
class Source {
public:
    virtual ~Source() = default;

    /// Moves to the next volume; false when the sequence has ended properly. Must be called before header().
    virtual bool next_volume() = 0;
    /// Goes back before the first volume, wherever in the sequence, if it can be had once more.
    virtual bool rewind() { return false; }
    virtual Header const& header() const = 0;
    virtual Access access() const = 0;

    /// Copies the voxels of out.box (inside the volume) to `out`, which lies in space().
    virtual void read(AnyView out) = 0;
    /// The region in place, if it happens to lie in memory as it is; valid until the next call. Never does work.
    virtual std::optional<ConstView> borrow(Box const& /*region*/) { return std::nullopt; }
    /// The region as a slab that may be handed on without a copy; null unless it lies so in memory that can be. Never
    /// does work.
    virtual std::shared_ptr<Lease> lease(Box const& /*region*/) { return nullptr; }
    /// The consumer will ask for nothing outside this region of the current volume: a chance to read ahead.
    virtual void expect(Box const& /*region*/) {}
    /// Whether the current volume is computed slab by slab from what lies where it can be read by several at once, so
    /// that each of several such sources may be asked for some of its slabs. `ascending`: slabs are asked for in order.
    virtual bool divisible(bool /*ascending*/) const { return true; }
    /// What is read from now on counts in remarks only in these slices: others compute the rest, too.
    virtual void count_only(std::int64_t /*begin*/, std::int64_t /*end*/) {}
    /// Slab height in which the source hands out slices most cheaply; 0 if all heights are alike.
    virtual std::int64_t natural_slab() const { return 0; }
    /// Where read() expects its output and borrow() hands it out.
    virtual Space space() const { return Space::host; }

    /// Asks, before the first next_volume(), for no more bricks of hierarchical volumes than a region needs (finest
    /// cells or world units). False if the source cannot: it then yields them whole. Structured volumes are not
    /// affected.
    virtual bool narrow(Roi const& /*roi*/, WorldRoi const& /*world_roi*/) { return false; }
    /// The current volume of kind hierarchical, which is not read region by region. Once per volume.
    virtual BrickSequence take_bricks();

    /// What the file of the current volume holds besides and nobody here can read: "grid 'v' of type vec3s".
    virtual std::vector<std::string> not_read() const { return {}; }

    /// How many volumes follow that are parts of the same whole as the current one, if the source cuts one up.
    virtual std::int64_t parts_to_come() const { return 0; }

    /// The whole current volume, finished, if it lies in memory in one piece that may be had without a copy. Only
    /// before anything else was asked of it.
    virtual std::optional<Volume> take_whole() { return std::nullopt; }

    /// Consumes what is left of the current volume and proves that it is whole. Throws Error{data} otherwise.
    virtual void finish() = 0;
};

/// Takes volumes slab by slab in z order. Call order: begin, (acquire, commit)…, end, begin, …, close.
/// Destruction without close() discards everything that was not yet promised: no partial output remains.
class Sink {
public:
    virtual ~Sink() = default;

    virtual void begin(Header const& header) = 0;
    /// Instead of begin() to end(), of a volume that is only planned: throws what begin() would for what is there
    /// already.
    virtual void plan(Header const& /*header*/) {}
    /// Memory for the next slab: whole slices, or whole rows of a single slice, following the last without a gap.
    /// Blocks under back-pressure.
    virtual AnyView acquire(Box const& slab) = 0;
    /// The slab last acquired is complete.
    virtual void commit() = 0;
    /// Takes a slab where it lies instead of acquire and commit; false if it has to be copied.
    virtual bool pass_on(Box const& /*slab*/, std::shared_ptr<Lease> const& /*lease*/) { return false; }
    /// The volume is complete.
    virtual void end() = 0;
    /// The sequence is complete: outputs appear under their final names.
    virtual void close() = 0;
    /// A volume of kind hierarchical, between begin and end, instead of slabs. Throws Error{usage} where the format
    /// cannot hold one.
    virtual void put_bricks(BrickSequence bricks);
    /// Slab height that the sink prefers; 0 if it has no preference.
    virtual std::int64_t natural_slab() const { return 0; }
    virtual Space space() const { return Space::host; }
    /// Tells a reader downstream why no more will come. Files need nothing.
    virtual void fail(std::string const& /*stage*/, std::string const& /*message*/) {}
};

} // namespace vkt
