// vkt mesh: closed surfaces as triangles, measured and written.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/shape/mesh.h"
#include "libvkt/core/error.h"
#include "libvkt/formats/series.h"
#include "libvkt/operations/shape/mesh_file.h"
#include "shell/measure.h"
#include "shell/terminal.h"

namespace vkt::shell {
namespace {

class MeshCommand : public Measure {
public:
    MeshCommand() : Measure(std::make_unique<MakeMesh>()) {}
    void parameters(Parameters& p) override {
        Measure::parameters(p);
        p.option("output", output_, "OUT", "mesh file: .stl, .ply, .obj or .vtp; %d is the label's number")
            .short_form('o')
            .not_in_history();
        p.option("format", format_, "FORMAT", "its format, where the name does not tell").not_in_history();
        p.flag("ascii", file_.ascii, "numbers as text instead of binary").not_in_history();
        p.flag("normals", file_.normals, "normals of vertices, in PLY, OBJ and VTP").not_in_history();
        p.flag("force", force_, "overwrite an existing output file").not_in_history();
    }
    void check() const override {
        Measure::check();
        if (output_.empty()) {
            if (format_ || file_.ascii || file_.normals || force_)
                throw Error(ErrorKind::usage, "--format, --ascii, --normals and --force are about the file of -o");
            return;
        }
        if (output_ == "-" && format() != MeshFormat::obj && !file_.ascii && output_is_terminal())
            throw Error(ErrorKind::usage, "refusing to write binary triangles to the terminal", "use -o FILE");
        (void)format(); // or it is refused
        if (output_ != "-") check_output(numbered_path(output_, 0), force_);
    }

    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        context_ = &context;
        return Measure::consume(inputs, context);
    }

protected:
    void found(Operation const& operation) override {
        auto const& mesh = static_cast<MakeMesh const&>(operation);
        if (output_.empty()) return;
        context_->refuse_lossy();
        std::span<Mesh const> const all = mesh.meshes();
        if (is_numbered(output_) && !mesh.iso) {
            if (volumes_++ > 0) throw Error(ErrorKind::usage, several, "number them by hand: vkt mesh FILE");
            for (std::size_t i = 0; i < all.size(); ++i)
                write(numbered_path(output_, all[i].label), all.subspan(i, 1), mesh, false);
            return;
        }
        if (volumes_ > 0 && !is_numbered(output_))
            throw Error(ErrorKind::usage, several, "give a place for the number: -o surface-%04d.ply");
        write(numbered_path(output_, volumes_++), all, mesh, !mesh.iso);
    }
    void print(std::vector<Report> const& reports, ReportForm form, Context& context) const override {
        for (std::string const& note : notes_) context.lossy(note);
        if (output_ != "-") Measure::print(reports, form, context);
    }

private:
    static constexpr char const* several = "the input holds several volumes, but -o names one mesh";

    MeshFormat format() const { return mesh_format(output_, format_, file_.normals); }
    void write(std::string const& path, std::span<Mesh const> meshes, MakeMesh const& mesh, bool labels) {
        MeshFileOptions options = file_;
        options.format = format();
        options.labels = labels;
        Vec3 const spacing = mesh.header().geometry.spacing;
        options.spacing = std::min({spacing.x, spacing.y, spacing.z});
        if (options.format == MeshFormat::stl && !fits_float32(meshes, options.spacing))
            notes_.push_back(text(path, ": STL rounds coordinates to float32, by more than 1/2048 of a voxel here"));
        if (options.format == MeshFormat::stl && !options.ascii && labels && meshes.size() > 1)
            notes_.push_back(text(path, ": binary STL does not tell labels apart"));
        OutputFile file(path, force_);
        write_meshes(file, meshes, options);
        file.commit();
    }

    Context* context_ = nullptr;
    std::string output_;
    std::optional<MeshFormat> format_;
    MeshFileOptions file_;
    bool force_ = false;
    std::int64_t volumes_ = 0;
    std::vector<std::string> notes_;
};

} // namespace

Command mesh_command() {
    Command command = operation_command("mesh");
    command.operation = nullptr;
    command.consumer = [] { return std::make_unique<MeshCommand>(); };
    return command;
}

} // namespace vkt::shell
