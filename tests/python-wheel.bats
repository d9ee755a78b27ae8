# The wheel: what it holds, that it works where it is put, and that it needs only what a system has.
load helper

setup_file() {
    [ -e "${VKT_BUILD:-}/python/vkt/_vkt.so" ] || return 0
    cmake --install "$VKT_BUILD" --component wheel --prefix "$BATS_FILE_TMPDIR/first" >"$BATS_FILE_TMPDIR/log"
    mv "$BATS_FILE_TMPDIR/first" "$BATS_FILE_TMPDIR/moved here"
}

setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    [ -e "$VKT_BUILD/python/vkt/_vkt.so" ] || skip "this build has no Python package; configure says why"
    python_with numpy
    site="$BATS_FILE_TMPDIR/moved here"
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
}

# Nothing outside of the package but libraries of the system; no run path but relative ones.
self_contained() {
    find "$1" -name '*.so*' -o -name vkt_parser >libraries
    [ "$(wc -l <libraries)" -ge 2 ]
    while IFS= read -r library; do
        run -0 readelf -d "$library"
        ! grep -E 'R(UN)?PATH' <<<"$output" | grep -vE '\[(\$ORIGIN(/[a-z./]*)?:?)+\]' || { echo "$library: $output" >&2; return 1; }
        run -0 ldd "$library"
        [[ "$output" != *"not found"* ]] || { echo "$library: $output" >&2; return 1; }
        # Whatever is found lies in the package or where the system's loader looks.
        sed -n 's/^.* => \(.*\) (0x[0-9a-f]*)$/\1/p' <<<"$output" | while IFS= read -r needed; do
            case $needed in
            "$1"/* | /lib/* | /lib64/* | /usr/lib/*) ;;
            *) [[ "$(realpath "$needed")" == "$(realpath "$1")"/* ]] || { echo "$library needs $needed" >&2; exit 1; } ;;
            esac
        done || return 1
    done <libraries
}

@test "the package with its library inside works where it was put, with nothing else" {
    [ "$(ls "$site")" = vkt ]
    [ -e "$site/vkt/__init__.pyi" ]
    [ -e "$site/vkt/py.typed" ]
    env -i PATH=/usr/bin PYTHONPATH="$site" /usr/bin/python3 -W error - <<'EOF2'
import vkt, os
v = vkt.read("volume.nrrd")
assert vkt.flip(vkt.flip(v, "x"), "x").array.tobytes() == v.array.tobytes()
for line in open("/proc/self/maps"):
    if "libvkt" in line or "_vkt" in line:
        assert os.path.dirname(vkt.__file__) in line, line
EOF2
}

@test "modules of formats are in it" {
    [ -e "$site/vkt/lib/vkt/vkt_hdf5.so" ] || skip "this build has no HDF5 module"
    env -i PATH=/usr/bin PYTHONPATH="$site" /usr/bin/python3 -W error - <<'EOF2'
import vkt
v = vkt.read("volume.nrrd")
v.write("volume.h5")
assert vkt.read("volume.h5").array.tobytes() == v.array.tobytes()
EOF2
}

@test "its libraries need only what is inside and what the system has" {
    self_contained "$site"
}

@test "pip makes and installs it, without a network (VKT_LONG=1)" {
    [ "${VKT_LONG:-}" = 1 ] || skip "compiles everything again: VKT_LONG=1"
    with_peer scikit_build_core
    PIP_NO_INDEX=1 /usr/bin/python3 -m pip install --quiet --no-build-isolation --no-deps --target installed \
        --config-settings=build-dir="$BATS_TEST_TMPDIR/build" "$VKT_ROOT/libvkt/python"
    [ -d installed/vkt-*.dist-info ]
    self_contained installed
    env -i PATH=/usr/bin PYTHONPATH="$PWD/installed" /usr/bin/python3 -W error -c '
import importlib.metadata, vkt
assert importlib.metadata.version("vkt") == vkt.__version__
assert vkt.read("volume.nrrd").stats()["count"] > 0'
}
