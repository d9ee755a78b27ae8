// Volumes made ready for drawing; PNG files with their metadata.
// SPDX-License-Identifier: MIT
#include "shell/pictures.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/render/settings.h"

#include <algorithm>
#include <cmath>

namespace vkt::shell {

namespace {

/// As render::Lattice and render::Tree keep them.
std::size_t drawn_size(Header const& header) {
    switch (header.dtype) {
    case DataType::uint8:
        return 1;
    case DataType::uint16:
    case DataType::int16:
        return 2;
    case DataType::int8:
        return header.kind == Kind::hierarchical ? 4 : 2;
    default:
        return 4;
    }
}

} // namespace

void check_memory(Header const& header, Execution const& execution) {
    std::size_t const bytes = bytes_to_draw(header);
    if (bytes <= execution.memory) return;
    throw Error(ErrorKind::resources,
                text("drawing the volume needs ", bytes_text(static_cast<double>(bytes)), " of memory, the budget is ",
                     bytes_text(static_cast<double>(execution.memory))),
                "raise --memory, or make the volume smaller with 'vkt crop' or 'vkt resample'");
}

std::size_t bytes_to_draw(Header const& header) {
    if (header.kind == Kind::hierarchical) {
        // Cells that rays can sample stay where they are.
        bool const in_place = header.dtype == DataType::float32 || drawn_size(header) < 4;
        return header.bytes() + (in_place ? 0 : static_cast<std::size_t>(header.cell_count) * sizeof(float)) +
               static_cast<std::size_t>(header.brick_count) * 140;
    }
    double voxels = 1; // of the padded copy; more than there is memory for is no reason to overflow
    for (int axis = 0; axis < 3; ++axis) voxels *= static_cast<double>(header.dims[axis] + 2 * render::lattice_padding);
    return header.bytes() +
           static_cast<std::size_t>(std::min(voxels * static_cast<double>(drawn_size(header)), 0x1p62));
}

std::vector<std::string> explanation(render::RenderSettings const& settings, Header const& header) {
    std::int64_t const rays = std::int64_t{settings.width} * settings.height;
    auto const length = [&](int axis) { return static_cast<double>(header.dims[axis]); };
    std::string method, cost;
    if (settings.algorithm == render::Algorithm::multi_scattering) {
        method = text("delta tracking, isotropic, ", settings.samples, " paths a pixel, seed ", settings.seed);
        cost = text(rays * settings.samples, " paths, each as long as the volume is dense");
    } else if (settings.algorithm == render::Algorithm::implicit_iso) {
        method = "implicit iso-surface, exact cubic per voxel";
        cost = text("at most ", header.dims.x + header.dims.y + header.dims.z, " voxels on each of ", rays, " rays");
    } else {
        method = settings.exact ? "exact, piece by piece between the points of the transfer function"
                                : text("ray marching, step ", settings.step,
                                       header.kind == Kind::hierarchical ? " of the finest cell nearby" : " voxel",
                                       settings.skip ? ", empty space skipped" : "");
        double const diagonal = std::hypot(length(0), length(1), length(2));
        cost = settings.exact ? text("at most ", header.dims.x + header.dims.y + header.dims.z, " voxels on each of ",
                                     rays, " rays")
                              : text("at most ", static_cast<std::int64_t>(std::ceil(diagonal / settings.step)),
                                     " steps on each of ", rays, " rays");
    }
    return {"method " + method, text(cost, ", ", bytes_text(static_cast<double>(bytes_to_draw(header))), " of memory")};
}

namespace {

/// Under this keyword a picture keeps its history as the headers of files do.
constexpr char history_keyword[] = "vkt history";
constexpr std::size_t most_history = 400'000;

class PictureSource : public Source {
public:
    explicit PictureSource(std::unique_ptr<ByteSource> bytes) : bytes_(std::move(bytes)) {}
    bool next_volume() override {
        if (std::exchange(opened_, true)) return false;
        for (auto const& [keyword, content] : render::read_png_texts(*bytes_))
            if (keyword == history_keyword) header_.history = parse_history(content);
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::forward; }
    void read(AnyView) override {
        throw Error(ErrorKind::usage, text("'", bytes_->name(), "' is a picture, not a volume"));
    }
    void finish() override {}

private:
    std::unique_ptr<ByteSource> bytes_;
    Header header_;
    bool opened_ = false;
};

} // namespace

bool is_picture(ByteSource& bytes) { return render::is_png(bytes.peek(8)); }

std::unique_ptr<Source> picture_source(std::unique_ptr<ByteSource> bytes) {
    return std::make_unique<PictureSource>(std::move(bytes));
}

bool Volumes::another() {
    while (!another_) {
        another_ = source_.next_volume();
        if (!*another_ || !source_.header().dry_run) break;
        context_.plan(source_.header(), context_.output());
        source_.finish();
        another_.reset();
    }
    return *another_;
}

bool Volumes::open() {
    if (!another()) return false;
    check_memory(source_.header(), context_.execution());
    another_.reset();
    return true;
}

bool Volumes::next() {
    if (!open()) return false;
    renderer_.reset();
    header_ = source_.header();
    renderer_ = std::make_unique<render::Renderer>(load(source_, context_.execution()), context_.execution());
    return true;
}

void write_picture(std::string const& path, bool force, Picture const& picture, Header const& header,
                   StageInfo const& stage, Context& context) {
    render::RenderReport const& r = picture.report;
    History const history = folded(history_step(stage, {header}));
    auto const png = render::to_png(picture.image, picture.background,
                                    {{"Software", "vkt " VKT_VERSION},
                                     {"History", history_as_shell(history)},
                                     {history_keyword, history_text(history, most_history)},
                                     {"Camera", render::camera_text(r.camera)},
                                     {"Method", r.method},
                                     {"Unit distance", to_text(r.unit)},
                                     {"Transfer function", render::transfer_to_json(r.transfer)}});
    if (r.missing > 0) context.lossy(text(r.missing, " voxels are not a number and show nothing"));
    if (r.infinite > 0) context.lossy(text(r.infinite, " voxels are infinite and show as the nearest finite value"));
    for (auto const& line : r.lossy) context.lossy(line);
    OutputFile file(path, force);
    file.write(png.data(), png.size());
    file.commit();
    if (r.capped > 0) context.note(text(r.capped, " paths were cut at the bounce limit"));
    if (context.verbose()) context.note(render::report_text(r));
}

} // namespace vkt::shell
