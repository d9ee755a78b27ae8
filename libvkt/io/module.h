// Modules: parts of vkt that need heavy libraries (HDF5, OpenVDB, libtiff, GDCM, OpenEXR, FreeType, a window's), loaded
// when they are asked for first.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/io/parser_child.h"

#include <string>

namespace vkt {

/// What a module exports under the name vkt_module_NAME: the version it was built for, a table of functions for the
/// process that loads it, and who reads files, which runs in a child (libvkt/io/parser.h).
struct ModuleExport {
    char const* version;
    void const* functions;
    ParserOpen parse;
};

/// Whether this build has the module NAME.
bool module_built(std::string const& name);
/// Whether it is there, too: part of the library or a file beside it, which may still lack libraries of its own.
bool module_installed(std::string const& name);

/// The functions of the module NAME, loaded from lib/vkt beside this library or program on the first call.
/// A command that meets no such file pays nothing: OpenVDB alone takes 30 ms and 30 MiB to load.
/// Throws Error{failure} if there is none, it does not load or belongs to another version, naming the reason and `what`
/// cannot be done without it.
void const* module_functions(std::string const& name, std::string const& what);

/// Who reads files in the module NAME; throws the same.
ParserOpen module_parser(std::string const& name, std::string const& what);

/// The program that runs such a reader, vkt_parser beside the modules. Throws Error{failure} if the build is without
/// the module or the program is not there.
std::string parser_program(std::string const& name, std::string const& what);

} // namespace vkt
