// Reading shares.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/share_of_range.h"

#include "libvkt/core/error.h"

namespace vkt {

ShareOfRange ValueText<ShareOfRange>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string number = w.front();
    if (!number.ends_with('%')) {
        double const share = ValueText<double>::read({number}, name);
        throw Error(ErrorKind::usage, text(name, ": ", number, " lacks the sign of a share of the value range"),
                    text("in percent: ", name, " ", share >= 1e-12 && share < 1 ? 100 * share : 1, "%"));
    }
    number.pop_back();
    return {ValueText<double>::read({number}, name)};
}

void check_tolerance(ShareOfRange tolerance) {
    if (!(tolerance.percent >= 1e-10 && tolerance.percent < 100))
        throw Error(ErrorKind::usage, text("--tolerance ", tolerance.percent, "% is not between 1e-10% and 100%"));
}

} // namespace vkt
