#!/bin/sh
# Looks into a volume: a quarter of it filled with nothing, then the upper half turned about z.
# teaser.sh [DIRECTORY]: writes teaser-volume.png, teaser-fill.png and teaser-rotate.png there (here). Draws the phantom
# that comes with vkt; with VKT_DATA=DIRECTORY the fuel injection of the Open SciVis data sets, if it is in there.
# SPDX-License-Identifier: MIT
set -eu
out=${1:-.}
mkdir -p "$out"
volume=$(dirname "$0")/data/phantom.nrrd
# Thin walls like glass, what is solid in red.
look='--colormap coolwarm --domain 20:130 --opacity 20:0,27:0,36:0.15,60:0.1,80:0.4,120:0.9'
real=${VKT_DATA:-}/raw/fuel_64x64x64_uint8.raw
if [ -n "${VKT_DATA:-}" ] && [ -e "$real" ]; then
    volume=$real
    look='--colormap coolwarm --domain 5:120 --opacity 5:0,10:0.1,60:0.2,120:0.9'
elif [ -n "${VKT_DATA:-}" ]; then
    echo "teaser.sh: there is no $real: the phantom instead" >&2
fi

# draw NAME: the volume from standard input, finer and smoother, as a picture; all with the same camera.
draw() {
    # shellcheck disable=SC2086  # several words
    vkt resample --scale 3 | vkt filter gaussian --sigma 1.2 |
        vkt render --size 320x320 --azimuth 20 --elevation 22 --zoom 1.15 --fit volume --shade gradient $look --force -o "$out/$1"
}

vkt read "$volume" | draw teaser-volume.png
vkt fill "$volume" --roi 50%:,:50%,: --value 0 | draw teaser-fill.png
vkt fill "$volume" --roi 50%:,:50%,: --value 0 | vkt rotate --roi :,:,50%: --axis z --angle -60 -q | draw teaser-rotate.png

echo "wrote teaser-volume.png, teaser-fill.png and teaser-rotate.png to $out"
