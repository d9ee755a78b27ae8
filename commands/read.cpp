// vkt read: a file of any format, or a region of it, as a stream.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/region_source.h"
#include "libvkt/formats/series.h"
#include "shell/command.h"
#include "shell/terminal.h"

namespace vkt {
namespace {
enum class Endian : std::uint8_t { little, big };
}
template <> struct EnumNames<Endian> {
    static std::vector<std::pair<Endian, char const*>> all() {
        return {{Endian::little, "little"}, {Endian::big, "big"}};
    }
};
} // namespace vkt

namespace vkt::shell {
namespace {

class Read : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", path_, "input: a file of any known format, a stream, or '-'").optional();
        p.option("input", input_, "IN", "the input, said as an option").short_form('i');
        p.option("dims", options_.dims, "X Y Z", "raw: voxels along each axis");
        p.option("dtype", options_.dtype, "T", "raw: type of a voxel");
        p.option("skip", options_.skip, "N", "raw: bytes before the first voxel");
        p.option("endian", endian_, "E", "raw: byte order");
        p.option("spacing", options_.spacing, "S", "raw: distance of voxels, one number or X,Y,Z");
        p.option("format", options_.format, "F", "input format, if content and name do not tell it");
        p.option("variable", options_.variable, "NAME", "the variable or grid of a file that holds several");
        p.option("roi", roi_, "R", "read only this region, X0:X1,Y0:Y1,Z0:Z1 in voxels");
        p.option("roi-world", world_roi_, "R", "read only this region, in world units");
    }

    void check() const override {
        if (!path_.empty() && !input_.empty())
            throw Error(ErrorKind::usage, text("two inputs: '", path_, "' and '", input_, "'"),
                        "read one, and the other with <(vkt read …)");
        if (!roi_.empty() && !world_roi_.empty())
            throw Error(ErrorKind::usage, "--roi and --roi-world exclude each other");
        if (options_.skip < 0) throw Error(ErrorKind::usage, text("--skip ", options_.skip, " is negative"));
        if (endian_ && !options_.format.empty() && options_.format != "raw")
            throw Error(ErrorKind::usage, text("--endian describes raw files, not ", options_.format));
    }

    std::unique_ptr<Source> open(Context& context) override {
        std::string const path = !input_.empty() ? input_ : path_.empty() ? "-" : path_;
        if (path == "-" && input_is_terminal())
            throw Error(ErrorKind::usage, "no input: standard input is a terminal",
                        "name a file; see 'vkt read --help'");
        ReadOptions options = options_;
        options.big_endian = endian_ == Endian::big;
        if (endian_) options.format = "raw";
        bool const told = options.dims || options.dtype || options.skip != 0 || options.spacing ||
                          !options.format.empty() || !options.variable.empty();
        auto const open_told = [options](std::string const& one) { return open_volume(open_bytes(one), options); };
        auto source = told ? series_source(matching_files(path), open_told) : context.open(path);
        return region_of(std::move(source), roi_, world_roi_);
    }

private:
    std::string path_, input_;
    ReadOptions options_;
    std::optional<Endian> endian_;
    Roi roi_;
    WorldRoi world_roi_;
};

} // namespace

Command read_command() {
    return opener_command<Read>(
        {"Read a volume from a file.",
         "The format is recognised by the content first and by the name second. Raw files say dims and type in their "
         "name,\n"
         "as the Open SciVis data sets do, or by options. Of a region only the bytes needed are read. FLASH files "
         "(HDF5), AMReX plotfiles\n(directories) and "
         "OpenVDB files hold hierarchical volumes; --variable chooses one, vkt info lists them.",
         {{"Any known format", "vkt read volume.nrrd | vkt flip x -o flipped.nrrd"},
          {"Bare voxels; dims and type stand in the name", "vkt info $DATA/raw/fuel_64x64x64_uint8.raw"},
          {"Bare voxels that say nothing",
           "head -c 24000 /dev/zero | vkt read - --dims 40 30 10 --dtype int16 --endian big | vkt info"},
          {"Only a region", "vkt read volume.nrrd --roi 25%:75%,:,10:+5 | vkt info"}}});
}

} // namespace vkt::shell
