#!/bin/sh
# Makes the project's charts of error against seconds: run.sh [options of charts.py]
# SPDX-License-Identifier: MIT
#
# Tables and pictures go to tests/charts/results. Needs gnuplot, python3-numpy and python3-scipy, and a Release build
# with the Python package in build/; draws OpenCV, scikit-image, SimpleITK, cc3d and edt beside it where they are
# installed (tests/bench/algorithms.py says how), and Mitsuba 3 (pip install --no-deps --target build/oracles mitsuba drjit)
# and VTK's ray caster (python3-vtk9, xvfb).
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
PYTHONPATH=$root/build/oracles${PYTHONPATH:+:$PYTHONPATH} exec /usr/bin/python3 "$root/tests/charts/charts.py" "$@"
