#!/usr/bin/env python3
"""Scores a library on the hard cases: `score.py [ENGINE...]`. Needs numpy, and the libraries that are scored.

To score your own, write a function that takes vertices (n, 3) f32 and triangles (m, 3) int32, and returns a function
from origins and directions (k, 3) f32 to the triangle hit first (k,) int, -1 for none, and its distance (k,). Add it to
ENGINES.
"""
import csv
import sys
from pathlib import Path

import numpy as np


def embree(robust):
    def build(vertices, triangles):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        scene = EmbreeScene(robust=robust)
        mesh = TriangleMesh(scene, vertices, triangles)

        def first_hits(origins, directions, _mesh=mesh):
            found = scene.run(origins, directions, output=True)
            return found["primID"], found["tfar"]

        return first_hits

    return build


ENGINES = {"embree": embree(robust=False), "embree-robust": embree(robust=True)}


def read(case):
    lines = [line.split() for line in case.with_suffix(".obj").read_text().splitlines()]
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], np.float32)
    triangles = np.array([line[1:] for line in lines if line[0] == "f"], np.int32) - 1
    with case.open(newline="") as file:
        return vertices, triangles, list(csv.DictReader(file))


def score(case, build):
    """Numbers of rays: missed, hit though there is nothing, wrong triangle; the largest error of t in ulp of f32."""
    vertices, triangles, rays = read(case)
    columns = lambda names: np.array([[ray[name] for name in names] for ray in rays], np.float32)
    found, distances = build(vertices, triangles)(columns(("ox", "oy", "oz")), columns(("dx", "dy", "dz")))
    missed = phantom = wrong = 0
    worst = 0.0
    for ray, triangle, t in zip(rays, found, distances):
        right = [int(index) for index in ray["triangles"].split()]
        missed += bool(right) and triangle < 0
        phantom += not right and triangle >= 0
        if right and triangle >= 0:
            wrong += triangle not in right
            worst = max(worst, abs(float(t) - float(ray["t"])) / np.spacing(np.float32(ray["t"])))
    return len(rays), missed, phantom, wrong, worst


def main():
    for name in sys.argv[1:] or ENGINES:
        if name not in ENGINES:
            sys.exit(f"no engine is called {name}; there are {', '.join(ENGINES)}")
        print(f"{name:20} rays missed phantom wrong  error of t (ulp)")
        for case in sorted(Path(__file__).parent.glob("*.csv")):
            print("{:20} {:4} {:6} {:7} {:5} {:17.3g}".format(case.stem, *score(case, ENGINES[name])))


if __name__ == "__main__":
    main()
