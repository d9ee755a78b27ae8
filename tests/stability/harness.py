"""What the table of stability tests is made of: vkt run on arrays, rows that are checked, and the printed table."""
# SPDX-License-Identifier: MIT
import concurrent.futures
import itertools
import json
import os
import random
import re
import subprocess
import sys
import tempfile

import numpy as np

VKT = os.environ.get("VKT") or "vkt"
PATIENCE = 600  # seconds after which a command counts as hung; nothing here takes a hundredth of it
NRRD_TYPES = {
    "uint8": "uchar", "int8": "signed char", "uint16": "ushort", "int16": "short", "uint32": "uint", "int32": "int",
    "uint64": "ulonglong", "int64": "longlong", "float32": "float", "float64": "double",
}  # fmt: skip
SABOTAGE = False  # set by --sabotage: what vkt hands back is damaged, and every test must notice

scratch = tempfile.TemporaryDirectory(prefix="vkt-stability-")
serial = itertools.count()


class Skip(Exception):
    """What a line needs is not there; the text says what."""


class Failed(Exception):
    """vkt exited with an error where it should not."""


def path_of(suffix):
    return os.path.join(scratch.name, f"{next(serial)}{suffix}")


def write_volume(array, spacing=(1, 1, 1), origin=(0, 0, 0)):
    """The path of a file with the voxels of array[z, y, x]; float16, which NRRD does not know, as bare voxels."""
    array = np.ascontiguousarray(array)
    dims = array.shape[::-1]
    if array.dtype == np.float16:
        path = path_of("_%dx%dx%d_float16.raw" % dims)
        array.tofile(path)
        return path
    path = path_of(".nrrd")
    axes = " ".join("(%s)" % ",".join(repr(float(s * (i == k))) for k in range(3)) for i, s in enumerate(spacing))
    with open(path, "wb") as file:
        file.write(
            f"NRRD0004\ntype: {NRRD_TYPES[array.dtype.name]}\ndimension: 3\nspace dimension: 3\nsizes: {dims[0]} {dims[1]} "
            f"{dims[2]}\nspace directions: {axes}\nspace origin: ({','.join(map(repr, map(float, origin)))})\n"
            "endian: little\nencoding: raw\n\n".encode()
        )
        file.write(array.tobytes())
    return path


def read_volume(path, half=None):
    """array[z, y, x] of a NRRD file that vkt wrote, or of bare float16 voxels of the shape half."""
    data = open(path, "rb").read()
    os.remove(path)
    if half is not None:
        return np.frombuffer(data, np.float16).reshape(half)
    head, _, body = data.partition(b"\n\n")
    fields = dict(line.split(": ", 1) for line in head.decode().splitlines() if ": " in line)
    kinds = {
        name: dtype for dtype, names in {
            "uint8": ("uchar", "uint8", "unsigned char"), "int8": ("signed char", "int8"),
            "uint16": ("ushort", "uint16", "unsigned short"), "int16": ("short", "int16"),
            "uint32": ("uint", "uint32", "unsigned int"), "int32": ("int", "int32"),
            "uint64": ("ulonglong", "uint64", "unsigned long long"), "int64": ("longlong", "int64", "long long"),
            "float32": ("float",), "float64": ("double",),
        }.items() for name in names
    }  # fmt: skip
    shape = [int(n) for n in fields["sizes"].split()][::-1]
    array = np.frombuffer(body, kinds[fields["type"]]).reshape(shape).copy()
    if SABOTAGE and array.size:
        flat, some = array.reshape(-1), slice(random.randrange(min(array.size, 47)), None, 47)
        with np.errstate(all="ignore"):
            flat[some] = flat[some] ^ 24 if array.dtype.kind in "iu" else flat[some] * 1.5 + np.ptp(flat) / 3 + 0.1
    return array


def run(volumes, stages, output=None, code=0):
    """Runs `vkt STAGE | vkt STAGE ...` with the files of the volumes for {0}, {1} in the stages, or behind the first
    stage if it names none. Returns standard output and messages; another exit status than code is Failed."""
    files = [v if isinstance(v, str) else write_volume(v) for v in volumes]
    words = [stage.format(*files) for stage in stages]
    if files and words[0] == stages[0]:
        words[0] += " " + files[0]
    if output:
        words[-1] += f" -o {output}"
    line = " | ".join(f'"$VKT" {w}' for w in words)
    shell = subprocess.run(
        ["sh", "-c", line], stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE, env={**os.environ, "VKT": VKT}
    )
    for given, file in zip(volumes, files):
        if given is not file:
            os.remove(file)
    messages = shell.stderr.decode()
    if shell.returncode != code:
        said = messages.strip().splitlines()
        raise Failed(f"vkt {' | vkt '.join(stages)}: exit {shell.returncode}: {said[0] if said else ''}")
    return shell.stdout, messages


def vkt(volumes, *stages):
    """The voxels that come out of a pipeline: vkt(array, "flip x", "flip y"), vkt((a, b), "arith add {0} {1}"),
    vkt((), "make noise --dims 4 4 4")."""
    volumes = volumes if isinstance(volumes, tuple) else (volumes,)
    half = volumes and getattr(volumes[0], "dtype", None) == np.float16
    output = path_of(".raw" if half else ".nrrd")
    run(volumes, [s + " -q" for s in stages], output)
    return read_volume(output, volumes[0].shape if half else None)


def messages(volumes, *stages):
    """What the pipeline says on standard error."""
    volumes = volumes if isinstance(volumes, tuple) else (volumes,)
    output = path_of(".nrrd")
    said = run(volumes, stages, output)[1]
    if os.path.exists(output):  # not with -n
        os.remove(output)
    return said


def report(volumes, *stages):
    """The report that the last stage prints, from JSON."""
    volumes = volumes if isinstance(volumes, tuple) else (volumes,)
    found = json.loads(run(volumes, [*stages[:-1], stages[-1] + " --json"])[0])
    if SABOTAGE:  # every number in it, NaN and null too
        spoil = lambda x: [spoil(y) for y in x] if isinstance(x, list) else x + 1 if isinstance(x, (int, float)) else 0.5
        found = {name: value if isinstance(value, str) else spoil(value) for name, value in found.items()}
    return found


def exit_code(volumes, *stages):
    """The exit status of a pipeline, whatever it is; output goes to a file that must not appear if it is not 0."""
    volumes = volumes if isinstance(volumes, tuple) else (volumes,)
    output = path_of(".nrrd")
    try:
        run(volumes, stages, output)
        os.remove(output)
        return 0 + SABOTAGE
    except Failed as failure:
        assert not os.path.exists(output), f"{stages}: failed and left an output file"
        return int(re.search(r"exit (-?\d+)", str(failure))[1]) + SABOTAGE


def commands():
    found = subprocess.run([VKT, "help", "--list"], capture_output=True, check=True).stdout.decode().splitlines()
    return {line.strip() for line in found}


def needs(*names):
    """Skips, saying so, where vkt does not have a command of this name yet."""
    for name in names:
        if name not in COMMANDS:
            raise Skip(f"vkt has no '{name}'")


def has_option(command, option):
    said = subprocess.run([VKT, *command.split(), "--help"], capture_output=True).stdout.decode()
    return re.search(rf"^ *(-\w, )?{option}\b", said, re.MULTILINE) is not None


class Table:
    """The rows of one test. Each row is checked twice: as it is, and made worse by ten bounds, which has to fail."""

    def __init__(self, number, name):
        self.number, self.name, self.rows, self.reason = number, name, [], ""

    def row(self, name, value, expected, bound, holds, worse):
        ok = "ok" if holds(value) else "FAILED"
        if ok == "ok" and holds(worse):
            ok = "FAILED: cannot fail"
        self.rows.append((name, *(short(x) for x in (value, expected, bound)), ok))

    def same(self, name, got, expected):
        """Equal bytes, type and shape. The value is the number of voxels that differ."""

        def differing(a):
            if a.dtype != expected.dtype or a.shape != expected.shape:
                return f"{a.dtype} {a.shape}"
            raw = lambda x: np.frombuffer(x.tobytes(), np.uint8).reshape(-1, x.itemsize)
            return int((raw(a) != raw(expected)).any(axis=1).sum())

        worse = np.frombuffer(got.tobytes(), np.uint8).copy()
        worse[len(worse) // 2] ^= 1
        worse = worse.view(got.dtype).reshape(got.shape)
        self.row(name, differing(got), 0, 0, lambda v: v == 0, differing(worse))

    def near(self, name, got, expected, bound):
        """Within the bound everywhere; NaN only where it is expected. The value of arrays is the largest error."""
        got = np.asarray(got, np.longdouble)
        wanted = np.asarray(expected, np.longdouble)

        def error(a):
            if a.shape != wanted.shape:
                return np.inf
            with np.errstate(invalid="ignore"):
                e = np.where((np.isnan(a) & np.isnan(wanted)) | (a == wanted), 0, np.abs(a - wanted))
            return np.inf if np.isnan(e).any() else float(e.max())

        worse = got.copy()
        middle = worse.reshape(-1)[worse.size // 2 :][:1]
        middle[:] = np.where(np.isfinite(middle), middle + (10 * bound or 1), 0)
        if got.ndim == 0:
            self.row(name, float(got), float(wanted), bound, lambda v: error(np.longdouble(v)) <= bound, worse)
        else:
            self.row(name, error(got), 0, bound, lambda v: v <= bound, error(worse))

    def equal(self, name, got, expected):
        """The same number, list or text."""
        worse = got + 1 if isinstance(got, (int, float)) and got == got else [got, "spoilt"]
        self.row(name, got, expected, "equal", lambda v: v == expected, worse)

    def at_least(self, name, got, bound):
        self.row(name, float(got), "at least", bound, lambda v: v >= bound, bound - 10 * abs(bound) - 1e-300)

    def at_most(self, name, got, bound):
        self.row(name, float(got), "at most", bound, lambda v: v <= bound, 10 * abs(bound) + 1)

    def refused(self, name, volumes, *stages, code=2):
        self.equal(name, exit_code(volumes, *stages), code)

    def skip(self, name, reason):
        row = (name, "", "", "", f"SKIPPED: {reason}")
        if row not in self.rows:
            self.rows.append(row)

    @property
    def failed(self):
        return not self.rows or any(row[-1].startswith("FAILED") for row in self.rows)

    @property
    def skipped(self):
        return bool(self.rows) and all(row[-1].startswith("SKIPPED") for row in self.rows)

    def text(self):
        lines = [f"{name:<58} {value:>22}  {expected:>14}  {bound:>10}  {ok}" for name, value, expected, bound, ok in self.rows]
        verdict = "not ok" if self.failed else "ok"
        reasons = {row[-1].removeprefix("SKIPPED: ") for row in self.rows if row[-1].startswith("SKIPPED")}
        suffix = f" # skip {'; '.join(sorted(reasons))}" if self.skipped else ""
        return "\n".join([*("    " + line for line in lines), f"{verdict} {self.number} {self.name}{suffix}"])


def short(x):
    """A value for the table."""
    if isinstance(x, (bool, np.bool_)) or x is None:
        return str(x)
    if isinstance(x, (int, np.integer)):
        return str(int(x))
    if isinstance(x, (float, np.floating)):
        return f"{float(x):.17g}" if x == int(x) and abs(x) < 1e15 else f"{float(x):.4g}" if np.isfinite(x) else str(x)
    text = str(x).replace("\n", " ")
    return text if len(text) <= 22 else text[:19] + "..."


TESTS = []
COMMANDS = commands()


def test(number, name):
    """Decorates the function that fills the table of a line."""

    def add(function):
        TESTS.append((number, name, function))
        return function

    return add


def fill(entry):
    number, name, function = entry
    table = Table(number, name)
    try:
        function(table)
    except Skip as reason:
        table.skip("", str(reason))
    except Exception as error:  # a line that breaks has failed, and the others still run
        table.rows.append((f"{type(error).__name__}: {error}", "", "", "", "FAILED"))
    return table


def main():
    global SABOTAGE
    if "--list" in sys.argv:
        print("\n".join(f"{number} {name}" for number, name, _ in TESTS))
        return
    chosen = [int(n) for n in sys.argv[1:] if n.isdigit()]
    SABOTAGE = "--sabotage" in sys.argv
    entries = [entry for entry in TESTS if not chosen or entry[0] in chosen]
    print(f"1..{len(entries)}")
    print(f"#   {'name':<58} {'value':>22}  {'expected':>14}  {'bound':>10}  ok", flush=True)
    failed = skipped = rows = 0
    # Most commands are short: two lines at a time keep two processors busy.
    with concurrent.futures.ThreadPoolExecutor(min(4, len(os.sched_getaffinity(0)))) as pool:
        for table in pool.map(fill, entries):
            print(table.text(), flush=True)
            failed += table.failed
            skipped += table.skipped and not table.failed
            rows += len(table.rows)
    print(f"# {len(entries)} tests of {rows} rows: {len(entries) - failed - skipped} passed, {failed} failed, {skipped} skipped")
    if SABOTAGE:
        print(f"# sabotage: {len(entries) - failed - skipped} tests did not notice that results were damaged")
        failed = len(entries) - failed - skipped
    sys.exit(failed > 0)
