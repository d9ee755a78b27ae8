# vkt merge: any order of any bricks is what SimpleITK pastes together; what does not fit leaves no file.
load helper

setup_more() {
    vkt make noise --dims 23 17 11 --dtype int16 --spacing 0.5,2,3 --origin -1,2,1e4 -o v.mha
    vkt brick v.mha --size 8,9,4 --ghost 2,0,1 -o 'b%02d.mha'
    bricks=(b*.mha)
}

@test "bricks without their ghosts, pasted by SimpleITK, are the volume that merge makes of them in any order" {
    python_with SimpleITK numpy
    vkt merge 'b*.mha' -o again.mha
    # shellcheck disable=SC2046
    vkt merge $(printf '%s\n' "${bricks[@]}" | sort -r) --no-history | cmp - <(vkt merge 'b*.mha' --no-history)
    # shellcheck disable=SC2046
    vkt merge $(printf '%s\n' "${bricks[@]}" | shuf --random-source=v.mha) | vkt diff - v.mha --geometry
    /usr/bin/python3 - <<'END'
import glob, SimpleITK as itk, numpy as np
v, again = itk.ReadImage("v.mha"), itk.ReadImage("again.mha")
pasted = itk.Image(v.GetSize(), v.GetPixelID())
for name in sorted(glob.glob("b*.mha")):
    brick = itk.ReadImage(name)
    at = np.rint(v.TransformPhysicalPointToContinuousIndex(brick.GetOrigin())).astype(int)
    pasted = itk.Paste(pasted, brick, brick.GetSize(), destinationIndex=[int(i) for i in at])
assert (itk.GetArrayFromImage(pasted) == itk.GetArrayFromImage(again)).all()
assert (again.GetSpacing(), again.GetOrigin(), again.GetDirection()) == (v.GetSpacing(), v.GetOrigin(), v.GetDirection())
END
}

@test "bricks that were worked on, in shared memory, in a stream, in other formats, by any slabs and threads" {
    for brick in "${bricks[@]}"; do vkt arith mul "$brick" 2 --dtype int32 -o "m${brick%.mha}.nrrd"; done
    vkt arith mul v.mha 2 --dtype int32 -o want.mha
    for options in '--slab 1 --threads 7' '--slab 5 --threads 1' '--memory 300k'; do
        # shellcheck disable=SC2086
        vkt merge 'mb*.nrrd' $options | vkt diff - want.mha --geometry
    done
    vkt brick v.mha --size 8 | vkt arith mul - 2 --dtype int32 | vkt merge | vkt diff - want.mha --geometry
    vkt brick v.mha --size 8 --transport shm | vkt merge --transport shm | vkt diff - v.mha --geometry
}

@test "missing, twice, cut, turned, moved, of another type: refused with the brick's name, and no file appears" {
    mkdir lost
    mv b03.mha lost
    fails_with 3 'missing' vkt merge 'b*.mha' -o out.mha
    cp lost/b03.mha b03.mha
    cp b03.mha b99.mha
    fails_with 3 'overlap' vkt merge 'b*.mha' -o out.mha
    rm b99.mha
    head -c -1 lost/b03.mha >b03.mha
    fails_with 3 'b03.mha' vkt merge 'b*.mha' -o out.mha
    for change in 'flip x' 'convert --dtype float32' 'set --origin 0,0,0' 'crop --roi 1:,:,:' 'set --spacing 1' \
        'set --slope 2' 'set --attribute brick-core=0:1,0:1,0:1' 'set --attribute brick-whole='; do
        # shellcheck disable=SC2086
        vkt $change lost/b03.mha -o b03.mha --force 2>/dev/null || vkt pipe "read lost/b03.mha | $change | write b03.mha --force"
        fails_with 3 'b03.mha' vkt merge 'b*.mha' -o out.mha
    done
    [ ! -e out.mha ]
    [ -z "$(find . -name '.*.vkt-*')" ]
}
