// What the module hdf5 hands to the library: the functions of flash.h.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/flash.h"
#include "libvkt/formats/parsed_tree.h"
#include "libvkt/formats/slab_sink.h"
#include "libvkt/io/module.h"

namespace vkt {

struct FlashFunctions {
    decltype(write_flash)* write;
    std::unique_ptr<VolumeWriter> (*writer)(std::string const& path, WriteOptions const& options);
};

namespace flash {
/// The reader, which runs in a child.
std::shared_ptr<TreeParser> open(std::string const& path);
void write(Volume const& volume, std::string const& path, std::string const& variable,
           FlashWriteOptions const& options);
} // namespace flash

} // namespace vkt
