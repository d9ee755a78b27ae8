# vkt-migration(7): every line of every table runs and makes what the other tool makes; NumPy and SciPy stand in for those
# that are not installed.
load helper

setup_more() {
    python_with numpy scipy nibabel tifffile
    # Debian calls it teem-unu.
    if ! command -v unu >/dev/null && command -v teem-unu >/dev/null; then
        mkdir bin
        ln -s "$(command -v teem-unu)" bin/unu
        PATH="$PWD/bin:$PATH"
    fi
    export PATH MRTRIX_QUIET=1
}

@test "every line of the page runs, and makes what is expected" {
    for tool in unu mrconvert; do
        command -v $tool >/dev/null || echo "# $tool is not installed: NumPy judges alone" >&3
    done
    /usr/bin/python3 "$VKT_ROOT/tests/migration/judge.py" "$VKT_ROOT/man/vkt-migration.7" >said 2>wrong || { cat said wrong >&2; false; }
    [ "$(wc -l <said)" -eq 7 ]
    [ "$(sed -n "s/.*: \([0-9]*\) lines,.*/\1/p" said | paste -sd+ | bc)" -ge 100 ]
}

@test "a line that rots is found" {
    sed 's/--roi 2:10,3:13,1:8/--roi 2:9,3:13,1:8/; s/^\.Li vkt project max in\.nrrd/& --axis q/' "$VKT_ROOT/man/vkt-migration.7" >page
    run ! /usr/bin/python3 "$VKT_ROOT/tests/migration/judge.py" page
    [[ "$output" == *'--roi 2:9,3:13,1:8'* && "$output" == *'--axis q'* ]]
    # An item without its counterpart.
    sed '0,/^\.Li vkt crop/{/^\.Li vkt crop/d}' "$VKT_ROOT/man/vkt-migration.7" >page
    run ! /usr/bin/python3 "$VKT_ROOT/tests/migration/judge.py" page
}
