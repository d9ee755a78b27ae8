#!/bin/sh
# Installs the Debian packages that are missing: packages.sh build | optional | package | test. As root, or through sudo.
# SPDX-License-Identifier: MIT
#
#   build      what libvkt and the command need
#   optional   OpenVDB, HDF5, libtiff, GDCM, OpenEXR, FreeType, expat, compressors, the viewer and Python; each is left out of the build where it is absent; what draws charts
#   package    what cpack makes packages with, and what checks them
#   test       test runner, sanitizer and fuzzing compiler, linters, and the programs tests compare with
set -eu

build='g++ cmake ninja-build ccache pkg-config zlib1g-dev libbz2-dev libpng-dev libboost-dev libcli11-dev libspdlog-dev
    nlohmann-json3-dev libxxhash-dev'
optional='libopenvdb-dev libtbb-dev libhdf5-dev libtiff-dev libgdcm-dev libopenexr-dev libfreetype-dev fonts-dejavu-core libexpat1-dev liblz4-dev liblzma-dev libzstd-dev libblosc-dev libkissfft-dev
    libglfw3-dev libgl-dev libimgui-dev python3-numpy gnuplot-nox'
package='dpkg-dev lintian'
test='abigail-tools doxygen bats make libgtest-dev libbenchmark-dev clang clang-tidy clang-format libclang-rt-14-dev libomp-dev mandoc fish zsh
    xvfb xdotool python3-numpy python3-scipy python3-nibabel python3-tifffile python3-pydicom python3-h5py python3-xarray python3-pip python3-vtk9 python3-openvdb python3-opencv teem-apps strace time xxd bsdutils
    util-linux procps gnuplot-nox'

command -v dpkg-query >/dev/null || {
    echo 'packages.sh: this is no Debian system; install the equivalents of these packages yourself:' >&2
    echo "    $build" >&2
    exit 0
}
wanted=
for group in "$@"; do
    case $group in
    build) wanted="$wanted $build" ;;
    optional) wanted="$wanted $optional" ;;
    package) wanted="$wanted $package" ;;
    test) wanted="$wanted $test" ;;
    *)
        echo "packages.sh: '$group' is not one of build, optional, package, test" >&2
        exit 2
        ;;
    esac
done

missing=
for package in $wanted; do
    case $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true) in
    installed*) ;;
    *) missing="$missing $package" ;;
    esac
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" -eq 0 ]; then
    as_root=
elif command -v sudo >/dev/null; then
    as_root=sudo
else
    echo 'packages.sh: neither root nor sudo; have somebody run:' >&2
    echo "    apt-get install --no-install-recommends$missing" >&2
    exit 1
fi
echo "installing:$missing"
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq
# shellcheck disable=SC2086  # a list of words
$as_root apt-get install -qq -y --no-install-recommends $missing </dev/null >/dev/null
