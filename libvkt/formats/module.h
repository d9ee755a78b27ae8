// Modules: parts of vkt that need heavy libraries (HDF5, OpenVDB), loaded when the first file asks for them.
// SPDX-License-Identifier: MIT
#pragma once

#include <string>

namespace vkt {

/// What a module exports under the name vkt_module_NAME: the version it was built for, and a table of functions.
struct ModuleExport {
    char const* version;
    void const* functions;
};

/// The functions of the module NAME, loaded from lib/vkt beside this library or program on the first call.
/// A command that meets no such file pays nothing: OpenVDB alone takes 30 ms and 30 MiB to load.
/// Throws Error{failure} if there is none, it does not load or belongs to another version, naming the reason and `what`
/// cannot be done without it.
void const* module_functions(std::string const& name, std::string const& what);

} // namespace vkt
