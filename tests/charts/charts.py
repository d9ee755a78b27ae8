#!/usr/bin/python3
# Error against seconds: vkt and its peers, on fields whose results are known. Writes one CSV and one SVG a chart.
# SPDX-License-Identifier: MIT
#
#   charts.py [--build DIR] [--out DIR] [--only WORD …] [--size N] [--runs N]      see run.sh
#   charts.py [--out DIR] --draw NAME …      draws charts anew from their tables
#
# Referees are not vkt: convolutions in float64 by SciPy with kernels cut at 8 sigma, values of smooth fields at the new
# positions, sums in exact integers, vtk's and SciPy's labels. Peers that are not installed are left out, and said.
import argparse
import csv
import datetime
import importlib
import math
import os
import platform
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

here = Path(__file__).resolve().parent
vkt = None
missing = set()


def module(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        missing.add(name)
        return None


def seconds_of(function, runs):
    """The best time of some runs after one that warms, and the result."""
    best, result = math.inf, None
    for run in range(runs + 1):
        begin = time.perf_counter()
        result = function()
        if run > 0:
            best = min(best, time.perf_counter() - begin)
    return best, result


def array_of(result):
    return result.array if hasattr(result, "array") else np.asarray(result)


def processor():
    names = (line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name"))
    return next(names, platform.processor())


class Chart:
    """Points of one figure: tool, variant, seconds, error."""

    def __init__(self, name, title, error, options, x="seconds"):
        self.name, self.title, self.error, self.options, self.x = name, title, error, options, x
        self.rows = []
        self.machine = f"{datetime.date.today()}, {processor()}, {len(os.sched_getaffinity(0))} threads"

    def add(self, tool, variant, function, error_of):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            seconds, result = seconds_of(function, self.options.runs)
            error = error_of(array_of(result))
        if math.isfinite(error):
            self.point(tool, variant, seconds, error)
        else:
            print(f"{self.name:<28} {tool:<10} {variant:<30} no finite result", flush=True)

    def point(self, tool, variant, seconds, error):
        self.rows.append((tool, variant, float(seconds), float(error)))
        print(f"{self.name:<28} {tool:<10} {variant:<30} {seconds:10.5f} {self.x} {error:12.4g}", flush=True)

    def write(self, folder):
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / f"{self.name}.csv", "w", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            file.write(f"# {self.title}; {self.error}; {self.machine}\n")
            table.writerow(["tool", "variant", self.x, "error"])
            for tool, variant, seconds, error in self.rows:
                table.writerow([tool, variant, f"{seconds:.6g}", f"{error:.6g}"])
        if shutil.which("gnuplot"):
            self.draw(folder)
        else:
            missing.add("gnuplot")

    @classmethod
    def read(cls, folder, name):
        """A chart as write() left it."""
        with open(folder / f"{name}.csv", newline="") as file:
            title, error, machine = file.readline()[2:].rstrip("\n").rsplit("; ", 2)
            columns, *rows = csv.reader(file)
        chart = cls(name, title, error, None, columns[2])
        chart.rows = [(tool, variant, float(x), float(y)) for tool, variant, x, y in rows]
        chart.machine = machine
        return chart

    def draw(self, folder):
        tools = list(dict.fromkeys(row[0] for row in self.rows))
        floor = 1e-9
        newline = r"\n"
        quoted = lambda text: '"' + text.replace('"', "'") + '"'
        script = [
            f'set terminal svg size 760,480 font "sans,13" background "white"',
            f"set output {quoted(str(folder / (self.name + '.svg')))}",
            f"set title {quoted(self.title.replace('^3', '³') + newline + self.machine)}",
            f"set xlabel {quoted('seconds' if self.x == 'seconds' else 'million voxels')}",
            f"set ylabel {quoted(self.error)}",
            "set logscale xy", 'set format xy "%g"', "set grid back lc rgb '#dddddd'", "set key outside right top",
        ]
        plots = []
        colours = ["#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#8c564b", "#17becf", "#7f7f7f", "#bcbd22"]
        for i, tool in enumerate(tools):
            points = sorted((max(s, 1e-9), max(e, floor), v) for t, v, s, e in self.rows if t == tool)
            script.append(f"$data{i} << end")
            script += [f"{s} {e} {quoted(v)}" for s, e, v in points]
            script.append("end")
            width = 2.5 if tool == "vkt" else 1
            plots.append(f"$data{i} using 1:2 with linespoints lw {width} pt {5 + i} ps 0.7 lc rgb '{colours[i % 8]}' title {quoted(tool)}")
            plots.append(f"$data{i} using 1:2:3 with labels font ',8' offset 0.6,0.5 left tc rgb '{colours[i % 8]}' notitle")
        script.append("plot " + ", ".join(plots))
        subprocess.run(["gnuplot"], input="\n".join(script), text=True, check=True)


def inside(reference, mask):
    return lambda result: np.max(np.abs(result.astype(np.float64) - reference)[mask])


def field(n, seed=1):
    """Noise on several scales, 0 to 1, float32."""
    ndimage = importlib.import_module("scipy.ndimage")
    random = np.random.default_rng(seed)
    total = np.zeros((n, n, n))
    for sigma in (0, 2, 6):
        v = random.random((n, n, n))
        v = ndimage.gaussian_filter(v, sigma) if sigma else v
        total += (v - v.min()) / (v.max() - v.min())
    total -= total.min()
    return (total / total.max()).astype(np.float32)


def waves(positions):
    """A smooth field of positions in [-1, 1]^3, (z, y, x): a Gaussian with ripples of five voxels in 64."""
    z, y, x = positions
    r2 = x * x + y * y + z * z
    return np.exp(-3 * r2) * (0.6 + 0.4 * np.cos(12 * x + 3 * y) * np.cos(11 * y - 2 * z) * np.cos(10 * z))


def grid(n):
    """Positions of voxel centres."""
    line = (np.arange(n) + 0.5) / n * 2 - 1
    return np.meshgrid(line, line, line, indexing="ij")


def gaussians(options):
    ndimage, cv2, itk = module("scipy.ndimage"), module("cv2"), module("SimpleITK")
    n = options.size
    v = field(n)
    volume, command, teem = vkt.Volume(v), gmic(v), unu(v)
    charts = []
    for sigma in (1, 2, 4, 8, 16, 32):
        chart = Chart(f"gaussian-{sigma}", f"Gaussian, sigma {sigma}, {n}^3 float32", "largest error, of the range", options)
        # Where no tool sees how the others continue the volume; with wide kernels all see it, and mirror it but ITK.
        inner = (slice(min(5 * sigma, n // 3), -min(5 * sigma, n // 3)),) * 3
        reference = ndimage.gaussian_filter(v.astype(np.float64), sigma, truncate=8)[inner]
        error = lambda result: np.max(np.abs(result[inner].astype(np.float64) - reference))
        for tolerance in ("3%", "1%", "0.1%", "0.01%", "0.001%", "0.00001%"):
            chart.add("vkt", tolerance, lambda: volume.apply("filter gaussian", sigma=sigma, tolerance=tolerance), error)
        for cut in (2, 3, 4, 5):
            chart.add("SciPy", f"cut at {cut}", lambda: ndimage.gaussian_filter(v, sigma, truncate=cut), error)
        if cv2:
            for cut in (2, 3, 4, 5):
                chart.add("OpenCV", f"cut at {cut}", lambda: opencv_gaussian(cv2, v, sigma, cut), error)
        if itk and 5 * sigma <= n // 3:
            image = itk.GetImageFromArray(v)
            for most in (0.1, 0.01, 0.001):
                def discrete():
                    return itk.GetArrayFromImage(itk.DiscreteGaussian(image, sigma**2, 16 * sigma, most, False))
                chart.add("ITK", f"discrete {most:g}", discrete, error)
            chart.add("ITK recursive", "", lambda: itk.GetArrayFromImage(itk.SmoothingRecursiveGaussian(image, sigma)), error)
        if teem:
            for cut in (3, 4, 5):
                teem.resample(chart, f"cut at {cut}", ["x1"] * 3, f"gauss:{sigma},{cut}", error)
        if command:
            for kind, name in enumerate(("recursive, Deriche", "recursive, Vliet")):
                command.add(chart, name, f"blur {sigma},1,{kind}", error)
        charts.append(chart)
    return charts


class Gmic:
    """G'MIC's command, which times itself: calls as seconds_of() wants them, without reading and writing of files."""

    def __init__(self, v):
        self.folder = tempfile.TemporaryDirectory()
        self.shape = v.shape
        with open(f"{self.folder.name}/in.cimg", "wb") as file:
            file.write(b"1 float little_endian\n%d %d %d 1\n" % v.shape[::-1])
            file.write(v.astype("<f4").tobytes())

    def add(self, chart, variant, words, error_of):
        """A point of the chart: the best of its runs."""
        best = math.inf
        for _ in range(chart.options.runs + 1):
            said = subprocess.run(["gmic", f"{self.folder.name}/in.cimg", "tic", *words.split(), "toc", "output",
                                   f"{self.folder.name}/out.cimg,float"], capture_output=True, text=True, check=True).stderr
            best = min(best, float(re.search(r"Elapsed time: ([0-9.]+) s", said).group(1)))
        with open(f"{self.folder.name}/out.cimg", "rb") as file:
            file.readline()
            file.readline()
            result = np.frombuffer(file.read(), "<f4").reshape(self.shape)
        chart.point("G'MIC", variant, best, error_of(result))


class Unu:
    """teem's command, which does not time itself: what `unu save` takes for a result as large is taken off. Of both it is
    the processor time, of their one thread, that counts: disks make commands wait."""

    def __init__(self, v, program):
        self.folder, self.program = tempfile.TemporaryDirectory(), program
        with open(f"{self.folder.name}/in.nrrd", "wb") as file:
            sizes = " ".join(map(str, v.shape[::-1]))
            file.write(f"NRRD0001\ntype: float\ndimension: 3\nsizes: {sizes}\nencoding: raw\nendian: little\n\n".encode())
            file.write(v.astype("<f4").tobytes())

    def seconds(self, runs, *words):
        best = math.inf
        for _ in range(runs):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([self.program, *words], stderr=subprocess.DEVNULL, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            best = min(best, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        return best

    def resample(self, chart, variant, sizes, kernel, error_of):
        """A point of the chart; sizes as unu takes them, centres of cells, ends that go on."""
        runs, out = chart.options.runs, f"{self.folder.name}/out.nrrd"
        seconds = self.seconds(runs, "resample", "-i", f"{self.folder.name}/in.nrrd", "-s", *sizes, "-k", kernel,
                               "-b", "mirror", "-c", "cell", "-co", "-o", out)
        with open(out, "rb") as file:
            head, _, voxels = file.read().partition(b"\n\n")
        shape = list(map(int, re.search(rb"sizes: ([0-9 ]+)", head).group(1).split()))[::-1]
        result = np.frombuffer(voxels, "<f4").reshape(shape)
        files = self.seconds(runs, "save", "-f", "nrrd", "-i", out, "-o", f"{self.folder.name}/copy.nrrd")
        chart.point("unu", variant, max(seconds - files, 1e-6), error_of(result))


def unu(v):
    """None, and noted as missing, where it is not installed."""
    program = shutil.which("unu") or shutil.which("teem-unu")
    if program:
        return Unu(v, program)
    missing.add("unu")
    return None


def gmic(v):
    """None, and noted as missing, where it is not installed."""
    if shutil.which("gmic"):
        return Gmic(v)
    missing.add("gmic")
    return None


def opencv_gaussian(cv2, v, sigma, cut):
    radius = int(cut * sigma + 0.5)
    k = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    k = (k / k.sum()).astype(np.float32)
    between = np.empty_like(v)
    for z in range(v.shape[0]):
        cv2.sepFilter2D(v[z], cv2.CV_32F, k, k, dst=between[z], borderType=cv2.BORDER_REFLECT)
    flat = between.reshape(v.shape[0], -1)
    return cv2.sepFilter2D(flat, cv2.CV_32F, np.ones(1, np.float32), k, borderType=cv2.BORDER_REFLECT).reshape(v.shape)


def resampling(options):
    ndimage, itk, transform = module("scipy.ndimage"), module("SimpleITK"), module("skimage.transform")
    n = options.size
    v = waves(grid(n)).astype(np.float32)
    volume, teem = vkt.Volume(v), unu(v)
    charts = []
    for name, m in (("half", n // 2), ("larger", n * 3 // 2)):
        chart = Chart(f"resample-{name}", f"{n}^3 to {m}^3, a smooth field", "largest error, of the range", options)
        at = grid(m)
        rim = np.max(np.abs(np.stack(at)), axis=0) < 0.9
        error = inside(waves(at), rim)
        for method in ("nearest", "linear", "cubic", "lanczos3", "bspline3", "bspline5", "auto"):
            chart.add("vkt", method, lambda: volume.apply("resample", dims=(m, m, m), method=method), error)
        for order in (0, 1, 3, 5):
            chart.add("SciPy", f"order {order}",
                      lambda: ndimage.zoom(v, m / n, order=order, mode="nearest", grid_mode=True), error)
        if teem:
            # Smaller with its kernels for larger ones too: a smooth field needs no average.
            for label, kernel in (("tent", "tent"), ("Catmull-Rom", "cubic:0,0.5"), ("Hann, radius 4", "hann:4")):
                teem.resample(chart, label, [str(m)] * 3, kernel, error)
        if transform:
            for order in (1, 3):
                chart.add("skimage", f"order {order}",
                          lambda: transform.resize(v, (m, m, m), order=order, anti_aliasing=False, mode="edge"), error)
        if itk:
            image = itk.GetImageFromArray(v)
            image.SetSpacing([1.0 / n] * 3)
            image.SetOrigin([0.5 / n] * 3)
            for label, kind in (("nearest", itk.sitkNearestNeighbor), ("linear", itk.sitkLinear), ("bspline", itk.sitkBSpline)):
                chart.add("ITK", label, lambda: itk.GetArrayFromImage(itk.Resample(
                    image, [m] * 3, itk.Transform(), kind, [0.5 / m] * 3, [1.0 / m] * 3)), error)
        charts.append(chart)
    return charts


def rotations(options):
    ndimage, itk, cv2 = module("scipy.ndimage"), module("SimpleITK"), module("cv2")
    n = options.size
    at = grid(n)
    v = waves(at).astype(np.float32)
    volume, command = vkt.Volume(v), gmic(v)
    ball = at[0] ** 2 + at[1] ** 2 + at[2] ** 2 < 0.8
    charts = []
    for turns, angle in ((1, 30), (12, 30)):
        chart = Chart(f"rotate-{turns}", f"{turns} rotation(s) by {angle} degrees about z, {n}^3 float32",
                      "largest error, of the range", options)
        t = math.radians(turns * angle)
        # Tools turn one way or the other.
        both = [inside(waves((at[0], at[1] * math.cos(t) - way * at[2] * math.sin(t),
                              at[2] * math.cos(t) + way * at[1] * math.sin(t))), ball) for way in (1, -1)]
        error = lambda result: min(way(result) for way in both)

        def ours(method):
            result = volume
            for _ in range(turns):
                result = result.apply("rotate", axis="z", angle=angle, method=method)
            return result

        def scipy(order):
            result = v
            for _ in range(turns):
                result = ndimage.rotate(result, angle, (1, 2), reshape=False, order=order, mode="constant")
            return result

        for method in ("nearest", "linear", "cubic", "lanczos3", "bspline3", "bspline5"):
            chart.add("vkt", method, lambda: ours(method), error)
        for order in (1, 3, 5) if turns == 1 else (1, 3):
            chart.add("SciPy", f"order {order}", lambda: scipy(order), error)
        if cv2:
            matrix = cv2.getRotationMatrix2D(((n - 1) / 2, (n - 1) / 2), angle, 1)
            for label, flag in (("linear", cv2.INTER_LINEAR), ("cubic", cv2.INTER_CUBIC), ("lanczos4", cv2.INTER_LANCZOS4)):
                def opencv():
                    result = v
                    for _ in range(turns):
                        result = np.stack([cv2.warpAffine(s, matrix, (n, n), flags=flag) for s in result])
                    return result
                chart.add("OpenCV", label, opencv, error)
        if itk:
            for label, kind in (("linear", itk.sitkLinear), ("bspline", itk.sitkBSpline)):
                def itk_turns():
                    image = itk.GetImageFromArray(v)
                    centre = [(n - 1) / 2] * 3
                    rotation = itk.Euler3DTransform(centre, 0, 0, math.radians(angle), (0, 0, 0))
                    for _ in range(turns):
                        image = itk.Resample(image, image, rotation, kind, 0.0)
                    return itk.GetArrayFromImage(image)
                chart.add("ITK", label, itk_turns, error)
        if command:
            centre = ",".join([str((n - 1) / 2)] * 3)
            for kind, label in ((0, "nearest"), (1, "linear"), (2, "cubic")):
                command.add(chart, label, " ".join([f"rotate 0,0,1,{angle},{kind},0,{centre}"] * turns), error)
        charts.append(chart)
    return charts


def equalization(options):
    exposure = module("skimage.exposure")
    n = options.size // 2
    v = field(n, 2)
    volume = vkt.Volume(v)
    chart = Chart("clahe-bins", f"CLAHE, {n}^3 float32, 8^3 bricks", "largest change from 65536 bins, of the range", options)
    reference = volume.apply("clahe", bins=65536, bricks=(8, 8, 8), clip=2).array.astype(np.float64)
    span = float(reference.max() - reference.min())
    error = lambda result: np.max(np.abs(result - reference)) / span
    for bins in (16, 64, 256, 1024, 4096):
        chart.add("vkt", f"{bins} bins", lambda: volume.apply("clahe", bins=bins, bricks=(8, 8, 8), clip=2), error)
    if exposure:
        settle = lambda nbins: exposure.equalize_adapthist(v, kernel_size=n // 8, clip_limit=0.01, nbins=nbins)
        fine = settle(4096).astype(np.float64)
        peer = lambda result: np.max(np.abs(result - fine)) / float(fine.max() - fine.min())
        for bins in (16, 64, 256, 1024):
            chart.add("skimage", f"{bins} bins, from its 4096", lambda: settle(bins), peer)
    return [chart]


def sums(options):
    charts = []
    n = options.size
    base = np.random.default_rng(4).random((n, n, n), np.float32)
    for offset in (0, 1e3, 1e6):
        v = (base + np.float32(offset)).astype(np.float32)
        whole = v.astype(np.float64)
        mean = math.fsum(whole.reshape(-1, n * n).sum(axis=1)) / whole.size
        variance = float(np.mean((whole - mean) ** 2, dtype=np.longdouble))
        volume = vkt.Volume(v)
        chart = Chart(f"variance-{offset:g}", f"Variance of {n}^3 float32 around {offset:g}", "relative error", options)
        error = lambda result: abs(float(result) / variance - 1) if variance else abs(float(result))
        chart.add("vkt", "stats", lambda: np.float64(volume.stats()["variance"]), error)
        chart.add("NumPy", "float32", lambda: np.var(v), error)
        chart.add("NumPy", "float64", lambda: np.var(v, dtype=np.float64), error)
        chart.add("one pass", "float64 squares", lambda: np.mean(np.square(whole)) - np.mean(whole) ** 2, error)
        charts.append(chart)
    return charts


def scaling(options):
    ndimage, cc3d, edt = module("scipy.ndimage"), module("cc3d"), module("edt")
    charts = []
    for name in ("label", "distance"):
        chart = Chart(f"{name}-scaling", f"{name}, blobs of half the volume", "seconds", options, x="megavoxels")
        for n in (32, 64, 128, options.size):
            smooth = ndimage.gaussian_filter(np.random.default_rng(5).random((n, n, n)), 2)
            mask = (smooth > np.median(smooth)).astype(np.uint8)
            volume = vkt.Volume(mask)
            def time_of(tool, function):
                seconds, _ = seconds_of(function, options.runs)
                chart.point(tool, f"{n}^3", n**3 / 1e6, seconds)
            if name == "label":
                time_of("vkt", lambda: volume.apply("label", connectivity=26))
                time_of("SciPy", lambda: ndimage.label(mask, np.ones((3, 3, 3))))
                if cc3d:
                    time_of("cc3d", lambda: cc3d.connected_components(mask, connectivity=26))
            else:
                time_of("vkt", lambda: volume.apply("distance"))
                time_of("SciPy", lambda: ndimage.distance_transform_edt(mask))
                if edt:
                    time_of("edt", lambda: edt.edt(mask, parallel=len(os.sched_getaffinity(0))))
        charts.append(chart)
    return charts


def pictures(options):
    """March, iso-surfaces and paths against a reference of their own that no table and no step enters."""
    n = options.size // 2
    charts = []
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/v.nrrd"
        volume = vkt.Volume((255 * waves(grid(n))).clip(0, 255).astype(np.uint8))
        volume.write(path)
        # Times are of all of the picture, also where that many seconds are enough for a smaller one only.
        for name, words, budget in (("march", "render --size 256x256", 20),
                                    ("iso", "render --size 256x256 --render-algo implicit-iso --iso 120", 100),
                                    ("scattering", "render --size 96x96 --render-algo multi-scattering", 20)):
            chart = Chart(name, f"{words}, {n}^3 uint8", "largest error, display levels", options)
            done = subprocess.run([options.vkt, "chart", words, path, "--csv", "--budget", str(budget)],
                                  capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit(done.stderr)
            for row in csv.DictReader(done.stdout.splitlines()):
                turned = re.findall("--(step|spp|tolerance|leave-out) ([^ ]+)", row["pipeline"])
                knob = ", ".join(" ".join(words) for words in turned) or "as it is"
                if int(row["threads"]) == len(os.sched_getaffinity(0)):
                    chart.point("vkt", knob, float(row["whole_seconds"]), float(row["max_error"]))
            charts.append(chart)
    return charts


def fog(n):
    """A smooth field of bytes with a rim of nothing: tools continue the volume differently."""
    v = (255 * waves(grid(n))).clip(0, 255).astype(np.uint8)
    within = np.zeros_like(v)
    within[3:-3, 3:-3, 3:-3] = 1
    return v * within


def table(thickness, colour):
    """Words for one colour and the opacities of an extinction in proportion to the value."""
    return ["--lut", *[colour] * 3, "0", *[colour] * 3, str(-math.expm1(-thickness))]


def fog_words(other):
    return ["--background", "0,0,0", "--shade", "none", *table(other.thin, "1")]


def frame(program, folder, n, *more, runs=3):
    """The best seconds of some frames of FOLDER/v.nrrd by the camera of renderers.py, and the linear grey picture."""
    other, middle, best = importlib.import_module("renderers"), (n - 1) / 2, math.inf
    words = ["--eye", ",".join(map(str, other.eye * n + middle)), "--target", f"{middle},{middle},{middle}", "--up", "0,0,1",
             "--fov", "30", "--domain", "0:255", "--unit-distance", "1", "--threads", str(len(os.sched_getaffinity(0)))]
    for _ in range(runs):
        said = subprocess.run([program, "render", f"{folder}/v.nrrd", *words, *more, "-v", "--force",
                               "-o", f"{folder}/a.pfm"], capture_output=True, text=True, check=True).stderr
        best = min(best, float(said.split("rendered in ")[1].split(" ms")[0]))
    with open(f"{folder}/a.pfm", "rb") as file:
        file.readline()
        width, height = map(int, file.readline().split())
        scale = abs(float(file.readline()))
        picture = np.frombuffer(file.read(), "<f4").reshape(height, width, 3)[::-1].mean(axis=2) * scale
    return best / 1000, picture


def renderers(options):
    """Fog without surfaces, beside VTK and Mitsuba: frames with the data loaded, without what is prepared once."""
    n, size = options.size // 2, 192
    v = fog(n)
    other = importlib.import_module("renderers")
    reference = other.march(v, size)
    marched = Chart("march-fog", f"Ray marching of fog, {size}x{size}, {n}^3 uint8", "largest error, levels of 255", options)
    paths = Chart("paths-fog", f"Multiple scattering, 64x64, {n}^3 uint8", "RMS error, of the mean", options)

    def rows_of_peer(chart, tool, command, *files):
        done = subprocess.run([*command, str(here / "renderers.py"), *files], capture_output=True, text=True)
        if done.returncode != 0:
            missing.add(tool)
            print(done.stderr[-500:], file=sys.stderr)
        for line in done.stdout.splitlines():
            variant, seconds, error = line.split(",")
            chart.point(tool, variant, float(seconds), float(error))

    with tempfile.TemporaryDirectory() as folder:
        vkt.Volume(v).write(f"{folder}/v.nrrd")
        np.save(f"{folder}/v.npy", v)
        np.save(f"{folder}/reference.npy", reference)
        drawn = lambda *words, **keys: frame(options.vkt, folder, n, *words, **keys)

        for step in (4, 2, 1, 0.5, 0.25):
            seconds, picture = drawn("--size", f"{size}x{size}", *fog_words(other), "--step", str(step))
            marched.point("vkt", f"step {step:g}", seconds, 255 * np.max(np.abs(picture - reference)))
        rows_of_peer(marched, "VTK", ["xvfb-run", "-a", sys.executable], "vtk-march", f"{folder}/v.npy",
                     f"{folder}/reference.npy")

        scene = ["--render-algo", "multi-scattering", "--size", "64x64", "--background", "1,1,1",
                 *table(other.thick, "0.9")]  # sRGB, 0.787 in linear light
        _, limit = drawn(*scene, "--spp", "1024", "--seed", "7", runs=1)
        for count in (4, 16, 64, 256):
            seconds, picture = drawn(*scene, "--spp", str(count))
            noise = np.mean((picture - limit) ** 2) / (1 + count / 1024)
            paths.point("vkt", f"spp {count}", seconds, math.sqrt(noise) / limit.mean())
        rows_of_peer(paths, "Mitsuba 3", [sys.executable], "mitsuba", f"{folder}/v.npy", "64")
    return [marched, paths]


def reconstructions(options):
    """Hierarchical volumes made structured: cell averages of a field in closed form, against the field."""
    bench = Path(options.build) / "tests" / "vkt_amr_bench"
    if not bench.exists():
        missing.add("vkt_amr_bench")
        return []
    done = subprocess.run([bench, "accuracy", str(len(os.sched_getaffinity(0)))], capture_output=True, text=True, check=True)
    chart = Chart("amr-reconstructions", "A tree of cell averages to a grid", "RMS error, of the field's deviation", options)
    for row in csv.DictReader(done.stdout.splitlines()):
        if row["where"] == "all":
            chart.point(row["method"], f"{float(row['samples_per_finest_cell']):g} a cell", float(row["seconds"]),
                        float(row["rms_error"]))
    return [chart]


def arguments():
    """The options, with the package imported from the build."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", default=str(here.parent.parent / "build"))
    parser.add_argument("--out", default=here / "results", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--draw", nargs="*", default=[])
    parser.add_argument("--size", type=int)
    parser.add_argument("--runs", type=int, default=2)
    options = parser.parse_args()
    options.vkt = str(Path(options.build) / "vkt")
    if not options.draw:
        sys.path.insert(0, str(Path(options.build) / "python"))
        global vkt
        vkt = importlib.import_module("vkt")
    return options


def main():
    options = arguments()
    for name in options.draw:
        Chart.read(options.out, name).draw(options.out)
    if options.draw:
        return
    options.size = options.size or 192
    for make in (gaussians, resampling, rotations, equalization, sums, scaling, pictures, renderers, reconstructions):
        if options.only and not any(word in make.__name__ for word in options.only):
            continue
        for chart in make(options):
            chart.write(options.out)
    if missing:
        print("left out, not installed: " + ", ".join(sorted(missing)), file=sys.stderr)


if __name__ == "__main__":
    main()
