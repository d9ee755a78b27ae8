// DICOM: the file or folder that is read, as names of files and messages speak of it.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/gdcm/slice.h"

#include <string>

namespace vkt::dicom {

struct Input {
    std::string path, base; ///< base: where names of files begin
    bool folder = false;    ///< several files
    bool listed = false;    ///< which somebody named one by one

    /// Throws Error{data}.
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", path, "': ", what), hint);
    }
    std::string full(std::string const& file) const {
        return file.empty() ? path : base.empty() ? file : base + "/" + file;
    }
    std::string shown(Slice const& s) const {
        return text(s.file.empty() ? path : s.file, s.frames > 1 ? text(" frame ", s.frame) : "");
    }
    /// How to have what is refused.
    std::string forced() const {
        return listed ? "vkt stack ... --force-uniform"
                      : text("vkt read ", shell_quoted(path), " --force-uniform | ...");
    }
    /// What to do about a file that does not belong to the others.
    std::string removal() const { return listed ? "do not name it" : "remove it from the folder"; }
};

} // namespace vkt::dicom
