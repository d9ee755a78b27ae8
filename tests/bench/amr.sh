#!/bin/sh
# Times hierarchical volumes against their bars and other programs, all in one run.
# SPDX-License-Identifier: MIT
#
#   sh tests/bench/amr.sh [build folder]      exit 1 if a bar is missed
#
# The tree is that of a SILCC snapshot, 72.8 M cells on 7 levels, as a FLASH file; yt and VTK read the same file. What
# takes them too long is left to a smaller tree and said so; both sides of a ratio always do the same. Large files go to a
# new folder in VKT_BENCH_DIR (default: /tmp) that is removed. VKT_THREADS: threads of vkt (2). The build folder is
# configured with -DVKT_BENCH=ON.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "${1:-$here/../../build}" && pwd)
PATH=$build:$PATH
bench=$build/tests/vkt_amr_bench
threads=${VKT_THREADS:-2}
patience=${VKT_BENCH_PATIENCE:-300} # seconds for each run of another program
[ -x "$bench" ] || {
    echo "amr.sh: $bench is absent: configure with -DVKT_BENCH=ON and build vkt_amr_bench" >&2
    exit 2
}
dir=$(mktemp -d "${VKT_BENCH_DIR:-/tmp}/vkt-amr.XXXXXX")
trap 'rm -rf "$dir"' EXIT
trap 'exit 130' INT TERM
cd "$dir"
missed=0
missing() { ! /usr/bin/python3 -c "import $1" 2>/dev/null; }

# line WHAT FIGURE UNIT [least|most BAR]: one row of the table; counts bars that are missed.
line() {
    verdict=$(awk -v figure="$2" -v way="${4:-}" -v bar="${5:-0}" 'BEGIN {
        if (way == "") exit
        good = way == "least" ? figure + 0 >= bar + 0 : figure + 0 <= bar + 0
        printf "%s (bar: at %s %s)", good ? "within" : "MISSED", way, bar
    }')
    printf '%-58s %12s %-12s %s\n' "$1" "$2" "$3" "$verdict"
    case $verdict in MISSED*) missed=1 ;; esac
}
ratio() { awk -v a="$1" -v b="$2" 'BEGIN { printf "%.3g", a / b }'; }
million() { awk -v a="$1" 'BEGIN { printf "%.4g", a * 1e-6 }'; }

# peer PROGRAM MODULE MODE FILE X Y Z METHOD NAME BAR: the other program's rate, vkt's for the same, and the ratio.
peer() {
    if missing "$2"; then
        echo "$1: skipped: /usr/bin/python3 has no $2"
        return
    fi
    if ! theirs=$(timeout "$patience" /usr/bin/python3 "$here/amr_peers.py" "$3" "$4" "$5" "$6" "$7" 2>peer.err | tail -n 1) ||
        [ -z "$theirs" ]; then
        echo "$1 on $9: no answer in $patience s: $(tail -n 1 peer.err | cut -c 1-80)"
        return
    fi
    ours=$("$bench" rate "$4" "$8" "$threads" "$5" "$6" "$7")
    line "$1, $5x$6x$7 of $9" "$(million "$theirs")" 'M samples/s'
    line "vkt --method $8, the same" "$(million "$ours")" 'M samples/s'
    line "vkt against $1" "$(ratio "$ours" "$theirs")" times least "${10}"
}

echo "# hierarchical volumes, $threads threads of $(nproc) processors"
"$bench" flash silcc.flash
vkt read silcc.flash --variable dens -o silcc.vkt
basis=$("$bench" rate silcc.flash basis "$threads" 136 136 2703 5)
line 'basis, whole volume on 50 M samples, in memory' "$(million "$basis")" 'M samples/s' least 60
for method in nearest average auto; do
    line "$method, the same" "$(million "$("$bench" rate silcc.flash $method "$threads" 136 136 2703 3)")" 'M samples/s'
done

echo
echo '# other programs'
peer yt-arbitrary_grid yt yt-arbitrary silcc.flash 64 64 1280 average 'the SILCC tree' 10
"$bench" flash small.flash 20000 7
peer yt-covering_grid yt yt-covering small.flash 512 512 512 nearest 'a tree of 20 000 blocks' 10
"$bench" flash tiny.flash 1500 5
peer vtkAMRResampleFilter vtk vtk-amr tiny.flash 128 128 128 nearest 'a tree of 1500 blocks' 50
peer vtkResampleToImage vtk vtk-image tiny.flash 128 128 128 nearest 'a tree of 1500 blocks' 50

# measured FIELD NAME PIPELINE: a column of measure.py's line (2: median ms, 6: largest peak memory in MiB).
measured() { "$here/measure.py" --runs "${VKT_BENCH_RUNS:-5}" "$2" "$3" | cut -f "$1"; }

echo
echo '# from the command line'
roi=25%:75%,25%:75%,45%:55%
zoom=$(measured 2 zoom "vkt crop silcc.vkt --roi $roi | vkt resample --cells 50M -o zoom.raw --format raw --force --threads $threads")
line 'zoom: crop the region, resample it to 50 M cells, write' "$(ratio "$zoom" 1000)" s most 1.5
line 'whole volume to 50 M cells, write' \
    "$(ratio "$(measured 2 whole "vkt resample silcc.vkt --cells 50M -o whole.raw --format raw --force --threads $threads")" 1000)" s
picture="vkt render silcc.vkt --size 512x512 --threads $threads --force -o picture.png"
line 'picture of the tree, 512x512, chosen colours' "$(ratio "$(measured 2 picture "$picture")" 1000)" s
line 'the same, all of it visible' \
    "$(ratio "$(measured 2 picture "$picture --domain 0:0.01 --opacity 0,0.002")" 1000)" s

if missing h5py; then
    echo 'HDF5: skipped: /usr/bin/python3 has no h5py'
else
    hdf5=$(/usr/bin/python3 "$here/amr_peers.py" hdf5 silcc.flash)
    copy=$(measured 2 cat 'cat silcc.flash > /dev/null')
    "$here/measure.py" --runs "${VKT_BENCH_RUNS:-5}" read 'vkt read silcc.flash --variable dens > /dev/null' >read.txt
    line "cat of the FLASH file" "$(ratio "$copy" 1000)" s
    line "HDF5's own read of the variable into new memory" "$hdf5" s
    line 'vkt read of the same file' "$(ratio "$(cut -f 2 read.txt)" 1000)" s
    both=$(awk -v a="$copy" -v b="$hdf5" 'BEGIN { print a / 1000 + b }')
    line 'vkt read against cat and HDF5 together' "$(ratio "$(ratio "$(cut -f 2 read.txt)" 1000)" "$both")" times most 1.2
    cells=$(vkt stats silcc.vkt --json | sed -n 's/.*"count": *\([0-9]*\).*/\1/p')
    line 'peak memory of vkt read over the leaf data' \
        "$(awk -v peak="$(cut -f 6 read.txt)" -v cells="$cells" 'BEGIN { printf "%.3g", peak * 1048576 / (4 * cells) }')" \
        times most 1.3
fi
exit $missed
