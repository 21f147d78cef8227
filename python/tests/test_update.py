"""Meshes whose vertices move."""

import copy
import pickle
import threading

import numpy as np
import pytest
from conftest import icosphere

import kiln

VERTICES, FACES = icosphere(3)
RAYS = np.random.default_rng(3).normal(size=(2, 20_000, 3)) * [[[2]], [[1]]]
POINTS = RAYS[0] / 3
TIERS = ["watertight", "double", "exact"]


def moved(step: int) -> np.ndarray:
    """Vertices at a step: a little at first, and then so far that the tree is built anew."""
    random = np.random.default_rng(step)
    return VERTICES * random.uniform(0.5, 2, 3) + random.normal(size=VERTICES.shape) * 0.02 * step**2


def answers(mesh: kiln.Mesh) -> list[np.ndarray]:
    found, crossings = mesh.all(*RAYS), mesh.crossings(*RAYS)
    return [*mesh.first(*RAYS), mesh.any(*RAYS), *found, *crossings, *mesh.closest_point(POINTS), mesh.contains(POINTS)]


def assert_equal(answers, others):
    for answer, other in zip(answers, others, strict=True):
        assert np.array_equal(answer, other, equal_nan=answer.dtype.kind == "f")


@pytest.mark.parametrize("preset", ["fast-build", "balanced", "best-trace"])
@pytest.mark.parametrize("tier", TIERS)
def test_an_updated_mesh_is_a_new_one(tier, preset):
    mesh = kiln.Mesh(VERTICES, FACES, tier=tier, preset=preset)
    before = answers(mesh)
    for step in range(5):
        mesh.update(moved(step))
        own, new = answers(mesh), answers(kiln.Mesh(moved(step), FACES, tier=tier, preset=preset))
        assert_equal(own, new)
    assert (mesh.closedness(), len(mesh), mesh.tier) == ((0, 0, 0, 0), len(FACES), tier)
    # And back, in other types of arrays.
    mesh.update(VERTICES.tolist())
    assert_equal(answers(mesh), before)


def test_queries_of_two_threads_while_a_mesh_is_updated():
    """Each query is of one step, the last one or one that was replaced while it ran."""
    steps = [moved(step) for step in range(4)]
    expected = [kiln.Mesh(vertices, FACES).first(*RAYS).distance for vertices in steps]
    mesh = kiln.Mesh(steps[0], FACES)
    found, failures, is_done = [], [], threading.Event()

    def run(work):
        try:
            work()
        except Exception as error:  # of a thread
            failures.append(error)

    def query():
        while not is_done.is_set():
            found.append(mesh.first(*RAYS).distance)

    def update():
        for number in range(40):
            mesh.update(steps[number % 4])

    queries = [threading.Thread(target=run, args=[query]) for _ in range(2)]
    updates = [threading.Thread(target=run, args=[update]) for _ in range(2)]
    for thread in queries + updates:
        thread.start()
    for thread in updates:
        thread.join()
    is_done.set()
    for thread in queries:
        thread.join()
    assert failures == [] and found
    for distances in found:
        assert any(np.array_equal(distances, step, equal_nan=True) for step in expected)
    assert np.array_equal(mesh.first(*RAYS).distance, expected[3], equal_nan=True)


def test_updates_that_raise_change_nothing():
    mesh = kiln.Mesh(VERTICES, FACES, tier="watertight")
    before = answers(mesh)
    for vertices, message in [
        (VERTICES[1:], "vertices: 641 rows, and the mesh has 642"),
        (VERTICES[:, :2], "vertices: expected the shape"),
        (np.where(np.arange(642)[:, None] == 7, np.nan, VERTICES), "vertices: row 7"),
        ("nonsense", "vertices: expected numbers"),
    ]:
        with pytest.raises(ValueError, match=message):
            mesh.update(vertices)
    # Rounding to f32 moves these by more than an edge, and warnings are errors here.
    with pytest.raises(kiln.KilnWarning, match="rounding to f32"):
        mesh.update(VERTICES * 1e-3 + 1e6)
    assert_equal(answers(mesh), before)
    with pytest.raises(ValueError, match="only a mesh of vertices and faces"):
        kiln.Scene({"sphere": [{"centre": [0, 0, 0], "radius": 1}]}).mesh().update(VERTICES)


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize("preset", ["fast-build", "best-trace"])
def test_meshes_are_pickled(tier, preset):
    vertices, faces = icosphere(2)
    # A vertex without a face.
    vertices = np.concatenate([vertices, [[5, 5, 5]]])
    mesh = kiln.Mesh(vertices, faces, tier=tier, preset=preset)
    mesh.update(vertices * [1, 2, 1 / 3])
    again = pickle.loads(pickle.dumps(mesh))
    assert (len(again), again.tier) == (len(mesh), tier)
    points = np.random.default_rng(0).uniform(-2, 2, (200, 3))
    for query in ("signed_distance", "contains"):
        np.testing.assert_array_equal(getattr(again, query)(points), getattr(mesh, query)(points))
    ours, theirs = again.crossings(points, -points), mesh.crossings(points, -points)
    np.testing.assert_array_equal(ours.distance, theirs.distance)
    again.update(vertices)
    with pytest.raises(ValueError, match="vertices"):
        again.update(vertices[:-1])


class Named(kiln.Mesh):
    """A subclass with an attribute."""


def test_subclasses_keep_their_attributes():
    mesh = Named(VERTICES, FACES)
    mesh.name = "ball"
    for other in (pickle.loads(pickle.dumps(mesh)), copy.copy(mesh), copy.deepcopy(mesh)):
        assert type(other) is Named and other.name == "ball" and len(other) == len(FACES)
        assert_equal(answers(other), answers(mesh))
    copied = copy.copy(mesh)
    mesh.update(VERTICES * 2)
    assert copied.first([0, 0, 0], [0, 0, 1]).distance < 1.1 < mesh.first([0, 0, 0], [0, 0, 1]).distance


def test_arrays_of_meshes():
    mesh = kiln.Mesh(VERTICES, FACES)
    assert np.array_equal(mesh.vertices, VERTICES) and np.array_equal(mesh.faces, FACES)
    assert np.array_equal(mesh.bounds, [VERTICES.min(axis=0), VERTICES.max(axis=0)])
    mesh.update(VERTICES * 2)
    assert np.array_equal(mesh.vertices, VERTICES * 2) and np.array_equal(mesh.bounds[1], 2 * VERTICES.max(axis=0))
    scene = kiln.Scene({"sphere": [{"centre": [1, 2, 3], "radius": 1}]}).mesh()
    # Rounded outwards to f32.
    assert np.allclose(scene.bounds, [[0, 1, 2], [2, 3, 4]], atol=1e-6) and kiln.Mesh([], []).bounds is None
    for name in ("vertices", "faces"):
        with pytest.raises(AttributeError, match=f"{name}: only a Mesh that is made of vertices and faces"):
            getattr(scene, name)
