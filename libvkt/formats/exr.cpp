// OpenEXR: what the module openexr does, and who asks it.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/exr.h"

#include "libvkt/core/text.h"
#include "libvkt/formats/whole_file.h"
#include "libvkt/io/module.h"

#include <algorithm>
#include <cstring>

namespace vkt {
namespace {

ExrFunctions const& functions(std::string const& what) {
    return *static_cast<ExrFunctions const*>(module_functions("openexr", what));
}

} // namespace

FloatPicture::Plane const* FloatPicture::find(std::string_view name) const {
    auto const found = std::find_if(planes.begin(), planes.end(), [&](Plane const& p) { return p.name == name; });
    return found == planes.end() ? nullptr : &*found;
}

void require_exr(std::string const& what) { functions(what); }

std::vector<std::byte> exr_bytes(FloatPicture const& picture, std::string const& what) {
    return functions(what).encode(picture);
}

bool is_exr(std::span<std::byte const> head) {
    constexpr unsigned char magic[4] = {0x76, 0x2f, 0x31, 0x01};
    return head.size() >= 4 && std::memcmp(head.data(), magic, 4) == 0;
}

FloatPicture read_exr(ByteSource& bytes) {
    std::string const what = text(bytes.name(), ": reading OpenEXR");
    ExrFunctions const& exr = functions(what);
    std::vector<std::byte> const file = whole_file(bytes, most_picture_bytes);
    return exr.decode(file, bytes.name());
}

} // namespace vkt
