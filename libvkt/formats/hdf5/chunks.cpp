// Where voxels lie in the file, of datasets that nothing compresses.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/chosen.h"
#include "libvkt/formats/hdf5/types.h"

#include <algorithm>

namespace vkt::hdf5 {

/// Contiguous data in the machine's own format are read without the library.
void ChosenDataset::find_places(ParsedGrids& grids) const {
    Handle const creation(H5Dget_create_plist(*data_), H5Pclose),
        file_creation(H5Fget_create_plist(all_.file()), H5Pclose);
    hsize_t user_block = 0;
    H5Pget_userblock(file_creation, &user_block);
    haddr_t const offset = H5Dget_offset(*data_);
    bool const as_it_is = plain(*type_) && user_block == 0;
    bool const in_order = std::is_sorted(leading_.begin(), leading_.end()) &&
                          (leading_.empty() || leading_.back() < static_cast<int>(leading_.size()));
    if (as_it_is && in_order && H5Pget_layout(creation) == H5D_CONTIGUOUS && H5Pget_external_count(creation) == 0 &&
        offset != HADDR_UNDEF) {
        std::int64_t const slice = grids.header.dims.x * grids.header.dims.y * static_cast<std::int64_t>(element_);
        std::int64_t const slices = grids.header.dims.z * grids.volumes;
        grids.big_endian = H5Tget_order(*type_) == H5T_ORDER_BE;
        if (slices > (std::int64_t{1} << 24)) return;
        for (std::int64_t i = 0; i < slices; ++i) grids.places.push_back(static_cast<std::int64_t>(offset) + i * slice);
    }
    if (H5Pget_layout(creation) != H5D_CHUNKED || axis_[2] < 0) return;
    std::vector<hsize_t> chunk(shape_.size());
    if (H5Pget_chunk(creation, static_cast<int>(chunk.size()), chunk.data()) <= 0) return;
    grids.slab = static_cast<std::int64_t>(
        std::clamp<hsize_t>(chunk[static_cast<std::size_t>(axis_[2])], 1, shape_[static_cast<std::size_t>(axis_[2])]));
    if (as_it_is && H5Pget_nfilters(creation) == 0) find_chunks(chunk, grids);
}

/// The same of chunks that no filter changed. Those that are missing hold the fill value, which the library knows.
void ChosenDataset::find_chunks(std::vector<hsize_t> const& chunk, ParsedGrids& grids) const {
#if H5_VERSION_GE(1, 10, 5)
    constexpr std::size_t most = 2048; // each is looked for among all
    std::vector<hsize_t> at(shape_.size(), 0);
    std::vector<std::int64_t> places;
    std::size_t count = 1;
    for (std::size_t k = 0; k < shape_.size(); ++k) {
        bool const spatial = k + 3 >= shape_.size();
        if (spatial ? axis_[shape_.size() - 1 - k] != static_cast<int>(k) : chunk[k] != 1) return;
        count *= static_cast<std::size_t>((shape_[k] + chunk[k] - 1) / chunk[k]);
        if (count > most) return;
        if (spatial) grids.chunk[static_cast<int>(shape_.size() - 1 - k)] = static_cast<std::int64_t>(chunk[k]);
    }
    for (std::size_t i = 0; i < count; ++i) {
        std::size_t rest = i;
        for (std::size_t k = shape_.size(); k-- > 0;) {
            std::size_t const n = static_cast<std::size_t>((shape_[k] + chunk[k] - 1) / chunk[k]);
            at[k] = rest % n * chunk[k];
            rest /= n;
        }
        unsigned filtered = 0;
        haddr_t place = HADDR_UNDEF;
        hsize_t bytes = 0;
        if (H5Dget_chunk_info_by_coord(*data_, at.data(), &filtered, &place, &bytes) < 0 || place == HADDR_UNDEF)
            return;
        places.push_back(static_cast<std::int64_t>(place));
    }
    grids.big_endian = H5Tget_order(*type_) == H5T_ORDER_BE;
    grids.chunk_places = std::move(places);
#else
    static_cast<void>(chunk), static_cast<void>(grids);
#endif
}

} // namespace vkt::hdf5
