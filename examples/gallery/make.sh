#!/bin/sh
# Makes the gallery: pictures, and README.md with the command and the data of each.
# make.sh [DIRECTORY]: writes them there (here). Everything is made from the volumes that come with vkt or from none.
# SPDX-License-Identifier: MIT
# shellcheck disable=SC2016  # backquotes are those of Markdown
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
out=${1:-.}
mkdir -p "$out"
cd "$out"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "$root/examples" "$work/examples"

cat >"$work/README.md" <<'END'
# Gallery

Each picture with the command that makes it, run where the folder `examples` lies, and the data it is made of.
`sh examples/gallery/make.sh DIRECTORY` makes all of them, and this page.
END

# show NAME TITLE DATA COMMAND: the command writes NAME.png.
show() {
    printf '\n## %s\n\n![%s](%s.png)\n\n```sh\n%s\n```\n\n%s\n' "$2" "$2" "$1" "$4" "$3" >>"$work/README.md"
    (cd "$work" && eval "$4") || {
        echo "make.sh: $1: the command fails" >&2
        exit 1
    }
}

ct='Data: `examples/data/ct.nrrd`, a made CT of a body with vertebrae, 72 x 60 x 40 voxels of 1.5 x 1.5 x 2.4 mm.'
phantom='Data: `examples/data/phantom.nrrd`, a made phantom, 64 x 64 x 96 voxels.'
made='Data: none, the volume is made.'

show window 'A slice through a window of values' "$ct" \
    'vkt slice examples/data/ct.nrrd --z 20 --range -160:240 -q | vkt resample --scale 3,3,1 | vkt slice -o window.png'
show projection 'The brightest voxel of every column' "$ct" \
    'vkt resample examples/data/ct.nrrd --spacing 1 | vkt project max --axis y | vkt flip y | vkt resample --scale 2,2,1 | vkt slice --range -100:900 -q -o projection.png'
show median 'Noise, taken away without the edges' "$phantom" \
    'vkt make noise --dims 64 64 96 --seed 1 | vkt set --spacing 0.5 --origin -15.75,-15.75,-23.75 | vkt transform "a > 0.97 ? 255 : a < 0.03 ? 0 : v" examples/data/phantom.nrrd - | vkt filter median --radius 1 | vkt slice --axis y | vkt flip y | vkt resample --scale 3,3,1 | vkt slice -o median.png'
show volume 'A volume, colours and opacities chosen from the data' "$phantom" \
    'vkt render examples/data/phantom.nrrd --size 200 -o volume.png'
show bone 'An iso-surface with shadows' "$ct" \
    'vkt filter gaussian examples/data/ct.nrrd --sigma 0.8 | vkt render -ra implicit-iso --iso 250 --light-direction 1,-1,1 --shadows --size 240 -o bone.png'
show lit 'Light from one direction, what the volume holds back of it, and of that from everywhere' "$ct" \
    'vkt render examples/data/ct.nrrd --opacity 0,0,0.3,0.8 --domain 0:500 --colormap bone --light-direction 1,-1,1 --shadows --ambient-occlusion 8 --size 200 -o lit.png'
show signal 'A test signal with fine ripples, and its two surfaces' "$made" \
    'vkt make marschner-lobb --dims 64 64 64 --dtype float32 | vkt render -ra implicit-iso --iso 0.5 --view z --projection orthographic --size 160 -o signal.png'
show cloud 'Light, scattered many times' "$made" \
    'vkt make sphere --dims 48 48 48 --edge coverage --dtype float32 | vkt render -ra multi-scattering --spp 16 --colormap heat --size 128 -q -o cloud.png'
show depth 'How deep voxels lie inside of an object' "$phantom" \
    'vkt threshold examples/data/phantom.nrrd --otsu | vkt distance --unit voxel | vkt slice --axis y | vkt flip y | vkt resample --scale 3,3,1 | vkt slice --range minmax -o depth.png'
show labels 'Objects that do not touch, numbered' "$ct" \
    'vkt threshold examples/data/ct.nrrd --above 250 | vkt label --min-size 20 | vkt render -ra maximum --colormap turbo --view -y --size 240 -o labels.png'
show contrast 'Contrast where it is low' "$ct" \
    'vkt clahe examples/data/ct.nrrd --range -160:240 --bricks 3,3,2 -q | vkt slice --z 20 | vkt resample --scale 3,3,1 | vkt slice --range minmax -o contrast.png'
show refinement 'Cells of a simulation, fine where they need to be' "$made" \
    'vkt make amr --blocks 200 --levels 4 | vkt render --opacity 0,0.3 --domain 0:1 --size 200 -o refinement.png'
show turned 'Turned, and cut' "$phantom" \
    'vkt rotate examples/data/phantom.nrrd --axis x --angle 20 | vkt render --clip-box 50%:,:,: --colormap viridis --shade gradient --size 200 -o turned.png'

mv "$work"/*.png "$work/README.md" .
echo "wrote $(grep -c '^## ' README.md) pictures and README.md to $out"
