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
#include "libvkt/operations/flip.h"
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

@test "headers stand on their own" {
    cd "$prefix/include"
    find libvkt/core libvkt/engine libvkt/formats -name '*.h' | while read -r header; do
        echo "#include \"$header\"" | c++ -std=c++20 -fsyntax-only -I. -x c++ - || { echo "$header" >&2; exit 1; }
    done
}

@test "a program builds with find_package" {
    cat >CMakeLists.txt <<'EOF'
cmake_minimum_required(VERSION 3.25)
project(consumer CXX)
find_package(vkt 0.1 REQUIRED)
add_executable(consumer consumer.cpp)
target_link_libraries(consumer PRIVATE vkt::vkt)
EOF
    cmake -S . -B build -G Ninja -DCMAKE_PREFIX_PATH="$prefix" >log 2>&1 || { cat log >&2; false; }
    cmake --build build >log 2>&1 || { cat log >&2; false; }
    run build/consumer
    [ "$output" = "2 1 0 5 4 3 " ]
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
