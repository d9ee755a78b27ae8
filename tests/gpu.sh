#!/bin/sh
# Builds everything with CUDA, compares GPU with CPU through the library and through the command, and times the kernels
# against the device's own copy bandwidth: gpu.sh [build folder]
# SPDX-License-Identifier: MIT
#
# Needs a CUDA GPU, nvcc, CMake, ninja and the packages of libvkt/cmake/packages.sh build. Headers that a machine lacks
# may lie under .carry/include.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
build=${1:-$root/build-cuda}
nvcc=$(command -v nvcc || echo /usr/local/cuda/bin/nvcc)
set -- -DCMAKE_BUILD_TYPE=Release -DVKT_CUDA=ON -DCMAKE_CUDA_COMPILER="$nvcc" -DVKT_TESTS=OFF -DVKT_OPENVDB=OFF \
    -DVKT_VIEWER=OFF
[ -d "$root/.carry/include" ] && set -- "$@" -DCMAKE_PREFIX_PATH="$root/.carry"
command -v ninja >/dev/null && set -- "$@" -G Ninja
mkdir -p "$build"
cmake -S "$root" -B "$build" "$@" >"$build/gpu.log" 2>&1 || { cat "$build/gpu.log" >&2; exit 1; }
cmake --build "$build" -j "$(nproc)" >"$build/gpu.log" 2>&1 || { grep -B2 -A8 -E 'error|FAILED' "$build/gpu.log" | head -80 >&2; exit 1; }
grep '^-- vkt:' "$build/gpu.log" || true
result=0
sh "$root/tests/gpu/commands.sh" "$build/vkt" || result=1
sh "$root/tests/gpu/several.sh" "$build/vkt" || [ $? = 77 ] || result=1
"$build/tests/gpu/vkt_gpu_several_bench" || [ $? = 77 ] || result=1
sh "$root/tests/gpu/transport.sh" "$build/vkt" "$build/tests/gpu/vkt_gpu_hand_over" || result=1
"$build/tests/gpu/vkt_gpu_parity" || result=1
"$build/tests/gpu/vkt_gpu_sampler" || result=1
"$build/tests/gpu/vkt_gpu_render" || result=1
"$build/tests/gpu/vkt_gpu_drivers_parity" || result=1
"$build/tests/gpu/vkt_gpu_drivers_bench" || result=1
if python3 -c 'import numpy' 2>/dev/null; then
    PYTHONPATH=$build/python python3 "$root/tests/gpu/arrays.py" || result=1
else
    echo 'arrays of GPUs in Python: skipped, there is no NumPy'
fi

echo
echo 'commands, 512^3 float32, seconds of wall time for each device:'
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$build/vkt" make noise --dims 512 512 512 --dtype float32 --seed 1 -o big_512x512x512_float32.raw
for device in cpu gpu; do
    for command in 'flip x' 'resample --scale 0.5' 'filter gaussian --sigma 2' 'filter gaussian --sigma 8'; do
        begin=$(date +%s%N)
        # shellcheck disable=SC2086  # a list of words
        "$build/vkt" $command big_512x512x512_float32.raw --device $device --force -o out.nrrd
        end=$(date +%s%N)
        echo "$device $command: $(((end - begin) / 1000000)) ms"
    done
done
exit $result
