# Common to the tests of the Python package: the package of the build folder, and volume.nrrd.
setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    [ -e "$VKT_BUILD/python/vkt/_vkt.so" ] || skip "this build has no Python package; configure says why"
    python_with numpy
    site=$VKT_BUILD/python
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
}

# Runs standard input with the package; vkt, numpy as np and `volume` are there already.
python() {
    { echo 'import warnings, numpy as np, vkt; volume = vkt.read("volume.nrrd")' && cat; } |
        PYTHONPATH="$site${PYTHONPATH:+:$PYTHONPATH}" timeout 120 /usr/bin/python3 -W error -
}
