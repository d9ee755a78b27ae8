// The text headers of AMReX plotfiles.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/amrex_header.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>

namespace vkt::amrex {

namespace {

constexpr std::int64_t largest_number = std::int64_t{1} << 40;
constexpr int most_levels = 40, most_components = 100000, most_ghosts = 64;
constexpr std::int64_t most_boxes = std::int64_t{1} << 26;

[[noreturn]] void refuse(std::string const& file, std::string const& why) {
    throw Error(ErrorKind::data, text(file, ": ", why));
}

/// A text file read word by word or line by line, with complaints that name it.
class Words {
public:
    explicit Words(std::string path) : path_(std::move(path)), stream_(open_part(path_)) {}

    std::string line() {
        std::string result;
        if (!std::getline(stream_, result)) refuse(path_, "ended early");
        if (result.size() > 1 << 20) refuse(path_, "has a line of more than 1 MiB");
        if (!result.empty() && result.back() == '\r') result.pop_back();
        return result;
    }

    /// The next line that is not blank.
    std::string full_line() {
        std::string result = line();
        while (result.find_first_not_of(" \t") == std::string::npos) result = line();
        return result;
    }

    std::int64_t integer(char const* what, std::int64_t low, std::int64_t high) {
        std::vector<std::int64_t> const values = integers_of(full_line(), path_);
        if (values.empty() || values[0] < low || values[0] > high)
            refuse(path_, text(what, " is not in ", low, "…", high));
        return values[0];
    }

    double real(char const* what) {
        std::vector<double> const values = reals(full_line(), ' ');
        if (values.size() != 1) refuse(path_, text(what, " is not a number"));
        return values[0];
    }

    std::vector<double> reals(std::string const& source, char separator) const {
        std::vector<double> values;
        std::istringstream words(source);
        for (std::string word; std::getline(words, word, separator);) {
            if (word.empty()) continue;
            char* end = nullptr;
            double const value = std::strtod(word.c_str(), &end);
            if (end == word.c_str()) refuse(path_, text("'", word, "' is not a number"));
            values.push_back(value);
        }
        return values;
    }

    std::string const& path() const { return path_; }

private:
    std::string path_;
    std::ifstream stream_;
};

/// The half-open box out of inclusive corners; axes beyond the dimensions are one cell.
Box box_from(std::vector<std::int64_t> const& values, std::size_t first, int dimensions, std::string const& file) {
    Box box{{0, 0, 0}, {1, 1, 1}};
    auto const nd = static_cast<std::size_t>(dimensions);
    if (values.size() < first + 2 * nd) refuse(file, "a box has too few corners");
    for (std::size_t a = 0; a < nd; ++a) {
        box.lower[static_cast<int>(a)] = values[first + a];
        box.upper[static_cast<int>(a)] = values[first + nd + a] + 1;
    }
    if (box.empty()) refuse(file, text("box ", box, " is empty"));
    // Then what the numbers stand for along each axis.
    for (std::size_t a = first + 2 * nd; a < std::min(values.size(), first + 3 * nd); ++a)
        if (values[a] != 0) refuse(file, "holds values at nodes or faces of cells, and only those of cells are read");
    return box;
}

/// Size and order of the numbers of a descriptor, whose integers begin at `at`; what comes next.
std::size_t read_descriptor(std::vector<std::int64_t> const& values, std::size_t at, std::string const& file,
                            FabHeader& fab) {
    // "((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))"
    std::size_t const bytes_at = at + 9;
    if (values.size() < bytes_at + 1 || values[at] != 8 || (values[bytes_at] != 4 && values[bytes_at] != 8))
        refuse(file, "a FAB record has an unknown number format");
    fab.bytes = static_cast<int>(values[bytes_at]);
    auto const width = static_cast<std::size_t>(fab.bytes);
    if (values.size() < bytes_at + 1 + width) refuse(file, "a FAB record is malformed");
    std::int64_t const exponent_bits = values[at + 2]; // the list is: bits of all, exponent, mantissa, …
    if (values[at + 1] != 8 * fab.bytes || exponent_bits != (fab.bytes == 8 ? 11 : 8))
        refuse(file, "a FAB record's numbers are not IEEE");
    bool ascending = true, descending = true;
    for (std::size_t i = 0; i < width; ++i) {
        ascending = ascending && values[bytes_at + 1 + i] == static_cast<std::int64_t>(i) + 1;
        descending = descending && values[bytes_at + 1 + i] == static_cast<std::int64_t>(width - i);
    }
    if (!ascending && !descending) refuse(file, "a FAB record has an unknown byte order");
    fab.big_endian = ascending;
    return bytes_at + 1 + width;
}

void read_level(Level& level, std::string const& directory, int dimensions, std::size_t components) {
    Words words(directory + "/" + level.folder_and_stem + "_H");
    // From 2 on records are bare numbers, and a line at the end says of what kind; minima and maxima of boxes are in
    // versions 1 and 3, of all boxes together in 4.
    std::int64_t const version = words.integer("version", 0, 4);
    bool const bare = version >= 2, tables = version != 2 && version != 4;
    words.integer("how", 0, 100);
    level.components = static_cast<int>(words.integer("number of components", 1, most_components));
    if (static_cast<std::size_t>(level.components) < components)
        refuse(words.path(), "has fewer components than Header names");
    // One number for all axes, or one for each.
    std::vector<std::int64_t> const ghosts = integers_of(words.full_line(), words.path());
    if (ghosts.size() != 1 && ghosts.size() < static_cast<std::size_t>(dimensions))
        refuse(words.path(), "does not say how many ghost cells there are");
    for (int a = 0; a < dimensions; ++a) {
        level.ghosts[a] = ghosts[ghosts.size() == 1 ? 0 : static_cast<std::size_t>(a)];
        if (level.ghosts[a] < 0 || level.ghosts[a] > most_ghosts)
            refuse(words.path(), text(level.ghosts[a], " ghost cells"));
    }
    std::int64_t const count = words.integer("number of boxes", 1, most_boxes); // "(n 0"
    for (std::int64_t b = 0; b < count; ++b)
        level.boxes.push_back(
            {box_from(integers_of(words.full_line(), words.path()), 0, dimensions, words.path()), "", 0});
    words.full_line(); // ")"
    if (words.integer("number of FABs", 0, most_boxes) != count)
        refuse(words.path(), "has other numbers of boxes and FABs");
    std::string const folder = level.folder_and_stem.substr(0, level.folder_and_stem.find_last_of('/') + 1);
    for (BoxData& data : level.boxes) {
        std::istringstream line(words.full_line());
        std::string label;
        if (!(line >> label >> data.file >> data.offset) || label != "FabOnDisk:" || data.offset < 0)
            refuse(words.path(), "a FabOnDisk line is malformed");
        if (data.file.find('/') != std::string::npos || data.file == "..")
            refuse(words.path(), text("names a file elsewhere: '", data.file, "'"));
        data.file = folder + data.file;
    }
    try { // the tables of minima and maxima are a convenience; older files have none
        for (std::vector<double>* table : {&level.minima, &level.maxima}) {
            if (!tables) break;
            words.full_line(); // "n,ncomp"
            for (std::int64_t b = 0; b < count; ++b) {
                std::vector<double> const values = words.reals(words.full_line(), ',');
                if (values.size() < components) refuse(words.path(), "a table row is too short");
                table->insert(table->end(), values.begin(), values.begin() + static_cast<std::ptrdiff_t>(components));
            }
        }
    } catch (Error const&) {
        if (bare) throw;
        level.minima.clear();
        level.maxima.clear();
    }
    if (!bare) return;
    std::string line = words.full_line();
    while (line.rfind("((", 0) != 0) line = words.full_line();
    level.numbers.emplace();
    read_descriptor(integers_of(line, words.path()), 0, words.path(), *level.numbers);
    level.numbers->components = level.components;
}

} // namespace

std::ifstream open_part(std::string const& path) {
    std::error_code error;
    if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
        refuse(path, "is no regular file");
    std::ifstream file(path, std::ios::binary);
    if (!file) throw Error(ErrorKind::io, text("cannot read ", path));
    return file;
}

std::vector<std::int64_t> integers_of(std::string const& source, std::string const& file) {
    std::vector<std::int64_t> values;
    char const *at = source.data(), *const end = at + source.size();
    while (at != end) {
        if (!(*at == '-' || (*at >= '0' && *at <= '9'))) {
            ++at;
            continue;
        }
        std::int64_t value = 0;
        auto const [next, error] = std::from_chars(at, end, value);
        if (error == std::errc::result_out_of_range || value > largest_number || value < -largest_number)
            refuse(file, text("'", source.substr(0, 80), "' has an absurd number"));
        at = error == std::errc{} ? next : at + 1;
        if (error == std::errc{}) values.push_back(value);
    }
    return values;
}

PlotHeader read_headers(std::string const& directory) {
    Words words(directory + "/Header");
    PlotHeader header;
    // "HyperCLaw-V1.1" or any other label of plotfiles
    if (std::string const label = words.line(); label.find("heckpoint") != std::string::npos)
        throw Error(ErrorKind::data, text(words.path(), ": is the header of a checkpoint ('", printable(label), "')"),
                    "plotfiles are read, which the simulation writes besides");
    std::int64_t const components = words.integer("number of components", 1, most_components);
    for (std::int64_t c = 0; c < components; ++c) header.names.push_back(words.line());
    header.dimensions = static_cast<int>(words.integer("dimensionality", 1, 3));
    header.time = words.real("time");
    auto const finest = static_cast<std::size_t>(words.integer("finest level", 0, most_levels));
    auto const corner = [&](char const* what) {
        std::vector<double> const values = words.reals(words.full_line(), ' ');
        if (values.size() != static_cast<std::size_t>(header.dimensions))
            refuse(words.path(), text(what, " has the wrong number of axes"));
        Vec3 result;
        for (std::size_t a = 0; a < values.size(); ++a) result[static_cast<int>(a)] = values[a];
        return result;
    };
    Vec3 const low = corner("lower corner"), high = corner("upper corner");
    for (int a = 0; a < header.dimensions; ++a) {
        if (!std::isfinite(low[a]) || !std::isfinite(high[a]) || !(high[a] > low[a]))
            refuse(words.path(), "the domain is empty");
        header.lower[a] = low[a];
        header.upper[a] = high[a];
    }
    std::string const ratios = words.line(); // blank if there is one level
    std::vector<std::int64_t> const factors = integers_of(ratios, words.path());
    if (factors.size() < finest) refuse(words.path(), "refinement ratios are missing");
    if (ratios.find('(') != std::string::npos) {
        auto const nd = static_cast<std::size_t>(header.dimensions);
        if (factors.size() < finest * nd) refuse(words.path(), "refinement ratios are missing");
        for (std::size_t l = 0; l < finest; ++l) {
            for (std::size_t a = 1; a < nd; ++a)
                if (factors[l * nd + a] != factors[l * nd])
                    refuse(words.path(), "refinement ratios differ between axes");
            header.ratios.push_back(static_cast<int>(factors[l * nd]));
        }
    } else {
        for (std::size_t l = 0; l < finest; ++l) header.ratios.push_back(static_cast<int>(factors[l]));
    }
    std::vector<std::int64_t> const domains = integers_of(words.full_line(), words.path());
    header.levels.resize(finest + 1);
    std::size_t const stride = 3 * static_cast<std::size_t>(header.dimensions);
    for (std::size_t l = 0; l <= finest; ++l) {
        if (domains.size() < (l + 1) * stride) refuse(words.path(), "level domains are missing");
        header.levels[l].domain = box_from(domains, l * stride, header.dimensions, words.path());
    }
    words.full_line();                                           // steps
    for (std::size_t l = 0; l <= finest; ++l) words.full_line(); // cell sizes: the domains say it exactly
    header.coordinate_system = static_cast<int>(words.integer("coordinate system", 0, 10));
    words.full_line(); // width of boundary data
    for (std::size_t l = 0; l <= finest; ++l) {
        std::istringstream head(words.full_line()); // "level grids time"
        std::int64_t number = 0, grids = 0;
        if (!(head >> number >> grids) || grids < 1 || grids > most_boxes)
            refuse(words.path(), text("level ", static_cast<std::int64_t>(l), " has no boxes"));
        words.full_line(); // step
        for (std::int64_t i = 0; i < grids * header.dimensions; ++i) words.full_line();
        header.levels[l].folder_and_stem = words.full_line();
        if (header.levels[l].folder_and_stem.find("..") != std::string::npos ||
            header.levels[l].folder_and_stem.front() == '/')
            refuse(words.path(), text("names files elsewhere: '", header.levels[l].folder_and_stem, "'"));
    }
    for (Level& level : header.levels) read_level(level, directory, header.dimensions, header.names.size());
    return header;
}

FabHeader parse_fab(std::string const& line, std::string const& file, int dimensions) {
    // "FAB ((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))((0,0,0) (63,31,15) (0,0,0)) 2"
    if (line.rfind("FAB ((8, (", 0) != 0) refuse(file, "a FAB record does not begin where it should");
    std::vector<std::int64_t> const values = integers_of(line, file);
    FabHeader fab;
    std::size_t const box_at = read_descriptor(values, 0, file, fab);
    if (values.size() < box_at + 3 * static_cast<std::size_t>(dimensions) + 1)
        refuse(file, "a FAB record is malformed");
    fab.box = box_from(values, box_at, dimensions, file);
    std::int64_t const components = values[box_at + 3 * static_cast<std::size_t>(dimensions)];
    if (components < 1 || components > most_components) refuse(file, "a FAB record has no components");
    fab.components = static_cast<int>(components);
    return fab;
}

} // namespace vkt::amrex
