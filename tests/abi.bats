# The C ABI: what libvkt exports, under which version, and what its structures look like to programs built before.
load helper

setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    library=$(find "$VKT_BUILD/libvkt" -maxdepth 1 -name 'libvkt.so' | head -n 1)
    [ -n "$library" ] || skip "libvkt is no shared library here"
}

# exported LIBRARY: functions of C, with their version.
exported() { nm -D --defined-only --with-symbol-versions "$1" | awk '$2 == "T" {print $3}' | grep -E '^vkt(_|[A-Z])' | sort; }

@test "libvkt exports the functions of the headers, all of them as VKT_1, and no others" {
    "$VKT_ROOT/tests/abi.sh" declared.so
    exported declared.so >want
    exported "$library" >got
    [ "$(wc -l <want)" -gt 150 ]
    run ! grep -v '@@VKT_1$' want
    diff want got
}

@test "functions of C++ have no version" {
    nm -D --defined-only --with-symbol-versions "$library" | awk '{print $3}' | grep _ZN3vkt >cpp
    [ "$(wc -l <cpp)" -gt 500 ]
    run ! grep @ cpp
}

@test "functions and structures are those of the reference" {
    command -v abidiff >/dev/null || skip "abidiff (Debian: abigail-tools) is not installed: TYPES OF THE C ABI ARE NOT COMPARED"
    [ "$(uname -m)" = x86_64 ] || skip "the reference describes x86_64"
    "$VKT_ROOT/tests/abi.sh" declared.so
    abidiff "$VKT_ROOT/libvkt/c/vkt.abi" declared.so >changes || {
        cat changes >&2
        echo "if that is meant: tests/abi.sh libvkt/c/vkt.abi" >&2
        false
    }
    # The comparison notices what it is there for: a field more, a function less.
    mkdir changed
    sed 's/^    int hierarchical;/    int more;\n    int hierarchical;/' "$VKT_ROOT/libvkt/c/vkt.h" >changed/vkt.h
    sed '/size_t vkt_trim/d' changed/vkt.h >changed/less.h
    mkdir -p tree/libvkt/c tree/tests
    cp "$VKT_ROOT"/libvkt/c/{volkit.h,vkt.map} tree/libvkt/c
    cp "$VKT_ROOT/tests/abi.sh" tree/tests
    for header in vkt less; do
        cp "changed/$header.h" tree/libvkt/c/vkt.h
        tree/tests/abi.sh "$header.so"
        run abidiff "$VKT_ROOT/libvkt/c/vkt.abi" "$header.so"
        [ "$status" -ne 0 ]
    done
    [[ "$output" == *"vkt_trim"* ]]
}

@test "structures of x86_64 have the sizes that they had, whatever tools there are" {
    [ "$(uname -m)" = x86_64 ] || skip "the reference describes x86_64"
    cat >layout.c <<'END'
#include "vkt.h"
#include "volkit.h"
_Static_assert(VKT_OK == 0 && VKT_RESOURCES == 5 && VKT_CANCELLED == 6 && sizeof(vkt_status) == 4, "status");
_Static_assert(sizeof(vkt_description) == 192 && offsetof(vkt_description, dtype) == 24 &&
               offsetof(vkt_description, slope) == 152 && offsetof(vkt_description, space) == 184, "description");
_Static_assert(sizeof(vkt_policy) == 24 && offsetof(vkt_policy, memory) == 16, "policy");
_Static_assert(sizeof(vktVoxelView_t) == 24 && sizeof(vktAggregates_t) == 52, "voxels");
_Static_assert(sizeof(vktExecutionPolicy_t) == 16 && sizeof(vktVolumeFileHeader_t) == 24, "policy and file");
_Static_assert(sizeof(vktRenderState_t) == 168 && offsetof(vktRenderState_t, snapshotTool) == 136, "render state");
END
    cc -std=c11 -fsyntax-only -I"$VKT_ROOT/libvkt/c" layout.c
}

@test "pages of the C API describe every function" {
    command -v doxygen >/dev/null || skip "doxygen is not installed: THE PAGES OF THE APIS ARE NOT BUILT"
    [ -e "$VKT_BUILD/Doxyfile.doc_c" ] || skip "the build was configured without doxygen: THE PAGES OF THE APIS ARE NOT BUILT"
    { cat "$VKT_BUILD/Doxyfile.doc_c"; echo "OUTPUT_DIRECTORY = \"$PWD/pages\""; } >Doxyfile
    mkdir pages
    (cd "$VKT_ROOT" && doxygen "$OLDPWD/Doxyfile")
    grep -q vkt_stream_next pages/*vkt_8h.html
    # What is not described fails.
    sed 's,^/\*\* The version of the library.*,,' "$VKT_ROOT/libvkt/c/vkt.h" >vkt.h
    { cat Doxyfile; echo "INPUT = \"$PWD/vkt.h\""; } >Doxyfile.less
    run doxygen Doxyfile.less
    [ "$status" -ne 0 ]
    [[ "$output" == *vkt_version* ]]
}
