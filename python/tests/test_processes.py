"""Queries in processes that were forked, and where memory is short."""

import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import icosphere

import kiln


def run(program: str) -> str:
    """What a program prints."""
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_a_forked_process_answers():
    program = """
import os, warnings
import numpy as np
import kiln
warnings.simplefilter("ignore")
mesh = kiln.Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
points = np.random.default_rng(0).uniform(0, 1, (50_000, 3))
expected = mesh.contains(points)
child = os.fork()
if child == 0:
    is_equal = (mesh.contains(points) == expected).all()
    loaded = kiln.Scene({"sphere": [{"centre": [0, 0, 0], "radius": 1}]})
    pixels = kiln.render(loaded, size=(8, 8)).pixels
    os._exit(0 if is_equal and pixels.shape == (8, 8, 3) else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), (mesh.contains(points) == expected).all())
"""
    assert run(program).split() == ["0", "True"]


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
def test_results_that_memory_has_no_room_for():
    program = """
import resource
import numpy as np
import kiln
mesh = kiln.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
count = 3_000_000
origins, directions = np.zeros((count, 3)), np.ones((count, 3))
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (150 << 20), resource.RLIM_INFINITY))
try:
    mesh.first(origins, directions)  # 72 bytes for each
except MemoryError:
    print("MemoryError")
print(mesh.first(origins[:10], directions[:10]).triangle.tolist())
"""
    assert run(program).split("\n")[:2] == ["MemoryError", str([-1] * 10)]


def test_vertices_that_are_not_finite_are_named_by_row():
    vertices, faces = icosphere(1)
    vertices[7, 1] = np.inf
    with pytest.raises(ValueError, match="vertices: row 7"):
        kiln.Mesh(vertices, faces)
