// Ray marching with absorption and emission: equidistant comb, segment integration, skipping that changes no bit.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/render/inner/cut.h"
#include "libvkt/render/inner/irradiance.h"
#include "libvkt/render/inner/occlusion.h"
#include "libvkt/render/inner/reflection.h"
#include "libvkt/render/inner/segments.h"
#include "libvkt/render/inner/sums.h"

namespace vkt::render {

/// False if so little light is left that is_settled() may be true.
VKT_HD bool is_bright(float transmittance, float patience) {
    constexpr float most = 9.8e-4F;
    return transmittance > most || transmittance / patience > most; // what is divided is no less
}
/// True if what lies behind changes no pixel by more than a quarter of an sRGB level of 255, whatever it is, nor its
/// alpha. Levels are narrow in the dark: one is 1/3300 of the light there, and 1/260 where there is 0.24 of it. What
/// may be left is below the curve, which is concave: two chords of it, from 0.003 over 0.03 to 0.24. With `patience`
/// below 1 that share of it may be left.
VKT_HD bool is_settled(float transmittance, Quad const& light, float patience) {
    if (is_bright(transmittance, patience)) return false;
    float const left = transmittance / patience;
    float const rg = light[1] < light[2] ? light[1] : light[2], least = rg < light[3] ? rg : light[3];
    return left < 5.1e-5F + 7.9e-3F * least && left < 1.9e-4F + 3.22e-3F * least;
}

/// Where the segments of a ray lie in a lattice: between the points k * step, the last one ends where the ray does.
struct EvenComb {
    using Real = float;
    using Vector = Float3;
    float step, length;
    int count; ///< segments of the whole ray

    VKT_HD float point(int k) const { return k < count ? static_cast<float>(k) * step : length; }
    /// False if segment k shows nothing whatever the values at its ends.
    VKT_HD bool shows(int) const { return true; }
};

/// What is known of the light on a volume when the loops are compiled: nothing, that there is no shading, or that there
/// is and nothing holds the light back. On GPUs what could be asked for takes registers from what is.
enum class Lighting : std::uint8_t { any, flat, open };

/// One ray on its way along a comb. Real is what positions along the ray are counted in; `points` answers what rays to
/// the light ask.
template <class S, class Comb, ScalarField P, Lighting lighting = Lighting::any> struct March {
    using Real = typename Comb::Real;
    static constexpr int together =
        GroupSampler<S> || NumberedSampler<S> ? group : chunk; ///< segments whose light is added up at once
    S const& sampler;
    P const& points;
    SceneView const& scene;
    Comb comb;
    typename Comb::Vector origin, direction;
    float world; ///< world length of one lattice unit
    Quad light{};
    double transmittance = 1; ///< in double, because the errors of many thin segments would add up
    float passing = 1;        ///< the same, rounded
    int known = -1;           ///< the point that `last` belongs to
    TablePoint last{};
    std::int64_t samples = 0;
    struct Nothing {};
    std::conditional_t<lighting == Lighting::any, Occlusion, Nothing> occlusion{};
    std::conditional_t<lighting != Lighting::flat, CutFace, Nothing> cut{};

    /// That this is a ray, which may begin where the medium is cut.
    VKT_HD void enter(Ray const& ray) {
        if constexpr (lighting != Lighting::flat)
            if (shaded()) cut = cut_face(scene, ray);
    }
    VKT_HD bool settled() const { return is_settled(passing, light, scene.patience); }
    VKT_HD bool shaded() const {
        return lighting == Lighting::open || (lighting == Lighting::any && scene.shade.strength > 0);
    }
    VKT_HD bool occluded() const { return lighting == Lighting::any && (scene.lamp.shadows || scene.around_count > 0); }
    /// Whether light from everywhere has colours, or something holds light back.
    VKT_HD bool lit_one_by_one() const { return occluded() || (lighting == Lighting::any && scene.around.on); }

    /// Adds segments [from, to), at most as many as one chunk of samples allows; returns where it stopped.
    VKT_HD int advance(int from, int to) {
        bool const carried = known == from;
        int const first = carried ? from + 1 : from;
        int const wanted = to + 1 - first;
        int const n = wanted < chunk ? wanted : chunk; // points to look up
        alignas(64) Real t[chunk];
        alignas(64) float value[chunk], length[chunk];
        for (int k = 0; k < chunk; ++k) t[k] = comb.point(first + (k < n ? k : n - 1));
        int const lanes = n <= group ? group : chunk; // that are looked at
        if constexpr (NumberedSampler<S>)
            sampler.values_of(first, lanes, value);
        else if constexpr (GroupSampler<S>)
            sampler.values(origin, direction, t, value, lanes);
        else
            sampler.values(origin, direction, t, value);
        samples += n;

        // Segment j ends at point from + j + 1. The one before the first is none, and what is behind the last.
        int const none = carried ? 0 : 1, segments = n - none;
        for (int k = 0; k < chunk; ++k) {
            bool const is = k >= none && k < n && comb.shows(from + k - none);
            Real const begin = k > 0 ? t[k - 1] : comb.point(from);
            length[k] = is ? static_cast<float>(t[k] - begin) * world : 0.0F;
        }
        // Of one segment none is left if it is none; groups may reach beyond the last one.
        constexpr int room = chunk > 1 ? chunk + together : 1;
        Quad means[room];
        alignas(64) float extinctions[room], depths[room];
        bool const seen = look_up_segments<chunk>(scene.table, value, length, lanes, last, means, extinctions, depths);
        known = from + segments;
        if (!seen) return known;
#ifndef __CUDACC__
        if (!shaded() && !lit_one_by_one()) {
            lanes == chunk ? add_unlit<chunk>(means, extinctions, depths)
                           : add_unlit<group>(means, extinctions, depths);
            return known;
        }
#endif
        if constexpr (chunk > 1)
            for (int k = lanes; k < room; ++k) means[k] = Quad{}, depths[k] = 0;
        int const skipped = chunk > 1 ? none : 0;
        float const *const depth = depths + skipped, *const extinction = extinctions + skipped;
        Quad const* const mean = means + skipped;
        int begin = 0, end = segments;
        if constexpr (together < chunk) {
            while (!(depth[begin] > 0)) ++begin;
            while (!(depth[end - 1] > 0)) --end;
        }
        for (int g = begin; g < end; g += together) {
            composite(from + g, end - g < together ? end - g : together, mean + g, extinction + g, depth + g);
            if (together < chunk && settled()) break;
        }
        return known;
    }

#ifndef __CUDACC__
    /// Adds a group of segments, up to the one that settles the ray. `diffuse` and `glint`: null for light that shows
    /// no surfaces.
    template <int n>
    VKT_HD void add_all(Quad const* mean, float const* extinction, float const* depth, float const* through,
                        float const* weight, float const* diffuse, float const* glint) {
        static_assert(n % wide == 0);
        alignas(64) double factor[n], before[n];
        alignas(64) float ratio[n], share[n];
        for (int j = 0; j < n; j += wide / 2) {
            Doubles const absorbed = doubles_of(weight + j), passed = doubles_of(through + j);
            store(factor + j, absorbed < 0.5 ? 1 - absorbed : passed); // whichever was rounded less
        }
        keep_in_memory(factor);
        double left = transmittance;
#pragma GCC unroll 32
        for (int j = 0; j < n; ++j) {
            before[j] = left;
            left *= factor[j];
        }
        Floats const zero{};
        for (int j = 0; j < n; j += wide) {
            Floats const part = floats_of(before + j) * floats_at(weight + j);
            Floats const seen = diffuse != nullptr ? part * floats_at(diffuse + j) : part;
            Ints const shows = floats_at(depth + j) > zero;
            store(ratio + j, shows ? seen / floats_at(extinction + j) : zero);
            if (glint != nullptr) store(share + j, shows ? part * floats_at(glint + j) : zero);
        }
        keep_in_memory(ratio);
        Quad sum = light;
        auto const add_one = [&](int j) __attribute__((always_inline)) {
            sum = sum + mean[j] * ratio[j];
            if (glint != nullptr) sum = sum + Quad{0, share[j], share[j], share[j]};
        };
        // It only ever becomes less.
        auto const rounded = static_cast<float>(left);
        if (is_bright(rounded, scene.patience)) {
#pragma GCC unroll 32
            for (int j = 0; j < n; ++j) add_one(j);
            transmittance = left, passing = rounded, light = sum;
            return;
        }
        for (int j = 0; j < n; ++j) {
            if (!(depth[j] > 0)) continue;
            add_one(j);
            transmittance = before[j] * factor[j];
            passing = static_cast<float>(transmittance);
            light = sum;
            if (settled()) return;
        }
    }
    /// The same of light that shows no surfaces.
    template <int n> VKT_HD void add_unlit(Quad const* mean, float const* extinction, float const* depth) {
        alignas(64) float through[n], weight[n];
        for (int j = 0; j < n; ++j) {
            Attenuation const a = attenuation(depth[j]);
            through[j] = a.transmitted;
            weight[j] = a.absorbed;
        }
        add_all<n>(mean, extinction, depth, through, weight, nullptr, nullptr);
    }
#endif

    /// Light of the environment, of which the share `open` arrives, on a segment with this gradient at its middle; of
    /// what is seen of it the share `at_face` lies at the face by which the ray enters.
    VKT_HD void surround(float x, float y, float z, bool shaded, float at_face, Float3 toward, float open,
                         float* out) const {
        auto const arriving = [&](Float3 g, float reference, float* to) __attribute__((always_inline)) {
            float const squared = squared_length(scene.shade, g);
            arriving_from(scene.around, g, squared, surface_share(scene.shade, squared, reference), dot(g, toward) > 0,
                          to);
        };
        Float3 g{0, 0, 0};
        if (shaded) g = {in_references(scene.shade, x), in_references(scene.shade, y), in_references(scene.shade, z)};
        arriving(g, 1.0F, out);
        if constexpr (lighting != Lighting::flat)
            if (at_face > 0) {
                float face[3];
                arriving(cut.normal, 0.0F, face);
                for (int c = 0; c < 3; ++c) out[c] += at_face * (face[c] - out[c]);
            }
        float const share = scene.shade.ambient * open;
        for (int c = 0; c < 3; ++c) out[c] *= share;
    }

    /// Adds segments from `from` on; what is behind the last one has no depth.
    VKT_HD void composite(int from, int segments, Quad const* mean, float const* extinction, float const* depth) {
        alignas(64) float through[together], weight[together];
        for (int j = 0; j < together; ++j) {
            Attenuation const a = attenuation(depth[j]);
            through[j] = a.transmitted;
            weight[j] = a.absorbed;
        }
        alignas(64) float diffuse[together], glint[together], gx[together], gy[together], gz[together];
        bool const shaded = this->shaded(), one_by_one = lit_one_by_one();
        if (shaded) {
            alignas(64) Real t[together];
            for (int j = 0; j < together; ++j) {
                int const k = from + (j < segments ? j : segments - 1);
                t[j] = Real(0.5) * (comb.point(k) + comb.point(k + 1));
            }
            if constexpr (NumberedSampler<S>)
                sampler.template gradients_of<together>(from, gx, gy, gz);
            else if constexpr (together < chunk)
                sampler.template gradients<together>(origin, direction, t, gx, gy, gz);
            else
                sampler.gradients(origin, direction, t, gx, gy, gz);
        }
        float const per_spacing = scene.shade.spacing / world;
        Float3 const toward = to_float(direction);
        LampFrame const lamp =
            shaded && scene.lamp.on
                ? lamp_frame(scene, Double3{direction.x, direction.y, direction.z}, static_cast<double>(world))
                : LampFrame{};
        auto const reflection = [&]<class F>(F x, F y, F z, bool by_lamp, Arriving const& arriving, float base,
                                             float reference) __attribute__((always_inline)) {
            return by_lamp ? lamplight(scene.shade, x, y, z, lamp.of(x, y, z), arriving, base, reference)
                           : headlight(scene.shade, x, y, z, (x * toward.x + y * toward.y + z * toward.z) * per_spacing,
                                       arriving.ambient, base, reference);
        };
        auto const reflect = [&](int j, Arriving const& arriving, float base) __attribute__((always_inline)) {
            Reflection const s = reflection(in_references(scene.shade, gx[j]), in_references(scene.shade, gy[j]),
                                            in_references(scene.shade, gz[j]), scene.lamp.on, arriving, base, 1.0F);
            diffuse[j] = s.diffuse;
            glint[j] = s.glint;
        };
        auto const reflect_all = [&](bool by_lamp) __attribute__((always_inline)) {
#ifdef __CUDACC__
            for (int j = 0; j < together; ++j) reflect(j, {}, 1.0F);
#else
            for (int j = 0; j < together; j += wide) {
                auto const s = reflection(in_references(scene.shade, floats_at(gx + j)),
                                          in_references(scene.shade, floats_at(gy + j)),
                                          in_references(scene.shade, floats_at(gz + j)), by_lamp, {}, 1.0F, 1.0F);
                store(diffuse + j, s.diffuse);
                store(glint + j, s.glint);
            }
#endif
        };
        // The face by which the ray enters is a surface as well.
        auto const share_of_face = [&](int j) __attribute__((always_inline)) {
            if constexpr (lighting == Lighting::flat)
                return 0.0F;
            else
                return cut.share(static_cast<float>(comb.point(from + j)), static_cast<float>(comb.point(from + j + 1)),
                                 depth[j], weight[j]);
        };
        auto const cut_by_face = [&](int j, Arriving const& arriving, float base) __attribute__((always_inline)) {
            if constexpr (lighting != Lighting::flat) {
                float const share = share_of_face(j);
                if (!(share > 0)) return;
                Float3 const g = cut.normal;
                Reflection const face = reflection(g.x, g.y, g.z, scene.lamp.on, arriving, base, 0.0F);
                diffuse[j] += share * (face.diffuse - diffuse[j]);
                glint[j] += share * (face.glint - glint[j]);
            }
        };
        auto const is_cut = [&] {
            if constexpr (lighting == Lighting::flat)
                return false;
            else
                return shaded && static_cast<float>(comb.point(from)) < cut.reach;
        };
        bool const at_face = is_cut();
        bool const at_once = shaded && !one_by_one;
        if (at_once && scene.lamp.on) reflect_all(true);
        if (at_once && !scene.lamp.on) reflect_all(false);
        for (int j = 0; j < segments && at_once && at_face; ++j) cut_by_face(j, {}, 1.0F);
#ifndef __CUDACC__ // it has one segment
        if (!one_by_one) {
            add_all<together>(mean, extinction, depth, through, weight, shaded ? diffuse : nullptr,
                              shaded ? glint : nullptr);
            return;
        }
#endif
        for (int j = 0; j < segments; ++j) {
            if (!(depth[j] > 0)) continue;
            float around[3] = {0, 0, 0};
            if constexpr (lighting == Lighting::any)
                if (one_by_one) {
                    int const k = from + j;
                    Arriving arriving;
                    if (occluded())
                        arriving =
                            occlusion.on_segment(points, scene, k, origin + direction * comb.point(k),
                                                 origin + direction * comb.point(k + 1), depth[j], weight[j], samples);
                    if (scene.around.on) {
                        surround(gx[j], gy[j], gz[j], shaded, at_face ? share_of_face(j) : 0.0F, toward,
                                 arriving.ambient, around);
                        arriving.ambient = 0;
                    }
                    float const base = unshaded(scene.shade, arriving);
                    diffuse[j] = base, glint[j] = 0;
                    if (shaded) reflect(j, arriving, base);
                    if (at_face) cut_by_face(j, arriving, base);
                }
            float const share = passing * weight[j];
            if (lighting == Lighting::any && scene.around.on) {
                float const g = share * glint[j], per = share / mean[j][0];
                light = light + Quad{0, mean[j][1] * ((diffuse[j] + around[0]) * per) + g,
                                     mean[j][2] * ((diffuse[j] + around[1]) * per) + g,
                                     mean[j][3] * ((diffuse[j] + around[2]) * per) + g};
            } else if (shaded || one_by_one) {
                float const g = share * glint[j];
                light = light + mean[j] * (share * diffuse[j] / mean[j][0]) + Quad{0, g, g, g};
            } else {
                light = light + mean[j] * (share / mean[j][0]);
            }
            // Whichever was rounded less. Conversions are slow on GPUs: one.
            bool const thin = weight[j] < 0.5F;
            double const part = static_cast<double>(thin ? weight[j] : through[j]);
            transmittance *= thin ? 1 - part : part;
            passing = static_cast<float>(transmittance);
            if (settled()) return;
        }
    }

    /// Adds segments [from, to); false when nothing more can be seen.
    VKT_HD bool add(int from, int to) {
        while (from < to) {
            from = advance(from, to);
            if (settled()) return false;
        }
        return true;
    }
};

/// Walks the macrocells and adds the segments that touch a visible one. One loop over chunks, in which a few cells are
/// walked where it needs them: so rays that are drawn together, on a GPU, integrate together.
template <Sampler S, Lighting lighting>
VKT_HD void walk(March<S, EvenComb, S, lighting>& march, SceneView const& scene) {
    CellWalk<float> cells;
    cells.start(march.origin, march.direction, march.comb.length, macrocell_origin, static_cast<float>(macrocell_size),
                scene.cells.nx, scene.cells.ny, scene.cells.nz);
    // Rounding of positions is far below this; segments near a cell's border count for both cells.
    constexpr float slack = 4e-3F;
    float const per_step = 1.0F / scene.step;
    int from = 0, to = 0;
    bool more = true;
    for (;;) {
        // Whole chunks are done at once, so that an opaque ray stops walking.
        while (more && to - from <= chunk) {
            std::int64_t const at = scene.cells.index(cells.cell);
            int distance = scene.cells.distance[at];
            if (distance == 0) {
                distance = scene.cells.depth[at];                             // all that are nearer show something, too
                int const a = static_cast<int>((cells.t - slack) * per_step); // truncation keeps it at or above 0
                int const b = static_cast<int>((cells.leave(distance) + slack) * per_step) + 1;
                int const last_segment = b < march.comb.count ? b : march.comb.count;
                if (a > to) {
                    if (from < to) break; // what lies before the gap comes first, and then this cell again
                    from = a;
                }
                to = last_segment > to ? last_segment : to;
            }
            more = cells.leap(distance);
        }
        if (from >= to) return; // there are no more cells
        from = march.advance(from, to);
        if (march.settled()) return;
    }
}

/// Segments of a ray.
VKT_HD int segments_of(Ray const& ray, float step) {
    int const count = static_cast<int>(std::ceil(static_cast<float>(ray.length) / step));
    return count < 1 ? 1 : count;
}

/// march_ray() with what is known of the light.
template <Lighting lighting, Sampler S>
VKT_HD Radiance march_lit(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    float const length = static_cast<float>(ray.length);
    March<S, EvenComb, S, lighting> march{sampler,
                                          sampler,
                                          scene,
                                          {scene.step, length, segments_of(ray, scene.step)},
                                          to_float(ray.entry),
                                          to_float(ray.direction),
                                          static_cast<float>(ray.world_per_lattice)};
    march.enter(ray);
    if (scene.skip)
        walk(march, scene);
    else
        march.add(0, march.comb.count);
    ++counters.rays;
    counters.segments += march.comb.count;
    counters.samples += march.samples;
    return {march.light[1], march.light[2], march.light[3], march.passing};
}

template <Sampler S>
VKT_HD Radiance march_ray(S const& sampler, SceneView const& scene, Ray const& ray, Counters& counters) {
    return march_lit<Lighting::any>(sampler, scene, ray, counters);
}

} // namespace vkt::render
