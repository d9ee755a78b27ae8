#!/bin/sh
# What programs of C that were built with vkt.h and volkit.h rely on, as abidw of libabigail tells it: abi.sh FILE.abi
# SPDX-License-Identifier: MIT
#
# The functions' types are those of the headers: a library of the same functions without bodies is described, which is
# compiled in no time. That libvkt exports them, and no others, is what tests/abi.bats compares.
# After a change that is meant: tests/abi.sh libvkt/c/vkt.abi
set -eu
out=$1
headers=$(cd "$(dirname "$0")/../libvkt/c" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
printf '#include "vkt.h"\n#include "volkit.h"\n' >"$scratch/all.h"
${CC:-cc} -E -P -I"$headers" "$scratch/all.h" |
    tr '\n' ' ' | sed 's/__attribute__((visibility("default"))) *\([^;]*\);/\n\1 { __builtin_trap(); }\n/g' >"$scratch/libvkt.c"
home=$(pwd)
cd "$scratch" # no folder of this machine gets into the description
${CC:-cc} -g -shared -fPIC -w -Wl,--version-script="$headers/vkt.map" libvkt.c -o libvkt.so
cd "$home"
case $out in
*.so) cp "$scratch/libvkt.so" "$out" ;; # the library itself
*) abidw --no-corpus-path --no-comp-dir-path --no-show-locs --out-file "$out" "$scratch/libvkt.so" ;;
esac
