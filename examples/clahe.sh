#!/bin/sh
# Case study of CLAHE: a CT spans air to bone, so that organs are one grey; equalised brick by brick, each shows.
# clahe.sh [DIRECTORY]: writes clahe-before.png and clahe-after.png there (here): one slice, values from least to greatest.
# Takes the made CT that comes with vkt; with VKT_DATA=DIRECTORY the MRI of a fetal brain (template_T2.nrrd), if it is in
# there.
# SPDX-License-Identifier: MIT
set -eu
out=${1:-.}
mkdir -p "$out"
volume=$(dirname "$0")/data/ct.nrrd
slice=25
real=${VKT_DATA:-}/nrrd/template_T2.nrrd
if [ -n "${VKT_DATA:-}" ] && [ -e "$real" ]; then
    volume=$real
    slice=60
elif [ -n "${VKT_DATA:-}" ]; then
    echo "clahe.sh: there is no $real: the made CT instead" >&2
fi

# picture NAME: the slice of the volume from standard input, four pixels a voxel.
picture() {
    vkt crop --roi ":,:,$slice:+1" | vkt resample --scale 4,4,1 --method cubic |
        vkt slice --range minmax -q --force -o "$out/$1"
}

# Equalisation raises noise as well: smooth a little first, and limit the contrast (--clip).
vkt filter gaussian "$volume" --sigma 0.6 | picture clahe-before.png
vkt filter gaussian "$volume" --sigma 0.6 | vkt clahe --bricks 4,4,3 --clip 4 | picture clahe-after.png

echo "wrote clahe-before.png and clahe-after.png to $out"
