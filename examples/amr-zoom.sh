#!/bin/sh
# Case study of an adaptive simulation: the whole volume on a grid of 50 million cells, then a region of it on as many, and
# pictures of both grids and of the trees they came from.
# amr-zoom.sh [CELLS [OPTION…]]: CELLS such as 50M; options of `vkt make amr` make another tree than a SILCC snapshot's.
# Writes whole.nrrd, zoom.nrrd, whole.png, zoom.png, whole-tree.png and zoom-tree.png to the current directory; with
# AMR_FILE=FILE it reads that file, AMR_VARIABLE of it, and AMR_LOOK says how to draw it.
# SPDX-License-Identifier: MIT
set -eu
cells=${1:-50M}
[ $# -eq 0 ] || shift
[ $# -gt 0 ] || set -- --silcc

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
# timed WHAT COMMAND…: runs it and says how long it took.
timed() {
    what=$1
    shift
    begin=$(date +%s%N)
    "$@"
    echo "$what: $((($(date +%s%N) - begin) / 1000000)) ms"
}

if [ -n "${AMR_FILE:-}" ]; then
    timed 'read the tree' vkt read "$AMR_FILE" ${AMR_VARIABLE:+--variable "$AMR_VARIABLE"} -o "$scratch/tree.vkt"
else
    timed 'make the tree' vkt make amr "$@" -o "$scratch/tree.vkt"
fi
vkt info "$scratch/tree.vkt"

timed "whole volume on $cells cells" vkt resample "$scratch/tree.vkt" --cells "$cells" --method auto -o whole.nrrd --force

# The zoom: only the bricks of the region go on, and it gets as many cells as the whole had.
timed 'crop the region' vkt crop "$scratch/tree.vkt" --roi 25%:75%,25%:75%,45%:55% -o "$scratch/region.vkt"
timed "region on $cells cells" vkt resample "$scratch/region.vkt" --cells "$cells" --method auto -o zoom.nrrd --force

# Density over many decades: the thin gas is a haze, the clouds are bodies in it. Opacities hold for 1/256 of a diagonal.
look=${AMR_LOOK:---domain 0.02:1 --opacity 0,0.02,0.1,0.5 --colormap viridis --shade gradient --unit-distance auto}
# shellcheck disable=SC2086  # several words
for name in whole zoom; do
    case $name in
    whole) tree=$scratch/tree.vkt ;;
    zoom) tree=$scratch/region.vkt ;;
    esac
    timed "picture of the $name grid" vkt render "$name.nrrd" $look -o "$name.png" --force
    timed "picture of the $name tree" vkt render "$tree" $look -o "$name-tree.png" --force
done
