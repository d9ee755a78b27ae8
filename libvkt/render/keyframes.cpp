// Camera paths: splines of places and of orientations.
// SPDX-License-Identifier: MIT
#include "libvkt/render/keyframes.h"

#include "libvkt/core/error.h"
#include "libvkt/core/products.h"
#include "libvkt/core/text.h"
#include "libvkt/io/whole_text.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace vkt::render {

using Json = nlohmann::json;

namespace {

Error malformed(std::string const& what) {
    return Error(ErrorKind::data, text("the keyframes are malformed: ", what),
                 R"(they look like [{"eye": [x, y, z], "target": [x, y, z], "up": [0, 0, 1], "fov": 30}, …])");
}

double number_of(Json const& value, std::string const& name) {
    if (!value.is_number() || !std::isfinite(value.get<double>())) throw malformed(text(name, " is no number"));
    return value.get<double>();
}

Vec3 triple_of(Json const& value, std::string const& name) {
    if (!value.is_array() || value.size() != 3) throw malformed(text(name, " is not three numbers"));
    return {number_of(value[0], name), number_of(value[1], name), number_of(value[2], name)};
}

CameraRequest key_of(Json const& object) {
    if (!object.is_object()) throw malformed("a key is no object");
    CameraRequest key;
    for (auto const& [name, value] : object.items()) {
        if (name == "eye")
            key.eye = triple_of(value, name);
        else if (name == "target")
            key.target = triple_of(value, name);
        else if (name == "up")
            key.up = triple_of(value, name);
        else if (name == "fov")
            key.fov = number_of(value, name);
        else if (name == "span")
            key.span = number_of(value, name);
        else
            throw malformed(text("'", name, "' is not one of eye, target, up, fov, span"));
    }
    if (!key.eye || !key.target) throw malformed("a key has no eye or no target");
    if (key.span) {
        if (object.contains("fov")) throw malformed("a key has a fov and a span");
        if (!(*key.span > 0)) throw malformed("a span is not above 0");
        key.projection = Projection::orthographic;
    }
    if (!(key.fov > 0 && key.fov < 180)) throw malformed("a fov is not between 0 and 180 degrees");
    Vec3 const way = *key.target - *key.eye, up = key.up.value_or(Vec3{0, 0, 1}), side = cross(way, up);
    if (!(dot(way, way) > 0)) throw malformed("an eye lies on its target");
    if (!(dot(side, side) > 1e-12 * dot(up, up) * dot(way, way)))
        throw malformed("a camera looks along its up direction");
    return key;
}

/// Of length 1: the turn from the world's axes to the camera's.
struct Turn {
    double w = 1;
    Vec3 v{0, 0, 0};
};
double dot4(Turn const& a, Turn const& b) { return a.w * b.w + dot(a.v, b.v); }
Turn negated(Turn const& a) { return {-a.w, a.v * -1}; }
Turn conjugate(Turn const& a) { return {a.w, a.v * -1}; }
Turn product(Turn const& a, Turn const& b) {
    return {a.w * b.w - dot(a.v, b.v), b.v * a.w + a.v * b.w + cross(a.v, b.v)};
}
/// Half the angle times the axis.
Vec3 logarithm(Turn const& a) {
    double const sine = length(a.v);
    return sine > 0 ? a.v * (std::atan2(sine, a.w) / sine) : Vec3{0, 0, 0};
}
Turn exponential(Vec3 half) {
    double const angle = length(half);
    return {std::cos(angle), angle > 0 ? half * (std::sin(angle) / angle) : Vec3{0, 0, 0}};
}
/// Evenly from a to b, as they are: not the other way around.
Turn between(Turn const& a, Turn const& b, double t) {
    return product(a, exponential(logarithm(product(conjugate(a), b)) * t));
}

/// The largest of the four numbers is found first, so that none is lost (Shepperd 1978).
Turn turn_of(Vec3 right, Vec3 up, Vec3 back) {
    std::array<double, 4> const squares{1 + right.x + up.y + back.z, 1 + right.x - up.y - back.z,
                                        1 - right.x + up.y - back.z, 1 - right.x - up.y + back.z};
    auto const largest = std::ranges::max_element(squares) - squares.begin();
    double const r = std::sqrt(squares[static_cast<std::size_t>(largest)]), s = 0.5 / r;
    switch (largest) {
    case 0:
        return {0.5 * r, {(up.z - back.y) * s, (back.x - right.z) * s, (right.y - up.x) * s}};
    case 1:
        return {(up.z - back.y) * s, {0.5 * r, (right.y + up.x) * s, (back.x + right.z) * s}};
    case 2:
        return {(back.x - right.z) * s, {(right.y + up.x) * s, 0.5 * r, (up.z + back.y) * s}};
    default:
        return {(right.y - up.x) * s, {(back.x + right.z) * s, (up.z + back.y) * s, 0.5 * r}};
    }
}
Vec3 turned(Turn const& a, Vec3 p) { return p + cross(a.v, cross(a.v, p) + p * a.w) * 2; }

/// A key as what is interpolated.
struct Key {
    Turn turn;
    Vec3 target;
    double distance; ///< logarithms, this and the next
    double opening;
};

Key key_of(CameraRequest const& camera) {
    Vec3 const way = *camera.target - *camera.eye, forward = unit(way);
    Vec3 const right = unit(cross(forward, camera.up.value_or(Vec3{0, 0, 1})));
    double const opening = camera.span ? *camera.span : std::tan(camera.fov * std::numbers::pi / 360);
    return {turn_of(right, cross(right, forward), forward * -1), *camera.target, std::log(length(way)),
            std::log(opening)};
}

/// Cubic in Hermite's form, from p[1] to p[2]; of a line that is missing at an end the one that is there goes on.
template <class T> T spline(std::array<T, 4> const& p, double t) {
    T const first = (p[2] - p[0]) * 0.5, last = (p[3] - p[1]) * 0.5;
    double const t2 = t * t, t3 = t2 * t;
    return p[1] * (2 * t3 - 3 * t2 + 1) + first * (t3 - 2 * t2 + t) + p[2] * (3 * t2 - 2 * t3) + last * (t3 - t2);
}

class Path {
    /// Of the keys around the way from i to the next.
    template <class F> auto four(std::size_t i, F const& of) const {
        auto const a = of(keys_[i]), b = of(keys_[i + 1]);
        return std::array{i > 0 ? of(keys_[i - 1]) : a * 2.0 - b, a, b,
                          i + 2 < keys_.size() ? of(keys_[i + 2]) : b * 2.0 - a};
    }

public:
    explicit Path(std::vector<CameraRequest> const& keys) {
        for (CameraRequest const& camera : keys) keys_.push_back(key_of(camera));
        for (std::size_t i = 1; i < keys_.size(); ++i)
            if (dot4(keys_[i].turn, keys_[i - 1].turn) < 0) keys_[i].turn = negated(keys_[i].turn);
        for (std::size_t i = 0; i < keys_.size(); ++i) inner_.push_back(inner(i));
    }

    /// A share of the way from key i to the next.
    Key at(std::size_t i, double t) const {
        Turn const outer = between(keys_[i].turn, keys_[i + 1].turn, t);
        Key result;
        result.turn = between(outer, between(inner_[i], inner_[i + 1], t), 2 * t * (1 - t));
        result.target = spline<Vec3>(four(i, [](Key const& k) { return k.target; }), t);
        result.distance = spline<double>(four(i, [](Key const& k) { return k.distance; }), t);
        result.opening = spline<double>(four(i, [](Key const& k) { return k.opening; }), t);
        return result;
    }

private:
    /// Shoemake's a: half-way between the turns to the neighbours, so that the speed is the same on both sides.
    Turn inner(std::size_t i) const {
        if (i == 0 || i + 1 == keys_.size()) return keys_[i].turn;
        Turn const back = conjugate(keys_[i].turn);
        Vec3 const sum = logarithm(product(back, keys_[i + 1].turn)) + logarithm(product(back, keys_[i - 1].turn));
        return product(keys_[i].turn, exponential(sum * -0.25));
    }

    std::vector<Key> keys_;
    std::vector<Turn> inner_;
};

} // namespace

std::vector<CameraRequest> keyframes_from_json(std::string const& json) {
    Json const root = Json::parse(json, nullptr, false);
    if (root.is_discarded()) throw malformed("this is no JSON");
    if (!root.is_array() || root.empty()) throw malformed("this is no list of cameras");
    std::vector<CameraRequest> keys;
    for (Json const& object : root) keys.push_back(key_of(object));
    for (CameraRequest const& key : keys)
        if (key.projection != keys.front().projection) throw malformed("some cameras have a span, and some have none");
    return keys;
}

std::vector<CameraRequest> keyframes_of_word(std::string const& word) {
    return keyframes_from_json(word.starts_with('[') ? word : whole_text(word, std::size_t{1} << 20));
}

std::vector<CameraRequest> camera_path(std::vector<CameraRequest> const& keys, int count) {
    if (count < 1) throw Error(ErrorKind::usage, text("--frames ", count, " is not at least one picture"));
    Path const path(keys);
    std::size_t const spans = keys.size() - 1, steps = static_cast<std::size_t>(std::max(1, count - 1));
    std::vector<CameraRequest> cameras;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        std::size_t const key = i * spans / steps, rest = i * spans % steps;
        if (rest == 0) {
            cameras.push_back(keys[key]);
            continue;
        }
        Key const at = path.at(key, static_cast<double>(rest) / static_cast<double>(steps));
        CameraRequest camera = keys[key];
        camera.target = at.target;
        camera.eye = at.target + turned(at.turn, {0, 0, 1}) * std::exp(at.distance);
        camera.up = turned(at.turn, {0, 1, 0});
        if (camera.span)
            camera.span = std::exp(at.opening);
        else
            camera.fov = std::atan(std::exp(at.opening)) * 360 / std::numbers::pi;
        cameras.push_back(camera);
    }
    return cameras;
}

} // namespace vkt::render
