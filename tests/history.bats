# vkt history: what it prints makes the same volume again.
load helper

@test "as a pipeline that runs" {
    vkt make noise --dims 9 8 7 --seed 5 | vkt resample --scale 0.5 | vkt arith sub - <(vkt make ramp --dims 5 4 4 | vkt set --spacing 1.8,2,1.75 --origin 0.4,0.5,0.375) -o d.vkt
    vkt history d.vkt --as-shell >line
    bash -c "$(cat line)" | vkt diff d.vkt
}

# again FILE: what its history prints makes it again.
again() {
    vkt history "$1" --as-shell >line
    bash -c "$(cat line)" | vkt diff "$1" - || { cat line >&2; false; }
}

@test "an input stands before options that take all words" {
    vkt make noise --dims 8 8 8 --dtype uint8 | vkt write - --format raw >r_8x8x8_uint8.raw
    vkt set r_8x8x8_uint8.raw --attribute a=1 b=2 -o set.vkt
    again set.vkt
    vkt flip x r_8x8x8_uint8.raw --roi 0:4,:,: -o flipped.vkt
    again flipped.vkt
}

@test "both operands are recorded, also an unsaid one" {
    vkt make ramp --dims 4 4 4 | vkt arith sub <(vkt make noise --dims 4 4 4) -o d.vkt
    again d.vkt
    vkt make ramp --dims 4 4 4 | vkt arith add 5 | vkt arith sub 7 - -o n.vkt
    again n.vkt
}

@test "operands are recorded by their position, whatever they are called" {
    vkt make ramp --dims 4 4 4 -o r.vkt
    vkt make ramp --dims 4 4 4 --no-history --format vkt -o add
    vkt arith add add 5 -o sum.vkt
    again sum.vkt
    vkt arith sub add add -o zero.vkt
    again zero.vkt
    cp r.vkt mul
    vkt arith mul mul 2 -o product.vkt
    again product.vkt
}

@test "as a tree and as JSON" {
    vkt make ramp --dims 4 4 4 | vkt resample --scale 2 >r.vkt
    [ "$(vkt history r.vkt | wc -l)" = 2 ]
    vkt history r.vkt --json | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert h["command"][0] == "resample" and h["inputs"][0]["command"][:2] == ["make", "ramp"], h'
}

@test "of several volumes: one list, and one form" {
    vkt make ramp --dims 4 4 4 -o a.nrrd
    vkt make noise --dims 4 4 4 --no-history -o b.vkt
    vkt read a.nrrd -o c.vkt
    vkt history '[ac].*' --json | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert [v["command"][:2] for v in h] == [["make", "ramp"]] * 2, h'
    vkt history '[bc].vkt' --json 2>note | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert h[0] is None and h[1]["command"][0] == "make", h'
    [ "$(vkt history '[ac].*' | wc -l)" = 2 ]
    fails_with 2 "exclude each other" vkt history a.nrrd --as-shell --json
}

@test "a volume without one" {
    vkt make ramp --dims 4 4 4 --no-history | vkt history >out 2>note
    [ ! -s out ]
    grep -q 'no history' note
}
