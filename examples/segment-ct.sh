#!/bin/sh
# Segments the largest bone of a CT and measures how thick it is.
# segment-ct.sh [DIRECTORY]: writes there (here) bone.nrrd, a mask; depth.nrrd, how far its voxels lie below its surface, in
# the unit of the CT; and pictures of a slice (ct-slice.png), the bone (ct-bone.png) and its depth, cut open (ct-depth.png).
# Takes the made CT that comes with vkt; with VKT_DATA=DIRECTORY the CT of an aorta with a stent, if it is in there.
# SPDX-License-Identifier: MIT
set -eu
out=${1:-.}
mkdir -p "$out"
ct=$(dirname "$0")/data/ct.nrrd
real=${VKT_DATA:-}/raw/stent_128x128x256_int16.raw
if [ -n "${VKT_DATA:-}" ] && [ -e "$real" ]; then
    ct=$real
elif [ -n "${VKT_DATA:-}" ]; then
    echo "segment-ct.sh: there is no $real: the made CT instead" >&2
fi

# Smoothed against noise. Air and fat count as water, so that Otsu's threshold parts bone from soft tissue, and not the body
# from the air around it. Of all that is left the largest component: one vertebra, without its neighbours and the table.
vkt filter gaussian "$ct" --sigma 1 --unit world | vkt arith max - 0 | vkt threshold --otsu |
    vkt label --keep-largest 1 --dtype uint8 --force -o "$out/bone.nrrd"
vkt distance "$out/bone.nrrd" --force -o "$out/depth.nrrd"
voxels=$(vkt stats "$out/bone.nrrd" | awk '$1 == "sum" { print $2 }')
deepest=$(vkt stats "$out/depth.nrrd" | awk '$1 == "max" { printf "%.2f", $2 }')

# As a radiologist sees it: a window of 400 HU, four pixels a voxel.
vkt crop "$ct" --roi :,:,50%:+1 | vkt resample --scale 4,4,1 | vkt slice --range -160:240 -q --force -o "$out/ct-slice.png"

# The surface is where the signed distance is 0: smooth, though the mask has steps. For the depth all above is taken away.
camera='--size 320x320 --azimuth 150 --elevation 42'
vkt distance "$out/bone.nrrd" --signed | vkt resample --spacing 0.6 --method cubic --force -o "$out/surface.vkt"
# shellcheck disable=SC2086  # several words
vkt render "$out/surface.vkt" --render-algo implicit-iso --iso 0 $camera --force -o "$out/ct-bone.png"
# shellcheck disable=SC2086
vkt fill "$out/surface.vkt" --roi :,:,54%: --value -9 |
    vkt render --colormap viridis --domain "0:$deepest" --opacity 0:0,0.3:0.9 --shade none $camera --force -o "$out/ct-depth.png"
rm "$out/surface.vkt"

echo "wrote bone.nrrd ($voxels voxels), depth.nrrd (up to $deepest), ct-slice.png, ct-bone.png and ct-depth.png to $out"
