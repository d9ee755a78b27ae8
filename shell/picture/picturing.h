// What a consumer is besides, if it makes pictures that can be compared.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/volume.h"

#include <string>

namespace vkt::shell {

struct PictureRequest {
    bool reference = false; ///< as exact as can be, with nothing random in common with other pictures
    double share = 1;       ///< width and height, of those asked for
};

struct DrawnPictures {
    /// Of each picture red, green and blue as three slices: display levels, 0 to 255, not rounded; the background lies
    /// behind.
    Volume levels;
    double seconds = 0;  ///< of drawing all of them, which grows with the pixels; the rest readies the volume
    bool on_gpu = false; ///< a GPU drew
};

class Picturing {
public:
    virtual ~Picturing() = default;
    /// All that the options ask for. Throws Error{resources} where the memory does not hold them.
    virtual DrawnPictures pictures(Volume const& volume, PictureRequest const& request,
                                   Execution const& execution) const = 0;
    /// Of the levels of pictures in the size asked for.
    virtual Index3 picture_dims() const = 0;
    /// Steps or paths of all pictures of such a volume; 0 if not known beforehand.
    virtual double picture_cost(Header const& header) const = 0;
    /// How the reference is drawn.
    virtual std::string reference_method() const = 0;
};

} // namespace vkt::shell
