"""Resident memory over many builds and queries, and over pictures: it must not grow.

python memory.py [BUILDS]
"""

import gc
import sys

import numpy as np
from conftest import icosphere

import kiln


def resident() -> float:
    """Megabytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


builds = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
vertices, faces = icosphere(3)
origins = np.random.default_rng(0).normal(size=(200, 3))
scene = kiln.Scene()
scene.add(vertices, faces)


def work():
    mesh = kiln.Mesh(vertices, faces)
    mesh.first(origins, -origins)
    mesh.all(origins, -origins)
    mesh.crossings(origins, -origins)
    mesh.signed_distance(origins)


used = []
for build in range(builds):
    work()
    if build % (builds // 10) == builds // 10 - 1:
        for _ in range(10):
            kiln.render(scene, size=(32, 32), draft=True, aovs=["depth"])
        gc.collect()
        used.append(resident())
print("resident MB:", " ".join(f"{megabytes:.1f}" for megabytes in used))
# The first tenth fills the pools of the allocator.
growth = max(used[5:]) - max(used[1:5])
if growth > 5:
    sys.exit(f"memory grew by {growth:.1f} MB in the second half of {builds} builds")
