// Several volumes one after another, as the C API hands them out.
// SPDX-License-Identifier: MIT
#pragma once

#include "ipc/c_calling.h"

#include "libvkt/c/vkt.h"
#include "libvkt/core/execution_options.h"
#include "libvkt/core/header.h"
#include "libvkt/engine/source.h"

#include <cstdint>
#include <functional>
#include <memory>

struct vkt_series_reader {
    vkt::ipc::Caller caller{}; ///< who waits for bytes
    vkt::ExecutionOptions options{};
    std::unique_ptr<vkt::Source> source{};
    std::function<void(vkt::Header&, std::int64_t number)> complete{}; ///< what a volume says of itself, where missing
    std::int64_t number = 0;
    vkt::ipc::Failure failure{"the series"};
};
