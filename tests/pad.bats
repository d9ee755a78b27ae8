# vkt pad: NumPy's pad for every rule and type, geometry kept.
load helper

setup_more() {
    python_with numpy
    # Bytes of every pattern, NaN payloads among the floats.
    for type in uint8 int16 float16 float32 int64; do
        /usr/bin/python3 -c "
import random, sys
size = {'uint8': 1, 'int16': 2, 'float16': 2, 'float32': 4, 'int64': 8}['$type']
random.seed(size)
sys.stdout.buffer.write(bytes(random.randrange(256) for _ in range(7 * 5 * 3 * size)))" >"v_7x5x3_$type.raw"
    done
}

raw() { vkt write "${1:--}" - --format raw; }

# same_as_numpy IN BITS BY RULE: with numpy's names of rules.
same_as_numpy() {
    /usr/bin/python3 - "$@" <<'EOF'
import numpy as np, sys
name, bits, by, rule = sys.argv[1:]
a = np.fromfile(name, f"uint{bits}").reshape(3, 5, 7)
x, y, z = ([int(n or 0) for n in part.split(":")] for part in by.split(","))
mode = {"border": "constant", "clamp": "edge", "mirror": "symmetric", "wrap": "wrap"}[rule]
# numpy folds paddings beyond the extent differently from version to version: by hand then.
if mode != "constant":
    def fold(i, n):
        if rule == "clamp": return min(max(i, 0), n - 1)
        if rule == "wrap": return i % n
        i %= 2 * n
        return i if i < n else 2 * n - 1 - i
    index = [[fold(i, n) for i in range(-below, n + above)] for n, (below, above) in zip(a.shape, (z, y, x))]
    want = a[np.ix_(*index)]
    if all(below <= n and above <= n for n, (below, above) in zip(a.shape, (z, y, x))):
        assert np.array_equal(want, np.pad(a, (z, y, x), mode=mode))
else:
    want = np.pad(a, (z, y, x), mode=mode)
want.tofile("want.raw")
EOF
    cmp out.raw want.raw
}

@test "every rule agrees with numpy, for every size of voxels, also beyond the extent" {
    for type in uint8:8 int16:16 float16:16 float32:32 int64:64; do
        for rule in border clamp mirror wrap; do
            for by in 2:3,1:0,0:2 0:0,0:0,3:1 20:17,11:30,9:8; do
                vkt pad "v_7x5x3_${type%:*}.raw" --by $by --boundary $rule --format raw -o out.raw --force
                same_as_numpy "v_7x5x3_${type%:*}.raw" "${type#*:}" $by $rule
            done
        done
    done
}

@test "slab heights, threads, pipes and a small budget make no difference" {
    for rule in border:7 clamp mirror wrap; do
        vkt pad v_7x5x3_uint8.raw --by 2:3,4:5,6:7 --boundary $rule | raw >want.raw
        for options in '--slab 1' '--slab 3' '--slab 7' '--threads 1' '--threads 5' '--memory 100k'; do
            # shellcheck disable=SC2086
            vkt pad v_7x5x3_uint8.raw --by 2:3,4:5,6:7 --boundary $rule $options | raw | cmp - want.raw
            # shellcheck disable=SC2086
            vkt read v_7x5x3_uint8.raw --slab 2 | vkt pad --by 2:3,4:5,6:7 --boundary $rule $options 2>/dev/null | raw | cmp - want.raw
        done
    done
}

@test "voxels keep their world positions" {
    vkt set v_7x5x3_uint8.raw --spacing 0.5,1,2 --origin 10,20,30 --direction 0,1,0,-1,0,0,0,0,1 -o s.nrrd
    vkt pad s.nrrd --by 2:3,4:5,6:7 -o p.nrrd
    vkt info p.nrrd | grep -x 'origin     14 19 18'
    vkt crop p.nrrd --roi 2:9,4:9,6:9 | vkt diff - s.nrrd --geometry
}

@test "the value is physical, exact for 64-bit integers, and what does not fit is said" {
    vkt set v_7x5x3_uint8.raw --slope 2 --intercept -10 -o mapped.nrrd
    vkt pad mapped.nrrd --by 1:0,0:0,0:0 --value 31 | raw | od -An -tu1 -N1 | grep -wq 20   # 20.5
    vkt pad v_7x5x3_int64.raw --by 1:0,0:0,0:0 --value 9007199254740993 | raw | od -An -td8 -N8 | grep -wq 9007199254740993
    run --separate-stderr bash -c 'vkt pad v_7x5x3_uint8.raw --by 1:0,0:0,0:0 --value 300 | vkt write - --format raw | od -An -tu1 -N1'
    [ "${output// /}" = 255 ]
    [[ "$stderr" == *"the value 300 does not fit uint8: stored as 255 in 15 voxels"* ]]
    fails_with 3 'does not fit' vkt pad v_7x5x3_uint8.raw --by 1 --value 300 --strict -o x.nrrd
    [ ! -e x.nrrd ]
}

@test "one number, one per axis, single voxels, nothing to add" {
    [ "$(vkt pad v_7x5x3_uint8.raw --by 4 | vkt info | grep ^dims)" = "$(vkt pad v_7x5x3_uint8.raw --by 4:4,4:4,4:4 | vkt info | grep ^dims)" ]
    vkt pad v_7x5x3_uint8.raw --by 1,2,3 | raw >a.raw
    vkt pad v_7x5x3_uint8.raw --by 1:1,2:2,3:3 | raw | cmp - a.raw
    vkt pad v_7x5x3_uint8.raw --by 1:,:2,: | raw >a.raw
    vkt pad v_7x5x3_uint8.raw --by 1:0,0:2,0:0 | raw | cmp - a.raw
    vkt pad v_7x5x3_uint8.raw --by 0 | vkt diff - v_7x5x3_uint8.raw --geometry
    for rule in clamp mirror wrap; do
        vkt make constant --dims 1 1 1 --dtype uint8 --value 3 | vkt pad --by 2:9,1:1,3:0 --boundary $rule | raw | tr -d '\003' | cmp - /dev/null
    done
}

@test "what cannot be is refused" {
    fails_with 2 'by' vkt pad v_7x5x3_uint8.raw -o x.nrrd
    fails_with 2 'not X0:X1' vkt pad v_7x5x3_uint8.raw --by 1:2,3:4 -o x.nrrd
    fails_with 2 'not a number of voxels' vkt pad v_7x5x3_uint8.raw --by=-1:2,3:4,0:0 -o x.nrrd
    fails_with 2 'voxels along an axis' vkt pad v_7x5x3_uint8.raw --by 1099511627776:0,0:0,0:0 -o x.nrrd
    fails_with 2 'for --boundary border' vkt pad v_7x5x3_uint8.raw --by 1 --boundary clamp --value 3 -o x.nrrd
    fails_with 2 'give one of them' vkt pad v_7x5x3_uint8.raw --by 1 --boundary border:2 --value 3 -o x.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical' vkt pad t.vkt --by 1 -o x.vkt
    [ ! -e x.nrrd ] && [ ! -e x.vkt ]
}
