// Parts of plot files, Zarr stores and headers.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/whole_of.h"

#include "libvkt/formats/format.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <vector>

namespace vkt {
namespace {

namespace fs = std::filesystem;

bool is_there(fs::path const& path) {
    std::error_code failed;
    return fs::exists(path, failed);
}

/// The folder of a plot file or the outermost one of a store that `path` lies in.
fs::path folder_around(fs::path const& path) {
    constexpr int most_levels = 8; // of groups, and of chunks in folders
    fs::path store, folder = path;
    for (int level = 0; level < most_levels && folder.has_relative_path(); ++level) {
        folder = folder.parent_path();
        fs::path here = folder.empty() ? fs::path(".") : folder;
        if (level < 2 && is_there(here / "Header") && is_there(here / "Level_0")) return here;
        bool const holds = is_there(here / ".zarray") || is_there(here / ".zgroup") || is_there(here / "zarr.json");
        if (holds)
            store = here;
        else if (!store.empty())
            break;
    }
    return store;
}

/// The header of detached voxels.
fs::path header_beside(fs::path const& path) {
    std::error_code failed;
    for (char const* const extension : {".mhd", ".nhdr", ".hdr"}) {
        fs::path header = path;
        header.replace_extension(extension);
        if (header == path || !is_there(header)) continue;
        std::vector<std::string> const files = detached_files(header.string());
        bool const own = std::any_of(files.begin(), files.end(),
                                     [&](std::string const& file) { return fs::equivalent(file, path, failed); });
        if (own) return header;
    }
    return {};
}

} // namespace

std::string whole_of(std::string const& path) {
    if (!is_there(path)) return {};
    fs::path const folder = folder_around(path);
    return (folder.empty() ? header_beside(path) : folder).string();
}

} // namespace vkt
