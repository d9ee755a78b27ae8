#!/usr/bin/env python3
"""What plans say of memory against what is held: every operation, its main methods, three data types.

usage: predicted_memory.py [SIDE [SLACK [TYPES [WORD]]]]   (160, 4, uint8,uint16,float32; commands with this word only),
vkt in PATH

The peak of the resident set, less that of the same command on a volume of 8 voxels a side, which holds the program
itself, may be SLACK MiB above what `-n` says at most. Meshes are left out, and so are masks of many components: plans say what
these take apiece, since nobody knows how many there are. Prints a line a command; exit code 1 if one holds more.
SPDX-License-Identifier: MIT
"""
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile

# Command, and what it is done to: N noise, S the noise made smooth, M a mask, L labels.
COMMANDS = """
arith mul N 3
arith add N N
arith div N N
arith exp N --dtype float32
transform 'v * 2 + 1' N
transform 'v - (v[-1,0,0] + v[0,0,1]) / 2' N
convert N --dtype uint8
convert N --dtype float64
convert N --dtype uint8 --range minmax
convert N --dtype uint8 --range p1:p99
convert N --dtype auto --tolerance 1
threshold N --above 100
threshold N --otsu
fill N --value 3
delete N --roi :,:,0:50%
copy N N
pad N --by 8
pad N --by 8 --boundary mirror
permute zyx N
permute yxz N
flip x N
flip z N
crop N --roi 10%:90%,10%:90%,10%:90%
set N --units HU
slice N --z 5
slice N --x 5
slice N --normal 1,1,1
slice N --normal 1,1,1 --thickness 20
project max N
project std N
project median N
project median N --axis x
scan N
filter gaussian N --sigma 1
filter gaussian N --sigma 4 --method fir
filter gaussian N --sigma 4 --method cascade --tolerance 1%
filter gaussian N --sigma 16
filter box N --radius 1
filter box N --radius 20
filter median N --radius 1
filter median N --radius 2
filter gradient N
filter sobel N
filter laplacian N
filter log N --sigma 2
filter dog N --sigma 2
filter sharpen N
filter kernel cross.txt N
filter kernel large.txt N --method fft
filter kernel large.txt N --method separable
filter bilateral N --range-sigma 100
filter nlmeans N --strength 100 --search 1
filter nlmeans N --noise auto --search 1
clahe N
clahe N --bricks 4,4,4 --bins 4096
morphology erode N
morphology open N --radius 2
morphology tophat N --radius 3 --shape box
resample N --scale 0.5
resample N --scale 0.7
resample N --scale 1.2
resample N --scale 1.2 --method cubic
resample N --scale 1.2 --method lanczos3
resample N --scale 1.2 --method bspline3
resample N --scale 1.2 --method bspline5
resample N --like T
rotate N --angle 20
rotate N --angle 20 --axis x
rotate N --angle 90 --expand
rotate N --angle 20 --method nearest
rotate N --angle 20 --method cubic
rotate N --angle 20 --method lanczos3
rotate N --angle 20 --method bspline3
rotate N --angle 20 --method bspline5
rotate N --euler 10,20,30
rotate N --euler 10,20,30 --method bspline3
scale N --factor 1.5
scale N --factor 0.6 --method bspline3
affine '1 0.2 0 0  0 1 0 0  0 0 1 0' N --unit voxel
label M
label M --connectivity 26
label M --keep-largest 2
label L --by-value
label N
fill-holes M
distance M
distance M --signed
watershed S
watershed S --depth 20
watershed M --on distance
refine S --tolerance 5
stats N
stats N --percentiles 1,99
stats N --labels L
stats N --mask M
histogram N
histogram N --bins 65536
histogram N --range p1:p99
diff N N
diff N N --ssim
diff N N --mutual-information
""".strip().splitlines()

UNITS = {"bytes": 2**-20, "KiB": 2**-10, "MiB": 1, "GiB": 1024}


def words(line, size):
    found = []
    for word in shlex.split(line):
        found.append(f"{size}{word}.vkt" if word in "NSMLT" and len(word) == 1 else word)
    return ["vkt"] + found


def sink(command):
    if command[1] in ("stats", "histogram", "diff"):
        return []
    return ["-o", "out.vkt", "--force"]


def peak(command):
    """In MiB, of a process that is begun by one that is small itself."""
    code = ("import os, sys, resource\n"
            "child = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ,\n"
            "    file_actions=[(os.POSIX_SPAWN_OPEN, 1, '/dev/null', os.O_WRONLY, 0)])\n"
            "_, status, usage = os.wait4(child, 0)\n"
            "print(usage.ru_maxrss, os.waitstatus_to_exitcode(status))")
    done = subprocess.run([sys.executable, "-S", "-E", "-c", code] + command, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, check=True, text=True)
    kib, status = done.stdout.split()
    if int(status) not in (0, 1):
        raise RuntimeError(f"{' '.join(command)}: exit code {status}, {done.stderr}")
    return int(kib) / 1024


def predicted(command):
    done = subprocess.run(command + ["-n"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    found = re.findall(r"peak memory about ([\d.]+) (\w+)", done.stderr)
    if not found:
        raise RuntimeError(f"{' '.join(command)} -n says nothing of memory: {done.stderr}")
    return sum(float(number) * UNITS[unit] for number, unit in found)


def make(line):
    subprocess.run(["bash", "-c", "set -e -o pipefail; " + line], check=True)


def main():
    side = sys.argv[1] if len(sys.argv) > 1 else "160"
    slack = float(sys.argv[2]) if len(sys.argv) > 2 else 4
    types = (sys.argv[3] if len(sys.argv) > 3 else "uint8,uint16,float32").split(",")
    only = sys.argv[4] if len(sys.argv) > 4 else ""
    os.environ.update(OMP_WAIT_POLICY="passive", VKT_THREADS="2", VKT_MEMORY="2GiB")
    os.environ.pop("XDG_CACHE_HOME", None)
    os.chdir(tempfile.mkdtemp())
    with open("cross.txt", "w") as file:
        print("3 3 3  0 0 0 0 1 0 0 0 0  0 1 0 1 2 1 0 1 0  0 0 0 0 1 0 0 0 0", file=file)
    with open("large.txt", "w") as file:
        print("9 9 9", *[(3 * i) % 11 + 1 for i in range(729)], file=file)
    above = 0
    try:
        for dtype in types:
            high = 255 if dtype == "uint8" else 1000
            for size, n in (("tiny", "8"), ("big", side)):
                make(f"vkt make noise --dims {n} {n} {n} --dtype {dtype} --high {high} -o {size}N.vkt --force -q")
                make(f"vkt convert {size}N.vkt --dtype float32 | vkt filter gaussian --sigma 3 |"
                     f" vkt convert --dtype uint8 --range minmax -o smooth.vkt --force -q")
                make(f"vkt convert smooth.vkt --dtype {dtype} -o {size}S.vkt --force -q")
                make(f"vkt threshold {size}S.vkt --otsu -o {size}M.vkt --force -q")
                make(f"vkt label {size}M.vkt --dtype uint16 -o {size}L.vkt --force -q")
                make(f"vkt rotate {size}N.vkt --angle 20 -o {size}T.vkt --force -q")
            for line in COMMANDS:
                if only not in line:
                    continue
                big, tiny = (words(line, size) for size in ("big", "tiny"))
                big, tiny = big + sink(big), tiny + sink(tiny)
                said = predicted(big)
                held = peak(big) - peak(tiny)
                good = held <= said + slack
                above += not good
                print(f"{dtype:8} {line:58} said {said:7.1f} MiB, held {held:7.1f}{'' if good else '  *'}", flush=True)
    finally:
        folder = os.getcwd()
        os.chdir("/")
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{above} hold more than {slack:g} MiB beyond what was said")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
