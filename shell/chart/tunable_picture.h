// Pictures as vkt chart varies them: what trades error for time, and pictures whose light can be compared.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/engine/tunable.h"
#include "libvkt/render/settings.h"
#include "shell/picture/picturing.h"

#include <string>
#include <vector>

namespace vkt::shell {

/// The part of a command that draws which its options alone determine.
class TunablePicture : public Tunable, public Picturing {
public:
    std::vector<Knob> knobs() const override;
    DrawnPictures pictures(Volume const& volume, PictureRequest const& request,
                           Execution const& execution) const override;
    Index3 picture_dims() const override;
    double picture_cost(Header const& header) const override;
    std::string reference_method() const override;

protected:
    render::SettingsParameters options_;
};

} // namespace vkt::shell
