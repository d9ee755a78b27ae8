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
