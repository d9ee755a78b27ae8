#!/bin/sh
# From a fresh clone to a picture: installs what is missing, builds everything, and renders the volume that comes with
# vkt.
# SPDX-License-Identifier: MIT
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)

sh "$root/libvkt/cmake/packages.sh" build optional

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
build() {
    cd "$root"
    # The tests have a script of their own; a build folder that has them keeps them.
    if [ -e build/CMakeCache.txt ]; then cmake --preset release; else cmake --preset release -DVKT_TESTS=OFF; fi &&
        cmake --build build
}
echo 'building (some minutes the first time)'
{ build >"$scratch/log" 2>&1 || touch "$scratch/failed"; touch "$scratch/done"; } &
shown=0
while [ ! -e "$scratch/done" ]; do
    sleep 1
    # ninja begins its lines with "[steps done/all steps]".
    now=$(sed -n 's,^\[\([0-9]*\)/\([0-9]*\)\].*,\1 \2,p' "$scratch/log" | tail -n 1 | awk '{ print int(10 * $1 / $2) * 10 }')
    if [ "${now:-0}" -gt "$shown" ]; then
        shown=$now
        echo "building: $shown %"
    fi
done
wait
if [ -e "$scratch/failed" ]; then
    tail -n 40 "$scratch/log" >&2
    echo 'quickstart.sh: the build failed' >&2
    exit 1
fi
grep '^-- vkt:' "$scratch/log" || true
PATH=$root/build:$PATH

# Each stage is a process of its own; voxels stream from one to the next. No stage can succeed on half a volume, so the
# status of the last one is that of the whole pipeline.
(cd "$root" && vkt read examples/data/phantom.nrrd) | vkt crop --roi :,:,2:94 | vkt resample --scale 3 |
    vkt filter gaussian --sigma 1.2 | vkt render --azimuth 30 --elevation 18 --force -o quickstart.png

echo "wrote $(pwd)/quickstart.png"
