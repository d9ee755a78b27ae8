// The operation description: one class serves CLI, C API, dry run, streaming engine, CPU and GPU.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/execution.h"
#include "libvkt/core/header.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/report.h"
#include "libvkt/core/texts.h"
#include "libvkt/core/view.h"
#include "libvkt/engine/error_bound.h"
#include "libvkt/engine/source.h"

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vkt {

/// What an operation does to the lattice. The engine derives from it what may stream and how hierarchical volumes are
/// treated: pointwise runs brick by brick, reductions weight by cell volume, the others say so when they cannot.
enum class Shape : std::uint8_t {
    source,        ///< no input
    pointwise,     ///< output voxel depends on the input voxel(s) at its position
    neighbourhood, ///< … on a box around its position (a halo)
    geometric,     ///< moves voxels: crop, flip, resample
    reduction,     ///< no output volume, but a report
};

/// All that is known before any voxel moves.
struct Plan {
    Header output;                   ///< ignored for reductions
    Access access = Access::forward; ///< random: ascending output slabs need input slabs in another order
    bool scans = false;              ///< wants scan() over the whole input before run(); reductions: more than once
    /// run() is called once, for all of the output; footprints are whole inputs. Refused where these, the output and
    /// state_bytes exceed the budget, but for LinePasses.
    bool whole = false;
    /// run() keeps what came before: it is called for all of the output, once, in order: slabs of whole slices, or
    /// whole rows of one. What is then asked for out of order is spooled by who asks.
    bool carries = false;
    Boundary boundary = Boundary::clamp; ///< how the engine fills footprints that reach outside the input
    /// Stored value for Boundary::border. The engine stores it as a voxel of the input's type; operations that compute
    /// with it keep their footprints inside the volume and use the value as it is.
    double border_value = 0;
    /// Output voxel p is input voxel p + shift, bit for bit (crop, header edits): the engine hands the input through.
    std::optional<Index3> shift;
    std::int64_t slab_hint = 0; ///< least slab height at which the operation is efficient (e.g. 4 halos); 0: any
    std::string method;         ///< name of the chosen method, e.g. "direct FIR, radius 8"
    ErrorBound error;           ///< exact: permutation, integer or correctly rounded result
    ErrorPassing passing;       ///< what becomes of the inputs' errors; unknown unless the operation says it
    /// Multiply-adds per output voxel, of what does something else as many as take as long on a CPU: for --explain,
    /// --device auto and predictions of time.
    double cost = 1;
    std::size_t state_bytes = 0; ///< memory held whatever the regions are that run() is given; see also fit()
    /// What is held besides, as much as the voxels ask for: "4 bytes a run of voxels, 72 a component". Empty: nothing.
    std::string_view grows_by{};
};

/// A remark for the user after the run: "12034 of 16777216 voxels clipped to [0,255]". Lossy remarks fail --strict.
struct Remark {
    std::string message;
    bool lossy = true;
};

class ReferenceVolume;
struct Measurement;

/// One instance is configured once (parameters), begun once per volume, as its plan has it, and then run on regions,
/// always from one thread at a time. It may be planned at any time, for any volume: that changes nothing. Results must
/// not depend on how the output is cut into regions.
class Operation {
public:
    virtual ~Operation() = default;

    virtual std::string_view name() const = 0;
    /// What help says. Commands with texts of their own (commands/) need none here.
    virtual Texts texts() const { return {}; }
    virtual Shape shape() const = 0;
    virtual int inputs() const { return shape() == Shape::source ? 0 : 1; }
    /// Paths of the inputs, for operations that take them among their own arguments; otherwise the framework asks.
    virtual std::vector<std::string> input_names() const { return {}; }

    /// The volume whose header the plan follows, for operations with an option --like.
    virtual ReferenceVolume* like() { return nullptr; }
    /// The parameter that names a file of a volume that is no input, such as that; empty if there is none. Programs
    /// give a volume in memory in its place.
    virtual std::string_view volume_file() const { return {}; }
    /// That volume, from whoever has it or has opened it; the parameter is set.
    virtual void take_volume(Source& /*opened*/) {}

    /// Declares the parameters and binds them to members.
    virtual void parameters(Parameters&) {}
    /// Checks that need no input, right after parsing; throws Error{usage}.
    virtual void check() const {}

    /// Validates against the inputs' headers and describes the output. Changes nothing: dry runs, budgets and previews
    /// ask as often as they like, and of a volume that is being worked on, too.
    virtual Plan plan(std::span<Header const> inputs) const = 0;
    /// A volume begins that was planned so, from the same headers: what was kept or counted of the one before is gone,
    /// and what footprint(), fit(), scan() and run() work with is made. Once per volume, before any of them; cheap,
    /// since dry runs begin their volumes, too. What lies below here is about the volume that was begun last.
    virtual void begin(std::span<Header const> /*inputs*/, Plan const& /*plan*/) {}
    /// Input region that an output region needs; may reach outside the input, where the boundary rule fills it. An
    /// operation that keeps input slices from the run before may leave them out of the next region's footprint.
    virtual Box footprint(Box const& output, int /*input*/) const { return output; }

    /// The part of the input that scan() wants to see; no more of it is read than that.
    virtual Box scanned(Box const& whole) const { return whole; }
    /// A pass before run(), if the plan asks for it: sees every slab of that part once, in z order, all its columns.
    /// All its rows too, unless a slice is too large for the budget: then it comes alone, in pieces of some rows, in
    /// order.
    virtual void scan(ConstView /*slab*/, Execution const&) {}
    /// Of how many rows, counted from the first of such a slice, its pieces are multiples.
    virtual std::int64_t scan_step(Index3 /*part*/) const { return 1; }
    virtual void scan_end() {}
    /// After scan_end(): true if one pass was not enough. Reductions only if their plan says that they scan.
    virtual bool scans_again() const { return false; }
    /// After scan_end(), once: what the scan found out goes into the plan: the output's value map, attributes, values
    /// and error, and a type of no more bytes than was planned. All else has been settled and must stay.
    virtual void after_scan(Plan& /*plan*/) const {}

    /// Regions for run() will be no larger than this. Returns the bytes that the operation is going to hold for such
    /// regions, besides them and their footprints; it may be asked about several before it runs, and the last counts.
    virtual std::size_t fit(Index3 /*largest*/, Execution const&) { return 0; }

    /// Computes out.box. inputs[i] covers footprint(out.box, i), borders included, and lies in execution.space().
    /// Reductions have no output, and nothing to do here.
    virtual void run(std::span<ConstView const> inputs, AnyView out, Execution const& execution) = 0;

    /// Neighbourhood operations on hierarchical volumes: plans one level, whose lattice the header describes as if it
    /// were a structured volume. Its cells are this many finest cells wide; lengths in voxels mean finest cells.
    virtual Plan plan_level(Header const& level, Index3 /*cell_width*/) const { return plan({&level, 1}); }
    /// That level begins, as a volume does. They come one after the other, any of them more than once.
    virtual void begin_level(Header const& level, Index3 /*cell_width*/, Plan const& plan) { begin({&level, 1}, plan); }
    /// Hierarchical volumes: the cells that scan() and run() see next are this many finest cells wide along each axis,
    /// and positions count cells of their level, of which cell (0,0,0) begins at `first` (in finest cells, never above
    /// 0 for pointwise operations and reductions). Reductions weight by the product, operations with regions scale
    /// them.
    virtual void enter_level(Index3 /*cell_width*/, Index3 /*first*/) {}
    /// Pointwise operations whose result never depends on positions say false: cells then come as long rows instead of
    /// brick by brick.
    virtual bool uses_position() const { return true; }
    /// The numbers of voxels that remarks() are made of, where they add up over regions: the engine takes out what was
    /// a trial, or what others computed, too, and adds what several instances counted in parts of one volume.
    virtual std::vector<std::int64_t*> counters() { return {}; }
    /// Geometric operations on hierarchical volumes give the bricks of the result here; they are made of the input's
    /// when they are asked for. None if bricks cannot be moved so.
    virtual std::optional<BrickSequence> move_bricks(BrickSequence /*input*/, Execution const&) { return {}; }
    /// Sources of hierarchical volumes, whose plan tells the counts of bricks, give the bricks here; cells are best
    /// made when they are asked for.
    virtual std::optional<BrickSequence> make_bricks(Execution const&) { return {}; }
    /// Geometric operations of one input whose plan makes a structured volume of a hierarchical one, or a hierarchical
    /// of a structured one, are given all of it here, before run(). They return the result whole, which then goes
    /// through after_scan(); or nothing: run() then computes region by region from what was given, and the footprint of
    /// such an input is empty.
    virtual std::optional<Volume> take_whole(Volume /*input*/, Execution const&) { return {}; }

    /// Reductions: reads all volumes of the inputs, finishes each of them, and tells their reports, see Measurement. By
    /// default reduce() is applied to each volume of the only input, and tells report().
    virtual void measure(Measurement& to);
    /// Reductions: whether reports can be printed so, once parameters are read whether as they ask for it.
    virtual bool prints(ReportForm form) const { return form != ReportForm::csv; }
    /// Reductions: false if what was measured is not as it should be; the command then exits with 1.
    virtual bool satisfied() const { return true; }

    /// True if run() works on device memory; of reductions, if what they do to an input does. Before begin(): if it
    /// does so for some volumes.
    virtual bool runs_on_gpu() const { return false; }
    /// True if scan() works on device memory.
    virtual bool scans_on_gpu() const { return shape() == Shape::reduction && runs_on_gpu(); }
    /// What was clipped, not a number, … in the volume just finished.
    virtual std::vector<Remark> remarks() const { return {}; }
    /// Voxels of the result that run() was asked for since begin(): the engine's own count.
    std::int64_t computed = 0;
    /// True if there is a report() beside the output. Adds the option --report to the command.
    virtual bool reports() const { return false; }
    /// What was found in the volume just finished.
    virtual Report report() const { return {}; }
};

/// Plans a volume and begins it.
inline Plan begun(Operation& operation, std::span<Header const> inputs) {
    Plan plan = operation.plan(inputs);
    operation.begin(inputs, plan);
    return plan;
}

/// An operation under the name that commands, C API and Python know it by. See libvkt/engine/registry.h.
struct RegisteredOperation {
    std::string_view name;
    std::unique_ptr<Operation> (*make)() = nullptr;
};

/// Registers a class: a line `VKT_OPERATION(Flip, "flip")` in the host part of its source. CMake lists these lines;
/// constructors of static objects would not do, because a static library leaves out what nobody names.
#define VKT_OPERATION(Class, name)                                                                                     \
    RegisteredOperation registered_##Class() {                                                                         \
        return {name, []() -> std::unique_ptr<Operation> { return std::make_unique<Class>(); }};                       \
    }

} // namespace vkt
