# The gallery: its commands make the pictures that it shows. And the array job for Slurm, run as Slurm runs it.
load helper

@test "the gallery's script makes its page and its pictures, small and not empty" {
    sh "$VKT_ROOT/examples/gallery/make.sh" out 2>said
    diff out/README.md "$VKT_ROOT/examples/gallery/README.md"
    [ "$(grep -c '^## ' out/README.md)" -ge 12 ]
    grep -o '([a-z-]*\.png)' out/README.md | tr -d '()' | sort >shown
    (cd "$VKT_ROOT/examples/gallery" && ls ./*.png | sed 's,^\./,,') | sort | diff shown -
    (cd "$VKT_ROOT/examples/gallery" && [ "$(cat ./*.png | wc -c)" -lt 400000 ])
    python_with vtk numpy
    /usr/bin/python3 - "$VKT_ROOT/examples/gallery" <<'END'
import sys
import numpy as np, vtk
from vtk.util.numpy_support import vtk_to_numpy
def pixels(name):
    reader = vtk.vtkPNGReader(); reader.SetFileName(name); reader.Update()
    image = reader.GetOutput()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[1::-1] + (-1,)).astype(float)
for name in open("shown").read().split():
    made, kept = pixels("out/" + name), pixels(f"{sys.argv[1]}/{name}")
    # Rounding differs between instruction sets.
    assert made.shape == kept.shape and np.sqrt(np.mean((made - kept) ** 2)) < 0.7, name
    assert np.ptp(made) > 60 and made.std() > 10, name
END
}

@test "a command of the gallery that fails is an error, and writes nothing" {
    mkdir -p tree/examples/gallery
    cp -r "$VKT_ROOT/examples/data" tree/examples
    sed 's/vkt slice -o window.png/vkt slice --axis q -o window.png/' "$VKT_ROOT/examples/gallery/make.sh" >tree/examples/gallery/make.sh
    run sh tree/examples/gallery/make.sh out
    [ "$status" -eq 1 ]
    [[ "$output" == *'window: the command fails'* ]]
    [ -z "$(ls out)" ]
}

@test "the array job: its tasks share the volumes out, each once, and do what is left when run again" {
    mkdir in
    for i in 0 1 2 3 4 5 6; do vkt make noise --dims 9 8 7 --dtype uint8 --seed $i -o in/v$i.nrrd; done
    grep -q '^#SBATCH --array=' "$VKT_ROOT/examples/slurm/filter-array.sh"
    export SLURM_ARRAY_TASK_MIN=2 SLURM_ARRAY_TASK_COUNT=3 SLURM_CPUS_PER_TASK=1
    for task in 2 3 4; do
        SLURM_ARRAY_TASK_ID=$task sh "$VKT_ROOT/examples/slurm/filter-array.sh" in out
        ls out | wc -l >>counts
    done
    [ "$(tr '\n' ' ' <counts)" = '3 5 7 ' ]
    for i in 0 6; do vkt filter median in/v$i.nrrd --radius 1 | vkt filter gaussian --sigma 1 | vkt diff - out/v$i.nrrd; done
    rm out/v3.nrrd
    touch -d '2001-01-01' out/*.nrrd
    SLURM_ARRAY_TASK_ID=2 sh "$VKT_ROOT/examples/slurm/filter-array.sh" in out
    [ -e out/v3.nrrd ]
    [ "$(find out -name '*.nrrd' -newermt 2002-01-01 | wc -l)" -eq 1 ]
    # A volume that cannot be read: the others are done, the task fails.
    rm -r out
    head -c 100 in/v0.nrrd >in/broken.nrrd
    export SLURM_ARRAY_TASK_ID=0 SLURM_ARRAY_TASK_MIN=0 SLURM_ARRAY_TASK_COUNT=1
    run sh "$VKT_ROOT/examples/slurm/filter-array.sh" in out
    [ "$status" -eq 1 ]
    [ "$(ls out | wc -l)" -eq 7 ]
    [ ! -e out/broken.nrrd ]
    mkdir empty
    run sh "$VKT_ROOT/examples/slurm/filter-array.sh" empty out
    [ "$status" -eq 1 ]
    # Without Slurm: all of them.
    unset SLURM_ARRAY_TASK_ID SLURM_ARRAY_TASK_MIN SLURM_ARRAY_TASK_COUNT
    rm in/broken.nrrd
    sh "$VKT_ROOT/examples/slurm/filter-array.sh" in again
    [ "$(ls again | wc -l)" -eq 7 ]
}
