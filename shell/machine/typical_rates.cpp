#include "shell/machine/typical_rates.h"
namespace vkt::shell {
std::span<TypicalRate const> typical_rates() { return {}; }
std::span<TypicalCalibration const> typical_calibration() { return {}; }
} // namespace vkt::shell
