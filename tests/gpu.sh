#!/bin/sh
# Builds the operations for CPU and GPU, compares their results and times the GPU against its own copy bandwidth.
#   tests/gpu.sh [build-folder]
# Needs a CUDA GPU, nvcc, CMake, ninja or make. Where nlohmann/json is not installed, put it under .carry/include.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
build=${1:-$root/build-gpu}
jobs=$(nproc 2>/dev/null || echo 4)
nvcc=$(command -v nvcc || echo /usr/local/cuda/bin/nvcc)
set -- -DCMAKE_CUDA_COMPILER="$nvcc"
[ -d "$root/.carry/include" ] && set -- "$@" -DCMAKE_PREFIX_PATH="$root/.carry" -DNLOHMANN_JSON_INCLUDE_DIR="$root/.carry/include"
command -v ninja >/dev/null && set -- "$@" -G Ninja
cmake -S "$root/tests/gpu" -B "$build" "$@" >"$build.log" 2>&1 || { cat "$build.log" >&2; exit 1; }
cmake --build "$build" -j "$jobs" >"$build.log" 2>&1 || { tail -50 "$build.log" >&2; exit 1; }
rm -f "$build.log"
exec "$build/parity"
