#!/usr/bin/env bats
# The rooms of the source: includes point down only. SPDX-License-Identifier: MIT

load helper

@test 'no file includes a header of a room above its own' {
    run python3 "$BATS_TEST_DIRNAME/includes.py" "$BATS_TEST_DIRNAME/.."
    [ "$status" -eq 0 ] || { echo "$output"; false; }
    [[ $output == *' includes, none upwards' ]]
}

@test 'an arrow upwards is found' {
    mkdir -p tree/libvkt/core tree/libvkt/engine
    echo '#include "libvkt/engine/source.h"' >tree/libvkt/core/types.h
    run python3 "$BATS_TEST_DIRNAME/includes.py" tree
    [ "$status" -eq 1 ]
    [[ $output == *'libvkt/core/types.h includes libvkt/engine/source.h'* ]]
}

@test 'sources that ask for a part are told whether there is one, and no others are' {
    cd "$VKT_ROOT/libvkt"
    # What set_property(SOURCE …) names, a line for each: PART FILE.
    sed -n 's/^vkt_define(\([A-Z0-9]*\) \(.*\))$/\1 \2/p' CMakeLists.txt |
        awk '{ for (i = 2; i <= NF; ++i) print $1, $i }' | sort >"$BATS_TEST_TMPDIR/told"
    grep -roE 'VKT_HAVE_[A-Z0-9]+' --include='*.cpp' --include='*.h' . | sed 's,^\./\(.*\):VKT_HAVE_\(.*\),\2 \1,' |
        sort -u >"$BATS_TEST_TMPDIR/asking"
    [ -s "$BATS_TEST_TMPDIR/told" ]
    diff "$BATS_TEST_TMPDIR/told" "$BATS_TEST_TMPDIR/asking"
}
