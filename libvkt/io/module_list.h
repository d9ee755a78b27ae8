// The modules that a build made, in a list that CMake generates.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/module.h"

#include <string_view>
#include <vector>

namespace vkt {

struct ListedModule {
    std::string_view name;      ///< "hdf5"
    ModuleExport const* linked; ///< none: a file that is loaded
};
std::vector<ListedModule> const& module_list();

} // namespace vkt
