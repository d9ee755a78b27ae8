// What a file says, read by the first who asks.
// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <string>

namespace vkt {

/// A file among the parameters of an operation is read by plan(), which changes nothing and may be called again, but a
/// pipe gives what it holds only once. So it is kept here, beside the path that it came from.
template <class T> class ReadOnce {
public:
    /// `read(path)`, which is called once for a path.
    template <class Read> T const& of(std::string const& path, Read const& read) const {
        if (!value_ || path_ != path) {
            value_.emplace(read(path));
            path_ = path;
        }
        return *value_;
    }

private:
    mutable std::string path_;
    mutable std::optional<T> value_;
};

} // namespace vkt
