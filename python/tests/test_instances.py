"""Meshes placed by transforms: equal to copies, to the bit, after every change."""

import threading
import warnings

import numpy as np
import pytest
from conftest import TETRAHEDRON, icosphere

import kiln



def at(x=0.0, y=0.0, z=0.0, scale=1.0):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def turned(random):
    """A rotation, scaled along axes, of which one is mirrored in half of the cases."""
    q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    matrix = np.eye(4)
    matrix[:3, :3] = q * random.uniform(0.5, 2, 3)
    matrix[:3, 3] = random.uniform(-3, 3, 3)
    return matrix


def placed(matrix, vertices):
    """The products and sums in the order of the library, which does not fuse them."""
    columns = [matrix[:3, axis] * vertices[:, axis, None] for axis in range(3)]
    return columns[0] + columns[1] + columns[2] + matrix[:3, 3]


def copied(parts):
    """One mesh of moved copies, the same with triangles under mirroring matrices turned over, the object of each
    triangle and its number there."""
    vertices, faces, turned, objects, triangles, count = [], [], [], [], [], 0
    for number, (matrix, (points, own)) in sorted(parts.items()):
        vertices.append(placed(matrix, points))
        faces.append(own + count)
        turned.append(faces[-1][:, [0, 2, 1]] if np.linalg.det(matrix[:3, :3]) < 0 else faces[-1])
        objects += [number] * len(own)
        triangles += range(len(own))
        count += len(points)
    meshes = [kiln.Mesh(np.concatenate(vertices), np.concatenate(triangles)) for triangles in (faces, turned)]
    return *meshes, np.array(objects), np.array(triangles)


def check_equal(instances, parts, random):
    mesh, turned, objects, triangles = copied(parts)
    assert len(instances) == len(mesh) and instances.objects.tolist() == sorted(parts)
    origins = random.uniform(-6, 6, (300, 3))
    directions = random.uniform(-3, 3, (300, 3)) - origins
    ours, theirs = instances.first(origins, directions), mesh.first(origins, directions)
    hit = theirs.triangle >= 0
    assert 0 < hit.sum() < 300
    np.testing.assert_array_equal(ours.distance, theirs.distance)
    np.testing.assert_array_equal(ours.barycentrics, theirs.barycentrics)
    np.testing.assert_array_equal(ours.object, np.where(hit, objects[theirs.triangle], -1))
    np.testing.assert_array_equal(ours.triangle, np.where(hit, triangles[theirs.triangle], -1))
    np.testing.assert_array_equal(instances.any(origins, directions), hit)
    ours, theirs = instances.all(origins, directions), mesh.all(origins, directions)
    np.testing.assert_array_equal(ours.ray, theirs.ray)
    np.testing.assert_array_equal(ours.distance, theirs.distance)
    np.testing.assert_array_equal(ours.object, objects[theirs.triangle])
    np.testing.assert_array_equal(ours.normal, turned.all(origins, directions).normal)
    ours, theirs = instances.crossings(origins, directions), turned.crossings(origins, directions)
    np.testing.assert_array_equal(ours.entering, theirs.entering)
    points = random.uniform(-4, 4, (300, 3))
    np.testing.assert_array_equal(instances.winding_number(points), turned.winding_number(points))
    ours, theirs = instances.closest_point(points), mesh.closest_point(points)
    np.testing.assert_array_equal(ours.location, theirs.location)
    np.testing.assert_array_equal(ours.object, objects[theirs.triangle])
    ours, theirs = instances.nearest(points, 3), mesh.nearest(points, 3)
    np.testing.assert_array_equal(ours.distance, theirs.distance)


@pytest.mark.filterwarnings("error")
def test_changes_equal_copies():
    random = np.random.default_rng(4)
    sphere = icosphere(2)
    instances, parts = kiln.Instances(), {}
    for step in range(12):
        shape = [TETRAHEDRON, sphere][step % 2]
        matrix = turned(random)
        number = instances.add(*shape, matrix)
        assert number == (max(parts) + 1 if parts else 0)
        parts[number] = matrix, shape
        if step == 4:
            copies = [turned(random) for _ in range(3)]
            for number, matrix in zip(instances.add_copies(1, copies).tolist(), copies):
                parts[number] = matrix, parts[1][1]
        if step % 3 == 2:
            moved = random.choice(sorted(parts), 2, replace=False)
            matrices = np.array([turned(random) for _ in moved])
            instances.set_transform(moved, matrices)
            for number, matrix in zip(moved.tolist(), matrices):
                parts[number] = matrix, parts[number][1]
        if step == 7:
            bent = (sphere[0] * [1, 2, 0.5], sphere[1])
            # Copies have the same vertices.
            instances.update(bent[0], object=1)
            for number in (1, *range(5, 8)):
                parts[number] = parts[number][0], bent
        if step in (6, 9):
            gone = sorted(parts)[step % 4]
            instances.remove(gone)
            del parts[gone]
        check_equal(instances, parts, random)
    for number, (matrix, _) in parts.items():
        np.testing.assert_array_equal(instances.transform(number), matrix)


def test_mirrored_parts_keep_their_outside():
    """Unit cubes from -1/4 and to 1/4 in x, the second of them mirrored, overlap in a box around 0."""
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) - [0.25, 0.5, 0.5]
    quads = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    matrices = [np.eye(4), np.diag([-1.0, 1, 1, 1])]
    parts, scene = kiln.Instances(), kiln.Scene()
    for matrix in matrices:
        parts.add(corners, faces, matrix)
    scene.add(corners, faces, transforms=matrices)
    for mesh in (parts, scene.mesh()):
        assert mesh.winding_number([[0, 0, 0], [0.5, 0, 0], [-0.5, 0, 0]]).tolist() == [2, 1, 1]
        answer = mesh.contains([0, 0, 0], return_margin=True)
        assert answer.inside and answer.margin == 1.5 and mesh.signed_distance([0, 0, 0]) == -0.25
        # On the mirrored cube alone.
        ray = [-0.5, 0.1, 5], [0, 0, -1]
        assert mesh.first(*ray).normal.tolist() == [0, 0, 1] and mesh.crossings(*ray).entering.tolist() == [True, False]
        assert mesh.count(*ray, cull_back_faces=True) == 1
    # A half without the face at x = 0, and its mirror image, are closed.
    whole = kiln.Instances()
    for matrix in matrices:
        whole.add(corners + [0.25, 0, 0], faces[2:], matrix)
    assert whole.closedness().is_closed and whole.contains([[0.9, 0, 0], [-0.9, 0, 0]]).all()


@pytest.mark.parametrize("is_open", [False, True])
def test_points_of_moved_parts(is_open):
    """After every motion the answers of a new mesh of the same parts, to the bit."""
    random = np.random.default_rng(8)
    points = random.uniform(-4, 4, (2000, 3))
    vertices, faces = icosphere(2)
    faces = faces[5:] if is_open else faces
    matrices = [turned(random) for _ in range(8)]

    def answers(parts):
        inside, margin = parts.contains(points, return_margin=True)
        numbers = parts.generalised_winding_number(points)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kiln.KilnWarning)
            return [inside, margin, *numbers, parts.signed_distance(points), parts.winding_number(points)]

    moving = kiln.Instances()
    part = moving.add(vertices, faces, matrices[0])
    moving.add_copies(part, matrices[1:])
    for step in range(4):
        for expected, found in zip(answers(built(matrices, vertices, faces)), answers(moving), strict=True):
            np.testing.assert_array_equal(expected, found)
        matrices[step] = turned(random)
        moving.set_transform(step, matrices[step])
    assert moving.closedness().is_closed != is_open


def built(matrices, vertices, faces):
    parts = kiln.Instances()
    first = parts.add(vertices, faces, matrices[0])
    parts.add_copies(first, matrices[1:])
    return parts


def test_removed_parts_leave_nothing():
    parts = kiln.Instances()
    kept = parts.add(*TETRAHEDRON)
    for step in range(100):
        number = parts.add(*TETRAHEDRON, at(z=2))
        assert number == step + 1
        parts.remove(number)
    assert parts.objects.tolist() == [kept] and repr(parts).startswith("<kiln.Instances of 1 objects, 4 triangles")
    other = parts.add(*TETRAHEDRON, at(z=2))
    ray = [0.1, 0.1, 9], [0, 0, -1]
    assert other == 101 and parts.first(*ray).object == other
    # Flags are of the objects that there are, in their order.
    assert parts.first(*ray, objects=[True, False]).object == kept
    assert parts.first(*ray, objects=[other]).object == other
    with pytest.raises(ValueError, match="there is no object 7 among 2"):
        parts.first(*ray, objects=[7])
    assert parts.in_box([0, 0, 2], [1, 1, 2]).object.tolist() == [other] * 4


def test_hits_name_objects():
    parts = kiln.Instances()
    near = parts.add(*TETRAHEDRON, at(z=2))
    copies = parts.add_copies(near, [at(z=4), at(z=6, scale=-1)])
    assert repr(parts) == "<kiln.Instances of 3 objects, 12 triangles, tier double>"
    hits = parts.all([0.1, 0.1, 0], [0, 0, 1], 5)
    assert hits.object.tolist() == [near, near, copies[0], copies[0]]
    assert hits.instance.tolist() == [0, 0, 1, 1] and hits.triangle[0] == 0
    assert parts.first([0.1, 0.1, 0], [0, 0, 1], objects=[copies[0]]).distance == 4
    # The face z = 0 of a tetrahedron that is mirrored at a point, seen from its outside.
    hit = parts.first([-0.1, -0.1, 9], [0, 0, -1])
    assert hit.object == copies[1] and hit.normal.tolist() == [0, 0, 1]
    parts.remove(near)
    assert parts.objects.tolist() == copies.tolist() and len(parts) == 8
    hit = parts.first([0.1, 0.1, 0], [0, 0, 1])
    assert (hit.object, hit.instance, hit.distance) == (copies[0], 0, 4)
    # Results are those of the objects at the time of the query.
    parts.set_transform(copies[0], at(z=9))
    assert hit.normal.tolist() == [0, 0, -1] and parts.first([0.1, 0.1, 0], [0, 0, 1]).distance == 9


def test_nothing_changes_by_errors():
    parts = kiln.Instances()
    vertices, faces = TETRAHEDRON
    part = parts.add(vertices, faces)
    wrong = [
        (lambda: parts.add(vertices, faces, at(x=1e39)), ValueError, "object 1"),
        (lambda: parts.add(vertices * np.nan, faces), ValueError, "vertices: rows 0, 1, 2, 3"),
        (lambda: parts.add(vertices, faces + 1), ValueError, "faces"),
        (lambda: parts.add(vertices, faces, np.eye(3)), ValueError, "transform: expected the shape"),
        (lambda: parts.add(vertices, faces, [np.eye(4)] * 2), ValueError, "transform: expected the shape"),
        (lambda: parts.set_transform(7, np.eye(4)), IndexError, "no object 7"),
        (lambda: parts.set_transform(-1, np.eye(4)), IndexError, "no object -1"),
        (lambda: parts.set_transform([part, 7], [at(z=3)] * 2), IndexError, "no object 7"),
        (lambda: parts.set_transform([part], [at(z=3)] * 2), ValueError, "transforms: 2 rows"),
        (lambda: parts.set_transform(part, np.ones((4, 4))), ValueError, "last row"),
        (lambda: parts.update(vertices[:3]), ValueError, "vertices: 3 rows"),
        (lambda: parts.remove(1), IndexError, "no object 1"),
        (lambda: parts.add_copies(3, [np.eye(4)]), IndexError, "no object 3"),
        (lambda: parts.transform(2), IndexError, "no object 2"),
    ]
    for call, error, text in wrong:
        with pytest.raises(error, match=text):
            call()
    assert parts.objects.tolist() == [part] and parts.first([0.1, 0.1, -1], [0, 0, 1]).distance == 1
    assert kiln.Instances().first([0, 0, 0], [0, 0, 1]).triangle == -1


def test_a_singular_transform_flattens():
    parts = kiln.Instances()
    parts.add(*TETRAHEDRON, at(z=2) * [[1], [1], [0], [1]])
    assert parts.first([0.1, 0.1, -1], [0, 0, 1]).distance == 1


def test_coarse_rounding_is_warned_of():
    parts = kiln.Instances(tier="watertight")
    part = parts.add(*TETRAHEDRON)
    with pytest.warns(kiln.KilnWarning, match="object 0: rounding to f32"):
        parts.set_transform(part, at(x=1e9 + 30))


def test_copies_are_independent():
    parts = kiln.Instances()
    part = parts.add(*TETRAHEDRON, at(z=2))
    other = parts.__copy__()
    parts.set_transform(part, at(z=3))
    assert type(other) is kiln.Instances and other.transform(part)[2, 3] == 2
    assert [mesh.first([0.1, 0.1, 0], [0, 0, 1]).distance for mesh in (parts, other)] == [3, 2]


def test_threads_add_and_query():
    parts = kiln.Instances()
    parts.add(*TETRAHEDRON, at(z=2))
    rays = np.tile([[0.1, 0.1, 0.0]], (5000, 1)), [0, 0, 1]

    def adds(first):
        for k in range(20):
            parts.add(*TETRAHEDRON, at(x=10 * first + k))

    threads = [threading.Thread(target=adds, args=(first,)) for first in (1, 20, 40)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        assert (parts.first(*rays).distance == 2).all()
    for thread in threads:
        thread.join()
    assert len(parts.objects) == 61 and len(parts) == 244
