# vkt history: what it prints makes the same volume again.
load helper

@test "as a pipeline that runs" {
    vkt make noise --dims 9 8 7 --seed 5 | vkt resample --scale 0.5 | vkt arith sub - <(vkt make ramp --dims 5 4 4 | vkt set --spacing 1.8,2,1.75 --origin 0.4,0.5,0.375) -o d.vkt
    vkt history d.vkt --as-shell >line
    bash -c "$(cat line)" | vkt diff d.vkt
}

@test "as a tree and as JSON" {
    vkt make ramp --dims 4 4 4 | vkt resample --scale 2 >r.vkt
    [ "$(vkt history r.vkt | wc -l)" = 2 ]
    vkt history r.vkt --json | /usr/bin/python3 -c '
import json, sys; h = json.load(sys.stdin)
assert h["command"][0] == "resample" and h["inputs"][0]["command"][:2] == ["make", "ramp"], h'
}

@test "a volume without one" {
    vkt make ramp --dims 4 4 4 --no-history | vkt history >out 2>note
    [ ! -s out ]
    grep -q 'no history' note
}
