// Rendering: a volume, settings and an execution policy in, a picture and a report out.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/roi.h"
#include "libvkt/core/volume.h"
#include "libvkt/render/camera.h"
#include "libvkt/render/environment.h"
#include "libvkt/render/goal.h"
#include "libvkt/render/image.h"
#include "libvkt/render/lattice.h"
#include "libvkt/render/presets.h"
#include "libvkt/render/tiles.h"
#include "libvkt/render/transfer.h"
#include "libvkt/render/tree.h"

#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

namespace vkt::render {

enum class Algorithm : std::uint8_t { ray_marching, implicit_iso, multi_scattering, maximum, minimum, mean };
/// Maximum, minimum and mean along rays, which have colours and no opacity.
inline bool is_projection(Algorithm a) {
    return a == Algorithm::maximum || a == Algorithm::minimum || a == Algorithm::mean;
}

/// Whether a volume is drawn as labels: where its header says that it holds some.
enum class LabelMode : std::uint8_t { automatic, always, never };

/// How a hierarchical volume is drawn: brick by brick, each at its own level; as that, but marched through blocks, see
/// TreeBlocks, where it has no holes and there is memory for them; as the grid of its finest cells that the basis
/// reconstruction makes of it; or as this where it takes no more memory and no part of it would be made up, else by
/// blocks.
enum class TreeDrawing : std::uint8_t { automatic, blocks, bricks, grid };

/// A label that a volume holds: its name, if it has one, and the colour that it is drawn in, sRGB.
struct ShownLabel {
    std::int64_t label = 0;
    std::string name;
    Color color;
};

/// All that decides a picture besides the volume. One optical model for all algorithms: extinction is -ln(1-alpha) per
/// unit distance, colour is emission (marching) or albedo (scattering).
struct RenderSettings {
    Algorithm algorithm = Algorithm::ray_marching;
    int width = 512, height = 512; ///< in 1…16384
    CameraRequest camera;

    // Transfer function: the first that is given holds; the colour map and opacities make one otherwise.
    std::optional<TransferFunction> transfer;
    std::vector<double> lut;        ///< r g b a … over the domain
    std::optional<DataKind> preset; ///< of the kind of data; the colour map may be another
    std::string colormap;           ///< empty: chosen from the data
    std::string opacity = "auto";   ///< "auto" or "A0,A1,…" over the domain or "VALUE:A,…"
    std::string domain = "auto";    ///< see resolve_domain
    /// What is chosen from the data is chosen from this, so that pictures of a series have the same colours; null: from
    /// the volume's own.
    std::shared_ptr<Histogram const> chosen_from;
    std::string unit; ///< world length, "auto" (diagonal / 256) or empty (the transfer's, else smallest spacing)
    double opacity_scale = 1; ///< multiplies extinctions

    /// Each label opaque, in a colour of its own, without values between labels; see draws_labels() for when.
    LabelMode labels = LabelMode::automatic;
    /// Of hierarchical volumes; a Renderer that is there already has decided.
    TreeDrawing tree = TreeDrawing::automatic;

    // Ray marching.
    double step = 0.5;  ///< in voxels along the ray, in [1/256, 4]
    bool exact = false; ///< reference mode, which has no step
    /// Levels of 8-bit display by which rays and steps may be left out in structured volumes over an opaque background
    /// where there is no other goal, see draw_sparsely(); 0: none is.
    double shortcut = 0;
    double shade =
        -1; ///< strength of gradient shading in [0,1]; below 0: chosen (iso 1, automatic transfer 0.8, else 0)
    /// Towards a light that is far away, in the world. None: it is at the eye, and of paths there is none. Paths are
    /// scattered from it, where nothing holds it back, as much as from a light of its share from everywhere.
    std::optional<Vec3> light_direction;
    double ambient = 0.25, specular = 0.12; ///< shares of the light, in [0,1]: from everywhere, of the highlight
    bool shadows = false;                   ///< of surfaces or of the volume, from that light
    /// Directions, up to 64, in which the volume or the surfaces are asked how much of the light from everywhere they
    /// hold back; 0: none of it. Within a world length; 0: a tenth of the volume's diagonal.
    int ambient_occlusion = 0;
    double occlusion_radius = 0;
    bool skip = true; ///< leave out empty space; the picture is the same bit for bit

    // Iso-surfaces: physical values; none: one is chosen from the data.
    std::vector<double> isos;
    std::vector<double> iso_colors;    ///< sRGB r g b of each; none: those of the transfer function
    std::vector<double> iso_opacities; ///< of each, in [0,1]; none: 1
    /// Rays of a pixel where a surface's edge passes, without another goal: a power of two, at most most_rays; 1: one
    /// everywhere.
    int edge_rays = 4;

    Roi clip; ///< voxels that are shown, in hierarchical volumes finest cells; empty: all

    /// Planes of the world, four numbers nx, ny, nz, d each, at most most_planes of them: points p with nx p.x + ny p.y
    /// + nz p.z >= d are shown. The camera does not follow them.
    std::vector<double> clip_planes;

    // Multiple scattering.
    int samples = 64;     ///< paths per pixel
    int first_sample = 0; ///< number of the first one, to continue elsewhere
    std::uint64_t seed = 0;
    double albedo = 1;     ///< multiplies the colours
    double anisotropy = 0; ///< mean cosine of the scattering angle, in (-1, 1); Henyey–Greenstein
    bool emission = false; ///< colours also glow
    int bounces = 100000;
    Color light{1, 1, 1}; ///< linear, of all light; an environment is multiplied by it

    /// Of all algorithms that have light: the one from everywhere. Null: it is the same from everywhere.
    std::shared_ptr<Environment const> environment;
    std::string environment_file;    ///< that it was read from
    double environment_rotation = 0; ///< degrees around z, counterclockwise from above
    double environment_strength = 1; ///< multiplies it, 0 or greater

    Goal goal;             ///< what the picture is refined to; with noise or seconds, samples is the most
    Background background; ///< behind the volume; without a goal it changes no light
    /// Which of so many parts of the picture is drawn, from 1 on: strips of rows_of_part(), pixel by pixel those of the
    /// whole picture. Not with a tolerance or seconds, which pixels share.
    int part = 1, parts = 1;
    bool layers = false; ///< report what is known of every pixel besides its colour
};

/// Rows [first, last) of the part that is drawn: whole strips of 16, as many in each part, but for one.
struct PartRows {
    int first, last;
};
PartRows rows_of_part(RenderSettings const& settings);

/// Whether rays and steps may be left out: see RenderSettings::shortcut.
bool may_leave_out(RenderSettings const& settings, Header const& header);

/// Whether pixels get more rays where a surface's edge passes: see RenderSettings::edge_rays. Labels have none.
bool smooths_edges(RenderSettings const& settings);

/// Throws Error{usage} for settings that no volume can be rendered with.
void check(RenderSettings const& settings);

/// Light of all paths of a picture so far, so that later passes add to it: what many passes give is, bit for bit, what
/// one pass of as many paths gives.
struct Accumulation {
    std::vector<double> sums; ///< four per pixel
    int samples = 0;          ///< paths per pixel in them
};

/// Facts about a picture, for reports.
struct RenderReport {
    Camera camera;
    std::string method;   ///< one line: algorithm and its knobs
    std::string drawn_by; ///< threads and their instructions, or a GPU
    double unit = 0;      ///< world units
    Domain domain;
    TransferFunction transfer;
    std::string recognised;        ///< what the data were taken for, and why; empty: nothing that there is a preset for
    std::vector<double> isos;      ///< physical values of the surfaces that were looked for
    std::vector<Color> iso_colors; ///< sRGB, of each
    /// Where the volume was drawn as labels: those that it holds, in ascending order.
    std::shared_ptr<std::vector<ShownLabel> const> labels;
    double shade = 0;            ///< strength of gradient shading
    std::int64_t rays = 0;       ///< that met the volume
    std::int64_t segments = 0;   ///< that lie on these rays (paths for scattering)
    std::int64_t samples = 0;    ///< values that were looked up
    std::int64_t capped = 0;     ///< paths that were cut at the bounce limit
    double paths = 0;            ///< a pixel, the mean; 0: no path was traced
    std::int64_t first_path = 0; ///< its number among those of the seed
    std::uint64_t seed = 0;
    double skipped = 0;                     ///< share of the macrocells or bricks that nothing can be seen in
    char const* parts = "macrocells";       ///< or bricks
    std::int64_t missing = 0, infinite = 0; ///< voxels that are NaN, infinite
    std::vector<std::string> lossy;         ///< one line each: what was asked for and cannot be seen, and why
    double prepare_seconds = 0, render_seconds = 0;
    double gpu_seconds = 0; ///< of the latter: that a GPU was drawing
    Quality quality;
    Savings savings;
    /// Of one ray through the middle of each pixel, where asked for: "Z", the world distance from the eye
    /// (orthographic: from the plane through it) to the nearest surface, or else to where half of the light is held
    /// back, infinite where nothing is; of surfaces "normal.X", "normal.Y", "normal.Z" in the world, towards the eye,
    /// and "albedo.R", "albedo.G", "albedo.B", their linear colours, zeros where nothing is. Of paths "variance.R",
    /// "variance.G", "variance.B" of the pixel's mean, as it lies over the background. Projections and
    /// pictures that were stopped have none.
    std::vector<Layer> layers;
};

struct Drawing;
struct Categories;

/// A volume made ready once, for many pictures.
class Renderer {
public:
    /// Throws Error{data} for volumes without finite voxels.
    Renderer(Volume const& volume, Execution const& execution, TreeDrawing tree = TreeDrawing::automatic);
    /// The same for voxels that lie elsewhere: those of a structured volume with this header.
    Renderer(Header header, ConstView voxels, Execution const& execution);
    /// The same for a structured volume that is read now, once; small integers are not copied.
    Renderer(Header header, VoxelReader const& read, Execution const& execution);

    /// Throws Error{usage} for settings out of range. Asked to stop, it returns soon and the picture is incomplete.
    /// With an accumulation, multi-scattering adds settings.samples paths to those that are in it and shows all of
    /// them; a pass that was asked to stop leaves it unusable, and a goal is not heeded.
    Image render(RenderSettings const& settings, RenderReport* report = nullptr, std::stop_token const& stop = {},
                 Accumulation* accumulation = nullptr) const;
    /// The same picture with somebody who watches. Stopped, it is what there is: fewer rays or paths than asked for,
    /// and background where nothing was drawn yet.
    Image watched(RenderSettings const& settings, RenderReport* report, Watch const& watch) const;
    Histogram const& histogram() const { return tree_ ? tree_->histogram() : lattice_.histogram; }
    /// Physical value of the voxel or cell at a continuous index; NaN outside, and where there is no data. In types
    /// other than uint8, uint16 and int16, to the precision of floats.
    double value_at(Vec3 index) const;
    Header const& header() const { return header_; }
    /// Times that what follows from transfer function and volume alone was made: cells, tables, ranges.
    std::int64_t preparations() const;

private:
    /// What the settings mean for this volume.
    struct Appearance {
        TransferFunction transfer;
        std::string recognised; ///< see RenderReport
        Domain domain;
        double unit = 1;
        double shade = 0;
        std::vector<IsoView> isos;                ///< in sampled values
        std::vector<double> iso_values;           ///< physical
        std::vector<std::string> lossy;           ///< surfaces that are not there
        std::shared_ptr<Categories const> labels; ///< null: it is not drawn as labels
    };
    struct Prepared;
    struct Drawn;
    /// Draws a hierarchical volume as labels: that of the grid of its finest cells. Throws Error{resources} where there
    /// is no memory for it.
    Renderer const& on_grid() const;
    CellGrid const& macrocells() const { return tree_ ? tree_->cells().grid : lattice_.cells; }
    Rescaling const& rescaling() const { return tree_ ? tree_->rescaling() : lattice_.rescaling; }
    Appearance appearance_of(RenderSettings const& settings) const;
    /// What was asked for and cannot be seen, one line each.
    std::vector<std::string> unseen(Appearance const& appearance, std::vector<Knot> const& knots,
                                    TransferTable const& table) const;
    /// Frames what can be seen, if the camera follows that; otherwise all that is shown.
    Camera camera_of(RenderSettings const& settings, Prepared const& ready) const;
    SceneView scene_of(RenderSettings const& settings, Appearance const& appearance, Camera const& camera) const;
    /// Those of the picture that `drawing` drew with another integrator; `tree` is that of a hierarchical volume.
    std::vector<Layer> layers_of(Drawing const& drawing, Image const& picture, Integrator integrator,
                                 TreeView const& tree) const;
    /// All of a report that does not depend on the pixels; its quality and savings are there.
    void tell(RenderReport& report, RenderSettings const& settings, Prepared const& ready, Drawn const& drawn) const;
    Image draw(RenderSettings const& settings, RenderReport* report, Watch const& watch, Accumulation* accumulation,
               bool in_passes) const;
    /// Whether a GPU draws it. Throws Error{usage} where one was asked for that cannot.
    bool on_gpu(RenderSettings const& settings, bool refines) const;
    /// The labels to draw; null where there is something else to draw. Throws Error{usage} where labels are asked for
    /// and are none.
    std::shared_ptr<Categories const> labels_for(RenderSettings const& settings) const;
    /// What does not change when only the camera moves: of the last picture, if it still holds.
    std::shared_ptr<Prepared const> prepared(RenderSettings const& settings) const;

    Header header_;
    Execution execution_;
    Lattice lattice_;                       ///< of a structured volume
    std::optional<Tree> tree_;              ///< of a hierarchical one that is drawn brick by brick
    Box region_;                            ///< voxels, of a hierarchical volume finest cells, that it holds
    std::optional<Volume> cells_of_labels_; ///< of a hierarchical volume, as they are, if they may be labels
    double prepare_seconds_ = 0;
    struct Cache;
    std::shared_ptr<Cache> cache_;
};

Image render(Volume const& volume, RenderSettings const& settings, Execution const& execution,
             RenderReport* report = nullptr);

/// A transfer function and an iso-value that suit most data: see automatic.cpp for how.
struct Automatic {
    TransferFunction transfer;
    double iso = 0;
};
/// extent: cube root of the volume's world size; unit: the distance that the opacities hold for.
Automatic choose_transfer(Histogram const& histogram, Domain const& domain, std::string const& colormap, double extent,
                          double unit);

} // namespace vkt::render

namespace vkt {
template <> struct EnumNames<render::Algorithm> {
    static std::vector<std::pair<render::Algorithm, char const*>> all() {
        return {{render::Algorithm::ray_marching, "ray-marching"},
                {render::Algorithm::implicit_iso, "implicit-iso"},
                {render::Algorithm::multi_scattering, "multi-scattering"},
                {render::Algorithm::maximum, "maximum"},
                {render::Algorithm::minimum, "minimum"},
                {render::Algorithm::mean, "mean"}};
    }
};
template <> struct EnumNames<render::TreeDrawing> {
    static std::vector<std::pair<render::TreeDrawing, char const*>> all() {
        return {{render::TreeDrawing::automatic, "auto"},
                {render::TreeDrawing::blocks, "blocks"},
                {render::TreeDrawing::bricks, "bricks"},
                {render::TreeDrawing::grid, "grid"}};
    }
};
template <> struct EnumNames<render::LabelMode> {
    static std::vector<std::pair<render::LabelMode, char const*>> all() {
        return {{render::LabelMode::automatic, "auto"},
                {render::LabelMode::always, "always"},
                {render::LabelMode::never, "never"}};
    }
};
template <> struct EnumNames<render::Fit> {
    static std::vector<std::pair<render::Fit, char const*>> all() {
        return {{render::Fit::content, "content"}, {render::Fit::volume, "volume"}};
    }
};
template <> struct EnumNames<render::Projection> {
    static std::vector<std::pair<render::Projection, char const*>> all() {
        return {{render::Projection::perspective, "perspective"}, {render::Projection::orthographic, "orthographic"}};
    }
};
} // namespace vkt
