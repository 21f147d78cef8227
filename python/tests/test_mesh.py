"""Queries of kiln.Mesh: derived values, and brute force."""

import copy
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import TETRAHEDRON, icosphere

import kiln
import kiln.trimesh


def test_first(tetrahedron):
    # Up through the base z = 0 and out at x + y + z = 1; the direction of length 2 does not scale distances.
    hits = tetrahedron.first([[0.25, 0.25, -1], [5, 5, 5]], [[0, 0, 2], [1, 0, 0]])
    assert hits.triangle.tolist() == [0, -1]
    assert hits.distance[0] == 1 and np.isnan(hits.distance[1])
    assert hits.location[0].tolist() == [0.25, 0.25, 0] and np.isnan(hits.location[1]).all()
    # Corners of triangle 0: (0, 0), (0, 1) and (1, 0).
    assert np.allclose(hits.barycentrics[0], [0.5, 0.25, 0.25]) and np.isnan(hits.barycentrics[1]).all()


def test_any_and_max_distance(tetrahedron):
    origins, directions = [[0.25, 0.25, -1]] * 2, [[0, 0, 1]] * 2
    assert tetrahedron.any(origins, directions).tolist() == [True, True]
    assert tetrahedron.any(origins, directions, 1.0).tolist() == [False, False]
    assert tetrahedron.any(origins, directions, max_distance=[1.0, 1.5]).tolist() == [False, True]
    assert tetrahedron.first(origins, directions, np.float32(0.5)).triangle.tolist() == [-1, -1]


def test_all_is_sorted(tetrahedron):
    hits = tetrahedron.all([[0.25, 0.25, 3], [9, 9, 9], [0.25, 0.25, -1]], [[0, 0, -1], [0, 0, 1], [0, 0, 1]])
    assert hits.ray.tolist() == [0, 0, 2, 2]
    assert hits.triangle.tolist() == [3, 0, 0, 3]
    assert hits.distance.tolist() == [2.5, 3, 1, 1.5]


def test_an_edge_is_hit_twice_and_crossed_once(tetrahedron):
    # Through the middle of the edge from (1, 0, 0) to (0, 1, 0) in z = 0, which the base and the slope share.
    origins, directions = [[1.0, 1.0, 0.5]], [[-0.5, -0.5, -0.5]]
    assert tetrahedron.all(origins, directions).triangle.tolist() == [0, 3]
    crossings = tetrahedron.crossings([[0.1, 0.2, -1.0]], [[0.4, 0.3, 1.0]])
    assert crossings.ray.tolist() == [0, 0] and crossings.entering.tolist() == [True, False]


def test_points(tetrahedron):
    points = [[0.1, 0.1, 0.1], [0.2, 0.2, -1], [2, 0, 0]]
    assert tetrahedron.contains(points).tolist() == [True, False, False]
    assert tetrahedron.winding_number(points).tolist() == [1, 0, 0]
    closest = tetrahedron.closest_point(points)
    assert closest.distance == pytest.approx([0.1, 1, 1])
    assert np.allclose(closest.location[1:], [[0.2, 0.2, 0], [1, 0, 0]])
    assert tetrahedron.signed_distance(points) == pytest.approx([-0.1, 1, 1])


def test_the_surface_is_decided_by_perturbation(tetrahedron):
    """Points and the ends of rays are taken as infinitesimally farther along +x, +y and +z: faces at 0 are inside."""
    points = [[0, 0.2, 0.2], [0.2, 0, 0.2], [0.2, 0.2, 0], [0, 0, 0], [0.25, 0.25, 0.5]]
    assert tetrahedron.contains(points).tolist() == [True, True, True, True, False]
    # To the base, at distance 1, and to the slope, at distance 1.
    origins, directions = [[0.25, 0.25, -1], [0.25, 0.25, 1.5]], [[0, 0, 1], [0, 0, -1]]
    assert tetrahedron.crossings(origins, directions, 1.0).ray.tolist() == [0]
    assert tetrahedron.all(origins, directions, 1.0).ray.tolist() == []


def test_inside_out_and_open():
    vertices, faces = TETRAHEDRON
    inverted = kiln.Mesh(vertices, faces[:, ::-1])
    assert inverted.winding_number([[0.1, 0.1, 0.1]]).tolist() == [-1]
    opened = kiln.Mesh(vertices, faces[1:])
    assert opened.closedness() == (3, 0, 3, 0) and not opened.closedness().is_closed
    rules = {"contains": "generalised", "winding_number": "one ray", "signed_distance": "generalised"}
    for query, rule in rules.items():
        with pytest.warns(kiln.KilnWarning, match=f"not closed: 3 edges are used more often.*{rule}"):
            getattr(opened, query)([[0.1, 0.1, 0.1]])
    assert opened.closest_point([[0.1, 0.1, 0.1]]).distance.tolist() == pytest.approx([0.1])


def test_open_surfaces_have_margins():
    """From the centre of a cube each face has a sixth of all directions; without one, 5/6 is 1/3 above 1/2."""
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) * 2.0 - 1
    quads = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    points = [[0, 0, 0], [9, 9, 9]]
    answer = kiln.Mesh(corners, faces).contains(points, return_margin=True)
    assert answer.inside.tolist() == [True, False] and answer.margin.tolist() == [0.5, 0.5]
    assert answer.rule == "crossings"
    opened = kiln.Mesh(corners, faces[2:])
    for beta in (1, 4, np.inf):
        numbers = opened.generalised_winding_number(points, beta)
        assert abs(numbers.value[0] - 5 / 6) <= numbers.error[0] < 0.1
    inside, margin = opened.contains(points, return_margin=True)
    assert inside.tolist() == [True, False] and margin[0] == pytest.approx(1 / 3, abs=0.05) and margin[1] > 0.4


def test_every_query_follows_the_rule_of_the_mesh():
    """A sphere that lacks 5 % of its triangles, and one of which every second is turned over: known by the distance to
    its centre, but for points between its facets and the sphere."""
    vertices, faces = icosphere(3)
    points = np.random.default_rng(5).uniform(-1.2, 1.2, (20_000, 3))
    radius = np.linalg.norm(points, axis=1)
    clear, truth = np.abs(radius - 0.995) > 0.01, radius < 1
    kept = np.random.default_rng(6).uniform(size=len(faces)) > 0.05
    turned = np.where(np.arange(len(faces))[:, None] % 2, faces, faces[:, ::-1])
    cases = [(faces[kept], "generalised winding number", "generalised"), (turned, "vote", "vote of three rays")]
    for triangles, rule, warning in cases:
        mesh = kiln.Mesh(vertices, triangles)
        answer = mesh.contains(points, return_margin=True)
        assert answer.rule == rule and (answer.inside == truth)[clear].mean() > 0.999
        if rule == "vote":
            assert mesh.closedness().inconsistent_edges > 0 and (answer.margin == 0).all()
            assert (answer.inside == truth)[clear].all()
        else:
            assert (answer.inside == truth)[clear & (answer.margin > 0.25)].all()
        own = trimesh.Trimesh(vertices, triangles, process=False)
        with pytest.warns(kiln.KilnWarning, match=warning):
            assert (mesh.contains(points) == answer.inside).all()
            assert ((mesh.signed_distance(points) < 0) == answer.inside).all()
            assert (kiln.trimesh.RayMeshIntersector(own).contains_points(points) == answer.inside).all()


@pytest.mark.parametrize("tier", ["watertight", "double", "exact"])
def test_brute_force(tier):
    """The plane of each triangle in numpy; rays that pass near an edge are left out."""
    random = np.random.default_rng(1)
    vertices, faces = icosphere(1)
    mesh = kiln.Mesh(vertices, faces, tier=tier)
    assert mesh.tier == tier and len(mesh) == 80
    origins, directions = random.normal(size=(2, 300, 3))
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    distance = np.einsum("rtk,tk->rt", a[None] - origins[:, None], normal) / (unit @ normal.T)
    point = origins[:, None] + distance[..., None] * unit[:, None]

    def edge(p, q):
        return np.einsum("rtk,tk->rt", np.cross(q - p, point - p), normal)

    inside = np.minimum(np.minimum(edge(a, b), edge(b, c)), edge(c, a)) / np.einsum("tk,tk->t", normal, normal)
    clear = ((np.abs(inside) > 1e-4) & (np.abs(distance) > 1e-4)).all(axis=1)
    assert clear.sum() > 200
    found = mesh.all(origins, directions)
    for ray in np.flatnonzero(clear):
        hit = np.flatnonzero((inside[ray] > 0) & (distance[ray] > 0))
        hit = hit[np.argsort(distance[ray, hit])]
        assert found.triangle[found.ray == ray].tolist() == hit.tolist()
        assert np.allclose(found.distance[found.ray == ray], distance[ray, hit], rtol=1e-4)
    first = mesh.first(origins, directions)
    starts = np.searchsorted(found.ray, np.arange(300))
    has = np.isin(np.arange(300), found.ray)
    assert (first.triangle[has] == found.triangle[starts[has]]).all() and (first.triangle[~has] == -1).all()
    assert (mesh.any(origins, directions) == has).all()


def test_closed_meshes_do_not_leak():
    """Rays from inside through every vertex and the middle of every edge, and to points of the surface."""
    vertices, faces = icosphere(3)
    mesh = kiln.Mesh(vertices, faces)
    middles = (vertices[faces] + vertices[np.roll(faces, 1, axis=1)]).reshape(-1, 3) / 2
    targets = np.concatenate([vertices, middles, vertices[faces].mean(axis=1)])
    for origin in ([0, 0, 0], [0.3, -0.2, 0.1]):
        origins = np.tile(np.array(origin, float), (len(targets), 1))
        assert mesh.any(origins, targets - origins).all()
        crossings = mesh.crossings(origins, targets - origins)
        assert (crossings.ray == np.arange(len(targets))).all() and not crossings.entering.any()


def test_threads_share_a_mesh(sphere):
    from concurrent.futures import ThreadPoolExecutor

    origins, directions = np.random.default_rng(2).normal(size=(2, 5000, 3))
    expected = sphere.first(origins, directions).triangle
    with ThreadPoolExecutor(8) as pool:
        for found in pool.map(lambda _: sphere.first(origins, directions).triangle, range(32)):
            assert (found == expected).all()


def obj_triangles(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of an .obj file whose faces are all triangles."""
    lines = [line.split() for line in file.read_text().splitlines()]
    vertices = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float)
    faces = [[int(corner.split("/")[0]) for corner in line[1:]] for line in lines if line[:1] == ["f"]]
    return vertices, np.array(faces) - 1


@pytest.mark.skipif("KILN_MODELS" not in os.environ, reason="KILN_MODELS is not set")
def test_rays_of_ambient_occlusion_leave_the_triangles_of_their_vertex():
    """The example of docs/python.md at coordinates of 100, where steps of f32 are 2**-17. Where the surface is concave,
    a triangle rightly occludes directions that point below its plane; no ray hits one whose plane it leaves."""
    text = (Path(__file__).parents[2] / "docs" / "python.md").read_text()
    names = {"np": np}
    exec(re.search(r"^def ambient_rays.*?(?=\n\n)", text, re.DOTALL | re.MULTILINE)[0], names)
    vertices, faces = obj_triangles(Path(os.environ["KILN_MODELS"]) / "spot.obj")
    vertices += 100
    count = 64
    origins, directions = names["ambient_rays"](vertices, faces, count)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)

    def self_hits(mesh, origins):
        hits = mesh.all(origins, directions)
        is_own = (faces[hits.triangle] == (hits.ray // count)[:, None]).any(axis=1)
        leaves = np.einsum("hk,hk->h", directions[hits.ray], normals[hits.triangle]) >= 0
        return np.count_nonzero(is_own & leaves)

    mesh = kiln.Mesh(vertices, faces, tier="double")
    assert self_hits(mesh, origins) == 0
    assert 0.05 < mesh.any(origins, directions).mean() < 0.5
    # Without the offset, and with vertices rounded to f32, there are such hits.
    assert self_hits(kiln.Mesh(vertices, faces, tier="watertight"), np.repeat(vertices, count, axis=0)) > 1000


def test_threads_may_ask_at_once_whether_a_surface_is_closed():
    program = """
from concurrent.futures import ThreadPoolExecutor
import sys
sys.path.insert(0, sys.argv[1])
import kiln
from conftest import icosphere
vertices, faces = icosphere(5)
with ThreadPoolExecutor(4) as pool:
    for _ in range(20):
        mesh = kiln.Mesh(vertices, faces)
        assert all(list(pool.map(mesh.contains, [[[0, 0, 0]]] * 4)))
"""
    folder = os.path.dirname(__file__)
    subprocess.run([sys.executable, "-c", program, folder], check=True, timeout=60)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_of_a_mesh_is_updated_on_its_own(copied):
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    mesh, ray = kiln.Mesh(vertices, [[0, 1, 2]]), ([0.25, 0.25, 1], [0, 0, -1])
    other = copied(mesh)
    assert other.first(*ray).distance == 1
    mesh.update(vertices - [0, 0, 1])
    other.update(vertices - [0, 0, 2])
    assert mesh.first(*ray).distance == 2 and other.first(*ray).distance == 3


def test_distances_of_crossings_do_not_descend():
    # Triangles around a common edge, which rays cross at distances that differ by their rounding alone.
    angles = np.linspace(0, np.pi, 40, endpoint=False)
    tips = np.stack([np.cos(angles), np.sin(angles), np.zeros(40)], axis=1)
    vertices = np.concatenate([[[0, 0, -1], [0, 0, 1]], tips])
    mesh = kiln.Mesh(vertices, [[0, 1, k + 2] for k in range(40)], tier="double")
    random = np.random.default_rng(3)
    targets = np.stack([np.zeros(5000), np.zeros(5000), random.uniform(-0.9, 0.9, 5000)], axis=1)
    origins = random.normal(size=(5000, 3))
    found = mesh.crossings(origins, targets - origins)
    same = found.ray[1:] == found.ray[:-1]
    assert same.sum() > 1000
    assert (np.diff(found.distance)[same] >= 0).all()


FAR_BOX = [[x, y, z] for x in (0, 0.01) for y in (0, 0.01) for z in (0, 0.01)]
# Corners of a box by the bits of x, y and z, counterclockwise seen from outside.
BOX_FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
BOX_FACES += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]


def test_small_parts_far_away_keep_their_shape():
    """A box of 0.01 at 1e6, where f32 has steps of 1/16: rounded, it is a point."""
    vertices = np.array(FAR_BOX) + 1e6
    targets = vertices[BOX_FACES].mean(axis=1)
    origins = np.broadcast_to(vertices.mean(axis=0) + [0.3, 0.2, 0.1], targets.shape)
    mesh = kiln.Mesh(vertices, BOX_FACES)
    assert mesh.tier == "double" and mesh.any(origins, targets - origins).all()
    scene = kiln.Scene()
    scene.add(vertices, BOX_FACES)
    assert scene.mesh().any(origins, targets - origins).all()
    with pytest.warns(kiln.KilnWarning, match="in tier watertight, merges vertices or planes of 12 triangles"):
        assert not kiln.Mesh(vertices, BOX_FACES, tier="watertight").any(origins, targets - origins).any()
    # A wall of 0.001 has both of its sides at 1e6.
    with pytest.warns(kiln.KilnWarning, match="of 12 triangles"):
        wall = kiln.Mesh((np.array(FAR_BOX) * 100) * [0.001, 4, 4] + 1e6, BOX_FACES, tier="watertight")
    assert not wall.contains([1e6 + 0.0005, 1e6 + 2, 1e6 + 2])
    # Without a warning: f64, vertices that are f32 already, and steps below the edges.
    kiln.Mesh(vertices, BOX_FACES, tier="exact")
    kiln.Mesh(vertices.astype("f4"), BOX_FACES, tier="watertight")
    kiln.Mesh((vertices - 1e6) * 100 + 1e5, BOX_FACES, tier="watertight")


def test_degenerate_triangles_keep_their_index():
    """Triangles with equal or collinear corners before and after those of a tetrahedron, which are 2, 3, 5 and 6."""
    vertices, faces = TETRAHEDRON
    flat = [[0, 0, 1], [2, 2, 2]]
    faces = np.concatenate([flat, faces[:2], flat[:1], faces[2:], flat[:1]])
    for tier in ("watertight", "double", "exact"):
        mesh = kiln.Mesh(vertices, faces, tier=tier)
        # Through the base, which is 2, and the slope, which is 6.
        ray = [[0.25, 0.25, -1]], [[0, 0, 1]]
        assert len(mesh) == 8 and mesh.first(*ray).triangle.tolist() == [2]
        assert mesh.all(*ray).triangle.tolist() == mesh.crossings(*ray).triangle.tolist() == [2, 6]
        assert mesh.closest_point([[0.25, 0.25, -1], [1, 1, 1]]).triangle.tolist() == [2, 6]
        assert mesh.contains([[0.1, 0.1, 0.1], [1, 1, 1]]).tolist() == [True, False]


def test_rays_of_any_shape(tetrahedron):
    origins, targets = np.random.default_rng(4).normal(size=(2, 6, 5, 3)) * [[[[1]]], [[[0.3]]]]
    directions = targets - origins
    flat = [array.reshape(-1, 3) for array in (origins, directions)]
    expected = tetrahedron.first(*flat)
    assert 0 < (expected.triangle >= 0).sum() < 30
    found = tetrahedron.first(origins, directions)
    assert found.triangle.shape == found.distance.shape == (6, 5) and found.location.shape == (6, 5, 3)
    for a, b in zip(found, expected):
        assert np.array_equal(a.reshape(b.shape), b, equal_nan=True)
    assert (tetrahedron.any(origins, directions) == (found.triangle >= 0)).all()
    assert tetrahedron.all(origins, directions).ray.tolist() == tetrahedron.all(*flat).ray.tolist()
    limits = np.full((6, 5), 1e-9)
    assert not tetrahedron.any(origins, directions, limits).any()
    inside = tetrahedron.contains(origins)
    assert inside.shape == (6, 5) and tetrahedron.winding_number(origins).dtype == np.int32
    assert tetrahedron.closest_point(origins).location.shape == (6, 5, 3)
    assert tetrahedron.signed_distance(origins).shape == (6, 5)


def test_one_vector_for_all_rays(tetrahedron):
    below, up = [0.25, 0.25, -1], [0, 0, 1]
    hit = tetrahedron.first(below, up)
    assert hit.triangle.shape == () and hit.triangle == 0 and hit.location.tolist() == [0.25, 0.25, 0]
    assert tetrahedron.any(below, up) and tetrahedron.all(below, up).triangle.tolist() == [0, 3]
    assert tetrahedron.first(below, [up, [0, 0, -1]]).triangle.tolist() == [0, -1]
    assert tetrahedron.first([[below], [[5, 5, 5]]], up, 1.5).triangle.tolist() == [[0], [-1]]
    assert tetrahedron.any(below, np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize("count", [64, 65, 4097, 40_000])
def test_batches_have_the_hits_of_single_rays(sphere, count):
    """Few rays are traced by the calling thread, many in ranges."""
    origins, directions = np.random.default_rng(5).normal(size=(2, count, 3))
    first, every, crossings = (getattr(sphere, query)(origins, directions) for query in ("first", "all", "crossings"))
    assert (sphere.any(origins, directions) == (first.triangle >= 0)).all()
    for ray in range(0, count, count // 50):
        alone = sphere.first(origins[ray], directions[ray])
        assert alone.triangle == first.triangle[ray]
        assert np.array_equal(alone.location, first.location[ray], equal_nan=True)
        alone = sphere.all(origins[ray], directions[ray])
        assert alone.triangle.tolist() == every.triangle[every.ray == ray].tolist()
        assert alone.location.tolist() == every.location[every.ray == ray].tolist()
        alone = sphere.crossings(origins[ray], directions[ray])
        assert alone.triangle.tolist() == crossings.triangle[crossings.ray == ray].tolist()
        assert alone.entering.tolist() == crossings.entering[crossings.ray == ray].tolist()


QUERIES = ["first", "any", "all", "crossings", "contains", "closest_point", "signed_distance"]


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT to one process")
@pytest.mark.parametrize("query", QUERIES)
def test_an_interrupt_ends_a_query(query):
    """SIGINT after 0.2 s of a query of many seconds: rays through the box of 1,000 equal triangles that miss them all,
    and points at equal distances from them all."""
    program = """
import os, signal, sys, threading, time, warnings
import numpy as np
import kiln
warnings.simplefilter("ignore")
mesh = kiln.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.tile([[0, 1, 2]], (1_000, 1)), preset="fast-build")
points = [0.8, 0.8, -1] + 0.1 * np.random.default_rng(0).random((4_000_000, 3))
mesh.closedness()
query = getattr(mesh, sys.argv[1])
directions = [np.array([0, 0, 1.0])] if sys.argv[1] in ("first", "any", "all", "crossings") else []
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
try:
    query(points, *directions)
    print("ended")
except KeyboardInterrupt:
    print("interrupted")
"""
    start = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", program, query], check=True, timeout=120, capture_output=True, text=True
    )
    assert done.stdout == "interrupted\n" and time.monotonic() - start < 20
