// Loading of modules.
// SPDX-License-Identifier: MIT
#include "libvkt/io/module.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/module_list.h"

#include <algorithm>
#include <cctype>
#include <dlfcn.h>
#include <filesystem>
#include <link.h>
#include <string_view>
#include <sys/resource.h>
#include <vector>

namespace vkt {
namespace {

/// The folder of the program or shared library that this code is part of.
std::filesystem::path own_folder() {
    Dl_info info{};
    link_map* map = nullptr;
    if (::dladdr1(reinterpret_cast<void*>(&module_functions), &info, reinterpret_cast<void**>(&map), RTLD_DL_LINKMAP) !=
            0 &&
        map != nullptr && map->l_name != nullptr && *map->l_name != '\0')
        return std::filesystem::path(map->l_name).parent_path();
    std::error_code ignored;
    return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
}

/// Where modules may lie: beside an installed program, beside a shared libvkt, in a build folder, where vkt was
/// installed (for programs elsewhere that contain libvkt).
std::vector<std::filesystem::path> folders() {
    std::filesystem::path const own = own_folder();
    std::vector<std::filesystem::path> list{own / VKT_LIBRARY_FROM_BINARY / "vkt", own / "vkt", own / "lib/vkt",
                                            own / "../lib/vkt"};
#ifdef VKT_LIBRARY_FROM_PYTHON // the Python package contains libvkt
    list.push_back(own / VKT_LIBRARY_FROM_PYTHON / "vkt");
    list.push_back(own / "../../lib/vkt");
#endif
    list.emplace_back(VKT_MODULE_FOLDER);
    return list;
}

ModuleExport const* load(std::string const& name, std::string& reason, bool& found) {
    for (auto const& folder : folders()) {
        std::filesystem::path const file = folder / text("vkt_", name, ".so");
        std::error_code ignored;
        if (!std::filesystem::exists(file, ignored)) continue;
        found = true;
        // Never closed: objects with code in the module may live until the process ends.
        void* const module = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
        void const* const symbol = module != nullptr ? ::dlsym(module, text("vkt_module_", name).c_str()) : nullptr;
        if (symbol != nullptr) return static_cast<ModuleExport const*>(symbol);
        char const* const error = ::dlerror();
        reason = text("its module does not load: ", error != nullptr ? error : file.string());
        return nullptr;
    }
    reason = text("no vkt_", name, ".so in ", folders().front().lexically_normal().string());
    return nullptr;
}
/// None if this build did not make it.
ListedModule const* listed(std::string_view name) {
    auto const& list = module_list();
    auto const found = std::find_if(list.begin(), list.end(), [&](ListedModule const& m) { return m.name == name; });
    return found == list.end() ? nullptr : &*found;
}

std::string upper_case(std::string name) {
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return name;
}

Error missing(std::string const& what, std::string const& reason) {
    return Error(ErrorKind::failure, text(what, ": ", reason), "install vkt again, with its folder lib/vkt");
}

ListedModule const& require_built(std::string const& name, std::string const& what) {
    ListedModule const* const module = listed(name);
    if (module == nullptr)
        throw Error(ErrorKind::failure, text(what, ": this build is without it"),
                    name == "window" ? std::string("build vkt with -DVKT_VIEWER=ON, GLFW and Dear ImGui")
                                     : text("build vkt with -DVKT_", upper_case(name), "=ON and lib", name));
    return *module;
}

ModuleExport const& module_named(std::string const& name, std::string const& what) {
    ModuleExport const* module = require_built(name, what).linked;
    std::string reason;
    bool found = false; // it is there, but may not fit
    if (module == nullptr) module = load(name, reason, found);
    rlimit space{};
    bool const limited = ::getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY;
    if (module == nullptr && found && limited)
        throw Error(ErrorKind::resources, text(what, ": ", reason),
                    "the limits of this shell or job are tight (ulimit -a)");
    if (module == nullptr) throw missing(what, reason);
    if (std::string_view(module->version) != VKT_VERSION)
        throw missing(what, text("its module is of version ", module->version, ", this is ", VKT_VERSION));
    return *module;
}

} // namespace

bool module_built(std::string const& name) { return listed(name) != nullptr; }

bool module_installed(std::string const& name) {
    ListedModule const* const module = listed(name);
    if (module == nullptr || module->linked != nullptr) return module != nullptr;
    auto const places = folders();
    return std::any_of(places.begin(), places.end(), [&](auto const& folder) {
        std::error_code ignored;
        return std::filesystem::exists(folder / text("vkt_", name, ".so"), ignored);
    });
}

void const* module_functions(std::string const& name, std::string const& what) {
    return module_named(name, what).functions;
}

ParserOpen module_parser(std::string const& name, std::string const& what) { return module_named(name, what).parse; }

std::string parser_program(std::string const& name, std::string const& what) {
    require_built(name, what);
    for (auto const& folder : folders()) {
        std::filesystem::path const file = folder / "vkt_parser";
        std::error_code ignored;
        if (std::filesystem::exists(file, ignored)) return file;
    }
    throw missing(what, text("no vkt_parser in ", folders().front().lexically_normal().string()));
}

} // namespace vkt
