// The options that say how work runs, declared once for command line, C API and Python.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/parameters.h"

#include <optional>
#include <string>

namespace vkt {

template <> struct EnumNames<Device> {
    static std::vector<std::pair<Device, char const*>> all() {
        return {{Device::automatic, "auto"}, {Device::cpu, "cpu"}, {Device::gpu, "gpu"}};
    }
};

struct ExecutionOptions {
    std::string device = "auto";
    std::optional<int> threads;
    std::optional<std::string> memory;
    std::int64_t slab = 0;

    void declare(Parameters& parameters);
    /// The options on top of what machine and environment say. Throws Error{usage}.
    Execution execution() const;
};

} // namespace vkt
