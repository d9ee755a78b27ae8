// Reading tolerances.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/common/value_tolerance.h"

namespace vkt {

ValueTolerance ValueText<ValueTolerance>::read(std::vector<std::string> const& w, std::string_view name) {
    std::string number = w.front();
    bool const percent = number.ends_with('%');
    if (percent) number.pop_back();
    return {ValueText<double>::read({number}, name), percent};
}

} // namespace vkt
