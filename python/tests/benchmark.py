"""The table of docs/python.md: queries and their wrong answers beside trimesh with embreex, and Open3D and libigl if
they are installed.

    KILN_MODELS=/path/to/models python benchmark.py [--threads N [N ...]] [RAYS]

Seconds are those of a clock, by libraries in turns: the best of three runs, for points of one run; with several numbers
of threads `a/b`. Each number has a process of its own; embreex has one thread. Times of a mesh from arrays include its
structure, not the conversion of arrays to f32.
"""

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

parser = argparse.ArgumentParser()
parser.add_argument("rays", nargs="?", type=float, default=1e6)
parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
parser.add_argument("--rows", action="store_true", help="print the rows as JSON, each with a number for each library")
parser.add_argument("--peak", nargs=2, help="print the memory that a library adds for a mesh in a file, in MiB")
arguments = parser.parse_args()
THREADS = arguments.threads[0]
for name in ("RAYON_NUM_THREADS", "IGL_NUM_THREADS"):
    os.environ[name] = str(THREADS)

if not (arguments.rows or arguments.peak):
    tables = []
    for threads in arguments.threads:
        command = [sys.executable, __file__, str(arguments.rays), "--threads", str(threads), "--rows"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            tables.append([json.loads(line) for line in process.stdout])
        if process.returncode:
            sys.exit(process.returncode)
    libraries = tables[0].pop(0)
    [table.pop(0) for table in tables[1:]]
    print(f"| {'/'.join(map(str, arguments.threads))} threads | {' | '.join(libraries)} |")
    print(f"| --- |{' --- |' * len(libraries)}")
    for rows in zip(*tables):
        cells = ["/".join(dict.fromkeys(row[1][name] for row in rows if name in row[1])) or "–" for name in libraries]
        print(f"| {rows[0][0]} | {' | '.join(cells)} |")
    sys.exit()

import numpy as np  # noqa: E402

LIBRARIES = ["kiln", "trimesh with embreex", "Open3D", "libigl"]


class Kiln:
    def __init__(self, vertices, faces):
        import kiln

        self.mesh = kiln.Mesh(vertices, faces)

    def first(self, origins, directions):
        return self.mesh.first(origins, directions).triangle >= 0

    def any(self, origins, directions):
        return self.mesh.any(origins, directions)

    def all(self, origins, directions):
        return self.mesh.all(origins, directions)

    def contains(self, points):
        return self.mesh.contains(points)

    def signed_distance(self, points):
        return self.mesh.signed_distance(points)

    def generalised(self, points):
        return self.mesh.generalised_winding_number(points)


class Trimesh:
    def __init__(self, vertices, faces):
        import trimesh
        from trimesh.ray import ray_pyembree

        self.trimesh, self.mesh = trimesh, trimesh.Trimesh(vertices, faces, process=False)
        self.ray = ray_pyembree.RayMeshIntersector(self.mesh)
        self.ray._scene  # noqa: B018, the structure

    def first(self, origins, directions):
        return self.ray.intersects_first(origins, directions) >= 0

    def any(self, origins, directions):
        return self.ray.intersects_any(origins, directions)

    def all(self, origins, directions):
        return self.ray.intersects_location(origins, directions)

    def contains(self, points):
        return self.ray.contains_points(points)

    def signed_distance(self, points):
        return -self.trimesh.proximity.signed_distance(self.mesh, points)


class Open3D:
    def __init__(self, vertices, faces):
        import open3d

        self.scene = open3d.t.geometry.RaycastingScene(nthreads=THREADS)
        self.scene.add_triangles(np.asarray(vertices, np.float32), np.asarray(faces, np.uint32))
        self.scene.cast_rays(np.zeros((1, 6), np.float32))

    @staticmethod
    def rays(origins, directions):
        return np.concatenate([origins, directions], axis=1).astype(np.float32)

    def first(self, origins, directions):
        return np.isfinite(self.scene.cast_rays(self.rays(origins, directions), THREADS)["t_hit"].numpy())

    def any(self, origins, directions):
        return self.scene.test_occlusions(self.rays(origins, directions), nthreads=THREADS).numpy()

    def all(self, origins, directions):
        return self.scene.list_intersections(self.rays(origins, directions), THREADS)

    def contains(self, points):
        return self.scene.compute_occupancy(points.astype(np.float32), THREADS).numpy() > 0.5

    def signed_distance(self, points):
        return self.scene.compute_signed_distance(points.astype(np.float32), THREADS).numpy()


class Libigl:
    def __init__(self, vertices, faces):
        import igl

        self.igl, self.arrays = igl, (np.asarray(vertices, np.float64), np.asarray(faces, np.int64))
        self.tree = igl.FastWindingNumberBVH()
        self.tree.init(*self.arrays)

    def generalised(self, points):
        return self.tree.winding_number(points)

    def contains(self, points):
        return self.generalised(points) > 0.5

    def signed_distance(self, points):
        kind = self.igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
        return self.igl.signed_distance(points, *self.arrays, kind)[0]


CLASSES = dict(zip(LIBRARIES, (Kiln, Trimesh, Open3D, Libigl)))

if arguments.peak:

    def resident(name: str) -> float:
        """VmRSS, now, or VmHWM, the most since it was reset, in MiB."""
        (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(name)]
        return int(line.split()[1]) / 1024

    arrays = np.load(arguments.peak[1])
    vertices, faces = arrays["vertices"], arrays["faces"]
    CLASSES[arguments.peak[0]](vertices[:3], faces[:1] * 0 + [0, 1, 2])
    Path("/proc/self/clear_refs").write_text("5")  # resets VmHWM
    before = resident("VmRSS")
    CLASSES[arguments.peak[0]](vertices, faces)
    print(resident("VmHWM") - before)
    sys.exit()

import trimesh  # noqa: E402
from conftest import icosphere  # noqa: E402

import kiln  # noqa: E402

random = np.random.default_rng(0)
count = int(arguments.rays)
warnings.simplefilter("ignore", kiln.KilnWarning)
LIBRARIES = LIBRARIES[:2] + [
    name for name, module in (("Open3D", "open3d"), ("libigl", "igl")) if importlib.util.find_spec(module)
]


def best(calls: dict, runs: int = 3) -> dict:
    """The least seconds of each of the calls, which take turns."""
    seconds = dict.fromkeys(calls, float("inf"))
    for _ in range(runs):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            seconds[name] = min(seconds[name], time.perf_counter() - start)
    return seconds


def row(what, values: dict, form: str = "{:.2f}") -> None:
    print(json.dumps([what, {name: form.format(value) for name, value in values.items()}]), flush=True)


def times(name, vertices, faces, points: int):
    """Rays from a sphere around the mesh to points in its bounds, and points in its bounds."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    around = random.normal(size=(count, 3))
    around *= np.linalg.norm(high - low) / np.linalg.norm(around, axis=1, keepdims=True)
    origins, targets = (low + high) / 2 + around, random.uniform(low, high, (count, 3))
    rays = origins, targets - origins
    row(
        f"{name}, {len(faces)} triangles: build",
        best({library: lambda c=CLASSES[library]: c(vertices, faces) for library in LIBRARIES}),
    )
    engines = {library: CLASSES[library](vertices, faces) for library in LIBRARIES}

    def timed(query, *values, runs=3):
        able = {key: e for key, e in engines.items() if hasattr(e, query)}
        return best({key: lambda e=e: getattr(e, query)(*values) for key, e in able.items()}, runs)

    row(f"closest hits of {count} rays", timed("first", *rays))
    row("whether they hit anything", timed("any", *rays))
    row("all hits", timed("all", *rays))
    if points:
        where = random.uniform(low, high, (points, 3))
        row(f"{points} points inside or not", timed("contains", where, runs=1))
        row("their generalised winding numbers", timed("generalised", where, runs=1))
        # trimesh takes minutes.
        del engines["trimesh with embreex"]
        row("their signed distances", timed("signed_distance", where, runs=1))


def poses(vertices, faces):
    """Depth, normals and objects of 50 pictures of 640 x 480 from a circle around the mesh."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle, size = (low + high) / 2, np.linalg.norm(high - low)
    K, matrices = np.array([[600.0, 0, 320], [0, 610, 240], [0, 0, 1]]), []
    for angle in np.linspace(0, 2 * np.pi, 50, endpoint=False):
        position = middle + size * np.array([np.sin(angle), 0.3, np.cos(angle)])
        z = (middle - position) / np.linalg.norm(middle - position)
        x = np.cross(z, [0, 1, 0])
        x /= np.linalg.norm(x)
        matrix = np.eye(4)
        matrix[:3] = np.stack([x, np.cross(z, x), z, position], axis=1)
        matrices.append(matrix)
    scene = kiln.Scene()
    scene.add(vertices, faces)
    prepared = kiln.Prepared(scene)
    cameras = [{"K": K, "pose": matrix, "axes": "opencv"} for matrix in matrices]
    names = ["depth", "normal", "object"]
    calls = {"kiln": lambda: list(prepared.render_many(cameras, size=(640, 480), aovs=names))}
    calls["kiln"]()
    if "Open3D" in LIBRARIES:
        theirs = Open3D(vertices, faces).scene

        def cast():
            for matrix in matrices:
                # Its pixels' centres are at halves.
                centred = K + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
                rays = theirs.create_rays_pinhole(centred, np.linalg.inv(matrix), 640, 480)
                theirs.cast_rays(rays, THREADS)

        calls["Open3D"] = cast
    row("50 poses of 640 x 480: depth, normal, object", best(calls))


def peak():
    """The memory that a mesh of two million triangles takes at most, beyond its arrays."""
    side = np.arange(1001)
    x, y = np.meshgrid(side, side, indexing="ij")
    vertices = np.stack([x, y, 30 * np.sin(x / 50) * np.cos(y / 70)], axis=-1).reshape(-1, 3).astype(float)
    corner = (x * 1001 + y)[:-1, :-1].ravel()
    faces = np.concatenate([corner[:, None] + [0, 1001, 1002], corner[:, None] + [0, 1002, 1]])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mesh.npz"
        np.savez(file, vertices=vertices, faces=faces)
        command = [sys.executable, __file__, "--threads", str(THREADS), "--peak"]
        used = {name: float(subprocess.check_output([*command, name, file])) for name in LIBRARIES if name != "libigl"}
    row(f"memory at most, {len(faces)} triangles, MiB", used, "{:.0f}")


def errors():
    """Misses of rays from inside of a closed sphere to its vertices and the middles of its edges, and wrong answers to
    whether it contains points on lines through its vertices and edges, in the direction of trimesh's test rays."""
    vertices, faces = icosphere(5)
    middles = (vertices[faces] + vertices[np.roll(faces, 1, axis=1)]).reshape(-1, 3) / 2
    targets = random.permutation(np.concatenate([vertices, middles]))
    targets = np.resize(targets, (count, 3))
    origins = random.uniform(-0.4, 0.4, (count, 3))
    along = np.array([0.4395064455, 0.617598629942, 0.652231566745])
    points = targets - along * random.uniform(0, 2, (count, 1))
    radius = np.linalg.norm(points, axis=1)
    # The facets lie between these radii.
    inner = np.linalg.norm(vertices[faces].mean(axis=1), axis=1).min()
    clear = (radius < inner) | (radius > 1)
    points, inside = points[clear], (radius < inner)[clear]
    leaks, wrong = {}, {}
    for library in LIBRARIES:
        engine = CLASSES[library](vertices, faces)
        if hasattr(engine, "first"):
            leaks[library] = np.count_nonzero(~engine.first(origins, targets - origins))
        wrong[library] = np.count_nonzero(engine.contains(points) != inside)
    row(f"rays that leak, of {count} to vertices and edges of a closed sphere", leaks, "{}")
    row(f"wrong answers to what is inside, of {len(points)} points", wrong, "{}")


def model(name):
    mesh = trimesh.load(Path(os.environ["KILN_MODELS"]) / name, force="mesh", process=False)
    return np.array(mesh.vertices, float), np.array(mesh.faces)


print(json.dumps(LIBRARIES), flush=True)
if "KILN_MODELS" in os.environ:
    bunny = model("stanford-bunny.obj")
    times("bunny", *bunny, points=count)
    poses(*bunny)
    times("kitchen", *model("kitchen.obj"), points=0)
else:
    print("KILN_MODELS is not set: bunny and kitchen are left out", file=sys.stderr)
times("sphere", *icosphere(8), points=0)
errors()
peak()
