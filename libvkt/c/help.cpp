// What the library knows of its operations, for the C API.
// SPDX-License-Identifier: MIT
#include "libvkt/c/call.h"
#include "libvkt/engine/operation_help.h"

using namespace vkt;
using namespace vkt::c;

vkt_status vkt_operation_help(char const* name, char** json) {
    return guarded([&](Call&) {
        need(name, "name");
        need(json, "json");
        *json = copied(operation_help(name));
    });
}
