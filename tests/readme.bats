# The README tells the truth: its pipelines run, its table has every command, its files exist.
load helper

@test "the pipelines of the README run" {
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
    sed -n '/^## Pipelines/,/^## Commands/p' "$VKT_ROOT/README.md" | grep '^vkt ' >lines
    [ "$(wc -l <lines)" -eq 9 ]
    while IFS= read -r line; do
        bash -c "$line" >out 2>err </dev/null || { echo "$line: $(cat err)" >&2; false; }
    done <lines
    for file in volume.png small.mha half.nrrd tree.png grid.nrrd; do [ -s "$file" ]; done
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
