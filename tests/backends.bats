# Objects compiled for newer processors leave nothing behind that the rest of the program could be linked to.
load helper

@test "AVX2 and AVX-512 objects define nothing outside their namespace" {
    command -v nm >/dev/null || skip "nm is not installed"
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD is not set"
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers keep inline functions out of line"
    for backend in avx2 avx512; do
        [ -d "$VKT_BUILD/libvkt/CMakeFiles/vkt_$backend.dir" ] || skip "this build has one instruction set only"
        find "$VKT_BUILD/libvkt/CMakeFiles/vkt_$backend.dir" -name '*.o' >objects
        [ -s objects ]
        while read -r object; do
            # As they are in the object: c++filt gives up on names of lambdas in lambdas. _ZGV are guards of variables.
            nm "$object" | grep ' [WVTu] ' | grep -v "${#backend}$backend\|DW.ref\|_ZGV" | c++filt | sed "s|^|$(basename "$object"): |"
        done <objects >leaks
        [ ! -s leaks ] || { cat leaks >&2; false; }
    done
}
