# vkt copy: a volume pasted into another, by index and by place in the world.
load helper

setup_more() {
    python_with numpy
    vkt make noise --dims 11 7 5 --dtype uint8 --high 255 --seed 1 -o into.nrrd
    vkt make noise --dims 4 3 2 --dtype uint8 --high 255 --seed 2 -o part.nrrd
}

raw() { vkt write "${1:--}" - --format raw; }

@test "the part stands where --at says, all else stays" {
    raw into.nrrd >into.raw
    raw part.nrrd >part.raw
    for at in 0,0,0 7,4,3 5,2,1; do
        vkt copy part.nrrd into.nrrd --at $at | raw >out.raw
        /usr/bin/python3 -c "
import numpy as np
a = np.fromfile('into.raw', np.uint8).reshape(5, 7, 11)
p = np.fromfile('part.raw', np.uint8).reshape(2, 3, 4)
x, y, z = $at
a[z:z+2, y:y+3, x:x+4] = p
assert a.tobytes() == open('out.raw', 'rb').read()"
        vkt read into.nrrd --slab 2 | vkt copy part.nrrd --at $at | raw | cmp - out.raw
        vkt read part.nrrd | vkt copy - into.nrrd --at $at | raw | cmp - out.raw
        for options in '--slab 1' '--slab 3' '--slab 7' '--threads 1' '--threads 5' '--memory 100k'; do
            # shellcheck disable=SC2086
            vkt copy <(vkt read part.nrrd --slab 1) <(vkt read into.nrrd) --at $at $options | raw | cmp - out.raw
        done
    done
    vkt copy into.nrrd into.nrrd --at 0,0,0 | vkt diff - into.nrrd --geometry
}

@test "bytes are moved, for every type" {
    for type in uint8:1 int16:2 float16:2 float32:4 int64:8; do
        size=${type#*:}
        head -c $((24 * size)) /dev/urandom >p_4x3x2_${type%:*}.raw
        head -c $((385 * size)) /dev/urandom >i_11x7x5_${type%:*}.raw
        vkt copy p_4x3x2_${type%:*}.raw i_11x7x5_${type%:*}.raw --at 6,1,2 -o o.vkt --force
        vkt crop o.vkt --roi 6:10,1:4,2:4 | raw | cmp - p_4x3x2_${type%:*}.raw
        vkt copy <(vkt crop i_11x7x5_${type%:*}.raw --roi 6:10,1:4,2:4) o.vkt --at 6,1,2 | raw | cmp - i_11x7x5_${type%:*}.raw
    done
}

@test "without --at the part goes where it lies in the world" {
    vkt set into.nrrd --spacing 0.5,1,2 --origin 10,20,30 --direction 0,1,0,-1,0,0,0,0,1 -o s.nrrd
    vkt crop s.nrrd --roi 3:7,2:6,1:4 -o p.nrrd
    vkt fill s.nrrd --value 0 | vkt copy p.nrrd -o back.nrrd
    vkt crop back.nrrd --roi 3:7,2:6,1:4 | vkt diff - p.nrrd --geometry
    vkt copy p.nrrd s.nrrd | vkt diff - s.nrrd --geometry
    vkt set p.nrrd --origin 10.1,20,30 -o aside.nrrd
    fails_with 2 'does not lie on the voxels' vkt copy aside.nrrd s.nrrd -o x.nrrd
    vkt set p.nrrd --spacing 1,1,2 -o coarse.nrrd
    fails_with 2 'does not lie on the voxels' vkt copy coarse.nrrd s.nrrd -o x.nrrd
    [ ! -e x.nrrd ]
}

@test "values are converted: types rounded and saturated, value maps by physical values" {
    vkt make ramp --dims 4 1 1 --dtype float32 --from -1.5 --to 299.5 -o f.nrrd
    vkt fill into.nrrd --value 0 -o zero.nrrd
    run --separate-stderr bash -c 'vkt copy f.nrrd zero.nrrd --at 0,0,0 | vkt write - --format raw | od -An -tu1 -N4'
    [ "$(echo $output)" = "0 99 199 255" ]
    [[ "$stderr" == *"2 of 4 voxels (50.00 %) clipped to [0,255]"* ]]
    vkt set zero.nrrd --slope 0.5 --intercept -10 -o mapped.nrrd
    vkt copy f.nrrd mapped.nrrd --at 0,0,0 2>/dev/null | raw | od -An -tu1 -N2 >got
    [ "$(echo $(cat got))" = "17 218" ] # (-1.5 + 10) / 0.5, and (98.8333 + 10) / 0.5
}

@test "what cannot be is refused" {
    fails_with 2 'does not lie in the volume' vkt copy part.nrrd into.nrrd --at 8,0,0 -o x.nrrd
    fails_with 2 'does not lie in the volume' vkt copy part.nrrd into.nrrd --at=-1,0,0 -o x.nrrd
    fails_with 2 'does not lie in the volume' vkt copy into.nrrd part.nrrd --at 0,0,0 -o x.nrrd
    fails_with 2 'PART' vkt copy -o x.nrrd
    fails_with 2 'only once' vkt copy - - -o x.nrrd
    vkt make amr --blocks 20 --levels 2 -o t.vkt
    fails_with 2 'hierarchical' vkt copy part.nrrd t.vkt --at 0,0,0 -o x.vkt
    fails_with 2 'hierarchical' vkt copy t.vkt into.nrrd --at 0,0,0 -o x.vkt
    [ ! -e x.nrrd ] && [ ! -e x.vkt ]
}
