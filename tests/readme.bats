# The README tells the truth: its pipelines run, its table has every command, its files exist.
load helper

@test "the pipelines of the README run" {
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
    sed -n '/^## Pipelines/,/^## Examples/p' "$VKT_ROOT/README.md" | grep '^vkt ' >lines
    [ "$(wc -l <lines)" -eq 18 ]
    [ "$(grep -c -e --window lines)" -eq 1 ] # which needs a display; viewer.bats has one
    sed -i '/--window/d' lines
    while IFS= read -r line; do
        bash -c "$line" >out 2>err </dev/null || { echo "$line: $(cat err)" >&2; false; }
    done <lines
    for file in volume.png lit.png small.mha half.nrrd tree.png grid.nrrd chart.svg smaller.nrrd turned.nrrd slim.vkt; do [ -s "$file" ]; done
    [ ! -e out.nrrd ] # only planned
}

@test "the table of the README has every command" {
    sed -n '/^## Commands/,/^## Building/p' "$VKT_ROOT/README.md" | grep '^| `' | cut -d'|' -f2 | grep -oE '[a-z][a-z-]*( [a-z]+)?' |
        sort -u >table
    vkt help --list >verbs
    while read -r verb; do
        grep -qx -e "$verb" -e "${verb%% *}" table || { echo "the README lacks $verb" >&2; false; }
    done <verbs
    while read -r name; do
        grep -qE "^$name( |$)" verbs || { echo "the README names $name, which is no command" >&2; false; }
    done <table
}

@test "files that the README names exist" {
    for path in $(grep -oE '(libvkt|ipc|shell|commands|man|tests|examples)/[a-zA-Z0-9_./-]*[a-zA-Z0-9]' "$VKT_ROOT/README.md" | sort -u); do
        [ -e "$VKT_ROOT/$path" ] || { echo "$path" >&2; false; }
    done
}

@test "the formats of the README are those that are known" {
    sed -n '/^## Formats/,/^## /p' "$VKT_ROOT/README.md" | grep '^| ' | tail -n +2 | grep -v '^| ---' >table
    names() { awk -F'|' -v column="$1" '$column ~ /yes/ { print $3 }' table | grep -oE '`[a-z0-9]+`' | tr -d '`' | sort; }
    names 5 | diff <(vkt completion --words read --format '' | sort) -
    names 6 | diff <(vkt completion --words write --format '' | sort) -
}

@test "the picture of the README is what its quickstart draws" {
    python_with vtk numpy
    grep -q '^!\[.*\](examples/quickstart.png)$' "$VKT_ROOT/README.md"
    # The command as it stands in the script.
    root=$VKT_ROOT
    sed -n '/vkt read /,/quickstart.png$/p' "$VKT_ROOT/examples/quickstart.sh" >line
    grep -q render line
    eval "$(cat line)"
    /usr/bin/python3 - "$VKT_ROOT/examples/quickstart.png" <<'END'
import sys
import numpy as np, vtk
from vtk.util.numpy_support import vtk_to_numpy
def pixels(name):
    reader = vtk.vtkPNGReader(); reader.SetFileName(name); reader.Update()
    image = reader.GetOutput()
    return image.GetDimensions(), vtk_to_numpy(image.GetPointData().GetScalars()).astype(int)
(size, a), (other, b) = pixels("quickstart.png"), pixels(sys.argv[1])
assert size == other and np.abs(a - b).max() <= 1, (size, other, np.abs(a - b).max())
END
    diff <(vkt history quickstart.png) <(vkt history "$VKT_ROOT/examples/quickstart.png")
}
