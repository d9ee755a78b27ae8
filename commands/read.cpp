// vkt read: a file of any format, or a region of it, as a stream.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "libvkt/formats/request.h"
#include "shell/command.h"
#include "shell/terminal.h"

namespace vkt::shell {
namespace {

class Read : public Opener {
public:
    void parameters(Parameters& p) override {
        p.positional("in", path_, "input: a file of any known format, a stream, or '-'").optional();
        p.option("input", input_, "IN", "the input, said as an option").short_form('i');
        request_.declare(p);
    }

    bool reads() const override { return true; }

    void check() const override {
        if (!path_.empty() && !input_.empty())
            throw Error(ErrorKind::usage, text("two inputs: '", path_, "' and '", input_, "'"),
                        "read one, and the other with <(vkt read …)");
        request_.check();
    }

    std::unique_ptr<Source> open(Context& context) override {
        std::string const path = !input_.empty() ? input_ : path_.empty() ? "-" : path_;
        if (path == "-" && input_is_terminal())
            throw Error(ErrorKind::usage, "no input: standard input is a terminal",
                        "name a file; see 'vkt read --help'");
        return request_.region_of(
            context.open(path, request_.options()),
            [detail = context.detail()](SteppedBox const& region) { detail(text("region ", region.box)); });
    }

private:
    std::string path_, input_;
    ReadRequest request_;
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
          {"Bare voxels; dims and type stand in the name", "vkt info engine_8x8x8_uint8.raw"},
          {"Bare voxels that say nothing",
           "head -c 24000 /dev/zero | vkt read - --dims 40 30 10 --dtype int16 --endian big | vkt info"},
          {"Only a region", "vkt read volume.nrrd --roi 25%:75%,:,10:+5 | vkt info"},
          {"One of several volumes",
           "vkt filter median volume.nrrd --radius 1 -o smooth.nrrd && vkt stack volume.nrrd smooth.nrrd -o "
           "series.nrrd && vkt read series.nrrd --index 1 | vkt diff - smooth.nrrd"}}});
}

} // namespace vkt::shell
