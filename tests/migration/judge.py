"""judge.py PAGE: runs every line of vkt-migration(7) in the current directory, vkt's side against NumPy and SciPy, and
against the other tool where that is installed. Prints a line for each tool. SPDX-License-Identifier: MIT"""
import gzip
import json
import os
import re
import shlex
import shutil
import subprocess
import sys

import nibabel
import numpy as np
import tifffile
from scipy import ndimage


def rows(page):
    """(section, their command, our command) of the page; what the lists hold and is no such pair is an error."""
    section, theirs, found, items = "", None, [], 0
    for line in open(page):
        line = line.rstrip("\n")
        if line.startswith(".Sh "):
            section = line[4:]
        elif line.startswith(".It Li "):
            items += 1
            theirs = plain(line[7:])
        elif line.startswith(".Li ") and theirs is not None:
            found.append((section, theirs, plain(line[4:])))
            theirs = None
    assert items == len(found), f"{items} commands of others, {len(found)} of vkt"
    return found


def plain(text):
    return text.replace("\\&", "").replace("\\(dq", '"').replace("\\e", "\\")


def read_nrrd(name):
    head, data = open(name, "rb").read().split(b"\n\n", 1)
    fields = dict(line.split(": ", 1) for line in head.decode().splitlines() if ": " in line)
    if fields["encoding"] in ("gzip", "gz"):
        data = gzip.decompress(data)
    kind = {"unsigned char": "u1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "unsigned short": "u2", "ushort": "u2",
            "uint16": "u2", "int": "i4", "int32": "i4", "unsigned int": "u4", "uint": "u4", "uint32": "u4", "float": "f4", "double": "f8"}[fields["type"]]
    assert fields.get("endian", "little") == "little"
    sizes = [int(n) for n in fields["sizes"].split()][::-1]
    return np.frombuffer(data, kind)[:int(np.prod(sizes))].reshape(sizes)


def read(name, canonical=False):
    """Voxels [z, y, x], axes of one voxel left out; canonical: axes of NIfTI in the order that their directions tell."""
    if name.endswith(".nrrd"):
        voxels = read_nrrd(name)
    elif name.endswith(".nii"):
        image = nibabel.load(name)
        voxels = np.asarray((nibabel.as_closest_canonical(image) if canonical else image).dataobj).T
    else:
        voxels = tifffile.imread(name)
    return np.squeeze(voxels)


def write_nrrd(name, voxels):
    kind = {"int16": "short", "float32": "float", "uint8": "uchar"}[voxels.dtype.name]
    z, y, x = voxels.shape
    head = (f"NRRD0004\ntype: {kind}\ndimension: 3\nspace dimension: 3\nsizes: {x} {y} {z}\nspace directions: (1,0,0) (0,1.5,0) (0,0,2)\n"
            "centerings: cell cell cell\nkinds: domain domain domain\nendian: little\nencoding: raw\nspace origin: (0,0,0)\n\n")
    open(name, "wb").write(head.encode() + voxels.tobytes())


rng = np.random.default_rng(7)
Z, Y, X = np.mgrid[0:16, 0:20, 0:24]
smooth = 180 * np.exp(-((X - 11) ** 2 / 60 + (Y - 9) ** 2 / 50 + (Z - 8) ** 2 / 30)) + 90 * np.exp(-((X - 19) ** 2 + (Y - 15) ** 2 + (Z - 4) ** 2) / 12)
V = np.clip(smooth + rng.normal(40, 25, smooth.shape), 0, 400).astype("i2")  # no negative values: TIFF holds uint16
B = np.clip(smooth[::-1] * 0.7 + rng.normal(60, 20, smooth.shape), 0, 400).astype("i2")
F, O = V.astype("f4") + rng.random(V.shape).astype("f4") / 2, B.astype("f4")
M = ((smooth > 60) | (rng.random(V.shape) > 0.985)).astype("u1")
M[7:9, 8:10, 10:12] = 0  # a cavity
v, m = F, M


def inputs():
    for name, voxels in (("in", V), ("second", B), ("mask", M)):
        write_nrrd(name + ".nrrd", voxels)
        nibabel.save(nibabel.Nifti1Image(np.ascontiguousarray(voxels.T), np.diag([1, 1.5, 2, 1])), name + ".nii")
        tifffile.imwrite(name + ".tif", voxels.astype("u2") if voxels.dtype == "i2" else voxels)
    write_nrrd("float.nrrd", F)
    write_nrrd("other.nrrd", O)


def ball(r):
    z, y, x = np.mgrid[-r:r + 1, -r:r + 1, -r:r + 1]
    return x * x + y * y + z * z <= r * r


def gauss(a, sigma):
    return ndimage.gaussian_filter(a.astype("f8"), sigma, truncate=8)


def rounded(a, low, high):
    return np.clip(np.rint(a), low, high)


def signed(a):
    inside, outside = ndimage.distance_transform_edt(a, sampling=(2, 1.5, 1)), ndimage.distance_transform_edt(1 - a, sampling=(2, 1.5, 1))
    return outside - inside


def largest(a):
    labels, n = ndimage.label(a, np.ones((3, 3, 3)))
    return labels == 1 + np.argmax(ndimage.sum(a, labels, range(1, n + 1)))


def halves(a):
    return a.reshape(a.shape[0] // 2, 2, a.shape[1] // 2, 2, a.shape[2] // 2, 2).mean(axis=(1, 3, 5))


def doubled(a):
    return ndimage.zoom(a.astype("f8"), 2, order=1, grid_mode=True, mode="nearest")


filled = V.copy()
filled[1:8, 3:13, 2:10] = 7
# Our command, with .nrrd for every format and without its output: what NumPy and SciPy make of it.
EXPECTED = {
    "vkt convert in.nrrd out.nrrd": V,
    "vkt declare-sv --dims 24 20 16 --dtype uint8 | vkt fill --value 1": np.full(V.shape, 255),
    "vkt fill in.nrrd --value 7 --roi 2:10,3:13,1:8": filled,
    "vkt flip x in.nrrd --roi 0:24,0:20,0:16": V[:, :, ::-1],
    "vkt resample in.nrrd --dims 12 10 8 --dtype float32": halves(V.astype("f8")),
    "vkt set in.nrrd --spacing 1,1,2": V,
    "vkt crop in.nrrd --roi 2:10,3:13,1:8": V[1:8, 3:13, 2:10],
    "vkt crop in.nrrd --roi 2:10,3:13,:": V[:, 3:13, 2:10],
    "vkt crop in.nrrd --roi 2:+8,3:+10,1:+7": V[1:8, 3:13, 2:10],
    "vkt crop in.nrrd --roi 2:+8,3:+10,:": V[:, 3:13, 2:10],
    "vkt crop float.nrrd --roi 2:10,3:13,1:8": F[1:8, 3:13, 2:10],
    "vkt pad in.nrrd --by 2 --boundary clamp": np.pad(V, 2, "edge"),
    "vkt pad in.nrrd --by 2 --value 5": np.pad(V, 2, constant_values=5),
    "vkt pad in.nrrd --by 2": np.pad(V, 2),
    "vkt pad float.nrrd --by 2 --boundary mirror": np.pad(F, 2, "symmetric"),
    "vkt flip x in.nrrd": V[:, :, ::-1],
    "vkt flip z in.nrrd": V[::-1],
    "vkt flip x float.nrrd": F[:, :, ::-1],
    "vkt permute zyx in.nrrd": V.transpose(2, 1, 0),
    "vkt permute xzy in.nrrd": V.transpose(1, 0, 2),
    "vkt slice in.nrrd --z 5": V[5],
    "vkt project max in.nrrd": V.max(axis=0),
    "vkt project max float.nrrd": F.max(axis=0),
    "vkt project mean float.nrrd --axis x": F.mean(axis=2, dtype="f8"),
    "vkt convert in.nrrd --dtype float32 | vkt project mean": V.mean(axis=0),
    "vkt convert in.nrrd --dtype float32 | vkt project mean --axis x": V.mean(axis=2),
    "vkt resample float.nrrd --scale 2 --method linear": doubled(F),
    "vkt resample float.nrrd --scale 0.5": halves(F.astype("f8")),
    "vkt convert in.nrrd --dtype float32 | vkt resample --scale 2 --method linear": doubled(V),
    "vkt convert in.nrrd --dtype float32": V,
    "vkt convert in.nrrd --dtype uint8 --range minmax": np.rint((V - V.min()) / (V.max() - V.min()) * 255),
    "vkt convert float.nrrd --dtype uint8 --range 0:300": rounded(F / 300.0 * 255, 0, 255),
    "vkt arith mul float.nrrd 2": 2 * F,
    "vkt arith sub float.nrrd other.nrrd": F - O,
    "vkt arith abs float.nrrd": abs(F),
    "vkt arith clamp float.nrrd 0 200": np.clip(F, 0, 200),
    "vkt arith clamp in.nrrd 0 200": np.clip(V, 0, 200),
    "vkt arith add in.nrrd 10": V + 10,
    "vkt arith add in.nrrd second.nrrd": V + B,
    "vkt arith sub in.nrrd second.nrrd": V - B,
    "vkt arith sub in.nrrd second.nrrd --dtype float32": V - B,
    "vkt arith mul mask.nrrd in.nrrd --dtype float32": M * V,
    "vkt arith where mask.nrrd in.nrrd 0": M * V,
    "vkt arith where mask.nrrd float.nrrd 0": M * F,
    "vkt transform 'v * 2 + 1' in.nrrd --dtype float32": V * 2 + 1,
    "vkt transform 'v < 100 ? 0 : v' in.nrrd": np.where(V < 100, 0, V),
    "vkt transform 'v > 200 ? 0 : v' in.nrrd": np.where(V > 200, 0, V),
    "vkt threshold float.nrrd --above 100": F > 100,
    "vkt threshold in.nrrd --range 100:": V >= 100,
    "vkt threshold in.nrrd --range 100:200": (V >= 100) & (V <= 200),
    "vkt threshold in.nrrd --range 100: | vkt arith mul - 255": 255 * (V >= 100),
    "vkt stack in.nrrd second.nrrd --along z --force-uniform": np.concatenate([V, B]),
    "vkt filter median in.nrrd --radius 1": ndimage.median_filter(V, 3),
    "vkt filter median float.nrrd --radius 1": ndimage.median_filter(F, 3),
    "vkt filter box float.nrrd --radius 2": ndimage.uniform_filter(F.astype("f8"), 5),
    "vkt convert in.nrrd --dtype float32 | vkt filter box --radius 1": ndimage.uniform_filter(V.astype("f8"), 3),
    "vkt filter gaussian float.nrrd --sigma 2": gauss(F, 2),
    "vkt convert in.nrrd --dtype float32 | vkt filter gaussian --sigma 2 --unit world": gauss(V, (1, 2 / 1.5, 2)),
    "vkt convert in.nrrd --dtype float32 | vkt filter gaussian --sigma 1.5": gauss(V, 1.5),
    "vkt convert in.nrrd --dtype float32 | vkt filter gaussian --sigma 2": gauss(V, 2),
    "vkt set float.nrrd --spacing 1 | vkt filter laplacian": ndimage.laplace(F.astype("f8")),
    "vkt set float.nrrd --spacing 1 | vkt filter gradient --component x": ndimage.convolve1d(F.astype("f8"), [0.5, 0, -0.5], axis=2),
    "vkt morphology erode in.nrrd": ndimage.grey_erosion(V, footprint=ball(1)),
    "vkt morphology dilate in.nrrd --radius 2": ndimage.grey_dilation(V, footprint=ball(2)),
    "vkt morphology dilate in.nrrd --shape box": ndimage.maximum_filter(V, 3),
    "vkt morphology erode in.nrrd --shape box": ndimage.minimum_filter(V, 3),
    "vkt morphology erode float.nrrd --shape box": ndimage.minimum_filter(F, 3),
    "vkt morphology dilate float.nrrd --shape box --boundary clamp": ndimage.grey_dilation(F, size=(3, 3, 3), mode="nearest"),
    "vkt morphology dilate mask.nrrd": ndimage.binary_dilation(M),
    "vkt morphology dilate mask.nrrd --boundary border:0": ndimage.binary_dilation(M),
    "vkt morphology dilate mask.nrrd --radius 2": ndimage.binary_dilation(M, ball(2)),
    "vkt morphology erode mask.nrrd --boundary border:0": ndimage.binary_erosion(M),
    "vkt fill-holes mask.nrrd": ndimage.binary_fill_holes(M),
    "vkt label mask.nrrd": ndimage.label(M)[0],
    "vkt label mask.nrrd --connectivity 26": ndimage.label(M, np.ones((3, 3, 3)))[0],
    "vkt label mask.nrrd --connectivity 26 --keep-largest 1 --dtype uint8": largest(M),
    "vkt distance mask.nrrd": ndimage.distance_transform_edt(M, sampling=(2, 1.5, 1)),
    "vkt distance mask.nrrd --unit voxel": ndimage.distance_transform_edt(M),
    "vkt distance mask.nrrd --signed | vkt arith neg -": signed(M),
    "vkt rotate float.nrrd --angle -90 --expand": np.rot90(F, 1, axes=(1, 2)),
    "vkt set float.nrrd --spacing 1 | vkt rotate --angle -30 --method linear --boundary clamp": ndimage.rotate(
        F.astype("f8"), 30, axes=(1, 2), reshape=False, order=1, mode="nearest"),
}
# What prints numbers: (those of our JSON, as NumPy has them).
PRINTED = {
    "vkt stats in.nrrd --json": lambda said: [(said["min"], V.min()), (said["max"], V.max()), (said["mean"], V.mean()), (said["count"], V.size)],
    "vkt info in.nrrd --json": lambda said: [(said["dims"][a], V.shape[2 - a]) for a in range(3)],
}
# Of other tools: largest difference, as a part of the range, and voxels at the faces that are left out.
TOLERANCE = {
    "mrfilter in.nii smooth": (0.04, 5), "mrfilter in.nii median": (1e-6, 1), "unu quantize": (0.005, 0),
    "gaussian_filter": (2e-3, 0), "rotate(v, 30": (1e-5, 0), "mrgrid in.nii regrid": (1e-5, 2),
}
TOOLS = {"FROM UNU": "unu", "FROM MRTRIX3": "mrconvert", "FROM VOLKIT": "vkt"}
problems = []


def complain(ours, what):
    problems.append(f"{ours}: {what}")


def same(a, b, part, margin=0):
    """None, or what differs."""
    a, b = np.asarray(a, "f8"), np.asarray(b, "f8")
    if a.shape != b.shape:
        return f"{a.shape} is not {b.shape}"
    if margin:
        inner = tuple(slice(margin, n - margin) for n in a.shape)
        a, b = a[inner], b[inner]
    allowed = part * max(np.ptp(b), 1e-30)
    worst = np.abs(a - b).max()
    return None if worst <= allowed else f"differs by {worst}, {allowed} is allowed, in {np.count_nonzero(np.abs(a - b) > allowed)} voxels"


def run(command, folder):
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    for name in os.listdir("."):
        if name.startswith(("in.", "second.", "mask.", "float.", "other.")):
            os.symlink(os.path.join("..", name), os.path.join(folder, name))
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], cwd=folder, capture_output=True, timeout=120)
    made = [n for n in sorted(os.listdir(folder)) if n.startswith("out.")]
    return done, os.path.join(folder, made[0]) if made else None


def key(ours):
    command = re.sub(r" -o out\.(nii|tif|nrrd)$", "", ours)
    return re.sub(r"\.(nii|tif)\b", ".nrrd", command)


def numbers(text):
    return [float(n) for n in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", text)]


def judge(section, theirs, ours, there):
    done, made = run(ours, "ours")
    if done.returncode:
        return complain(ours, f"fails: {done.stderr.decode()}")
    prints = made is None
    if prints:
        said = done.stdout.decode()
        if key(ours) in PRINTED:
            for got, want in PRINTED[key(ours)](json.loads(said)):
                if abs(float(got) - float(want)) > 1e-9 * max(1, abs(float(want))):
                    complain(ours, f"says {got}, NumPy {want}")
        elif key(ours) == "vkt info in.nrrd":
            if "24 x 20 x 16" not in said and "24 20 16" not in said:
                complain(ours, f"does not tell the dims: {said}")
        elif key(ours) == "vkt dump in.nrrd --roi 2:5,3:6,1:2":
            want = V[1, 3:6, 2:5].ravel().tolist()
            if [int(n) for n in numbers(said)][-9:] != want and not set(want) <= set(map(int, numbers(said))):
                complain(ours, f"prints {said}, NumPy {want}")
        else:
            return complain(ours, "prints what nothing here knows")
    else:
        voxels = read(made)
        if key(ours) not in EXPECTED:
            return complain(ours, "nothing here knows what it should make")
        exact = voxels.dtype.kind in "ui"
        if wrong := same(voxels, EXPECTED[key(ours)], 0 if exact else 3e-4):
            complain(ours, f"against NumPy: {wrong}")
    part, margin = next((t for k, t in TOLERANCE.items() if theirs.startswith(k)), (1e-6, 0))
    if section == "FROM SCIPY.NDIMAGE":
        if wrong := same(voxels, eval(theirs, {**vars(ndimage), "v": F.astype("f8"), "m": M, "np": np}), max(part, 1e-5), margin):
            complain(ours, f"against {theirs}: {wrong}")
        return None
    if not there:
        return None
    done, made = run(theirs, "theirs")
    if done.returncode:
        return complain(ours, f"'{theirs}' fails: {done.stderr.decode()}")
    if prints:
        got = numbers(done.stdout.decode())
        for want in {"unu minmax": [V.min(), V.max()], "mrstats": [V.mean()], "mrinfo": [24, 20, 16], "unu head": [24, 20, 16], "vkt read": V[1, 3:6, 2:5].ravel()}[" ".join(theirs.split()[:2 if theirs[0] in "uv" else 1])]:
            if not any(abs(g - want) <= 1e-4 * max(1, abs(want)) for g in got):
                complain(ours, f"'{theirs}' does not say {want}: {got}")
        return None
    if made is None:
        return complain(ours, f"'{theirs}' makes no file")
    if wrong := same(voxels, read(made, True), part, margin):
        complain(ours, f"against '{theirs}': {wrong}")
    return None


inputs()
count = {}
for section, theirs, ours in rows(sys.argv[1]):
    there = section in TOOLS and shutil.which(TOOLS[section]) is not None
    judge(section, theirs, ours, there)
    total, compared = count.get(section, (0, 0))
    count[section] = (total + 1, compared + (there or section == "FROM SCIPY.NDIMAGE"))
for section, (total, compared) in count.items():
    print(f"{section}: {total} lines, {compared} of them against the tool itself")
print("\n".join(problems), file=sys.stderr)
sys.exit(1 if problems or sum(t for t, _ in count.values()) < 100 else 0)
