// Render settings as parameters: one declaration for command line, help, completion and C API.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/parameters.h"
#include "libvkt/render/render.h"

namespace vkt::render {

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
    /// Whether colours, opacities or surfaces are chosen from the data.
    bool depends_on_data() const;
    /// Of every volume: one, or those of --orbit or --keyframes.
    std::vector<CameraRequest> cameras() const;
    bool has_keyframes() const { return !keyframes_file_.empty(); }

private:
    void refuse_misfits() const;
    std::vector<CameraRequest> const& keyframes() const;

    Parameters* list_ = nullptr;
    Algorithm algorithm_ = Algorithm::ray_marching;
    std::string size_ = "512x512", background_ = "0.07,0.075,0.09", transfer_file_, light_ = "1,1,1", shading_ = "auto";
    RenderSettings settings_;
    std::optional<int> orbit_, frames_;
    std::string keyframes_file_;
    std::optional<double> noise_, tolerance_, seconds_;
    mutable std::optional<TransferFunction> transfer_;       ///< what the file holds, once it is read
    mutable std::shared_ptr<Environment const> environment_; ///< the same
    mutable std::vector<CameraRequest> keyframes_;           ///< the same
    std::int64_t seed_ = 0;
    bool no_skip_ = false, denoise_ = false;
};

/// One line: method, sizes, shares, times.
std::string report_text(RenderReport const& report);

/// What became of the goal, for the picture's own texts and for notes: error, rays or paths, seconds; empty if nothing
/// is known.
std::string quality_text(RenderReport const& report, Goal const& goal);
/// Under this keyword pictures of paths keep how many there are a pixel, the mean.
inline constexpr char samples_keyword[] = "Samples";
/// And under this one which, for every seed: "SEED:FIRST-LAST", several joined by ", ".
inline constexpr char paths_keyword[] = "Paths";
/// What else a picture says of itself, for text chunks: camera, method, transfer function, quality.
std::vector<std::pair<std::string, std::string>> texts_of(RenderReport const& report, Goal const& goal);
/// What of the volume or the request is not shown as it is, a line each.
std::vector<std::string> remarks_of(RenderReport const& report, Goal const& goal);
/// Which model of light the settings ask for, and why no heavier one is needed; a line each.
std::vector<std::string> model_text(RenderSettings const& settings);

/// An option as a command line has it: its name without dashes and the words that follow it.
struct OptionWords {
    std::string name;
    std::vector<std::string> values;
    friend bool operator==(OptionWords const&, OptionWords const&) = default;
};

/// The options of `vkt render` that make these settings, bit for bit; what no option is needed for is left out, as is
/// what does not apply to the algorithm. A transfer function is given as its JSON.
std::vector<OptionWords> options_of(RenderSettings const& settings);
/// The share of the light from everywhere where none is asked for: all of it where an environment is all that lights
/// surfaces.
double ambient_unless_given(RenderSettings const& settings);
/// The strength of highlights where none is asked for: 0 there, since no light comes from one direction.
double specular_unless_given(RenderSettings const& settings);
/// Whether the option has a meaning for the algorithm.
bool applies(std::string_view option, Algorithm algorithm);
/// True if light is held back that would reach a point without any surface: a light means something with --shade none.
bool holds_back_light(RenderSettings const& settings, Algorithm algorithm);

} // namespace vkt::render
