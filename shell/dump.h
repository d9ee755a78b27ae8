// Printing the values of a volume in volkit's layout.
// SPDX-License-Identifier: MIT
#pragma once

#include "shell/command.h"

namespace vkt::shell {

/// `dump` and, with a range that must be given, `dump-range`.
class Dump : public Consumer {
public:
    explicit Dump(bool needs_range) : needs_range_(needs_range) {}
    void parameters(Parameters& p) override;
    void check() const override;
    int inputs() const override { return file_.empty() ? 1 : 0; }
    bool writes() const override { return false; }
    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override;

private:
    Box region(Index3 dims) const;
    void print(Source& source, Context& context) const;

    bool needs_range_;
    Roi roi_;
    std::optional<Index3> first_, last_;
    std::string file_;
    std::unique_ptr<Source> named_; ///< opened from file_
};

} // namespace vkt::shell
