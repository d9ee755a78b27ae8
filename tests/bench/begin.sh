# What the scripts beside it begin with, to be sourced: vkt on PATH, a folder for volumes, the limits of this machine.
# SPDX-License-Identifier: MIT
# shellcheck shell=sh
set -eu
here=$(cd "$(dirname "$0")" && pwd)
PATH=$(cd "${1:-$here/../../build}" && pwd):$PATH
if [ -n "${VKT_BENCH_DIR:-}" ]; then
    mkdir -p "$VKT_BENCH_DIR"
    cd "$VKT_BENCH_DIR"
else
    dir=$(mktemp -d /tmp/vkt-bench.XXXXXX)
    trap 'rm -rf "$dir"' EXIT
    cd "$dir"
fi

echo "# limits of this machine ($(nproc) processors)"
c++ -std=c++20 -O3 -pthread "$here/limits.cpp" -o limits
./limits | tee limits.txt
# limit NAME: one of them, in GB/s.
limit() { sed -n "s/^$1 *\([0-9.]*\) GB.*/\1/p" limits.txt; }
