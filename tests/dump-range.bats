# vkt dump-range: volkit's name for dump with a region.
load helper

setup_more() { vkt make noise --seed 4 --dims 7 6 5 --dtype uint8 -o noise.nrrd; }

@test "prints the region and nothing else, under its indices" {
    vkt read noise.nrrd | vkt write - --format raw >noise.raw
    vkt dump-range noise.nrrd --first 1 2 3 --last 6 4 5 >out
    /usr/bin/python3 -c '
import re
v, text = open("noise.raw", "rb").read(), open("out").read().split("data:\n")[1]
want = "\n".join("[%d]\n{\n%s}\n" % (z, "".join("  [%d] {%s}\n" % (y, ", ".join(
    "%.1f" % v[(z * 6 + y) * 7 + x] for x in range(1, 6))) for y in range(2, 4))) for z in range(3, 5))
assert text == want, text + want'
    grep -q '^  dims: (7,6,5)$' out # the header is that of the volume
}

@test "volkit's spellings say the same" {
    vkt dump-range noise.nrrd --first 1 2 3 --last 6 4 5 >want
    vkt dump-range -first 1 2 3 -last 6 4 5 <noise.nrrd | diff want -
    vkt dump-range -i noise.nrrd --first 1,2,3 --last 6,4,5 | diff want -
    vkt dump noise.nrrd --roi 1:6,2:4,3:5 | diff want -
    vkt read noise.nrrd | vkt dump-range --roi 1:6,2:4,3:5 | diff want -
}

@test "a region is needed and lies in the volume" {
    fails_with 2 "no range is given" vkt dump-range noise.nrrd
    fails_with 2 "go together" vkt dump-range noise.nrrd --last 1 1 1
    fails_with 2 "is empty" vkt dump-range noise.nrrd --first 3 3 3 --last 3 4 4
    fails_with 2 "" vkt dump-range noise.nrrd --first 0 0 0 --last 7 6 6
    fails_with 2 "give one of them" vkt dump-range noise.nrrd --roi :,:,: --first 0 0 0 --last 1 1 1
}
