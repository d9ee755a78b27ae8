// One picture of several: weights, layers and texts.
// SPDX-License-Identifier: MIT
#include "libvkt/render/combine.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/render/refuse.h"
#include "libvkt/render/settings.h"

#include <algorithm>

namespace vkt::render {

namespace {

Layer const* find(PictureContents const& picture, std::string const& name) {
    auto const found =
        std::find_if(picture.layers.begin(), picture.layers.end(), [&](Layer const& l) { return l.name == name; });
    return found == picture.layers.end() ? nullptr : &*found;
}

bool all_have(std::vector<PictureContents> const& pictures, std::string const& name) {
    return std::all_of(pictures.begin(), pictures.end(),
                       [&](PictureContents const& p) { return find(p, name) != nullptr; });
}

PictureTexts common_texts(std::vector<PictureContents> const& pictures) {
    PictureTexts texts;
    for (auto const& entry : pictures.front().texts)
        if (std::all_of(pictures.begin(), pictures.end(), [&](PictureContents const& p) {
                return std::find(p.texts.begin(), p.texts.end(), entry) != p.texts.end();
            }))
            texts.push_back(entry);
    return texts;
}

/// Paths a pixel, or ones.
std::vector<double> weights_of(std::vector<PictureContents> const& pictures) {
    std::vector<double> weights;
    std::size_t told = 0;
    for (PictureContents const& picture : pictures) {
        std::string const samples = picture.text(samples_keyword);
        bool const known = is_number(samples) && parse_double(samples) > 0;
        told += known ? 1 : 0;
        weights.push_back(known ? parse_double(samples) : 1);
    }
    if (told != 0 && told != pictures.size())
        refuse(
            "only some of the pictures tell how many paths a pixel they are made of, so that they cannot be weighted",
            "PFM files tell nothing: write OpenEXR");
    return weights;
}

/// Paths of a seed, from the first to the last.
struct PathRange {
    std::string seed;
    std::int64_t first, last;
};

/// What a picture says of its paths; nothing where that is not known.
std::vector<PathRange> paths_of(PictureContents const& picture) {
    std::vector<PathRange> ranges;
    for (std::string const& entry : split(picture.text(paths_keyword), ',')) {
        std::size_t const begin = entry.find_first_not_of(' '), colon = entry.find(':'), dash = entry.find('-', colon);
        if (begin == std::string::npos || colon == std::string::npos || dash == std::string::npos) continue;
        std::string const first = entry.substr(colon + 1, dash - colon - 1), last = entry.substr(dash + 1);
        if (!is_number(first) || !is_number(last)) continue;
        ranges.push_back({entry.substr(begin, colon - begin), parse_integer(first), parse_integer(last)});
    }
    return ranges;
}

/// A path that both pictures have, in words; empty if there is none.
std::string path_of_both(PictureContents const& a, PictureContents const& b) {
    for (PathRange const& one : paths_of(a))
        for (PathRange const& other : paths_of(b)) {
            std::int64_t const first = std::max(one.first, other.first), last = std::min(one.last, other.last);
            if (one.seed == other.seed && first <= last)
                return text("paths ", first, " to ", last, " of seed ", one.seed, " are in both");
        }
    bool const same = !a.text("History").empty() && a.text("History") == b.text("History");
    return same && a.image.pixels == b.image.pixels ? "they are the same" : "";
}

/// Paths count once: the same again would pass for more of them, with less noise than there is.
void refuse_same_paths(std::vector<PictureContents> const& pictures) {
    for (std::size_t k = 1; k < pictures.size(); ++k)
        for (std::size_t i = 0; i < k; ++i)
            if (std::string const same = path_of_both(pictures[i], pictures[k]); !same.empty())
                refuse(text("pictures ", i + 1, " and ", k + 1, " are made of the same paths: ", same),
                       "draw each with a --seed of its own, or with --first-sample after the last path of another");
}

/// Those of all of them; empty where one of them does not tell.
std::string all_paths(std::vector<PictureContents> const& pictures) {
    std::vector<std::string> all;
    for (PictureContents const& picture : pictures) {
        all.push_back(picture.text(paths_keyword));
        if (all.back().empty()) return {};
    }
    return join(all, ", ");
}

} // namespace

PictureContents mean_of(std::vector<PictureContents> const& pictures) {
    PictureContents const& first = pictures.front();
    std::vector<double> const weights = weights_of(pictures);
    if (!first.text(samples_keyword).empty()) refuse_same_paths(pictures);
    double total = 0;
    for (double const w : weights) total += w;
    std::vector<double> sum(first.image.pixels.size());
    PictureContents mean;
    for (std::size_t k = 0; k < pictures.size(); ++k) {
        Image const& image = pictures[k].image;
        if (image.width != first.image.width || image.height != first.image.height)
            refuse(text("the pictures differ in size: ", first.image.width, " by ", first.image.height, " and ",
                        image.width, " by ", image.height));
        if (!(pictures[k].options.part == first.options.part)) refuse("the pictures are different parts of a whole");
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += weights[k] * static_cast<double>(image.pixels[i]);
        mean.alpha = mean.alpha || pictures[k].alpha;
    }
    mean.image = {first.image.width, first.image.height, std::vector<float>(sum.size())};
    for (std::size_t i = 0; i < sum.size(); ++i) mean.image.pixels[i] = static_cast<float>(sum[i] / total);
    mean.options = first.options;
    mean.texts = common_texts(pictures);
    std::erase_if(mean.texts,
                  [](auto const& entry) { return entry.first == samples_keyword || entry.first == paths_keyword; });
    if (std::string paths = all_paths(pictures); !paths.empty())
        mean.texts.emplace_back(paths_keyword, std::move(paths));
    if (!first.text(samples_keyword).empty()) mean.texts.emplace_back(samples_keyword, to_text(total));
    for (Layer const& layer : first.layers) {
        if (!all_have(pictures, layer.name)) continue;
        if (layer.name.starts_with("variance.")) {
            Layer together{layer.name, std::vector<float>(layer.values.size())};
            for (std::size_t k = 0; k < pictures.size(); ++k) {
                auto const share = static_cast<float>(weights[k] * weights[k] / (total * total));
                std::vector<float> const& one = find(pictures[k], layer.name)->values;
                for (std::size_t i = 0; i < one.size(); ++i) together.values[i] += share * one[i];
            }
            mean.layers.push_back(std::move(together));
        } else if (std::all_of(pictures.begin(), pictures.end(),
                               [&](PictureContents const& p) { return find(p, layer.name)->values == layer.values; })) {
            mean.layers.push_back(layer);
        }
    }
    return mean;
}

PictureContents join_of(std::vector<PictureContents> const& parts) {
    PictureContents const& first = parts.front();
    Part const whole = first.options.part;
    // OpenEXR does not tell a part that is all of it.
    if (parts.size() == 1 && first.options.format == PictureFormat::exr && whole.whole_width == 0) return first;
    if (whole.whole_width == 0) refuse("the first picture is no part of another one", "vkt render --tiles makes parts");
    auto const width = static_cast<std::size_t>(whole.whole_width),
               height = static_cast<std::size_t>(whole.whole_height);
    PictureContents joined;
    joined.alpha = first.alpha;
    joined.options = {first.options.format, first.options.depth, {}};
    joined.texts = common_texts(parts);
    joined.image = {whole.whole_width, whole.whole_height, std::vector<float>(4 * width * height)};
    for (Layer const& layer : first.layers)
        if (all_have(parts, layer.name)) joined.layers.push_back({layer.name, std::vector<float>(width * height)});
    std::vector<bool> there(width * height);
    for (PictureContents const& part : parts) {
        Part const& p = part.options.part;
        if (p.whole_width != whole.whole_width || p.whole_height != whole.whole_height)
            refuse("the pictures are no parts of one whole");
        if (part.alpha != first.alpha || part.options.format != first.options.format ||
            part.options.depth != first.options.depth)
            refuse("the parts are not of one kind");
        if (p.x < 0 || p.y < 0 || p.x + part.image.width > p.whole_width || p.y + part.image.height > p.whole_height)
            refuse("a part reaches out of the whole picture");
        for (int y = 0; y < part.image.height; ++y)
            for (int x = 0; x < part.image.width; ++x) {
                std::size_t const to = static_cast<std::size_t>(p.y + y) * width + static_cast<std::size_t>(p.x + x);
                std::size_t const from = static_cast<std::size_t>(y) * static_cast<std::size_t>(part.image.width) +
                                         static_cast<std::size_t>(x);
                if (there[to]) refuse(text("pixel ", p.x + x, ", ", p.y + y, " is in two of the parts"));
                there[to] = true;
                std::copy_n(&part.image.pixels[4 * from], 4, &joined.image.pixels[4 * to]);
                for (Layer& layer : joined.layers) layer.values[to] = find(part, layer.name)->values[from];
            }
    }
    auto const missing = std::find(there.begin(), there.end(), false);
    if (missing != there.end()) {
        auto const at = static_cast<std::size_t>(missing - there.begin());
        refuse(text("pixel ", at % width, ", ", at / width, " is in none of the parts"), "name all of them");
    }
    return joined;
}

} // namespace vkt::render
