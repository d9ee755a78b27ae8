#!/usr/bin/python3
"""budget.py MIB FACTOR [COMMAND…]: runs every command that `vkt help --list` names (or these) with --memory MIB on
volumes FACTOR times as large, of three shapes, and on hierarchical ones of small and of large bricks, from a file and
from a pipe, and compares the largest resident set with the budget, beside what the command takes on a tiny volume.

A command that is new is run as `vkt COMMAND FILE`; where that is not enough, say in `arguments` what is."""
import json
import os
import shlex
import struct
import subprocess
import sys

budget, factor = int(sys.argv[1]), int(sys.argv[2])
mib = 1 << 20
bytes_ = budget * factor * mib
threads = 2
voxels = bytes_ // 4
# Small slices, slices as large as the budget, and a single slice.
shapes = {
    "deep": (128, 128, voxels // (128 * 128)),
    "thick": (1024, budget * mib // 4096, factor),
    "flat": (4096, voxels // 4096, 1),
}

# {f}: the volume, {bricks}: a directory of its bricks, {x}…{z}: its dims. Several lines of arguments are several runs.
arguments = {
    "affine": ["0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0 {f}", "0.9,0.1,0,0,-0.1,0.9,0,0,0,0,1,0 {f} --method bspline3 --memory 64M"],
    "arith": ["add {f} {f}", "mul {f} 2"],
    "brick": ["{f} --size 64 --ghost 2", "{f} --size 64 --ghost 1 --boundary mirror", "{f} --size 5000"],
    "chart": ["'filter gaussian --sigma 1' {f} --budget 1", "'render --size 32' {f} --roi 0:64,0:64,0:1 --budget 0.1"],
    "clahe": ["{f} --range 0:1", "{f} --bricks 3,2,1", "{f} --range p1:p99 --memory 64M"],
    "convert": ["{f} --dtype uint8 --range 0:1", "{f} --dtype uint8 --range minmax", "{f} --dtype uint16 --range p1:100 --memory 64M"],
    "copy": ["{f} {f} --at 0,0,0"],
    "crop": ["{f} --roi 10%:90%,10%:90%,:", "{f} --roi ::2,1::3,::2"],
    "declare-sv": ["--dims {x} {y} {z} --dtype float32"],
    "delete": ["{f} --roi 0:64,:,:"],
    "diff": ["{f} {f}", "{f} {f} --mutual-information", "{f} {f} --ssim"],
    "distance": ["{f}", "{f} --signed"],
    "dump": ["{f} --roi 0:12%,0:60%,0:1"],
    "dump-range": ["{f} --first 0 0 0 --last 64 100 1"],
    "fill": ["{f} --value 3 --roi 0:64,:,:"],
    "fill-range": ["{f} --value 3 --first 0 0 0 --last 64 {y} {z}"],
    "filter gaussian": ["{f} --sigma 1", "{f} --sigma 2 --boundary wrap", "{f} --sigma 0,0,40", "{f} --sigma 0,3,0",
                        "{f} --sigma 4 --method cascade --tolerance 1%", "{f} --sigma 1 --roi 10%:90%,:,:"],
    "filter bilateral": ["{f} --sigma 0.4 --range-sigma 1"],
    "filter box": ["{f} --radius 3"],
    "filter dog": ["{f} --sigma 0.5", "{f} --sigma 2 --memory 32M"],
    "filter kernel": ["kernel.txt {f}"],
    "filter log": ["{f} --sigma 0.5", "{f} --sigma 2 --memory 32M"],
    "filter median": ["{f} --radius 1", "{f} --radius 3"],
    "filter sharpen": ["{f} --sigma 0.5", "{f} --sigma 2 --memory 32M"],
    "filter nlmeans": ["{f} --search 1 --patch 1 --strength 1", "{f} --search 1,1,0 --patch 0 --noise auto"],
    "flip": ["x {f}", "y {f}", "z {f}"],
    "flip-range": ["{f} --axis y --first 0 0 0 --last {x} {y} {z}"],
    "label": ["{f}", "{f} --connectivity 26 --min-size 2"],
    "histogram": ["{f}", "{f} --range 0:1", "{f} --range p1:p99 --memory 64M"],
    "make amr": ["--blocks {blocks} --levels 6 --block-size 16"],
    "make checkerboard": ["--dims {x} {y} {z}"],
    "make constant": ["--dims {x} {y} {z}"],
    "make marschner-lobb": ["--dims {x} {y} {z}"],
    "make noise": ["--dims {x} {y} {z}"],
    "make ramp": ["--dims {x} {y} {z}"],
    "make sphere": ["--dims {x} {y} {z} --edge distance"],
    "pad": ["{f} --by 0:3,2:0,1:1", "{f} --by 1 --boundary mirror"],
    "permute": ["zyx {f}", "yzx {f}", "xzy {f}"],
    "project": ["max {f}", "mean {f} --axis x", "std {f} --axis y --memory 32M", "median {f}", "median {f} --axis x"],
    "merge": ["{bricks}"],
    "reorient": ["--to zyx {f}"],
    "split": ["{f} --along z"],
    "stack": ["{f} {f} --along z --force-uniform", "{f} {f}"],
    "view": ["{f} -n"],
    "mesh": ["{f} --iso 2", "{f} --iso 2 --json"],
    "morphology": ["close {f} --radius 2 --shape box", "erode {f} --radius 2"],
    "read": ["{f}", "{f} --roi 5%:,5%:,:", "{f} --roi ::2,1::3,::2"],
    "refine": ["{f} --tolerance 1"],
    "render": ["{f} -o picture.png --force"],
    "resample": ["{f} --dims 64 64 64", "{f} --scale 0.5", "{f} --dims {x} {y} {z} --dtype float64",
                 "{f} --scale 0.5,0.5,2 --method cubic"],
    "rotate": ["{f} --axis z --angle 30", "{f} --axis z --angle 90"],
    "scale": ["{f} --factor 0.5", "{f} --factor 2,1,1 --method cubic"],
    "scan": ["{f}", "{f} --exclusive"],
    "set": ["{f} --spacing 1,2,3"],
    "set-header": ["{f} --dist 1 2 3"],
    "edit": ["{f} --units K"],
    "slim": ["{f} --for 'convert --dtype float32' --within 1"],
    "slice": ["{f} --z 0", "{f} --x 5", "{f} --axis y --range 0:1"],
    "threshold": ["{f} --above 3", "{f} --otsu"],
    "transform": ["v*2+sin(x)*a {f} {f}", "v[0,1,-1]+v[3,0,2] {f}"],
    "stats": ["{f}", "{f} --mask {f}", "{f} --per z", "{f} --per x", "{f} --per y", "{f} --per x --memory 64M", "{f} --percentiles 1,50,99 --memory 64M",
              "{f} --mask {f} --percentiles 1,50,99", "{f} --per z --percentiles 1,50,99", "{f} --per x --percentiles 50 --memory 64M"],
    "watershed": ["{f}", "{f} --on gradient --depth 1", "{f} --on distance --line"],
    "write": ["{f} - --format raw"],
}
# On hierarchical volumes: what is not here refuses them.
tree_arguments = {
    "arith": ["add {f} {f}", "mul {f} 2"],
    "convert": ["{f} --dtype uint8 --range 0:1", "{f} --dtype float64", "{f} --dtype uint8 --range minmax",
                "{f} --dtype uint16 --range p1:100 --memory 64M"],
    "crop": ["{f} --roi 10%:90%,10%:90%,:"],
    "delete": ["{f} --roi 0:64,:,:"],
    "diff": ["{f} {f}"],
    "fill": ["{f} --value 3 --roi 0:64,:,:"],
    "fill-range": ["{f} --value 3 --first 0 0 0 --last 9 9 9"],
    "filter bilateral": ["{f} --sigma 0.4 --range-sigma 1"],
    "filter box": ["{f} --radius 2"],
    "filter dog": ["{f} --sigma 0.5"],
    "filter gaussian": ["{f} --sigma 1", "{f} --sigma 1 --boundary wrap --memory 32M"],
    "filter gradient": ["{f}"],
    "filter kernel": ["kernel.txt {f}"],
    "filter laplacian": ["{f}"],
    "filter log": ["{f} --sigma 0.5"],
    "filter median": ["{f} --radius 1"],
    "filter nlmeans": ["{f} --search 1 --patch 0 --strength 1"],
    "filter sharpen": ["{f} --sigma 0.5"],
    "filter sobel": ["{f}"],
    "flip": ["x {f}", "z {f}"],
    "flip-range": ["{f} --axis y --first 0 0 0 --last {x} {y} {z}"],
    "histogram": ["{f}", "{f} --range 0:1", "{f} --range p1:p99 --memory 64M"],
    "history": ["{f}"],
    "info": ["{f}"],
    "morphology": ["close {f} --radius 1"],
    "permute": ["zyx {f}", "yzx {f}"],
    "read": ["{f}", "{f} --roi 5%:,5%:,:"],
    "render": ["{f} -o picture.png --force"],
    "reorient": ["--to zyx {f}"],
    "resample": ["{f} --dims 64 64 64"],
    "set": ["{f} --units K"],
    "set-header": ["{f} --dist 1 2 3"],
    "edit": ["{f} --units K"],
    "stack": ["{f} {f}"],
    "stats": ["{f}", "{f} --percentiles 1,50,99 --memory 64M"],
    "threshold": ["{f} --above 0.5", "{f} --otsu"],
    "transform": ["v*2+sin(x) {f}", "v[0,1,-1]+v[1,0,2] {f}"],
    "view": ["{f} -n"],
    "write": ["{f} - --format vkt"],
}
no_volumes = {"completion", "doctor", "help", "pipe", "stress", "shm list", "shm remove", "image diff", "image join", "image mean"}  # pipe: its stages are the commands above
grids_only = {"chart"}  # charts hold hierarchical volumes whole, as their page says
# May be refused, before anything is held; scan for a slice of sums.
held_whole = {"refine", "render", "scan", "slim", "view", "watershed"}
held_plane = {"affine", "mesh", "project", "rotate", "stats"}  # the same where a slice is as large as the budget, or a row wide


def peak(command, source=None):
    """Exit status, largest resident set in MiB, and what was said."""
    feeder = subprocess.Popen(source, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) if source else None
    with open("errors", "w+b") as errors:
        process = subprocess.Popen(command, stdin=feeder.stdout if feeder else subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL, stderr=errors)
        if feeder:
            feeder.stdout.close()
        _, status, usage = os.wait4(process.pid, 0)
        if feeder:
            feeder.wait()
        errors.seek(0)
        return os.waitstatus_to_exitcode(status), usage.ru_maxrss / 1024, errors.read().decode()


os.environ["VKT_THREADS"] = str(threads)
os.environ["OMP_WAIT_POLICY"] = "passive"
failed = 0
with open("tiny_8x8x8_float32.raw", "wb") as tiny:
    tiny.truncate(8 * 8 * 8 * 4)
base = max(peak(["vkt", *words.split()])[1] for words in
           ["flip x tiny_8x8x8_float32.raw", "stats tiny_8x8x8_float32.raw", "convert tiny_8x8x8_float32.raw --dtype uint8"])
commands = subprocess.run(["vkt", "help", "--list"], check=True, capture_output=True, text=True).stdout.splitlines()
assert len(commands) > 20, commands
commands = [name for name in commands if not sys.argv[3:] or name in sys.argv[3:]]
worst = 0
with open("kernel.txt", "w") as kernel:
    kernel.write("3 3 5 " + "1 2 -3 " * 15)


bases = {}


def base_of(name, words):
    """MiB of what a command takes on a tiny volume, its code and libraries, if it works there; else of any command."""
    if (name, words) not in bases:
        line = [*name.split(), *shlex.split(words.format(f="tiny_8x8x8_float32.raw", bricks="none", x=8, y=8, z=8, blocks=1))]
        bases[name, words] = max(base, peak(["vkt", *line])[1])
    return bases[name, words]


def check(name, words, file, context, may_refuse, refuses=False):
    """Runs a command on a file and on a pipe and says what is wrong; `refuses`: it must say that it cannot do that."""
    global failed, worst
    runs = [(file, None)]
    if "{f}" in words:
        runs.append(("-", ["vkt", "read", file, "--memory", f"{budget}M"]))
    for given, source in runs:
        first = words.replace("{f}", given, 1)  # the other input of two is a file
        line = [*name.split(), *shlex.split(first.format(f=file, **context))]
        own = int(line[-1][:-1]) if "--memory" in line else budget  # tables of fixed size may need more
        if "--memory" not in line:
            line += ["--memory", f"{budget}M"]
        limit = base_of(name, words) + own
        status, used, said = peak(["vkt", *line], source)
        worst = max(worst, used)
        wrong = []
        if used > limit:
            wrong.append(f"{used:.0f} MiB, more than {limit:.0f}")
        if status == 2 and not refuses:
            wrong.append("say in tests/budget.py how to run it")
        if status != (2 if refuses else 0) and not (status == 5 and may_refuse):
            wrong.append(f"exit status {status}: {said.strip()}")
        if os.environ.get("VERBOSE"):
            print(f"{used:6.0f} MiB  {status}  vkt {' '.join(line)}", flush=True)
        if wrong:
            failed += 1
            print(f"vkt {' '.join(line)}{' < pipe' if source else ''}: {'; '.join(wrong)}", flush=True)


for shape, (x, y, z) in shapes.items():
    file = f"{shape}_{x}x{y}x{z}_float32.raw"
    with open(file, "wb") as voxels_file:
        voxels_file.truncate(x * y * z * 4)
        for place in range(1, 100):  # not all zeros, yet sparse
            voxels_file.seek(place * (x * y * z // 100) * 4)
            voxels_file.write(struct.pack("<f", place))
    subprocess.run(["vkt", "brick", file, "--size", "96,96,64", "-o", "bricks", "--force"], check=True)
    for name in commands:
        if name in no_volumes:
            continue
        for words in arguments.get(name, ["{f}"]):
            check(name, words, file, {"bricks": "bricks", "x": x, "y": y, "z": z, "blocks": voxels // 16**3},
                  name in held_whole or name in held_plane and shape != "deep")
    os.unlink(file)
# Bricks that are small beside a sixteenth of the budget, and such as take an eighth of it: with neighbours, too much, as
# are those of whole lines where ends meet.
for shape, size in {"small": 16, "large": round((budget * mib / 32) ** (1 / 3)) // 2 * 2}.items():
    file = f"{shape}.vkt"
    subprocess.run(["vkt", "make", "amr", "--blocks", str(voxels // size**3), "--levels", "6", "--block-size", str(size), "-o", file],
                   check=True)
    x, y, z = json.loads(subprocess.run(["vkt", "info", file, "--json"], check=True, capture_output=True).stdout)["dims"]
    for name in commands:
        refuses = name not in tree_arguments
        if name in no_volumes or name in grids_only or refuses and not any("{f}" in words for words in arguments.get(name, ["{f}"])):
            continue
        neighbours = name.startswith("filter") or name in {"morphology", "transform"}
        for words in tree_arguments.get(name, arguments.get(name, ["{f}"])):
            check(name, words, file, {"bricks": "bricks", "x": x, "y": y, "z": z},
                  name in {"render", "resample", "view"} or neighbours and shape == "large" or "wrap" in words, refuses)
    os.unlink(file)
print(f"base {base:.0f} MiB, budget {budget} MiB, at most {worst:.0f} MiB")
sys.exit(1 if failed else 0)
