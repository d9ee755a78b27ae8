// The version, and the parts of the build.
// SPDX-License-Identifier: MIT
#include "shell/version.h"

#include "libvkt/core/build_parts.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module_list.h"

#include <vector>

namespace vkt::shell {

std::string version_text() {
    std::vector<std::string> with, without, modules, missing;
    for (BuildPart const& part : build_parts()) {
        std::string const note = part.note.empty() ? "" : text(part.there ? " " : ": ", part.note);
        (part.there ? with : without).push_back(text(part.name, note));
    }
    for (ListedModule const& module : module_list())
        (module_installed(std::string(module.name)) ? modules : missing).emplace_back(module.name);
    std::string result = text("vkt ", VKT_VERSION, "\n");
    auto const line = [&](char const* name, std::vector<std::string> const& words, char const* between) {
        if (!words.empty()) result += text(name, join(words, between), "\n");
    };
    line("with:     ", with, "; ");
    line("without:  ", without, "; ");
    line("modules:  ", modules, " ");
    line("missing:  ", missing, " "); // built, but not installed
    line("kernels:  ", {built_kernels().begin(), built_kernels().end()}, " ");
    return result;
}

} // namespace vkt::shell
