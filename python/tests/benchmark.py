"""Time of 10^6 rays and of containment, leaks and wrong answers, beside embreex, trimesh's own intersector and Open3D,
where these are installed: the table of docs/python.md.

    KILN_MODELS=/path/to/models python benchmark.py [RAYS]

Seconds are those of a clock, the best of three runs, by libraries in turns; --cpu takes processor time instead, for
machines that do other work. RAYON_NUM_THREADS=1 restricts kiln to one thread; embreex has one anyway.
"""

import os
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import trimesh
from conftest import icosphere
from trimesh.ray import ray_pyembree, ray_triangle

import kiln
import kiln.trimesh

numbers = [argument for argument in sys.argv[1:] if argument != "--cpu"]
clock = time.process_time if "--cpu" in sys.argv else time.perf_counter
rays = int(float(numbers[0])) if numbers else 1_000_000
random = np.random.default_rng(0)
warnings.simplefilter("ignore", kiln.KilnWarning)


def best(calls: dict) -> dict:
    """The least seconds of each of the calls, which take turns."""
    seconds = dict.fromkeys(calls, float("inf"))
    for _ in range(3):
        for name, call in calls.items():
            start = clock()
            call()
            seconds[name] = min(seconds[name], clock() - start)
    return seconds


def print_row(what, seconds: dict, least: str) -> None:
    ratios = ", ".join(f"{name} {value:.3f} s" for name, value in seconds.items())
    print(f"{what}: {ratios}; kiln is {seconds[least] / seconds['kiln']:.2f} times as fast as {least}")


def open3d_scene(mesh):
    try:
        import open3d
    except ImportError:
        return None
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))
    return scene


def times(name, mesh):
    """Rays from a sphere around the mesh to points in its bounds."""
    middle, radius = mesh.bounds.mean(axis=0), np.linalg.norm(mesh.extents)
    origins = random.normal(size=(rays, 3))
    origins = middle + origins / np.linalg.norm(origins, axis=1, keepdims=True) * radius
    directions = random.uniform(*mesh.bounds, size=(rays, 3)) - origins
    ours, theirs = kiln.trimesh.RayMeshIntersector(mesh), ray_pyembree.RayMeshIntersector(mesh)
    queries = kiln.Mesh(mesh.vertices, mesh.faces)
    embree = theirs._scene
    scaled = ((origins - embree.origin) * embree.scale).astype(np.float32)
    unit = directions.astype(np.float32)
    first = {
        "embreex": lambda: embree.scene.run(scaled, unit),
        "trimesh with embreex": lambda: theirs.intersects_first(origins, directions),
        "kiln": lambda: queries.first(origins, directions),
        "kiln.trimesh": lambda: ours.intersects_first(origins, directions),
    }
    scene = open3d_scene(mesh)
    if scene is not None:
        tensor = np.concatenate([origins, directions], axis=1).astype(np.float32)
        first["Open3D"] = lambda: scene.cast_rays(tensor)
    print(f"{name}, {len(mesh.faces)} triangles, {rays} rays")
    print_row("  first hits", best(first), "embreex")
    every = {
        "trimesh with embreex": lambda: theirs.intersects_location(origins, directions),
        "kiln": lambda: queries.all(origins, directions),
        "kiln.trimesh": lambda: ours.intersects_location(origins, directions),
    }
    print_row("  all hits", best(every), "trimesh with embreex")
    few = slice(0, min(rays, 200))
    native = ray_triangle.RayMeshIntersector(mesh)
    native.intersects_first(origins[:1], directions[:1])
    start = clock()
    native.intersects_first(origins[few], directions[few])
    print(
        f"  trimesh without embreex: {(clock() - start) * rays / len(origins[few]):.0f} s, "
        f"from {len(origins[few])} rays"
    )


def errors():
    """Misses of rays from inside of a closed sphere to its vertices and the middles of its edges, and wrong answers to
    whether it contains points on lines through its vertices and edges, in the direction of trimesh's test rays."""
    vertices, faces = icosphere(5)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    count = min(rays, 1_000_000)
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
    engines = {
        "kiln": kiln.trimesh.RayMeshIntersector(mesh),
        "trimesh with embreex": ray_pyembree.RayMeshIntersector(mesh),
    }
    native = ray_triangle.RayMeshIntersector(mesh)
    print(f"a closed sphere of {len(faces)} triangles, {count} rays, {len(points)} points")
    for name, engine in engines.items():
        leaks = np.count_nonzero(~engine.intersects_any(origins, targets - origins))
        wrong = np.count_nonzero(engine.contains_points(points) != inside)
        print(f"  {name}: {leaks / count * 1e6:.0f} leaks and {wrong / len(points) * 1e6:.0f} wrong answers a million")
    few = slice(0, min(count, 300))
    leaks = np.count_nonzero(~native.intersects_any(origins[few], (targets - origins)[few]))
    wrong = np.count_nonzero(native.contains_points(points[few]) != inside[few])
    print(f"  trimesh without embreex, of {len(origins[few])}: {leaks} leaks and {wrong} wrong answers")
    scene = open3d_scene(mesh)
    if scene is not None:
        tensor = np.concatenate([origins, targets - origins], axis=1).astype(np.float32)
        leaks = np.count_nonzero(np.isinf(scene.cast_rays(tensor)["t_hit"].numpy()))
        wrong = np.count_nonzero((scene.compute_occupancy(points.astype(np.float32)).numpy() > 0.5) != inside)
        print(f"  Open3D: {leaks / count * 1e6:.0f} leaks and {wrong / len(points) * 1e6:.0f} wrong answers a million")


if "KILN_MODELS" in os.environ:
    for name in ("stanford-bunny.obj", "kitchen.obj"):
        mesh = trimesh.load(Path(os.environ["KILN_MODELS"]) / name, force="mesh", process=False)
        times(name, trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))
else:
    print("KILN_MODELS is not set: bunny and kitchen are left out")
times("sphere", trimesh.Trimesh(*icosphere(8), process=False))
errors()
