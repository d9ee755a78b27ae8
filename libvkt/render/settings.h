// Render settings as parameters: one declaration for command line, help, completion and C API.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/render/render.h"

namespace vkt::render {

enum class Shading : std::uint8_t { automatic, none, gradient };

/// Declares the options and turns them into settings. Must outlive and stay with the list it declared into.
class SettingsParameters {
public:
    void declare(Parameters& list);
    /// Throws Error{usage} for all that settings() and the renderer would refuse of any volume, naming the option.
    void check() const;
    /// Throws Error{usage} for values out of range and for options that do not apply to the algorithm or exclude each
    /// other, Error{io} or Error{data} for the transfer function file.
    RenderSettings settings() const;
    Background background() const;

private:
    void refuse_misfits() const;

    Parameters* list_ = nullptr;
    Algorithm algorithm_ = Algorithm::ray_marching;
    Shading shading_ = Shading::automatic;
    std::string size_ = "512x512", background_ = "0.07,0.075,0.09", transfer_file_, light_ = "1,1,1";
    RenderSettings settings_;
    mutable std::optional<TransferFunction> transfer_; ///< what the file holds, once it is read
    std::int64_t seed_ = 0;
    bool no_skip_ = false;
};

/// One line: method, sizes, shares, times.
std::string report_text(RenderReport const& report);

} // namespace vkt::render

namespace vkt {
template <> struct EnumNames<render::Shading> {
    static std::vector<std::pair<render::Shading, char const*>> all() {
        return {{render::Shading::automatic, "auto"},
                {render::Shading::none, "none"},
                {render::Shading::gradient, "gradient"}};
    }
};
} // namespace vkt
