// A way of the camera through given places: what a film is drawn along.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/camera.h"

#include <string>
#include <vector>

namespace vkt::render {

/// Cameras from a JSON list, [{"eye": [x, y, z], "target": [x, y, z], "up": [x, y, z], "fov": degrees}, …], named and
/// meant as the options are; up is 0,0,1 and fov 30 if they are not said. Orthographic cameras have a "span" instead of
/// a "fov"; either all of them, or none. Throws Error{data}.
std::vector<CameraRequest> keyframes_from_json(std::string const& json);
/// The same of a file of up to 1 MiB, or of a word that is such a list itself. Throws Error{io} and Error{data}.
std::vector<CameraRequest> keyframes_of_word(std::string const& word);

/// So many cameras from the first key to the last, the keys being equally far apart in time. Where one falls on a key
/// it is that key, bit for bit. Between them the target moves along a cubic spline through the keys' (Catmull and Rom
/// 1974: at a key it moves as the straight line between its neighbours, at the ends as the one to the neighbour), and
/// so do the logarithms of the distance of the eye and of tan(fov / 2), or of the span. The camera turns around the
/// target by the spherical spline through the keys' orientations (Shoemake's squad, 1987), the short way around;
/// between two keys alone evenly, about one axis. One camera is the first key. Throws Error{usage} for fewer than one.
std::vector<CameraRequest> camera_path(std::vector<CameraRequest> const& keys, int count);

} // namespace vkt::render
