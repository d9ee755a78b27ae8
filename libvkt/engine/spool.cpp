// Spools.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/spool.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>

namespace vkt {

Spool::Spool(Source& source, Execution const& execution, StageInfo const& info) : header_(source.header()) {
    std::size_t const bytes = header_.bytes();
    AnyView whole;
    if (bytes <= execution.memory) {
        memory_.reserve(bytes);
        whole = dense_view(memory_.write(Space::host), header_.dtype, box_of(header_.dims));
        voxels_ = whole;
    } else {
        open_file(execution.temporary_directory);
        if (info.listener)
            info.listener(info.name,
                          text("spooling ", bytes_text(static_cast<double>(bytes)), " to ", directory_,
                               " (--memory is ", bytes_text(static_cast<double>(execution.memory)), ")"),
                          false);
    }
    std::int64_t const height = slab_height(header_, source.natural_slab(), execution);
    source.expect(box_of(header_.dims));
    Buffer slab;
    for (std::int64_t z = 0; z < header_.dims.z; z += height) {
        Box const box{{0, 0, z}, {header_.dims.x, header_.dims.y, std::min(z + height, header_.dims.z)}};
        if (file_ < 0) {
            source.read(whole.part(box));
            continue;
        }
        if (auto const lent = source.borrow(box); lent && lent->contiguous()) {
            write_slab(*lent);
            continue;
        }
        std::size_t const need = static_cast<std::size_t>(box.voxels()) * size_of(header_.dtype);
        slab.reserve(need);
        AnyView const view = dense_view(slab.write(Space::host), header_.dtype, box);
        source.read(view);
        write_slab(view);
    }
    source.finish();
}

Spool::~Spool() {
    if (file_ >= 0) ::close(file_);
}

void Spool::open_file(std::string const& directory) {
    directory_ = directory;
    file_ = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file_ >= 0) return;
    // File systems without O_TMPFILE: a private name that exists for an instant.
    std::string name = directory + "/.vkt-spool-XXXXXX";
    file_ = ::mkostemp(name.data(), O_CLOEXEC);
    if (file_ < 0)
        throw Error(ErrorKind::io, text("cannot spool to ", directory, ": ", std::strerror(errno)),
                    "set TMPDIR to a writable directory, or raise --memory");
    ::unlink(name.c_str());
}

void Spool::write_slab(ConstView slab) {
    std::byte const* data = slab.data;
    std::size_t left = slab.bytes();
    while (left > 0) {
        ssize_t const n = ::write(file_, data, left);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0)
            throw Error(ErrorKind::io, text("cannot spool to ", directory_, ": ", std::strerror(errno)),
                        "set TMPDIR to a larger file system, or raise --memory");
        data += n;
        left -= static_cast<std::size_t>(n);
    }
}

std::optional<ConstView> Spool::borrow(Box const& region) const {
    if (file_ >= 0) return std::nullopt;
    return voxels_.part(region);
}

void Spool::read(AnyView out) {
    if (file_ < 0) return copy(voxels_.part(out.box), out);
    // Slice by slice, the rows between the first and the last wanted: one read each.
    Index3 const n = out.dims();
    std::size_t const size = size_of(header_.dtype);
    std::size_t const bytes = static_cast<std::size_t>(header_.dims.x * n.y) * size;
    scratch_.reserve(bytes);
    for (std::int64_t z = out.box.lower.z; z < out.box.upper.z; ++z) {
        std::byte* const rows = scratch_.write(Space::host);
        auto const offset = (z * header_.dims.y + out.box.lower.y) * header_.dims.x * static_cast<std::int64_t>(size);
        std::size_t done = 0;
        while (done < bytes) {
            ssize_t const got = ::pread(file_, rows + done, bytes - done, offset + static_cast<std::int64_t>(done));
            if (got < 0 && errno == EINTR) continue;
            if (got <= 0)
                throw Error(ErrorKind::io, text("cannot read the spool in ", directory_, ": ", std::strerror(errno)));
            done += static_cast<std::size_t>(got);
        }
        Box const slice{{0, out.box.lower.y, z}, {header_.dims.x, out.box.upper.y, z + 1}};
        Box part = out.box;
        part.lower.z = z;
        part.upper.z = z + 1;
        copy(ConstView(dense_view(rows, header_.dtype, slice)).part(part), out.part(part));
    }
}

} // namespace vkt
