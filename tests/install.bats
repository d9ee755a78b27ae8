# Installation: found from where it lies, by find_package and pkg-config, after the tree was moved.
load helper

setup_file() {
    [ -n "${VKT_BUILD:-}" ] || return 0
    install_and_move
}

setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    prefix="$BATS_FILE_TMPDIR/moved here"
    cat >consumer.cpp <<'EOF'
#include "libvkt/engine/pipeline.h"
#include "libvkt/operations/voxels/flip.h"
#include <iostream>
int main() {
    vkt::Header header;
    header.dims = {3, 2, 1};
    vkt::Volume volume(header);
    for (int i = 0; i < 6; ++i) volume.mutable_view().data[i] = std::byte(i);
    vkt::Flip flip;
    vkt::Parameters parameters;
    flip.parameters(parameters);
    parameters.set("axis", {"x"});
    auto const flipped = vkt::apply(flip, {volume}, vkt::default_execution());
    for (int i = 0; i < 6; ++i) std::cout << int(flipped.view().data[i]) << ' ';
}
EOF
}

@test "the installed command runs from where it was moved to" {
    run "$prefix/bin/vkt" info --json "$VKT_ROOT/examples/data/phantom.nrrd"
    [ "$status" -eq 0 ]
    [[ "$output" == *uint8* ]]
}

@test "the version tells the parts, and the modules that are not installed" {
    "$prefix/bin/vkt" --version >said
    [ "$(head -n 1 said)" = "vkt $(sed -n 's/^project(vkt VERSION \([0-9.]*\) .*/\1/p' "$VKT_ROOT/CMakeLists.txt")" ]
    grep -q '^kernels:  baseline' said
    run ! grep '^missing' said
    modules=$(sed -n 's/^modules: *//p' said)
    [ "$(ls "$prefix"/lib*/vkt | sed -n 's/^vkt_\(.*\)\.so$/\1/p' | sort | tr '\n' ' ')" = "$(echo "$modules" | tr ' ' '\n' | sort | tr '\n' ' ')" ]
    # What CMake said of each part.
    for part in CUDA OpenVDB HDF5 TIFF GDCM Blosc OpenEXR FreeType viewer Python expat LZ4 LZMA Zstandard bzip2; do
        grep -E '^(with|without):' said | grep -q "$part" || { echo "$part" >&2; false; }
    done
    cp -r "$prefix" less
    [ -n "$modules" ] || skip "this build is without modules"
    rm less/lib*/vkt/vkt_"${modules%% *}".so
    less/bin/vkt --version | grep -qx "missing:  ${modules%% *}"
}

@test "manual pages, completion and licence are installed" {
    [ -e "$prefix/share/man/man1/vkt.1" ]
    [ -e "$prefix/share/man/man1/vkt-crop.1" ]
    [ -e "$prefix/share/man/man3/vkt.3" ]
    [ -e "$prefix/share/man/man5/vkt-stream.5" ]
    [ -e "$prefix/share/man/man7/vkt.7" ]
    [ -e "$prefix/share/bash-completion/completions/vkt" ]
    [ -e "$prefix/share/zsh/site-functions/_vkt" ]
    [ -e "$prefix/share/fish/vendor_completions.d/vkt.fish" ]
    [ -e "$prefix/share/doc/vkt/LICENSE" ]
}

@test "no installed text names the source, build or first folder" {
    run grep -rIl -e "$VKT_ROOT" -e "$VKT_BUILD" -e "$BATS_FILE_TMPDIR/first" "$prefix"
    [ -z "$output" ] || { echo "$output" >&2; false; }
}

# Others come first in a source of their own, which sanitizers and clang-tidy read without a precompiled header.
@test "headers stand on their own" {
    cd "$prefix/include"
    find libvkt/core libvkt/engine libvkt/formats/format.h libvkt/formats/request.h libvkt/kernel/kernel.h \
        libvkt/operations/functions.h -name '*.h' | while read -r header; do
        echo "#include \"$header\"" | c++ -std=c++20 -fsyntax-only -I. -x c++ - || { echo "$header" >&2; exit 1; }
    done
}

# project_of LANGUAGE SUFFIX: builds consumer.SUFFIX.
project_of() {
    cat >CMakeLists.txt <<EOF
cmake_minimum_required(VERSION 3.25)
project(consumer $1)
find_package(vkt 0.1 REQUIRED)
add_executable(consumer consumer.$2)
target_link_libraries(consumer PRIVATE vkt::vkt)
EOF
}

@test "a program builds with find_package" {
    project_of CXX cpp
    cmake -S . -B build -G Ninja -DCMAKE_PREFIX_PATH="$prefix" >log 2>&1 || { cat log >&2; false; }
    cmake --build build >log 2>&1 || { cat log >&2; false; }
    run build/consumer
    [ "$output" = "2 1 0 5 4 3 " ]
}

@test "a program in C alone builds, without what the library was built with" {
    grep -q '^BUILD_SHARED_LIBS:BOOL=ON' "$VKT_BUILD/CMakeCache.txt" || skip "a static library needs what it was built with"
    project_of C c
    cat >consumer.c <<'EOF'
#include <stdio.h>
#include <vkt/vkt.h>
int main(void) { return puts(vkt_version()) < 0; }
EOF
    cmake -S . -B build -G Ninja -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_DISABLE_FIND_PACKAGE_ZLIB=ON \
        -DCMAKE_DISABLE_FIND_PACKAGE_PNG=ON -DCMAKE_DISABLE_FIND_PACKAGE_BZip2=ON -DVKT_LIBRARY_expat=VKT_LIBRARY_expat-NOTFOUND \
        >log 2>&1 || { cat log >&2; false; }
    cmake --build build >log 2>&1 || { cat log >&2; false; }
    [ "vkt $(build/consumer)" = "$(vkt --version | head -n 1)" ]
    pc=$(find "$prefix" -name vkt.pc)
    PKG_CONFIG_PATH='' PKG_CONFIG_LIBDIR="${pc%/*}" pkg-config --cflags --libs vkt >flags
    eval "cc consumer.c -o in_c $(cat flags)"
    [ "vkt $(./in_c)" = "$(vkt --version | head -n 1)" ]
}

@test "a program builds with pkg-config" {
    pc=$(find "$prefix" -name vkt.pc)
    export PKG_CONFIG_PATH="${pc%/*}"
    [ "$(pkg-config --modversion vkt)" = "$(vkt --version | sed -n '1s/vkt //p')" ]
    # pkg-config escapes the blank in the folder for a shell.
    eval "c++ -std=c++20 consumer.cpp -o consumer $(pkg-config --cflags --libs vkt)"
    run ./consumer
    [ "$output" = "2 1 0 5 4 3 " ]
}

@test "the programs of the README build and run" {
    cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
    sed -n '/^```c$/,/^```$/p' "$VKT_ROOT/README.md" | sed '/^```/d' >program.c
    sed -n '/^```cpp$/,/^```$/p' "$VKT_ROOT/README.md" | sed '/^```/d' >program.cpp
    pc=$(find "$prefix" -name vkt.pc)
    export PKG_CONFIG_PATH="${pc%/*}"
    eval "cc -std=c99 -pedantic -Wall -Wextra -Werror program.c -o in_c $(pkg-config --cflags --libs vkt)"
    eval "c++ -std=c++20 program.cpp -o in_cpp $(pkg-config --cflags --libs vkt)"
    ./in_c
    vkt filter gaussian volume.nrrd --sigma 2 -o want.nrrd
    vkt diff want.nrrd smooth.nrrd --geometry
    want=$(vkt filter sobel want.nrrd | vkt stats --json | sed -n 's/^ *"mean": \(.*\),$/\1/p')
    read -r labels mean < <(./in_cpp)
    [ "$labels" -ge 1 ]
    /usr/bin/python3 -c "assert abs($mean / $want - 1) < 1e-4, ($mean, $want)"
    # What fails says why, and with which code.
    rm volume.nrrd
    run -4 ./in_c
    [[ "$output" == *"volume.nrrd"* ]]
}

@test "a session in volkit's names builds and makes what the commands make" {
    pc=$(find "$prefix" -name vkt.pc)
    export PKG_CONFIG_PATH="${pc%/*}"
    eval "cc -std=c99 -pedantic -Wall -Wextra -Werror '$VKT_ROOT/examples/volkit-session.c' -o session $(pkg-config --cflags --libs vkt) -lm"
    run -0 ./session
    [ -z "$output" ]
    [ "$(head -c 8 session.png | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
    # SciPy turns a mask of the region and smooths it; what is at its rim depends on which voxels count as turned.
    python_with scipy numpy
    /usr/bin/python3 - <<'END'
import numpy as np, scipy.ndimage as nd
header, data = open("session.nrrd", "rb").read().split(b"\n\n", 1)
assert b"sizes: 64 64 64" in header and b"type: uint8" in header.replace(b"unsigned char", b"uint8"), header
got = np.frombuffer(data, np.uint8).reshape(64, 64, 64).astype(float) / 255
source = np.full((64, 64, 64), round(0.1 * 255) / 255)
source[16:48, 8:56, 24:40] = 1
z, y, x = np.mgrid[:64, :64, :64] - 31.5
c, s = np.cos(0.5), np.sin(0.5)
at = np.array([z, -s * x + c * y, c * x + s * y]) + 31.5
turned = nd.map_coordinates(source, at, order=1, mode="nearest")
i = np.rint(at).astype(int)
inside = (i[0] >= 16) & (i[0] < 48) & (i[1] >= 8) & (i[1] < 56) & (i[2] >= 24) & (i[2] < 40)
turned = np.rint(np.where(inside, turned, source[0, 0, 0]) * 255) / 255
w = np.exp(-(np.arange(-3, 4) ** 2) / 2); w /= w.sum()
want = turned
for axis in range(3): want = nd.correlate1d(want, w, axis, mode="reflect")
error = np.abs(got - want)
assert error.max() < 1.01 / 255, error.max() * 255
END
}

@test "an operation of one's own builds against the installed tree" {
    cp -r "$VKT_ROOT/examples/own-operation" own
    [ "$(wc -l <own/gamma.cpp)" -le 40 ]
    cmake -S own -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$prefix" >log 2>&1 || { cat log >&2; false; }
    cmake --build build >log 2>&1 || { cat log >&2; false; }
    for type in uint8 float32; do
        vkt make noise --dims 70 60 50 --dtype $type -o in.nrrd --force
        build/gamma in.nrrd out_$type.nrrd 0.5
        [ "$type" = uint8 ] && top=255 || top=1
        vkt transform "$top * (v / $top)^0.5" in.nrrd --dtype $type | vkt diff - out_$type.nrrd --tolerance 1e-6
        vkt history out_$type.nrrd | grep -q 'gamma 0.5'
    done
    run -1 build/gamma in.nrrd out_uint8.nrrd 0.5 # which is there already
    run -1 build/gamma missing.nrrd x.nrrd 0.5
    [[ "$output" == *missing.nrrd* ]]
    [ ! -e x.nrrd ]
}

@test "a version that is not there is refused" {
    cat >CMakeLists.txt <<'EOF'
cmake_minimum_required(VERSION 3.25)
project(consumer CXX)
find_package(vkt 9 REQUIRED)
EOF
    run cmake -S . -B build -G Ninja -DCMAKE_PREFIX_PATH="$prefix"
    [ "$status" -ne 0 ]
    [[ "$output" == *"not compatible"* || "$output" == *"requested version"* ]]
}
