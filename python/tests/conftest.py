"""Meshes that tests share."""

import numpy as np
import pytest

import kiln


def icosphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed sphere of radius 1 of 20 * 4**subdivisions triangles, counterclockwise seen from outside."""
    golden = (1 + 5**0.5) / 2
    vertices = [(s, t * golden, 0.0) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([np.roll(v, k) for k in range(3) for v in vertices])
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = np.isclose(distance, 2)
    faces = [
        (a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c] and near[c, a]
    ]
    faces = [(a, b, c) if np.linalg.det(vertices[[a, b, c]]) > 0 else (a, c, b) for a, b, c in faces]
    vertices /= np.linalg.norm(vertices[0])
    for _ in range(subdivisions):
        faces = np.array(faces)
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, place = np.unique(edges, axis=0, return_inverse=True)
        middle = vertices[unique].sum(axis=1)
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        ab, bc, ca = (place.reshape(-1, 3) + len(vertices)).T
        a, b, c = faces.T
        vertices = np.concatenate([vertices, middle])
        faces = np.concatenate([np.stack(t, axis=1) for t in [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]])
    return vertices, np.asarray(faces)


TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


@pytest.fixture(scope="session")
def tetrahedron() -> kiln.Mesh:
    return kiln.Mesh(*TETRAHEDRON)


@pytest.fixture(scope="session")
def sphere() -> kiln.Mesh:
    return kiln.Mesh(*icosphere(3), tier="double")
