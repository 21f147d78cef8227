"""Triangles near points, in boxes, and of two meshes that meet."""

import numpy as np
import pytest
from conftest import TETRAHEDRON, icosphere

import kiln

VERTICES, FACES = icosphere(1)
POINTS = np.random.default_rng(1).normal(size=(40, 3))


def grid(count):
    """Unit squares of z = 0 in rows along x, each of a triangle below its diagonal and one above."""
    vertices = np.array([[x, y, 0] for y in range(count + 1) for x in range(count + 1)], float)
    width = count + 1
    corners = [(y * width + x, y * width + x + 1, (y + 1) * width + x + 1, (y + 1) * width + x)
               for y in range(count) for x in range(count)]
    return vertices, np.array([t for a, b, c, d in corners for t in ((a, b, c), (a, c, d))])


def test_nearest_triangles_are_those_of_all():
    """Against the closest point of each triangle alone."""
    alone = [kiln.Mesh(VERTICES, FACES[[index]]).closest_point(POINTS) for index in range(len(FACES))]
    distances = np.stack([closest.distance for closest in alone], axis=1)
    order = np.argsort(distances, axis=1, kind="stable")
    mesh = kiln.Mesh(VERTICES, FACES)
    for count in (1, 5, 80, 1000):
        near = mesh.nearest(POINTS, count)
        kept = min(count, len(FACES))
        assert near.point.tolist() == np.repeat(np.arange(40), kept).tolist()
        assert np.array_equal(near.triangle.reshape(40, kept), order[:, :kept])
        assert np.array_equal(near.distance.reshape(40, kept), np.sort(distances, axis=1)[:, :kept])
    assert np.array_equal(mesh.nearest(POINTS, 1).location, mesh.closest_point(POINTS).location)
    for radius in (0.0, 0.3, 1.0):
        near = mesh.nearest(POINTS, max_distance=radius)
        assert np.array_equal(np.bincount(near.point, minlength=40), (distances <= radius).sum(axis=1))
        assert (near.distance <= radius).all() and (near.object == 0).all()
        some = mesh.nearest(POINTS, 3, max_distance=radius)
        assert np.array_equal(np.bincount(some.point, minlength=40), np.minimum((distances <= radius).sum(axis=1), 3))
    assert len(mesh.nearest(POINTS, 0).point) == len(mesh.nearest(np.zeros((0, 3)), 3).point) == 0
    assert len(kiln.Mesh([], []).nearest(POINTS, 3).point) == 0
    with pytest.raises(ValueError, match="count: give it, max_distance, or both"):
        mesh.nearest(POINTS)
    for mistake in (-1.0, np.nan):
        with pytest.raises(ValueError, match="max_distance: .* is not 0 or more"):
            mesh.nearest(POINTS, 3, mistake)
        with pytest.raises(ValueError, match="max_distance: .* is not 0 or more"):
            mesh.closest_point(POINTS, mistake)


def test_closest_points_within_a_distance():
    mesh = kiln.Mesh(VERTICES, FACES)
    every = mesh.closest_point(POINTS)
    for limit in (0.2, 0.7, np.inf):
        within = every.distance <= limit
        found = mesh.closest_point(POINTS, max_distance=limit)
        assert np.array_equal(found.triangle, np.where(within, every.triangle, -1))
        assert np.array_equal(found.distance[within], every.distance[within])
        assert np.isnan(found.distance[~within]).all() and np.isnan(found.location[~within]).all()
    # Above the middle of the base of the tetrahedron, at exactly this distance.
    assert kiln.Mesh(*TETRAHEDRON).closest_point([0.25, 0.25, -2], 2).triangle == 0


def test_triangles_in_a_box():
    mesh = kiln.Mesh(*grid(4))
    # The square from (1, 1) to (2, 2) alone is 2 * 5; its border has a point of 16 others:
    # of the 3 x 3 squares around it, all but the triangles whose only corner is theirs beyond it.
    inside = mesh.in_box([1.25, 1.25, -1], [1.75, 1.75, 1])
    assert inside.triangle.tolist() == [10, 11] and inside.object.tolist() == [0, 0]
    touching = mesh.in_box([2, 2, 0], [2, 2, 0])
    # Six triangles have the corner (2, 2): squares (1, 1) both, (2, 2) both, (1, 2) below and (2, 1) above.
    assert touching.triangle.tolist() == [10, 11, 13, 18, 20, 21]
    assert len(mesh.in_box([-9, -9, 0.1], [9, 9, 9]).triangle) == 0
    assert len(mesh.in_box([-np.inf] * 3, [np.inf] * 3).triangle) == len(mesh) == 32
    for low, high in [([0, 0, 1], [1, 1, 0]), ([np.nan, 0, 0], [1, 1, 1])]:
        with pytest.raises(ValueError, match="max: .* is not above"):
            mesh.in_box(low, high)
    with pytest.raises(ValueError, match="min: expected one vector"):
        mesh.in_box([[0, 0, 0]], [1, 1, 1])
    scene = kiln.Scene()
    scene.add(*TETRAHEDRON)
    scene.add(TETRAHEDRON[0] + [9, 0, 0], TETRAHEDRON[1])
    found = scene.mesh().in_box([8, -1, -1], [11, 2, 2])
    assert found.object.tolist() == [1] * 4 and found.triangle.tolist() == [0, 1, 2, 3]


def test_triangles_that_meet():
    """A triangle that touches z = 0 along y = 1/2 from x = 1/2 to 7/2. There the triangles above the diagonals are from
    x = i to i + 1/2, those below from i + 1/2 to i + 1: all of the squares 0 to 3, in two of them one point."""
    upright = kiln.Mesh([[0.5, 0.5, 0], [3.5, 0.5, 0], [2, 0.5, 1]], [[0, 1, 2]])
    plane = kiln.Mesh(*grid(4))
    found = plane.intersecting_triangles(upright)
    assert found.triangle.tolist() == list(range(8)) and found.other_triangle.tolist() == [0] * 8
    swapped = upright.intersecting_triangles(plane)
    assert swapped.other_triangle.tolist() == list(range(8)) and swapped.object.tolist() == [0] * 8
    lifted = kiln.Mesh([[0.5, 0.5, 2**-60], [3.5, 0.5, 2**-60], [2, 0.5, 1]], [[0, 1, 2]])
    assert len(plane.intersecting_triangles(lifted).triangle) == 0
    scene = kiln.Scene()
    scene.add(TETRAHEDRON[0] + 9, TETRAHEDRON[1])
    scene.add(*grid(4))
    of_scene = upright.intersecting_triangles(scene.mesh())
    assert of_scene.other_object.tolist() == [1] * 8 and of_scene.other_triangle.tolist() == list(range(8))
    with pytest.raises(TypeError, match="other: expected a Mesh, not int"):
        plane.intersecting_triangles(5)
