// Fuzzes the reader of AMReX plotfiles, directories of text headers and records.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/amrex.h"
#include "tests/fuzz/volume_input.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace {

/// A directory for the files of a plotfile, removed at the end.
class Folder {
public:
    Folder() : path_(std::filesystem::temp_directory_path() / ("vkt-amrex-fuzz-" + std::to_string(getpid()))) {
        for (char const* level : {"Level_0", "Level_1"}) std::filesystem::create_directories(path_ / level);
    }
    ~Folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    std::filesystem::path const& path() const { return path_; }

private:
    std::filesystem::path path_;
};

} // namespace

// The files of a plotfile one after another, each ended by the byte 0x1e.
extern "C" int LLVMFuzzerTestOneInput(std::uint8_t const* data, std::size_t size) {
    static Folder const folder;
    std::string_view rest(reinterpret_cast<char const*>(data), size);
    for (char const* name :
         {"Header", "Level_0/Cell_H", "Level_0/Cell_D_00000", "Level_1/Cell_H", "Level_1/Cell_D_00000"}) {
        std::string_view const content = rest.substr(0, rest.find('\x1e'));
        std::ofstream(folder.path() / name, std::ios::binary) << content;
        rest.remove_prefix(std::min(rest.size(), content.size() + 1));
    }
    try {
        auto const file = vkt::open_amrex(folder.path().string());
        vkt::AmrReadOptions options;
        options.variable = file->listing().variables.front().name;
        vkt::BrickSequence bricks = file->read(options, {});
        check(bricks.header());
        if (bricks.header().bytes() < std::size_t{1} << 24) std::move(bricks).whole();
    } catch (vkt::Error const&) {
    } // the only thing that may come out of a reader
    return 0;
}
