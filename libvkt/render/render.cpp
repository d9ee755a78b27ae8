// Rendering: settings are checked and turned into a scene, tiles are shared out to threads.
// SPDX-License-Identifier: MIT
#include "libvkt/render/render.h"

#include "libvkt/amr/cells.h"
#include "libvkt/amr/reconstruct.h"
#include "libvkt/core/device.h"
#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/categories.h"
#include "libvkt/render/cost.h"
#include "libvkt/render/device.h"
#include "libvkt/render/inner/exact.h"
#include "libvkt/render/passes.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>

namespace vkt::render {

namespace {

constexpr int largest_image = 16384;

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

[[noreturn]] void refuse(std::string const& message, std::string const& hint = {}) {
    throw Error(ErrorKind::usage, message, hint);
}

double smallest_spacing(Geometry const& g) { return std::min({g.spacing.x, g.spacing.y, g.spacing.z}); }

/// Volume of one voxel in the world.
double voxel_size(Geometry const& g) {
    Matrix3 const m = lattice_to_world(g);
    Double3 const c{m.y.y * m.z.z - m.y.z * m.z.y, m.y.z * m.z.x - m.y.x * m.z.z, m.y.x * m.z.y - m.y.y * m.z.x};
    return std::abs(dot(m.x, c));
}

double diagonal(Geometry const& g, Index3 dims) {
    auto const c = corners_of(g, box_of(dims));
    double longest = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        Vec3 const d = c[7 - i] - c[i];
        longest = std::max(longest, std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
    }
    return longest;
}

/// "A0,A1,…" over the domain or "VALUE:A,VALUE:A,…".
std::vector<std::pair<double, double>> read_opacity(std::string const& words, Domain const& domain) {
    std::vector<std::pair<double, double>> ramp;
    auto const parts = split(words, ',');
    for (std::size_t i = 0; i < parts.size(); ++i) {
        auto const pair = split(parts[i], ':');
        bool const placed = pair.size() == 2;
        if (pair.size() > 2 || pair.empty() || (i > 0 && placed != (split(parts[0], ':').size() == 2)))
            refuse(text("--opacity '", words, "' is neither auto nor A,A,… nor VALUE:A,VALUE:A,…"),
                   "for example --opacity 0,0,0.1,0.8");
        double const share = parts.size() > 1 ? static_cast<double>(i) / static_cast<double>(parts.size() - 1) : 1;
        double const value = placed ? parse_double(pair[0]) : std::lerp(domain.lower, domain.upper, share);
        ramp.emplace_back(value, parse_double(pair.back()));
        if (!(ramp.back().second >= 0 && ramp.back().second <= 1))
            refuse(text("--opacity '", words, "' has an opacity outside 0 to 1"));
    }
    return ramp;
}

/// Where a value lies between two others: 0 to 1 from the lower to the upper one; `alone` if these are equal.
double share_of(double value, double lower, double upper, double alone) {
    double const half = upper / 2 - lower / 2; // the whole may be more than doubles hold
    return half > 0 ? (value / 2 - lower / 2) / half : alone;
}

/// A colour map over the domain with opacities of its own: control points wherever either bends.
TransferFunction combine(std::string const& map, Domain const& domain, std::vector<std::pair<double, double>> ramp) {
    std::stable_sort(ramp.begin(), ramp.end(), [](auto const& a, auto const& b) { return a.first < b.first; });
    auto const color_at = [&](double v) { return colormap(map, share_of(v, domain.lower, domain.upper, 0.5)); };
    // Between the opacities it is extinction that runs linearly.
    auto const alpha_at = [&](double v) {
        if (v <= ramp.front().first) return ramp.front().second;
        for (std::size_t i = 1; i < ramp.size(); ++i) {
            if (v > ramp[i].first) continue;
            double const a = extinction_of(ramp[i - 1].second), b = extinction_of(ramp[i].second);
            return -std::expm1(-(a + share_of(v, ramp[i - 1].first, ramp[i].first, 1) * (b - a)));
        }
        return ramp.back().second;
    };
    TransferFunction transfer;
    for (auto const& [value, alpha] : ramp) transfer.points.push_back({value, color_at(value), alpha});
    constexpr int parts = 64;
    for (int i = 0; i <= parts; ++i) {
        double const v = std::lerp(domain.lower, domain.upper, static_cast<double>(i) / parts);
        bool const taken = std::any_of(ramp.begin(), ramp.end(), [&](auto const& r) { return r.first == v; });
        if (!taken) transfer.points.push_back({v, color_at(v), alpha_at(v)});
    }
    transfer.check_and_sort();
    return transfer;
}

/// Corners of boxes of macrocells that hold all that is visible: each row of them from its first visible one to its
/// last.
std::vector<Vec3> visible_corners(CellVisibility const& cells, Index3 counts, Geometry const& geometry,
                                  Box const& within) {
    std::vector<Vec3> points;
    auto const from = [](std::int64_t cell) { return macrocell_size * cell + lattice_padding - 1 - lattice_padding; };
    for (std::int64_t z = 0; z < counts.z; ++z)
        for (std::int64_t y = 0; y < counts.y; ++y) {
            auto const seen = [&](std::int64_t x) {
                return cells.distance[static_cast<std::size_t>((z * counts.y + y) * counts.x + x)] == 0;
            };
            std::int64_t first = 0, last = counts.x - 1;
            while (first <= last && !seen(first)) ++first;
            while (last >= first && !seen(last)) --last;
            if (last < first) continue;
            Box const row = intersect(
                Box{{from(first), from(y), from(z)}, {from(last + 1) + 1, from(y + 1) + 1, from(z + 1) + 1}}, within);
            if (row.empty()) continue;
            auto const corners = corners_of(geometry, row);
            points.insert(points.end(), corners.begin(), corners.end());
        }
    return points;
}

/// Voxels that lie in visible macrocells; all of them if there is none.
Box visible_box(CellVisibility const& cells, Index3 dims) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
        if (cells.last[axis] < cells.first[axis]) return box_of(dims);
        constexpr std::int64_t before = lattice_padding - 1; // cells begin there in the padded lattice
        box.lower[axis] = macrocell_size * static_cast<std::int64_t>(cells.first[axis]) + before - lattice_padding;
        box.upper[axis] =
            macrocell_size * static_cast<std::int64_t>(cells.last[axis] + 1) + before - lattice_padding + 1;
    }
    return intersect(box, box_of(dims));
}

/// A plane of the world, as RenderSettings::clip_planes has it, in the lattice in which the first cell's centre is at
/// (first, first, first).
HalfSpace half_space(double const* plane, Geometry const& g, double first) {
    // Whatever the size of the world: only the direction of the normal matters, once the distance is in its units.
    double const length = std::hypot(plane[0], plane[1], plane[2]);
    Double3 const normal{plane[0] / length, plane[1] / length, plane[2] / length};
    Matrix3 const to_world = lattice_to_world(g);
    Double3 const mapped{dot(to_world.x, normal), dot(to_world.y, normal), dot(to_world.z, normal)};
    double const origin = dot(normal, Double3{g.origin.x, g.origin.y, g.origin.z});
    return {mapped, plane[3] / length - origin + first * (mapped.x + mapped.y + mapped.z)};
}

/// A direction of the world, of unit length, with a reach in the world.
LightWay light_way(SceneView const& scene, Double3 world, double reach) {
    Double3 const lattice = scene.to_lattice * world;
    double const length = std::sqrt(dot(lattice, lattice));
    return {to_float(lattice * (1 / length)), static_cast<float>(1 / length), static_cast<float>(reach * length)};
}

/// Whether light from behind passes everywhere.
bool is_empty(Image const& image) {
    for (std::size_t i = 3; i < image.pixels.size(); i += 4)
        if (image.pixels[i] < 1) return false;
    return true;
}

/// A mean number of paths, whole if it is.
std::string mean_text(double paths) { return to_text(std::round(paths * 10) / 10); }

/// All that decides a Prepared.
struct PreparedFor {
    Algorithm algorithm;
    std::optional<TransferFunction> transfer;
    std::vector<double> lut;
    std::string colormap, opacity, domain, unit;
    double opacity_scale, shade;
    std::vector<double> isos, iso_colors, iso_opacities;
    bool labels;
    friend bool operator==(PreparedFor const&, PreparedFor const&) = default;
};
PreparedFor prepared_for(RenderSettings const& s, Header const& header) {
    return {s.algorithm,
            s.transfer,
            s.lut,
            s.colormap,
            s.opacity,
            s.domain,
            s.unit,
            s.opacity_scale,
            s.shade,
            s.isos,
            s.iso_colors,
            s.iso_opacities,
            draws_labels(s, header)};
}

} // namespace

struct Renderer::Prepared {
    PreparedFor made_for;
    Appearance appearance;
    std::vector<Knot> knots;
    TransferTable table;
    CellVisibility cells;
    Tree::Visibility bricks;
};

struct Renderer::Cache {
    std::mutex mutex;
    std::shared_ptr<Prepared const> last;
    std::shared_ptr<Categories const> labels;
    std::int64_t made = 0;
    std::mutex drawing; ///< of who draws with the copies
    std::unique_ptr<DeviceCopies> copies;
};

PartRows rows_of_part(RenderSettings const& s) {
    std::int64_t const strips = (s.height + tile_side - 1) / tile_side;
    auto const row = [&](int parts) {
        return static_cast<int>(std::min<std::int64_t>(s.height, strips * parts / s.parts * tile_side));
    };
    return {row(s.part - 1), row(s.part)};
}

void check(RenderSettings const& s) {
    auto const fits = [](int n) { return n >= 1 && n <= largest_image; };
    if (!fits(s.width) || !fits(s.height))
        refuse(text("the image size must be 1 to ", largest_image, " pixels each way"));
    if (!(s.step >= 1.0 / 256 && s.step <= 4))
        refuse(text("the step must be between 1/256 and 4 voxels, not ", s.step));
    if (!(s.opacity_scale >= 0) || !std::isfinite(s.opacity_scale)) refuse("the opacity scale must be 0 or greater");
    if (!(s.shade <= 1)) refuse("the shading strength must be between 0 and 1");
    if (s.samples < 1 || s.samples > 1 << 24) refuse("the samples per pixel must be 1 to 16777216");
    if (s.first_sample < 0 || s.first_sample > 1 << 30) refuse("the number of the first sample must be 0 to 2^30");
    if (!(s.albedo >= 0 && s.albedo <= 1)) refuse("the albedo must be between 0 and 1");
    if (!(std::abs(s.anisotropy) <= 0.9999)) refuse("the anisotropy must be between -0.9999 and 0.9999");
    if (s.light_direction) {
        Vec3 const v = *s.light_direction;
        double const squared = v.x * v.x + v.y * v.y + v.z * v.z;
        if (!(squared > 0) || !std::isfinite(squared))
            refuse("the direction of the light must be finite and not 0,0,0");
    }
    if (!(s.ambient >= 0 && s.ambient <= 1)) refuse("the ambient light must be between 0 and 1");
    if (!(s.specular >= 0 && s.specular <= 1)) refuse("the specular light must be between 0 and 1");
    if (s.shadows && !s.light_direction)
        refuse("--shadows needs a light that is not at the camera, which throws none", "give --light-direction X,Y,Z");
    auto const positive = [](double v) { return v >= 0 && std::isfinite(v); };
    if (!positive(s.goal.noise) || !positive(s.goal.tolerance) || !positive(s.goal.seconds))
        refuse("errors to stop at and seconds must be positive");
    if (s.parts < 1 || s.part < 1 || s.part > s.parts) refuse(text("there is no part ", s.part, " of ", s.parts));
    if (int const strips = (s.height + tile_side - 1) / tile_side; s.parts > strips)
        refuse(text("a picture of ", s.height, " rows has at most ", strips, " parts, of ", tile_side, " rows each"));
    if (s.parts > 1 && (s.goal.tolerance > 0 || s.goal.seconds > 0))
        refuse("with --tolerance or --time pixels of all parts have to do with each other",
               "--noise and --step do not have that");
    if (s.ambient_occlusion != 0 && (s.ambient_occlusion < 6 || s.ambient_occlusion > most_ways))
        refuse(text("--ambient-occlusion looks in 6 to ", most_ways, " directions, or in 0"));
    if (!(s.occlusion_radius >= 0) || !std::isfinite(s.occlusion_radius))
        refuse("--occlusion-radius must be 0 or greater");
    if (s.exact && (s.shadows || s.ambient_occlusion > 0)) refuse("--exact has neither shadows nor ambient occlusion");
    if (!std::isfinite(s.environment_rotation)) refuse("--environment-rotation must be finite");
    if (!(s.environment_strength >= 0 && s.environment_strength <= 1e30))
        refuse("--environment-strength must be 0 or greater");
    if (s.clip_planes.size() % 4 != 0 || s.clip_planes.size() > 4 * std::size_t{most_planes})
        refuse(text("--clip-plane takes NX NY NZ D for each of at most ", most_planes, " planes, not ",
                    s.clip_planes.size(), " numbers"));
    for (std::size_t i = 0; i < s.clip_planes.size(); i += 4) {
        double const length = std::hypot(s.clip_planes[i], s.clip_planes[i + 1], s.clip_planes[i + 2]);
        if (!(length > 0) || !std::isfinite(length) || !std::isfinite(s.clip_planes[i + 3]))
            refuse("--clip-plane: a normal must be finite and not 0 0 0, and its distance finite");
    }
    if (s.bounces < 1) refuse("the number of bounces must be at least 1");
    if (s.isos.size() > most_isos) refuse(text("at most ", most_isos, " iso-values can be shown at once"));
    for (double const v : s.isos)
        if (!std::isfinite(v)) refuse("an iso-value is not finite");
    std::size_t const surfaces = std::max<std::size_t>(1, s.isos.size());
    auto const unit_range = [](std::vector<double> const& list) {
        return std::all_of(list.begin(), list.end(), [](double v) { return v >= 0 && v <= 1; });
    };
    if (!s.iso_colors.empty() && (s.iso_colors.size() != 3 * surfaces || !unit_range(s.iso_colors)))
        refuse("--iso-color takes R G B from 0 to 1 for each iso-value");
    if (!s.iso_opacities.empty() && (s.iso_opacities.size() != surfaces || !unit_range(s.iso_opacities)))
        refuse("--iso-opacity takes an opacity from 0 to 1 for each iso-value");
}

namespace {

/// The finest cells of a box.
SampleGrid grid_in(Box const& box) {
    SampleGrid grid;
    for (int a = 0; a < 3; ++a) grid.lower[a] = static_cast<double>(box.lower[a]);
    grid.dims = box.dims();
    return grid;
}

/// The finest cells of a hierarchical volume, as vkt resample makes them, in the type of its cells.
Lattice lattice_of_tree(Volume const& volume, Execution const& execution) {
    Header const& header = volume.header();
    SampleGrid const grid = grid_in(box_of(header.dims));
    double const background = stored_background(header).value_or(header.values.stored(0));
    Reconstructor const cells(volume, grid, Reconstruction::basis, background);
    Execution host = execution;
    host.device = Device::cpu;
    return make_lattice(
        cells.header(), [&](AnyView const& to) { cells.run(to, host); }, execution);
}

} // namespace

Renderer::Renderer(Volume const& volume, Execution const& execution, TreeDrawing tree)
    : header_(volume.header()), execution_(execution),
      region_(header_.kind == Kind::hierarchical ? region_of(header_) : box_of(header_.dims)) {
    execution_.threads = std::max(1, execution.threads);
    auto const start = Clock::now();
    if (header_.kind == Kind::structured)
        lattice_ = make_lattice(volume.view(), header_.values, execution_);
    else if (drawn_as_grid(header_, tree) &&
             (tree == TreeDrawing::grid || !leaves_holes(header_, volume.bricks(), grid_in(region_))))
        lattice_ = lattice_of_tree(volume, execution_);
    else
        tree_.emplace(volume, execution_);
    cache_ = std::make_shared<Cache>();
    prepare_seconds_ = seconds_since(start);
}

Renderer::Renderer(Header header, ConstView voxels, Execution const& execution)
    : header_(std::move(header)), execution_(execution), region_(box_of(header_.dims)),
      cache_(std::make_shared<Cache>()) {
    execution_.threads = std::max(1, execution.threads);
    auto const start = Clock::now();
    lattice_ = make_lattice(voxels, header_.values, execution_);
    prepare_seconds_ = seconds_since(start);
}

Renderer::Renderer(Header header, VoxelReader const& read, Execution const& execution)
    : header_(std::move(header)), execution_(execution), region_(box_of(header_.dims)),
      cache_(std::make_shared<Cache>()) {
    execution_.threads = std::max(1, execution.threads);
    auto const start = Clock::now();
    double reading = 0; // is no part of what prepares a picture
    auto const timed = [&](AnyView const& to) {
        auto const begin = Clock::now();
        read(to);
        reading = seconds_since(begin);
    };
    lattice_ = make_lattice(header_, timed, execution_);
    prepare_seconds_ = seconds_since(start) - reading;
}

std::int64_t Renderer::preparations() const {
    std::lock_guard const lock(cache_->mutex);
    return cache_->made;
}

std::shared_ptr<Renderer::Prepared const> Renderer::prepared(RenderSettings const& settings) const {
    std::lock_guard const lock(cache_->mutex);
    PreparedFor wanted = prepared_for(settings, header_);
    if (cache_->last && cache_->last->made_for == wanted) return cache_->last;
    cache_->last.reset(); // its memory is needed for the next
    Appearance appearance = appearance_of(settings);
    std::vector<Knot> knots =
        knots_of(appearance.transfer, header_.values, rescaling(), appearance.unit, settings.opacity_scale);
    TransferTable table(knots);
    CellVisibility cells;
    Tree::Visibility bricks;
    if (tree_) bricks = tree_->classify(table);
    cells = appearance.labels                             ? classify_cells(macrocells(), appearance.labels->nothing)
            : wanted.algorithm == Algorithm::implicit_iso ? classify_cells(macrocells(), appearance.isos)
                                                          : classify_cells(macrocells(), table);
    cache_->last = std::make_shared<Prepared const>(Prepared{std::move(wanted), std::move(appearance), std::move(knots),
                                                             std::move(table), std::move(cells), std::move(bricks)});
    ++cache_->made;
    return cache_->last;
}

std::shared_ptr<Categories const> Renderer::labels_for(RenderSettings const& settings) const {
    if (!draws_labels(settings, header_)) return nullptr;
    bool const asked = settings.labels == LabelMode::always;
    if (header_.kind == Kind::hierarchical)
        refuse("--labels always: hierarchical volumes are not drawn as labels", "vkt resample makes a grid");
    auto& labels = cache_->labels;
    if (!labels) labels = std::make_shared<Categories>(categories_of(lattice_, header_, execution_.threads));
    if (labels->why_not.empty()) return labels;
    if (asked) refuse(text("--labels always: the volume holds ", labels->why_not));
    return nullptr;
}

double Renderer::value_at(Vec3 index) const {
    constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
    Index3 at;
    for (int axis = 0; axis < 3; ++axis) {
        double const i = std::floor(index[axis] + 0.5);
        if (!(i >= 0 && i < static_cast<double>(header_.dims[axis]))) return nothing;
        at[axis] = static_cast<std::int64_t>(i);
    }
    double const sampled = tree_ ? tree_->value_at({index.x + 0.5, index.y + 0.5, index.z + 0.5}) : lattice_.at(at);
    Rescaling const& r = rescaling();
    return header_.values.physical(sampled / r.scale + r.offset);
}

Renderer::Appearance Renderer::appearance_of(RenderSettings const& settings) const {
    Appearance appearance;
    Geometry const& g = header_.geometry;
    appearance.domain = resolve_domain(settings.domain, histogram());
    double const smallest = smallest_spacing(g);
    appearance.unit = settings.transfer && settings.transfer->unit > 0 ? settings.transfer->unit : smallest;
    if (settings.unit == "auto")
        appearance.unit = diagonal(g, region_.dims()) / 256;
    else if (!settings.unit.empty())
        appearance.unit = parse_double(settings.unit);
    if (!(appearance.unit > 0) || !std::isfinite(appearance.unit)) refuse("the unit distance must be positive");

    double voxels = volume_of(region_.dims());
    if (tree_) voxels = std::min(tree_->covered(), voxels);
    double const extent = std::cbrt(voxel_size(g) * voxels);
    Automatic const automatic =
        choose_transfer(histogram(), appearance.domain, settings.colormap, extent, appearance.unit);
    bool chosen = false;
    if (settings.transfer) {
        appearance.transfer = *settings.transfer;
    } else if (!settings.lut.empty()) {
        appearance.transfer = transfer_from_lut(settings.lut, appearance.domain.lower, appearance.domain.upper);
    } else if (is_projection(settings.algorithm)) {
        appearance.domain = resolve_domain(settings.domain == "auto" ? "minmax" : settings.domain, histogram());
        appearance.transfer = combine(settings.colormap.empty() ? "grey" : settings.colormap, appearance.domain,
                                      {{appearance.domain.lower, 1}});
    } else if (settings.opacity != "auto") {
        appearance.transfer = combine(settings.colormap.empty() ? "tissue" : settings.colormap, appearance.domain,
                                      read_opacity(settings.opacity, appearance.domain));
    } else {
        appearance.transfer = automatic.transfer;
        chosen = true;
    }
    appearance.transfer.check_and_sort();
    appearance.domain.lower = appearance.transfer.points.front().value;
    appearance.domain.upper = appearance.transfer.points.back().value;
    bool const surfaces = settings.algorithm == Algorithm::implicit_iso;
    appearance.labels = labels_for(settings);
    appearance.shade = settings.shade >= 0 ? settings.shade : surfaces || appearance.labels ? 1 : chosen ? 0.8 : 0;
    if (!surfaces || appearance.labels) return appearance;

    std::vector<double> isos = settings.isos;
    if (isos.empty()) isos.push_back(automatic.iso);
    auto const& [least, greatest] = std::pair(histogram().least, histogram().greatest);
    std::vector<Knot> const knots = knots_of(appearance.transfer, header_.values, rescaling(), 1, 1);
    for (double const iso : isos) {
        double const value = rescaling().of(header_.values.stored(iso));
        Knot const k = evaluate(knots.data(), static_cast<int>(knots.size()), value);
        // What is at the value counts as above it, and above is where stored values are greater.
        bool const met = header_.values.slope > 0 ? least < iso && iso <= greatest : least <= iso && iso < greatest;
        if (!met)
            appearance.lossy.push_back(
                text("no surface of ", iso, " is there: the values are ", least, " to ", greatest));
        std::size_t const i = appearance.isos.size();
        IsoView view{static_cast<float>(value), static_cast<float>(k.red), static_cast<float>(k.green),
                     static_cast<float>(k.blue)};
        if (!settings.iso_colors.empty()) {
            auto const linear = [&](std::size_t c) {
                return static_cast<float>(srgb_to_linear(settings.iso_colors[3 * i + c]));
            };
            view.red = linear(0), view.green = linear(1), view.blue = linear(2);
        }
        if (!settings.iso_opacities.empty()) view.alpha = static_cast<float>(settings.iso_opacities[i]);
        appearance.isos.push_back(view);
        appearance.iso_values.push_back(iso);
    }
    return appearance;
}

std::vector<std::string> Renderer::unseen(Appearance const& appearance, std::vector<Knot> const& knots,
                                          TransferTable const& table) const {
    std::vector<std::string> lines = appearance.lossy;
    if (!appearance.isos.empty() || appearance.labels) return lines;
    double const one = rescaling().of(header_.values.stored(histogram().least)),
                 other = rescaling().of(header_.values.stored(histogram().greatest));
    double const least = std::min(one, other), greatest = std::max(one, other);
    if (!(table.greatest_extinction(static_cast<float>(least), static_cast<float>(greatest)) > 0)) {
        lines.push_back(text("nothing is visible: the opacity of all values, ", histogram().least, " to ",
                             histogram().greatest, ", is zero"));
        return lines;
    }
    // Floats of wider types were rounded; and no table has nodes closer together than floats can say.
    double const lower = knots.front().value, upper = knots.back().value;
    double const largest =
        std::min(std::max(std::abs(lower), std::abs(upper)), std::max(std::abs(least), std::abs(greatest)));
    double const step = computes_in_double(header_.dtype) ? std::max(largest * 0x1p-23, 0x1p-149) : 0;
    if (appearance.domain.upper > appearance.domain.lower && upper - lower < std::max(256 * step, 1024 * 0x1p-126))
        lines.push_back(text("the colours from ", appearance.domain.lower, " to ", appearance.domain.upper,
                             " are closer together than the values that rays sample"));
    return lines;
}

bool Renderer::on_gpu(RenderSettings const& settings, bool refines, bool labels) const {
    if (execution_.device == Device::automatic) {
        // Getting hold of a GPU takes as long as a picture, unless that takes many paths.
        constexpr double worth_it = 2e8;
        double const paths = static_cast<double>(settings.samples) * settings.width * settings.height;
        bool const heavy = settings.algorithm == Algorithm::multi_scattering && paths > worth_it;
        return heavy && !tree_ && !refines && gpu_count() > 0;
    }
    if (execution_.device != Device::gpu) return false;
    if (!tree_ && !refines && !labels) return true;
    if (execution_.only_gpu && labels)
        throw Error(ErrorKind::usage, "--device gpu: labels are not drawn on a GPU",
                    "leave the choice to vkt: --device auto");
    if (execution_.only_gpu)
        throw Error(
            ErrorKind::usage,
            tree_ ? "--device gpu: hierarchical volumes are not drawn on a GPU"
                  : "--device gpu: pictures with --noise, --time or --tolerance, and layers, are not drawn on a GPU",
            tree_ ? "leave the choice to vkt: --device auto"
                  : "give --spp, write no .exr, or leave the choice to vkt: --device auto");
    return false;
}

SceneView Renderer::scene_of(RenderSettings const& settings, Appearance const& appearance, Camera const& camera) const {
    SceneView scene{};
    Geometry const& g = header_.geometry;
    double const first = tree_ ? 0.5 : lattice_padding;
    scene.frame = frame_of(camera, g, first, settings.width, settings.height);
    Box shown = region_;
    if (!settings.clip.empty()) shown = intersect(shown, settings.clip.resolve(header_.dims));
    auto const place = [&](Index3 i) {
        double const low = first - 0.5;
        return Double3{low + static_cast<double>(i.x), low + static_cast<double>(i.y), low + static_cast<double>(i.z)};
    };
    scene.shown.lower = place(shown.lower);
    scene.shown.upper = place(shown.upper);
    scene.to_lattice = world_to_lattice(g);
    scene.to_world = lattice_to_world(g);
    for (std::size_t i = 0; i + 4 <= settings.clip_planes.size(); i += 4)
        scene.shown.planes[scene.shown.plane_count++] = half_space(&settings.clip_planes[i], g, first);

    // Gradients are shaded in units of a reference, so that the sizes of values and of the world do not matter. |A^T
    // g|^2 for a lattice gradient g, A mapping world vectors, in smallest spacings, to lattice vectors.
    double const smallest = smallest_spacing(g);
    Matrix3 const& a = scene.to_lattice;
    Double3 const rows[3] = {Double3{a.x.x, a.y.x, a.z.x} * smallest, Double3{a.x.y, a.y.y, a.z.y} * smallest,
                             Double3{a.x.z, a.y.z, a.z.z} * smallest};
    auto const metric = [&](int i, int j, double factor) { return static_cast<float>(factor * dot(rows[i], rows[j])); };
    auto const part_of = [](double share, double from, double to) { return share * to - share * from; };
    double part = part_of(0.02, appearance.domain.lower, appearance.domain.upper);
    // Of a single value all surfaces are shaded, and of a constant volume none.
    if (!(part > 0)) part = part_of(2e-8, histogram().least, histogram().greatest);
    if (!(part > 0)) part = 0.02;
    double const reference =
        part / std::abs(header_.values.slope) * rescaling().scale / (tree_ ? tree_->typical_width() : 1);
    scene.shade = {
        static_cast<float>(appearance.shade),
        static_cast<float>(settings.ambient),
        static_cast<float>(settings.specular),
        static_cast<float>(std::min(1 / reference, 1e30)),
        static_cast<float>(smallest),
        {metric(0, 0, 1), metric(1, 1, 1), metric(2, 2, 1), metric(0, 1, 2), metric(0, 2, 2), metric(1, 2, 2)}};
    if (settings.light_direction) {
        Vec3 const v = *settings.light_direction;
        double const length = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
        Double3 const toward{v.x / length, v.y / length, v.z / length};
        constexpr double anywhere = std::numeric_limits<double>::infinity();
        scene.lamp = {true, settings.shadows, toward, scene.to_lattice * toward};
        scene.ways[0] = light_way(scene, toward, anywhere);
    }
    double const radius = settings.occlusion_radius > 0 ? settings.occlusion_radius : diagonal(g, region_.dims()) / 10;
    scene.around_count = settings.ambient_occlusion;
    for (int i = 0; i < scene.around_count; ++i) {
        // Evenly spread: rings of the same area, turned by the golden angle from one to the next.
        double const z = 1 - (2 * i + 1.0) / scene.around_count, r = std::sqrt(1 - z * z);
        double const angle = i * 2.3999632297286533;
        scene.ways[1 + i] = light_way(scene, {r * std::cos(angle), r * std::sin(angle), z}, radius);
    }
    scene.iso_count = static_cast<int>(appearance.isos.size());
    std::copy(appearance.isos.begin(), appearance.isos.end(), scene.isos);
    if (appearance.labels) {
        scene.labels = appearance.labels->views.data();
        scene.label_count = static_cast<int>(appearance.labels->views.size());
        scene.nothing = appearance.labels->nothing;
        for (int axis = 0; axis < 3; ++axis)
            scene.voxels[axis] = static_cast<int>(header_.dims[axis]) + 2 * lattice_padding;
    }
    scene.step = static_cast<float>(settings.step);
    scene.skip = settings.skip;
    if (settings.goal.any()) // what rays leave out is to be a small part of the error
        scene.patience = static_cast<float>(std::clamp(settings.goal.tolerance / 2, 1.0 / 64, 1.0));
    scene.samples = settings.samples;
    scene.first_sample = settings.first_sample;
    scene.bounces = settings.bounces;
    scene.seed = settings.seed;
    scene.albedo = static_cast<float>(settings.albedo);
    scene.anisotropy = static_cast<float>(settings.anisotropy);
    scene.emission = settings.emission;
    double const strength = settings.environment ? settings.environment_strength : 1;
    scene.light[0] = static_cast<float>(settings.light.red * strength);
    scene.light[1] = static_cast<float>(settings.light.green * strength);
    scene.light[2] = static_cast<float>(settings.light.blue * strength);
    if (settings.environment) scene.environment = settings.environment->view(settings.environment_rotation);
    return scene;
}

Image Renderer::render(RenderSettings const& settings, RenderReport* report, std::stop_token const& stop,
                       Accumulation* accumulation) const {
    Watch watch;
    if (stop.stop_possible()) watch.stop = [&] { return stop.stop_requested(); };
    return draw(settings, report, watch, accumulation, settings.goal.any() && accumulation == nullptr);
}

Image Renderer::watched(RenderSettings const& settings, RenderReport* report, Watch const& watch) const {
    return draw(settings, report, watch, nullptr, true);
}

std::vector<Layer> Renderer::layers_of(Drawing const& drawing, Integrator integrator, TreeView const& tree) const {
    std::vector<Layer> layers;
    int const width = static_cast<int>(drawing.scene.frame.width),
              height = static_cast<int>(drawing.scene.frame.height);
    std::size_t const count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    auto const drawn = [&](Integrator what) {
        Image image{width, height, std::vector<float>(4 * count)};
        Drawing one = drawing;
        one.draw = [&](SceneView const& view, Tile tile, float* pixels, Counters& counters) {
            if (tree_)
                tree_tile_function(execution_.instructions)(view, tree, what, tile, pixels, width, counters);
            else
                tile_function(execution_.instructions)(view, lattice_.view, what, tile, pixels, width, counters);
        };
        one.scene.samples = 1;
        Counters counters;
        draw_once(one, image, counters);
        return image;
    };
    auto const add = [&](char const* name, Image const& from, std::size_t channel) {
        layers.push_back({name, std::vector<float>(count)});
        for (std::size_t i = 0; i < count; ++i) layers.back().values[i] = from.pixels[4 * i + channel];
    };
    if (integrator == Integrator::iso) {
        Image const place = drawn(Integrator::place), albedo = drawn(Integrator::albedo);
        add("Z", place, 3);
        add("normal.X", place, 0), add("normal.Y", place, 1), add("normal.Z", place, 2);
        add("albedo.R", albedo, 0), add("albedo.G", albedo, 1), add("albedo.B", albedo, 2);
    } else {
        add("Z", drawn(Integrator::half_distance), 3);
    }
    if (drawing.variance == nullptr) return layers;
    for (std::size_t c = 0; c < 3; ++c) {
        auto const plane = drawing.variance->begin() + static_cast<std::ptrdiff_t>(c * count);
        layers.push_back({c == 0   ? "variance.R"
                          : c == 1 ? "variance.G"
                                   : "variance.B",
                          {plane, plane + static_cast<std::ptrdiff_t>(count)}});
    }
    return layers;
}

Image Renderer::draw(RenderSettings const& settings, RenderReport* report, Watch const& watch,
                     Accumulation* accumulation, bool in_passes) const {
    check(settings);
    auto const start = Clock::now();
    std::shared_ptr<Prepared const> const ready = prepared(settings);
    Appearance const& appearance = ready->appearance;
    std::vector<Knot> const& knots = ready->knots;
    TransferTable const& table = ready->table;
    CellVisibility const& cells = ready->cells;
    Tree::Visibility const& bricks = ready->bricks;
    bool const labels = appearance.labels != nullptr;
    bool const surfaces = settings.algorithm == Algorithm::implicit_iso || labels;
    Box content = region_;
    // What projections show is everywhere.
    bool const projected = is_projection(settings.algorithm);
    if (settings.camera.fit == Fit::content && !projected)
        content = !tree_ ? visible_box(cells, header_.dims) : surfaces ? tree_->box_of(cells) : bricks.content;
    // A grid may hold more than the part of a tree that there is.
    if (content = intersect(content, region_); content.empty()) content = region_;
    if (!settings.clip.empty()) {
        Box const clip = settings.clip.resolve(header_.dims);
        Box const within = intersect(content, clip);
        content = within.empty() ? clip : within;
    }
    std::vector<Vec3> points;
    if (!tree_ && settings.camera.fit == Fit::content && !projected && !settings.camera.steady)
        points = visible_corners(cells, {lattice_.cells.nx, lattice_.cells.ny, lattice_.cells.nz}, header_.geometry,
                                 content);
    if (points.empty()) {
        auto const corners = corners_of(header_.geometry, content);
        points.assign(corners.begin(), corners.end());
    }
    Camera const camera = make_camera(settings.camera, points, static_cast<double>(settings.width) / settings.height);
    SceneView scene = scene_of(settings, appearance, camera);
    scene.projection = settings.algorithm == Algorithm::minimum ? Projected::least
                       : settings.algorithm == Algorithm::mean  ? Projected::mean
                                                                : Projected::greatest;
    scene.table = table.view();
    scene.knots = knots.data();
    scene.knot_count = static_cast<int>(knots.size());
    scene.cells = view_of(macrocells(), cells);
    TreeView const tree = tree_ ? tree_->view(bricks) : TreeView{};
    Integrator const integrator = surfaces                                            ? Integrator::iso
                                  : settings.algorithm == Algorithm::multi_scattering ? Integrator::scatter
                                  : projected                                         ? Integrator::project
                                  : settings.exact                                    ? Integrator::exact
                                                                                      : Integrator::march;

    if (accumulation != nullptr && integrator == Integrator::scatter) {
        if (accumulation->samples == 0)
            accumulation->sums.assign(
                4 * static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height), 0);
        scene.first_sample = settings.first_sample + accumulation->samples;
        scene.sums.light = accumulation->sums.data();
        scene.before = accumulation->samples;
        accumulation->samples += settings.samples;
    }

    PartRows const rows = rows_of_part(settings);
    Image image{settings.width, settings.height, {}};
    image.pixels.resize(4 * static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height));
    bool const layers = settings.layers && report != nullptr && !projected;
    bool const with_gpu = on_gpu(settings, layers || (in_passes && settings.goal.any()), labels);
    // Until something is drawn there: a GPU draws all of a picture at once.
    for (std::size_t i = 3; i < image.pixels.size() && !(with_gpu && settings.parts == 1); i += 4) image.pixels[i] = 1;
    Drawing drawing{[&, of_lattice = tile_function(execution_.instructions),
                     of_tree = tree_tile_function(execution_.instructions)](SceneView const& view, Tile tile,
                                                                            float* pixels, Counters& counters) {
                        if (tree_)
                            of_tree(view, tree, integrator, tile, pixels, image.width, counters);
                        else
                            of_lattice(view, lattice_.view, integrator, tile, pixels, image.width, counters);
                    },
                    scene,
                    settings.background,
                    settings.goal,
                    watch,
                    rows.first,
                    rows.last,
                    execution_.threads,
                    nullptr,
                    start};
    std::vector<float> variance;
    if (layers && integrator == Integrator::scatter && in_passes) drawing.variance = &variance;
    Counters counters;
    Quality quality;
    double gpu_seconds = 0;
    if (with_gpu) {
        device_select(execution_.gpu);
        std::lock_guard const lock(cache_->drawing);
        auto& copies = cache_->copies;
        if (!copies) copies = std::make_unique<DeviceCopies>(lattice_.view, lattice_.voxels.bytes());
        quality = draw_on_gpu(drawing, copies->scene(scene, ready, settings.environment), copies->lattice(), integrator,
                              in_passes, image, counters, gpu_seconds);
    } else if (integrator == Integrator::scatter && in_passes)
        quality = draw_paths(drawing, image, counters);
    else if (settings.goal.any() && in_passes)
        quality = draw_adaptively(drawing, integrator == Integrator::march, image, counters);
    else
        quality = draw_once(drawing, image, counters);
    if (report != nullptr) {
        report->camera = camera;
        report->unit = appearance.unit;
        report->domain = appearance.domain;
        report->transfer = appearance.transfer;
        report->isos = appearance.iso_values;
        report->iso_colors.clear();
        for (IsoView const& iso : appearance.isos)
            report->iso_colors.push_back({linear_to_srgb(static_cast<double>(iso.red)),
                                          linear_to_srgb(static_cast<double>(iso.green)),
                                          linear_to_srgb(static_cast<double>(iso.blue))});
        report->labels = labels ? appearance.labels->shown : nullptr;
        report->shade = appearance.shade;
        report->rays = counters.rays, report->segments = counters.segments, report->samples = counters.samples;
        report->capped = counters.capped;
        report->quality = quality;
        if (layers && !quality.stopped) report->layers = layers_of(drawing, integrator, tree);
        bool const by_bricks = tree_ && integrator == Integrator::march;
        auto const visible = static_cast<double>(by_bricks ? bricks.visible_count : cells.visible_count);
        report->skipped = 1 - visible / static_cast<double>(by_bricks ? tree_->brick_count() : cells.distance.size());
        report->parts = by_bricks ? "bricks" : "macrocells";
        report->lossy = projected ? appearance.lossy : unseen(appearance, knots, table);
        if (report->lossy.empty() && !quality.stopped && settings.parts == 1 && is_empty(image))
            report->lossy.push_back("the picture is empty: nothing that can be seen is in front of the camera");
        report->missing = histogram().missing, report->infinite = histogram().infinite;
        if (integrator == Integrator::scatter)
            report->paths = in_passes ? quality.rays : scene.before + settings.samples;
        report->method =
            labels     ? text("labels, ", scene.label_count, " of them, nearest voxel, shading ", appearance.shade)
            : surfaces ? text("implicit iso-surface, exact cubic per voxel, ", scene.iso_count, " value(s)")
            : integrator == Integrator::scatter
                ? text("delta tracking, ",
                       settings.anisotropy == 0 ? std::string("isotropic")
                                                : text("Henyey-Greenstein of mean cosine ", settings.anisotropy),
                       ", ", in_passes ? mean_text(quality.rays) : text(scene.before + settings.samples),
                       " paths per pixel, seed ", settings.seed)
            : projected ? text(enum_name(settings.algorithm), " of the values along each ray, cubic by cubic")
            : settings.exact
                ? "exact, piece by piece between the points of the transfer function"
                : text("ray marching, step ", in_passes && settings.goal.any() ? quality.finest : settings.step,
                       tree_                                ? " of the finest cell"
                       : header_.kind == Kind::hierarchical ? " voxel of the finest grid"
                                                            : " voxel",
                       ", shading ", appearance.shade);
        if (with_gpu) report->method += ", on a GPU";
        report->prepare_seconds = prepare_seconds_;
        report->render_seconds = seconds_since(start);
        report->gpu_seconds = gpu_seconds;
    }
    if (settings.parts > 1) {
        auto const cut = [&](std::vector<float>& pixels, std::size_t channels) {
            std::size_t const row = channels * static_cast<std::size_t>(settings.width);
            pixels.resize(row * static_cast<std::size_t>(rows.last));
            pixels.erase(pixels.begin(), pixels.begin() + static_cast<std::ptrdiff_t>(row) * rows.first);
        };
        cut(image.pixels, 4);
        image.height = rows.last - rows.first;
        if (report != nullptr)
            for (Layer& layer : report->layers) cut(layer.values, 1);
    }
    return image;
}

Image render(Volume const& volume, RenderSettings const& settings, Execution const& execution, RenderReport* report) {
    return Renderer(volume, execution, settings.tree).render(settings, report);
}

TileFunction tile_function([[maybe_unused]] InstructionSet instructions) {
#ifdef VKT_X86_BACKENDS
    if (instructions == InstructionSet::avx512) return avx512::tile_function();
    if (instructions == InstructionSet::avx2) return avx2::tile_function();
#endif
    return baseline::tile_function();
}

TreeTileFunction tree_tile_function([[maybe_unused]] InstructionSet instructions) {
#ifdef VKT_X86_BACKENDS
    if (instructions == InstructionSet::avx512) return avx512::tree_tile_function();
    if (instructions == InstructionSet::avx2) return avx2::tree_tile_function();
#endif
    return baseline::tree_tile_function();
}

} // namespace vkt::render
