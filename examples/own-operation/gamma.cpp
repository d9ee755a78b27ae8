// An operation that vkt does not have, in a program of its own: gamma correction of a file, slab by slab.
// gamma IN OUT EXPONENT: values become top * (value / top)^EXPONENT, top being the type's largest.
// SPDX-License-Identifier: MIT
#include "libvkt/engine/pipeline.h"
#include "libvkt/formats/request.h"
#include "libvkt/kernel/kernel.h"

#include <cmath>
#include <iostream>

class Gamma : public vkt::Operation {
public:
    double exponent = 1;
    vkt::Losses losses; // what was clipped
    std::string_view name() const override { return "gamma"; }
    vkt::Shape shape() const override { return vkt::Shape::pointwise; }
    vkt::Plan plan(std::span<vkt::Header const> inputs) const override {
        return {.output = inputs.front()}; // same grid, type and place; the engine adds the history
    }
    void run(std::span<vkt::ConstView const> inputs, vkt::AnyView out, vkt::Execution const& execution) override {
        double const top = vkt::is_integer(out.type) ? vkt::highest_of(out.type) : 1;
        // What happens to a voxel; the driver runs it over rows, on all threads, in and out of any type.
        auto const curve = [top, e = exponent](double v) { return top * std::pow(v / top, e); };
        vkt::baseline::map<double>(execution, out, losses, curve, inputs.front());
    }
};

int main(int argc, char** argv) try {
    if (argc != 4) throw vkt::Error(vkt::ErrorKind::usage, "gamma IN OUT EXPONENT");
    auto const execution = vkt::default_execution();
    Gamma gamma;
    gamma.exponent = std::stod(argv[3]);
    std::vector<std::unique_ptr<vkt::Source>> inputs;
    inputs.push_back(vkt::ReadRequest().open(argv[1]));
    auto const out = vkt::attach(std::move(inputs), gamma, execution, {.name = "gamma", .words = {"gamma", argv[3]}});
    vkt::drain(*out, *vkt::create_volume(argv[2], {}), execution);
} catch (std::exception const& e) {
    std::cerr << "gamma: " << e.what() << '\n';
    return 1;
}
