// Removing a dataset: its name, and what others say of it.
// SPDX-License-Identifier: MIT
#include "libvkt/formats/hdf5/remove.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/formats/hdf5/scales.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <vector>

namespace vkt::hdf5 {
namespace {

class Removal {
public:
    Removal(hid_t file, std::string const& path, std::string const& shown) : file_(file), path_(path), shown_(shown) {}

    void remove() const {
        H5L_info_t link{};
        H5O_info_t object{};
        need(H5Lget_info(file_, path_.c_str(), &link, H5P_DEFAULT) >= 0);
        // Under another name it stays as it is.
        bool const last = link.type == H5L_TYPE_HARD &&
                          H5Oget_info_by_name1(file_, path_.c_str(), &object, H5P_DEFAULT) >= 0 && object.rc == 1;
        if (last && object.type == H5O_TYPE_DATASET) leave_scales();
        need(H5Ldelete(file_, path_.c_str(), H5P_DEFAULT) >= 0);
    }

private:
    void need(bool done) const {
        if (done) return;
        unsigned major = 0, minor = 0, release = 0;
        H5get_libversion(&major, &minor, &release);
        throw Error(ErrorKind::data,
                    text("'", shown_, "': HDF5 ", static_cast<std::int64_t>(major), ".",
                         static_cast<std::int64_t>(minor), ".", static_cast<std::int64_t>(release), " cannot replace '",
                         path_, "', which a later one may have written"),
                    text("give the new one another name: -o ", shell_quoted(text(shown_, ":", path_, "_new"))));
    }

    bool has(hid_t object, char const* attribute) const {
        htri_t const found = H5Aexists(object, attribute);
        need(found >= 0);
        return found > 0;
    }

    /// Empty where a scale has none.
    std::vector<User> users(hid_t scale) const {
        if (!has(scale, users_of)) return {};
        Handle const list(H5Aopen(scale, users_of, H5P_DEFAULT), H5Aclose), type = user_type();
        need(static_cast<bool>(list));
        Handle const space(H5Aget_space(list), H5Sclose);
        std::vector<User> result(static_cast<std::size_t>(std::max<hssize_t>(H5Sget_simple_extent_npoints(space), 0)));
        need(H5Aread(list, type, result.data()) >= 0);
        return result;
    }

    void leave_scales() const {
        Handle const dataset(H5Dopen2(file_, path_.c_str(), H5P_DEFAULT), H5Dclose);
        need(static_cast<bool>(dataset));
        if (auto const list = users(dataset); !list.empty())
            throw Error(ErrorKind::usage,
                        text("'", shown_, "': '", path_, "' is a scale of dimensions that ", std::ssize(list),
                             list.size() == 1 ? " other dataset names" : " other datasets name", " as theirs"),
                        text("give the new one another name: -o ", shell_quoted(text(shown_, ":", path_, "_new"))));
        if (!has(dataset, scales_of)) return;
        Handle const list(H5Aopen(dataset, scales_of, H5P_DEFAULT), H5Aclose);
        need(static_cast<bool>(list));
        Handle const space(H5Aget_space(list), H5Sclose), type(H5Tvlen_create(H5T_STD_REF_OBJ), H5Tclose);
        std::vector<hvl_t> all(static_cast<std::size_t>(std::max<hssize_t>(H5Sget_simple_extent_npoints(space), 0)));
        need(H5Aread(list, type, all.data()) >= 0);
        hobj_ref_t own = 0;
        need(H5Rcreate(&own, file_, path_.c_str(), H5R_OBJECT, -1) >= 0);
        for (hvl_t const& some : all)
            for (std::size_t i = 0; i < some.len; ++i) {
                Handle const scale(
                    H5Rdereference2(file_, H5P_DEFAULT, H5R_OBJECT, static_cast<hobj_ref_t*>(some.p) + i), H5Oclose);
                if (scale) forget_user(scale, own);
            }
        H5Dvlen_reclaim(type, space, H5P_DEFAULT, all.data());
    }

    void forget_user(hid_t scale, hobj_ref_t dataset) const {
        std::vector<User> list = users(scale);
        if (std::erase_if(list, [&](User const& user) { return user.dataset == dataset; }) == 0) return;
        need(H5Adelete(scale, users_of) >= 0);
        if (list.empty()) return remove_ours(scale);
        hsize_t const n = list.size();
        Handle const space(H5Screate_simple(1, &n, nullptr), H5Sclose), type = user_type();
        Handle const attribute(H5Acreate2(scale, users_of, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
        need(attribute && H5Awrite(attribute, type, list.data()) >= 0);
    }

    /// A scale that vkt made goes with the last dataset that named it.
    void remove_ours(hid_t scale) const {
        std::array<char, 4096> name{};
        if (!has(scale, our_scale) || H5Iget_name(scale, name.data(), name.size()) <= 0) return;
        need(H5Ldelete(file_, name.data(), H5P_DEFAULT) >= 0);
    }

    hid_t file_;
    std::string const &path_, &shown_;
};

} // namespace

void remove_named(std::int64_t file, std::string const& path, std::string const& shown) {
    Removal(file, path, shown).remove();
}

} // namespace vkt::hdf5
