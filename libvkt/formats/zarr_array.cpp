// Metadata of Zarr arrays.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/zarr_array.h"

#include "libvkt/core/error.h"
#include "libvkt/core/half.h"
#include "libvkt/core/header.h"
#include "libvkt/core/text.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

namespace vkt::zarr {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t most_chunk = std::int64_t{1} << 31; ///< bytes: what codecs count to
constexpr std::int64_t most_in_shard = std::int64_t{1} << 22;

struct TypeName {
    char const* v2; ///< without byte order
    char const* v3;
    DataType type;
};
constexpr TypeName type_names[] = {
    {"u1", "uint8", DataType::uint8},     {"i1", "int8", DataType::int8},       {"u2", "uint16", DataType::uint16},
    {"i2", "int16", DataType::int16},     {"u4", "uint32", DataType::uint32},   {"i4", "int32", DataType::int32},
    {"u8", "uint64", DataType::uint64},   {"i8", "int64", DataType::int64},     {"f2", "float16", DataType::float16},
    {"f4", "float32", DataType::float32}, {"f8", "float64", DataType::float64}, {"b1", "bool", DataType::uint8},
};

/// By numcodecs' name.
std::optional<Codec> codec_named(std::string const& name) {
    constexpr std::pair<char const*, Codec> known[] = {
        {"zlib", Codec::zlib}, {"gzip", Codec::gzip}, {"zstd", Codec::zstd}, {"blosc", Codec::blosc},
        {"lz4", Codec::lz4},   {"bz2", Codec::bzip2}, {"lzma", Codec::lzma}};
    auto const found = std::find_if(std::begin(known), std::end(known), [&](auto const& k) { return name == k.first; });
    return found == std::end(known) ? std::nullopt : std::optional(found->second);
}

/// By numcodecs' name.
std::optional<Codec> checksum_named(std::string const& name, bool at_start) {
    if (name == "crc32c") return at_start ? Codec::crc32c_before : Codec::crc32c;
    if (name == "crc32") return at_start ? Codec::crc32_before : Codec::crc32;
    if (name == "adler32") return at_start ? Codec::adler32_before : Codec::adler32;
    if (name == "jenkins_lookup3") return Codec::lookup3;
    return name == "fletcher32" ? std::optional(Codec::fletcher32) : std::nullopt;
}

/// Of version 3 without a prefix.
bool standard(Codec codec) { return codec == Codec::gzip || codec == Codec::zstd || codec == Codec::blosc; }

class Metadata {
public:
    explicit Metadata(std::string folder) { array_.folder = std::move(folder); }
    Array read(Json const& json, int version);

private:
    [[noreturn]] void fail(std::string const& what, std::string const& hint = {}) const {
        throw Error(ErrorKind::data, text("'", array_.folder, "': ", what), hint);
    }
    Json const& member(Json const& object, char const* name) const {
        auto const found = object.is_object() ? object.find(name) : object.end();
        if (!object.is_object() || found == object.end()) fail(text("its metadata lack ", name));
        return *found;
    }
    static Json const* maybe(Json const& object, char const* name) {
        auto const found = object.is_object() ? object.find(name) : object.end();
        return !object.is_object() || found == object.end() || found->is_null() ? nullptr : &*found;
    }
    std::string words(Json const& value, char const* what) const {
        if (!value.is_string()) fail(text(what, " is no text"));
        return value.get<std::string>();
    }
    Position extents(Json const& value, char const* what) const;
    void read_v2(Json const& json);
    void read_v3(Json const& json);
    void read_type(std::string name, bool v2);
    void read_codecs(Json const& list, bool inside_shard);
    bool read_filter(std::string const& name, Json const& configuration);
    DataType filter_type(Json const& configuration, char const* name, DataType otherwise);
    void read_shard(Json const& configuration);
    void read_transpose(Json const& configuration);
    void read_fill(Json const& value);
    void put_fill(double value);
    void check();

    Array array_;
};

Position Metadata::extents(Json const& value, char const* what) const {
    Position result;
    if (!value.is_array() || value.empty() || value.size() > most_dimensions)
        fail(text(what, " is no list of 1 to 16 extents"));
    for (auto const& n : value) {
        if (!n.is_number_integer() || n.is_number_float()) fail(text(what, " holds what is no number"));
        std::int64_t const extent =
            n.is_number_unsigned() && n.get<std::uint64_t>() > INT64_MAX ? -1 : n.get<std::int64_t>();
        if (extent < 1 || extent > max_extent)
            fail(text(what, ": an extent of ", extent, " is not between 1 and 2^40"));
        result.push_back(extent);
    }
    return result;
}

void Metadata::read_type(std::string name, bool v2) {
    if (v2 && name.size() == 3 && std::string_view("<>|").find(name.front()) != std::string_view::npos) {
        array_.big_endian = name.front() == '>';
        name.erase(0, 1);
    }
    for (TypeName const& entry : type_names)
        if (name == (v2 ? entry.v2 : entry.v3)) {
            array_.dtype = entry.type;
            array_.boolean = entry.type == DataType::uint8 && std::string_view(entry.v3) == "bool";
            return;
        }
    fail(text("elements of type '", name.substr(0, 40), "', which volumes do not have"));
}

void Metadata::put_fill(double value) {
    auto const put = [&]<class T>(T v) { std::memcpy(array_.fill.data(), &v, sizeof v); };
    auto const integer = [&]<class T>(T) {
        double const low = static_cast<double>(std::numeric_limits<T>::lowest()),
                     high = static_cast<double>(std::numeric_limits<T>::max());
        if (!(value >= low && value <= high)) fail(text("its fill value ", value, " is none of its type"));
        // The largest 64-bit numbers have no double of their own.
        put(value >= high ? std::numeric_limits<T>::max() : static_cast<T>(value));
    };
    switch (array_.dtype) {
    case DataType::uint8:
        return integer(std::uint8_t{});
    case DataType::int8:
        return integer(std::int8_t{});
    case DataType::uint16:
        return integer(std::uint16_t{});
    case DataType::int16:
        return integer(std::int16_t{});
    case DataType::uint32:
        return integer(std::uint32_t{});
    case DataType::int32:
        return integer(std::int32_t{});
    case DataType::uint64:
        return integer(std::uint64_t{});
    case DataType::int64:
        return integer(std::int64_t{});
    case DataType::float16:
        return put(Half(value).bits);
    case DataType::float32:
        return put(static_cast<float>(value));
    case DataType::float64:
        return put(value);
    }
}

void Metadata::read_fill(Json const& value) {
    bool const real = !is_integer(array_.dtype);
    if (value.is_null()) return;
    if (value.is_boolean()) return put_fill(value.get<bool>() ? 1 : 0);
    if (value.is_number_unsigned() && array_.dtype == DataType::uint64) {
        auto const v = value.get<std::uint64_t>();
        std::memcpy(array_.fill.data(), &v, 8);
        return;
    }
    if (value.is_number_integer() && array_.dtype == DataType::int64 && !value.is_number_unsigned()) {
        auto const v = value.get<std::int64_t>();
        std::memcpy(array_.fill.data(), &v, 8);
        return;
    }
    if (value.is_number()) return put_fill(value.get<double>());
    if (real && value.is_string()) {
        std::string const word = value.get<std::string>();
        double const infinity = std::numeric_limits<double>::infinity();
        if (word == "NaN") return put_fill(std::numeric_limits<double>::quiet_NaN());
        if (word == "Infinity") return put_fill(infinity);
        if (word == "-Infinity") return put_fill(-infinity);
        if (word.starts_with("0x") && word.size() == 2 + 2 * size_of(array_.dtype)) { // its bits
            std::uint64_t bits = 0;
            for (char const c : word.substr(2)) {
                int const digit = c >= '0' && c <= '9'   ? c - '0'
                                  : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                  : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                                         : -1;
                if (digit < 0) fail("its fill value is no number");
                bits = bits << 4 | static_cast<std::uint64_t>(digit);
            }
            std::memcpy(array_.fill.data(), &bits, 8); // little-endian, as all machines that this is built for
            return;
        }
    }
    fail("its fill value is no number");
}

void Metadata::read_v2(Json const& json) {
    array_.shape = extents(member(json, "shape"), "shape");
    array_.chunk = array_.inner = extents(member(json, "chunks"), "chunks");
    read_type(words(member(json, "dtype").is_string() ? member(json, "dtype") : Json("structured"), "dtype"), true);
    if (Json const* const separator = maybe(json, "dimension_separator"))
        array_.separator = *separator == "/" ? '/' : '.';
    array_.order.resize(array_.shape.size());
    std::iota(array_.order.begin(), array_.order.end(), std::size_t{0});
    if (Json const* const order = maybe(json, "order"); order != nullptr && *order == "F")
        std::reverse(array_.order.begin(), array_.order.end());
    if (Json const* const filters = maybe(json, "filters"))
        for (auto const& filter : *filters)
            if (std::string const id = words(member(filter, "id"), "the filter's id"); !read_filter(id, filter))
                fail(text("the filter '", id.substr(0, 40), "', which is not read"),
                     "in Python: store it again without filters");
    if (Json const* const compressor = maybe(json, "compressor")) {
        std::string const id = words(member(*compressor, "id"), "the compressor's id");
        if (!read_filter(id, *compressor)) // filters may stand there too
            fail(text("compressed by '", id.substr(0, 40), "'; zlib, gzip, zstd, blosc, lz4, bz2 and lzma are read"));
    }
    if (Json const* const fill = maybe(json, "fill_value")) read_fill(*fill);
}

/// A type of NumPy in a filter's configuration. Its byte order, of the last filter, is that of the chunks.
DataType Metadata::filter_type(Json const& configuration, char const* name, DataType otherwise) {
    Json const* const type = maybe(configuration, name);
    if (type == nullptr) return otherwise;
    DataType const own = array_.dtype;
    std::string word = words(*type, name);
    for (TypeName const& entry : type_names) // "float32" too
        if (word == entry.v3) word = text("<", entry.v2);
    read_type(word, true);
    return std::exchange(array_.dtype, own);
}

/// False for what is no filter that is read.
bool Metadata::read_filter(std::string const& name, Json const& configuration) {
    Filter filter;
    auto const number = [&](char const* what) {
        Json const& value = member(configuration, what);
        if (!value.is_number()) fail(text("a filter's ", what, " is no number"));
        return value.get<double>();
    };
    if (array_.filters.size() + array_.codecs.size() >= 8) fail("more than eight filters");
    Json const* const location = maybe(configuration, "location");
    bool const at_start = location != nullptr ? *location == "start" : name == "crc32" || name == "adler32";
    if (auto const sum = checksum_named(name, at_start)) {
        for (char const* const what : {"initval", "prefix"})
            if (Json const* const value = maybe(configuration, what);
                sum == Codec::lookup3 && value != nullptr && !value->is_null() && *value != 0)
                fail(text("a checksum jenkins_lookup3 with its own ", what, ", which is not read"));
        array_.codecs.push_back(*sum);
        return true;
    }
    if (auto const codec = codec_named(name)) {
        array_.codecs.push_back(*codec);
        return true;
    }
    if (!array_.codecs.empty()) return false; // behind what made bytes of numbers
    DataType const before = array_.filters.empty() ? array_.dtype : array_.filters.back().to;
    if (!array_.filters.empty() && array_.filters.back().kind == Filter::Kind::bits) return false;
    if (name == "packbits") {
        if (size_of(before) != 1 ||
            (!array_.filters.empty() && array_.filters.back().kind == Filter::Kind::bytes_apart))
            fail("bits of other elements than bool");
        filter.kind = Filter::Kind::bits;
        array_.filters.push_back(filter);
        return true;
    }
    if (name == "shuffle") {
        Json const* const element = maybe(configuration, "elementsize");
        std::uint64_t const size = element != nullptr && element->is_number_unsigned() ? element->get<std::uint64_t>()
                                   : element == nullptr                                ? 4
                                                                                       : 0;
        if (size < 1 || size > 1024) fail("a filter that parts bytes of no elements");
        filter.kind = Filter::Kind::bytes_apart;
        filter.element = static_cast<std::size_t>(size);
        array_.filters.push_back(filter);
        return true;
    }
    constexpr std::string_view of_numbers[] = {"delta", "fixedscaleoffset", "quantize", "astype", "bitround"};
    if (std::find(std::begin(of_numbers), std::end(of_numbers), name) == std::end(of_numbers)) return false;
    if (!array_.filters.empty() && array_.filters.back().kind == Filter::Kind::bytes_apart)
        fail("a filter of numbers behind one of bytes, which is not read");
    if (name == "bitround") return true; // what was rounded stays so
    filter.from = filter_type(configuration, name == "astype" ? "decode_dtype" : "dtype", before);
    filter.to = filter_type(configuration, name == "astype" ? "encode_dtype" : "astype", filter.from);
    if (name == "delta") {
        member(configuration, "dtype");
        filter.kind = Filter::Kind::delta;
    } else if (name == "fixedscaleoffset") {
        filter.kind = Filter::Kind::scale;
        filter.scale = number("scale");
        filter.offset = number("offset");
        if (!(std::abs(filter.scale) > 0)) fail("a filter whose scale is 0");
    }
    if (filter.from != before) fail("filters of other types than its own");
    array_.filters.push_back(filter);
    return true;
}

void Metadata::read_transpose(Json const& configuration) {
    Json const& order = member(configuration, "order");
    std::size_t const n = array_.shape.size();
    if (order == "C") return;
    if (order == "F") return std::reverse(array_.order.begin(), array_.order.end());
    std::vector<bool> seen(n);
    std::vector<std::size_t> const before = array_.order; // one transposition after another
    if (!order.is_array() || order.size() != n) fail("a transposition of other dimensions");
    for (std::size_t i = 0; i < n; ++i) {
        if (!order[i].is_number_unsigned() || order[i].get<std::uint64_t>() >= n)
            fail("a transposition of other dimensions");
        auto const axis = order[i].get<std::size_t>();
        if (seen[axis]) fail("a transposition that names a dimension twice");
        seen[axis] = true;
        array_.order[i] = before[axis];
    }
}

void Metadata::read_shard(Json const& configuration) {
    array_.sharded = true;
    array_.inner = extents(member(configuration, "chunk_shape"), "chunk_shape");
    if (array_.inner.size() != array_.chunk.size()) fail("shards of other dimensions");
    std::int64_t count = 1;
    for (std::size_t i = 0; i < array_.inner.size(); ++i) {
        if (array_.chunk[i] % array_.inner[i] != 0) fail("shards that are no whole chunks");
        count *= array_.chunk[i] / array_.inner[i];
        if (count > most_in_shard) fail("shards of more than 2^22 chunks");
    }
    read_codecs(member(configuration, "codecs"), true);
    Json const& index = member(configuration, "index_codecs");
    for (auto const& codec : index) {
        std::string const name = words(member(codec, "name"), "a codec");
        Json const* const how = maybe(codec, "configuration");
        bool const little = how == nullptr || maybe(*how, "endian") == nullptr || *maybe(*how, "endian") == "little";
        if (name == "crc32c")
            array_.index_checksum = true;
        else if (name != "bytes" || !little)
            fail(text("shards whose index is encoded by '", name.substr(0, 40), "'"));
    }
    if (Json const* const where = maybe(configuration, "index_location")) array_.index_first = *where == "start";
}

void Metadata::read_codecs(Json const& list, bool inside_shard) {
    if (!list.is_array()) fail("its codecs are no list");
    bool bytes = false;
    for (auto const& codec : list) {
        std::string const name = codec.is_string() ? codec.get<std::string>() : words(member(codec, "name"), "a codec");
        Json const* const found = maybe(codec, "configuration");
        Json const how = found != nullptr ? *found : Json::object();
        if (name == "transpose" && !bytes) {
            if (!inside_shard && list.size() > 1 && list.back().is_object() && list.back().contains("name") &&
                list.back()["name"] == "sharding_indexed")
                fail("shards that are transposed, which are not read");
            read_transpose(how);
        } else if (name == "bytes" && !bytes) {
            bytes = true;
            if (Json const* const endian = maybe(how, "endian")) array_.big_endian = *endian == "big";
        } else if (name == "sharding_indexed" && !inside_shard && list.size() == 1) {
            return read_shard(how);
        } else if (name.starts_with("numcodecs.") && read_filter(name.substr(10), how)) {
            bool const of_bytes = name == "numcodecs.shuffle" || !array_.codecs.empty();
            if (bytes != of_bytes) fail(text("the filter '", name.substr(0, 40), "' where it cannot be"));
        } else if (bytes && name == "crc32c") {
            array_.codecs.push_back(Codec::crc32c);
        } else if (auto const known = codec_named(name.starts_with("numcodecs.") ? name.substr(10) : name);
                   bytes && known && (name.starts_with("numcodecs.") || standard(*known))) {
            array_.codecs.push_back(*known);
        } else {
            fail(text("encoded by '", name.substr(0, 40),
                      "' in a way that is not read; bytes, transpose, gzip, zstd, blosc, crc32c and "
                      "sharding_indexed are"));
        }
    }
    if (!bytes) fail("its codecs make no bytes of numbers");
}

void Metadata::read_v3(Json const& json) {
    array_.shape = extents(member(json, "shape"), "shape");
    array_.order.resize(array_.shape.size());
    std::iota(array_.order.begin(), array_.order.end(), std::size_t{0});
    Json const& grid = member(json, "chunk_grid");
    if (member(grid, "name") != "regular") fail("chunks on no regular grid");
    array_.chunk = array_.inner = extents(member(member(grid, "configuration"), "chunk_shape"), "chunk_shape");
    if (array_.chunk.size() != array_.shape.size()) fail("chunks of other dimensions");
    Json const& type = member(json, "data_type");
    read_type(type.is_string() ? type.get<std::string>() : "structured", false);
    Json const& keys = member(json, "chunk_key_encoding");
    std::string const name = words(keys.is_string() ? keys : member(keys, "name"), "chunk_key_encoding");
    array_.prefix = name == "default";
    array_.separator = array_.prefix ? '/' : '.';
    if (!array_.prefix && name != "v2") fail("keys of chunks in no known form");
    if (Json const* const how = maybe(keys, "configuration"))
        if (Json const* const separator = maybe(*how, "separator")) array_.separator = *separator == "/" ? '/' : '.';
    if (Json const* const transformers = maybe(json, "storage_transformers");
        transformers != nullptr && !transformers->empty())
        fail("storage transformers, which are not read");
    read_codecs(member(json, "codecs"), false);
    if (Json const* const fill = maybe(json, "fill_value")) read_fill(*fill);
    if (Json const* const names = maybe(json, "dimension_names"); names != nullptr && names->is_array())
        for (auto const& n : *names) array_.names.push_back(n.is_string() ? n.get<std::string>() : "");
}

void Metadata::check() {
    if (array_.chunk.size() != array_.shape.size()) fail("chunks of other dimensions");
    std::int64_t bytes = static_cast<std::int64_t>(size_of(array_.dtype));
    for (std::int64_t const n : array_.inner)
        if (__builtin_mul_overflow(bytes, n, &bytes) || bytes >= most_chunk) fail("chunks of 2 GiB or more");
    std::int64_t all = static_cast<std::int64_t>(size_of(array_.dtype));
    for (std::int64_t const n : array_.shape)
        if (__builtin_mul_overflow(all, n, &all) || all >= std::int64_t{1} << 62) fail("more than 2^62 bytes");
}

Array Metadata::read(Json const& json, int version) {
    if (!json.is_object()) fail("damaged: its metadata are no JSON");
    if (version == 2)
        read_v2(json);
    else
        read_v3(json);
    check();
    if (Json const* const attributes = maybe(json, "attributes"))
        array_.attributes = attributes->dump(-1, ' ', false, Json::error_handler_t::replace);
    return array_;
}

/// Names of dimensions as xarray writes them into version 2, which has no place of its own for them.
std::vector<std::string> dimensions_in(std::string const& attributes) {
    Json const json = Json::parse(attributes, nullptr, false);
    std::vector<std::string> result;
    auto const found = json.is_object() ? json.find("_ARRAY_DIMENSIONS") : json.end();
    if (json.is_object() && found != json.end() && found->is_array())
        for (auto const& name : *found) result.push_back(name.is_string() ? name.get<std::string>() : "");
    return result;
}

} // namespace

std::size_t Array::inner_bytes() const {
    std::size_t bytes = size_of(dtype);
    for (std::int64_t const n : inner) bytes *= static_cast<std::size_t>(n);
    return bytes;
}

std::size_t Array::filtered_bytes() const {
    return zarr::filtered_bytes(filters, dtype, inner_bytes() / size_of(dtype));
}

std::string Array::key(Position const& file) const {
    std::string key = prefix ? "c" : "";
    for (std::int64_t const n : file) key += text(key.empty() ? "" : std::string(1, separator), n);
    return key;
}

bool is_zarr(std::string const& folder) { return directories()->is_node(folder); }

Array parse_array(std::string const& json, int version, std::string const& folder) {
    return Metadata(folder).read(Json::parse(json, nullptr, false), version);
}

std::optional<Array> read_array(Store const& store, std::string const& folder) {
    auto const parsed = [&](std::string const& json, int version) {
        Array array = Metadata(store.shown(folder)).read(Json::parse(json, nullptr, false), version);
        array.folder = folder;
        return array;
    };
    if (auto const json = store.metadata(folder, ".zarray")) {
        Array array = parsed(*json, 2);
        array.attributes = read_attributes(store, folder);
        array.names = dimensions_in(array.attributes);
        return array;
    }
    auto const json = store.metadata(folder, "zarr.json");
    if (!json) return std::nullopt;
    Json const node = Json::parse(*json, nullptr, false);
    if (!node.is_object())
        throw Error(ErrorKind::data, text("'", store.shown(folder), "': damaged: zarr.json is no JSON"));
    if (node.contains("node_type") && node["node_type"] == "group") return std::nullopt;
    return parsed(*json, 3);
}

std::optional<std::size_t> rank_of_array(Store const& store, std::string const& folder) {
    auto metadata = store.metadata(folder, ".zarray");
    if (!metadata) metadata = store.metadata(folder, "zarr.json");
    if (!metadata) return std::nullopt;
    Json const json = Json::parse(*metadata, nullptr, false);
    auto const shape = json.is_object() ? json.find("shape") : json.end();
    if (!json.is_object() || shape == json.end() || !shape->is_array()) return std::nullopt;
    return shape->size();
}

std::string read_attributes(Store const& store, std::string const& folder) {
    Json json;
    if (auto const own = store.metadata(folder, ".zattrs"))
        json = Json::parse(*own, nullptr, false);
    else if (auto const node = store.metadata(folder, "zarr.json"))
        if (Json const all = Json::parse(*node, nullptr, false); all.is_object() && all.contains("attributes"))
            json = all["attributes"];
    return json.is_object() ? json.dump(-1, ' ', false, Json::error_handler_t::replace) : "{}";
}

} // namespace vkt::zarr
