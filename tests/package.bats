# Packages: Debian's, checked by lintian, unpacked anywhere and run; the archive of the source; recipes.
load helper

setup_file() {
    [ -n "${VKT_BUILD:-}" ] && command -v cpack dpkg-deb dpkg-shlibdeps >/dev/null || return 0
    # What is built is packed, and nothing is compiled.
    (cd "$VKT_BUILD" && cpack -G DEB -B "$BATS_FILE_TMPDIR/debs") >"$BATS_FILE_TMPDIR/log" 2>&1 || return 0
    dpkg -x "$BATS_FILE_TMPDIR"/debs/vkt_*.deb "$BATS_FILE_TMPDIR/un packed"
}

# needs PROGRAM…: skips, saying so.
needs() {
    local program
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    for program in "$@"; do command -v "$program" >/dev/null || skip "$program is not installed"; done
}

setup_more() {
    debs="$BATS_FILE_TMPDIR/debs"
    root="$BATS_FILE_TMPDIR/un packed"
}

@test "cpack makes the packages, without compiling" {
    needs cpack dpkg-deb dpkg-shlibdeps
    ls "$debs"/vkt_*.deb "$debs"/libvkt-dev_*.deb || { cat "$BATS_FILE_TMPDIR/log" >&2; false; }
    run ! grep -E 'Building CXX|Compiling' "$BATS_FILE_TMPDIR/log"
    version=$(vkt --version | sed -n '1s/vkt //p')
    [ "$(dpkg-deb -f "$debs"/vkt_*.deb Version)" = "$version-1" ]
    # The command needs what it links to; modules recommend.
    dpkg-deb -f "$debs"/vkt_*.deb Depends >needed
    grep -q 'libc6' needed
    grep -q 'libpng16' needed
    run ! grep -E 'openvdb|hdf5|libgdcm|libtiff|glfw|, ,' needed
    for module in $(vkt --version | sed -n 's/^modules: *//p'); do
        [ -e "$root"/usr/lib*/vkt/vkt_"$module".so ]
        case $module in hdf5 | openvdb | tiff | gdcm | blosc | openexr | freetype)
            dpkg-deb -f "$debs"/vkt_*.deb Recommends | grep -q "lib$module" ;;
        esac
    done
    dpkg-deb -f "$debs"/libvkt-dev_*.deb Depends | grep -qF "vkt (= $version-1)"
    dpkg-deb -c "$debs"/libvkt-dev_*.deb >files
    grep -q 'usr/include/libvkt/core/volume.h' files
    grep -q 'cmake/vkt/vktConfig.cmake' files
    grep -q 'libvkt.so ->' files
    run ! grep -q 'usr/bin' files
}

@test "lintian finds nothing but what overrides say and explain" {
    needs cpack dpkg-deb dpkg-shlibdeps lintian
    # Each override hides something that is there.
    lintian --allow-root --show-overrides "$debs"/*.deb >said 2>&1 || true # it counts what is overridden, too
    [ -s said ]
    run ! grep -E '^[EW]: ' said
    # Each line of an override stands below one that says why.
    for file in "$VKT_ROOT"/libvkt/cmake/debian/*.lintian-overrides; do
        awk '/^#/ { why = 1; next } !why { exit 1 } { why = 0 }' "$file"
        while read -r _ tag _; do grep -qF "O: $(basename "$file" .lintian-overrides): $tag" said || { echo "$file: $tag" >&2; false; }; done < <(grep -v '^#' "$file")
    done
}

@test "unpacked into any folder it runs, with its modules, pages and completion" {
    needs cpack dpkg-deb dpkg-shlibdeps
    vkt make noise --dims 9 8 7 --dtype uint8 -o v.nrrd
    PATH="$root/usr/bin:/usr/bin:/bin"
    hash -r
    [ "$(command -v vkt)" = "$root/usr/bin/vkt" ]
    vkt stats v.nrrd >said
    loaded=$(ldd "$root/usr/bin/vkt" | sed -n 's/.*libvkt[^=]*=> \(.*\) (0x.*/\1/p')
    [[ "$(readlink -f "$loaded")" == "$(readlink -f "$root")/usr/lib"* ]]
    run ! bash -c "vkt --version | grep '^missing'"
    for module in $(vkt --version | sed -n 's/^modules: *//p'); do
        case $module in
        tiff) vkt write v.nrrd v.tif; vkt diff v.tif v.nrrd ;;
        hdf5) vkt write v.nrrd v.h5; vkt diff v.h5 v.nrrd ;;
        openvdb) vkt write v.nrrd v.vdb; vkt info v.vdb ;;
        blosc) vkt write v.nrrd v.zarr --codec blosc; vkt diff v.zarr v.nrrd ;;
        esac
    done
    gzip -dc "$root/usr/share/man/man1/vkt-crop.1.gz" | diff - "$VKT_ROOT/man/vkt-crop.1"
    [ -z "$(find "$root/usr/share/man" -type f ! -name '*.gz')" ]
    for file in bash-completion/completions/vkt zsh/vendor-completions/_vkt fish/vendor_completions.d/vkt.fish \
        doc/vkt/copyright doc/vkt/changelog.Debian.gz vkt/examples/data/phantom.nrrd; do
        [ -s "$root/usr/share/$file" ] || [ -s "$root/usr/share/${file/examples\//}" ] || { echo "$file" >&2; false; }
    done
    gzip -dc "$root/usr/share/doc/vkt/changelog.Debian.gz" | head -n 1 | grep -q "^vkt ($(vkt --version | sed -n '1s/vkt //p')-1) "
    # Nothing in it names where it was built.
    run ! grep -rlF -e "$VKT_ROOT/" -e "$VKT_BUILD" -e "$BATS_FILE_TMPDIR" "$root"
}

@test "a package whose recommended libraries are absent says what is missing" {
    needs cpack dpkg-deb dpkg-shlibdeps
    vkt make noise --dims 9 8 7 --dtype uint8 -o v.nrrd
    [ -e "$root"/usr/lib*/vkt/vkt_tiff.so ] || skip "this build is without TIFF"
    cp -r "$root" less
    rm less/usr/lib*/vkt/vkt_tiff.so
    less/usr/bin/vkt --version | grep -qx 'missing:  tiff'
    fails_with 1 'writing TIFF' less/usr/bin/vkt write v.nrrd v.tif
    less/usr/bin/vkt write v.nrrd v.mha
}

@test "the Python package finds the library of the command" {
    needs cpack dpkg-deb dpkg-shlibdeps
    python_with numpy
    [ -e "$debs"/python3-vkt_*.deb ] || skip "this build is without Python"
    dpkg -x "$debs"/python3-vkt_*.deb "$root"
    cd /
    PYTHONPATH="$root/usr/lib/python3/dist-packages" /usr/bin/python3 -c '
import vkt, numpy as np
v = vkt.Volume(np.arange(24, dtype="u1").reshape(2, 3, 4))
assert (v.apply("flip", axis="x").array == v.array[:, :, ::-1]).all()'
}

@test "the archive of the source has what git has, and builds without git" {
    needs git
    git -C "$VKT_ROOT" rev-parse HEAD >/dev/null 2>&1 || skip "this is no checkout of git"
    cmake --build "$VKT_BUILD" --target source_archive >log 2>&1 || { cat log >&2; false; }
    archive=$(ls "$VKT_BUILD"/packages/vkt-*.tar.gz)
    tar -xf "$archive"
    folder=$(ls -d vkt-*)
    (cd "$folder" && find . -type f -o -type l | sed 's,^\./,,' | sort) >got
    git -C "$VKT_ROOT" ls-tree -r --name-only HEAD | sort | diff - got
    [ ! -e "$folder/.git" ]
    # Configured where there is no git; every source that is named is there.
    mkdir bin
    for program in /usr/bin/* /bin/*; do
        case ${program##*/} in git | git-*) ;; *) [ -e "bin/${program##*/}" ] || ln -s "$program" bin ;; esac
    done
    PATH="$PWD/bin" cmake -S "$folder" -B built -G Ninja -DVKT_TESTS=OFF -DVKT_UNITE=OFF >log 2>&1 || { tail -n 20 log >&2; false; }
    PATH="$PWD/bin" ninja -C built -t commands vkt | grep -oE -- ' -c [^ ]+' | cut -c5- | sort -u >sources
    [ "$(wc -l <sources)" -gt 200 ]
    while read -r source; do [ -e "built/$source" ] || [ -e "$source" ] || { echo "$source" >&2; false; }; done <sources
    PATH="$PWD/bin" ninja -C built libvkt/CMakeFiles/vkt.dir/core/roi.cpp.o >log 2>&1 || { tail -n 20 log >&2; false; }
    [ -e built/libvkt/CMakeFiles/vkt.dir/core/roi.cpp.o ]
}

@test "recipes name options, packages and files that there are" {
    recipe="$VKT_ROOT/libvkt/cmake/spack/packages/vkt/package.py"
    /usr/bin/python3 -m py_compile "$recipe"
    rm -rf "${recipe%/*}/__pycache__"
    for part in $(sed -n 's/^ *parts = (\(.*\))/\1/p' "$recipe" | tr -d '",'); do
        grep -qi "^option(VKT_$part " "$VKT_ROOT/CMakeLists.txt" || { echo "$part" >&2; false; }
        grep -q "variant(\"$part\"" "$recipe"
    done
    grep -q "version(\"$(vkt --version | sed -n '1s/vkt //p')\"" "$recipe"
    file="$VKT_ROOT/libvkt/cmake/Containerfile"
    for group in $(sed -n 's/.*packages\.sh \([a-z ]*[a-z]\) .*/\1/p' "$file"); do
        grep -q "^ *$group)" "$VKT_ROOT/libvkt/cmake/packages.sh" || { echo "$group" >&2; false; }
    done
}
