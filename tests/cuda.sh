#!/bin/sh
# Compiles every CUDA source, on machines without a GPU as well: cuda.sh RESULTS, a line "pass|fail|skip NAME" for each.
# SPDX-License-Identifier: MIT
#
# nvcc is the one on the PATH or in /usr/local/cuda; without one it comes as wheels into build/nvcc.
set -eu
results=$1
root=$(cd "$(dirname "$0")/.." && pwd)
cd "$root"
: >"$results"
nvcc=$(command -v nvcc || ls /usr/local/cuda/bin/nvcc 2>/dev/null || true)
if [ -z "$nvcc" ]; then
    wheels='nvidia-cuda-nvcc nvidia-cuda-runtime nvidia-cuda-crt nvidia-nvvm nvidia-cuda-cccl'
    # shellcheck disable=SC2086  # a list of words
    [ -e build/nvcc/nvidia/cu13/bin/nvcc ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target build/nvcc $wheels ||
        true
    nvcc=$root/build/nvcc/nvidia/cu13/bin/nvcc
    [ -e "$nvcc" ] || {
        echo 'skip cuda: nvcc could not be installed' >>"$results"
        exit 0
    }
    chmod +x build/nvcc/nvidia/cu13/bin/* build/nvcc/nvidia/cu13/nvvm/bin/* 2>/dev/null || true
fi
"$nvcc" --version | tail -n 2 | head -n 1
mkdir -p build/cuda
flags='-std=c++20 --extended-lambda --expt-relaxed-constexpr --fmad=false -O1 -Xcicc -O1 -Xptxas -O1 -arch=sm_90 --diag-suppress=554
    -DVKT_BACKEND=cuda -DVKT_BACKEND_cuda -DVKT_CUDA -I.'
# Kernels that a header declares for CPUs only are no CUDA sources (libvkt/CMakeLists.txt).
for source in libvkt/*/kernels/*.cpp libvkt/*/kernels/*.cu libvkt/*/*/kernels/*.cpp libvkt/*/*/kernels/*.cu libvkt/cuda/*.cu tests/gpu/*.cu; do
    header=${source%.*}.h
    case $source in *.cpp) [ ! -e "${source%.cpp}.cu" ] || continue ;; esac
    if [ -e "$header" ] && grep -q '^VKT_CPU_KERNEL' "$header" && ! grep -q '^VKT_KERNEL' "$header"; then continue; fi
    echo "$source"
done >build/cuda/sources
# Sources and what they include are not looked at one by one: an object is as new as the newest header or none.
newest=$(find libvkt tests/gpu -name '*.h' -newer build/cuda/stamp 2>/dev/null | head -n 1 || true)
if [ ! -e build/cuda/stamp ] || [ -n "$newest" ]; then rm -f build/cuda/*.o; fi
touch build/cuda/stamp
launcher=$(command -v ccache || true) # of the same text, the same object
export nvcc flags launcher
# shellcheck disable=SC2016  # expanded by the inner shell
xargs -P "$(nproc)" -n 1 sh -c '
    object=build/cuda/$(echo "$2" | tr / _).o
    [ "$object" -nt "$2" ] && { echo "pass $2" >>"$1"; exit 0; }
    if $launcher "$nvcc" $flags -x cu -c "$2" -o "$object" >"$object.log" 2>&1; then
        echo "pass $2" >>"$1"
    else
        grep -A5 error "$object.log" | head -n 40
        echo "fail $2" >>"$1"
    fi' sh "$results" <build/cuda/sources
