"""trimesh's interface: options, changed meshes, and regressions of issues of trimesh."""

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kiln.trimesh

trimesh = pytest.importorskip("trimesh")


def with_kiln(mesh):
    mesh.ray = kiln.trimesh.RayMeshIntersector(mesh)
    return mesh


@pytest.fixture
def box():
    """A cube from -1 to 1."""
    return with_kiln(trimesh.creation.box(extents=[2, 2, 2]))


def test_options(box):
    origins, directions = [[0.25, 0.5, -5], [9, 9, 9], [0.5, 0.25, 3]], [[0, 0, 2], [0, 0, 1], [0, 0, -1]]
    triangles, rays = box.ray.intersects_id(origins, directions)
    assert rays.tolist() == [0, 0, 2, 2]
    triangles, rays, locations = box.ray.intersects_id(origins, directions, return_locations=True, max_hits=1)
    assert rays.tolist() == [0, 2] and locations.tolist() == [[0.25, 0.5, -1], [0.5, 0.25, 1]]
    assert np.allclose(box.face_normals[triangles], [[0, 0, -1], [0, 0, 1]])
    first = box.ray.intersects_id(origins, directions, multiple_hits=False)
    assert first[0].tolist() == triangles.tolist() and first[1].tolist() == [0, 2]
    assert box.ray.intersects_first(origins, directions).tolist() == [triangles[0], -1, triangles[1]]
    assert box.ray.intersects_any(origins, directions).tolist() == [True, False, True]
    locations, rays, triangles = box.ray.intersects_location(origins, directions)
    assert locations[:, 2].tolist() == [-1, 1, 1, -1] and len(rays) == len(triangles) == 4
    assert box.contains([[0.5, 0.5, 0.5], [1.5, 0, 0]]).tolist() == [True, False]


def test_invalid_rays_hit_nothing(box):
    nan, inf = np.nan, np.inf
    origins = [[0.2, 0.1, -5], [0.2, 0.1, -5], [0.2, nan, -5], [0.2, 0.1, -5], [0.2, 0.1, -inf], [0.2, 0.1, -5]]
    directions = [[0, 0, 0], [0, 0, 1], [0, 0, 1], [0, nan, 1], [0, 0, 1], [0, 0, inf]]
    own = trimesh.creation.box(extents=[2, 2, 2], use_embree=False)
    for multiple_hits in (True, False):
        _, rays = box.ray.intersects_id(origins, directions, multiple_hits=multiple_hits)
        assert rays.tolist() == [1] * (1 + multiple_hits)
        locations, rays, triangles = box.ray.intersects_location(origins, directions, multiple_hits=multiple_hits)
        assert rays.tolist() == [1] * (1 + multiple_hits) and locations[0].tolist() == [0.2, 0.1, -1]
    first = box.ray.intersects_first(origins, directions)
    assert first.dtype == np.int64 and (first >= 0).tolist() == [False, True, False, False, False, False]
    assert box.ray.intersects_any(origins, directions).tolist() == (first >= 0).tolist()
    none = box.ray.intersects_location([[nan] * 3], [[0, 0, 1]])
    assert [part.shape for part in none] == [(0, 3), (0,), (0,)]
    points = [[0, nan, 0], [0.5, 0.2, 0.1], [inf, 0, 0], [1e300, 0, 0]]
    assert box.ray.contains_points(points).tolist() == own.contains(points).tolist() == [False, True, False, False]


def test_thickness_with_a_zero_normal(box):
    """Of a cube: 2 from a side to the opposite one, and nothing is hit without a direction."""
    points, normals = [[0.3, 0.2, 1], [0.3, 0.2, 1]], [[0, 0, 1], [0, 0, 0]]
    assert trimesh.proximity.thickness(box, points, normals=normals, method="ray") == pytest.approx([2, np.inf])
    spheres = trimesh.proximity.thickness(box, points, normals=normals)
    own = trimesh.creation.box(extents=[2, 2, 2], use_embree=False)
    assert spheres == pytest.approx(trimesh.proximity.thickness(own, points, normals=normals))


def test_types_of_arguments(box):
    below = np.array([[0, 0, -5]]), np.array([[0, 0, 1]])
    for dtype in (np.float16, np.int8, ">f4", np.longdouble):
        assert box.ray.intersects_any(*[array.astype(dtype) for array in below]).tolist() == [True]
    assert box.ray.intersects_any([], []).shape == box.ray.intersects_first([], []).shape == (0,)
    assert box.ray.intersects_location([], [])[0].shape == (0, 3) and box.ray.contains_points([]).shape == (0,)


@pytest.mark.parametrize(
    "origins, directions, what",
    [
        ([0, 0, 1], [[0, 0, 1]], r"^ray_origins: .*\(3,\)"),
        ([[0, 0, 1]], [[0, 1]], r"^ray_directions: .*\(1, 2\)"),
        ([[0, 0, 1]], [[0, 0, 1]] * 2, "^ray_directions: 2 rows, and ray_origins has 1"),
        ([[0, 0, "a"]], [[0, 0, 1]], "^ray_origins: expected numbers, not the dtype <U"),
        ([[0, 0, 1]], [[0, 0, {}]], "^ray_directions: expected numbers, not the dtype object$"),
        (np.array([[0, 0, 1]], object), [[0, 0, 1]], "^ray_origins: expected numbers, not the dtype object$"),
        (np.array([[0, 0, 1j]]), [[0, 0, 1]], "^ray_origins: expected numbers, not the dtype complex128$"),
        ([[False, False, True]], [[0, 0, 1]], "^ray_origins: expected numbers, not the dtype bool$"),
        ([[0, 0, 1], [0]], [[0, 0, 1]], "^ray_origins: not an array: "),
        ([[0, 0, 1]], np.ma.masked, "^ray_directions: row 0 has masked entries$"),
        ([[0, 0, 1], [0, 0, 1e39]], [[0, 0, 1]] * 2, "^ray_origins: row 1 is too large for f32"),
        (np.ma.masked_less([[1, 1, 1], [0, 0, 1]], 1), [[0, 0, 1]] * 2, "^ray_origins: row 1 has masked entries$"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_mistakes_name_the_argument(box, origins, directions, what):
    for query in (box.ray.intersects_id, box.ray.intersects_first, box.ray.intersects_any):
        with pytest.raises(ValueError, match=what):
            query(origins, directions)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("points", [np.ones((1, 3), complex), np.ones((1, 3), object), np.ones((1, 3), bool)])
def test_points_are_numbers(box, points):
    with pytest.raises(ValueError, match="^points: expected numbers, not the dtype"):
        box.ray.contains_points(points)


@pytest.mark.filterwarnings("error")
def test_numbers_beyond_float64_are_not_finite(box):
    huge = np.array([[0, 0, np.longdouble("1e4000")]])
    if np.isfinite(huge).all():  # longdouble is not float64 everywhere
        assert not box.ray.intersects_any(huge, [[0, 0, -1]]).any() and not box.ray.contains_points(huge).any()


def test_max_hits(box):
    """Of a ray through both sides of a cube, and one that misses it."""
    rays = [[0.25, 0.5, -5], [9, 9, 9]], [[0, 0, 2], [0, 0, 1]]
    for multiple_hits, counts in [(True, [0, 1, 2, 2]), (False, [0, 1, 1, 1])]:
        for max_hits, count in zip([0, np.int8(1), 2, None], counts):
            found = box.ray.intersects_id(*rays, multiple_hits, max_hits, True)
            assert [len(part) for part in found] == [count] * 3
        for wrong in (1.0, "1", [1]):
            with pytest.raises(TypeError, match=f"^max_hits: expected an integer, not {type(wrong).__name__}$"):
                box.ray.intersects_id(*rays, multiple_hits, wrong)
            with pytest.raises(TypeError, match="^max_hits"):
                box.ray.intersects_location(*rays, multiple_hits, max_hits=wrong)


def test_a_wrong_tier_is_an_error_at_once(box):
    with pytest.raises(ValueError, match="^tier: `slow` is none of watertight, "):
        kiln.trimesh.RayMeshIntersector(box, tier="slow")


def test_the_tree_follows_the_mesh(box):
    below = [[0, 0, -5]], [[0, 0, 1]]
    assert box.ray.intersects_location(*below, multiple_hits=False)[0].tolist() == [[0, 0, -1]]
    box.apply_scale(2)
    assert box.ray.intersects_location(*below, multiple_hits=False)[0].tolist() == [[0, 0, -2]]
    for other in (copy.copy(box.ray), copy.deepcopy(box.ray), pickle.loads(pickle.dumps(box.ray))):
        assert other.intersects_any(*below).all()


def test_issue_1180_no_ray_is_lost():
    """Of 1024 x 512 rays from inside of a closed mesh, one was missing."""
    sphere = with_kiln(trimesh.creation.icosphere(subdivisions=3))
    longitude, latitude = np.meshgrid(np.linspace(0, 2 * np.pi, 1024), np.linspace(-np.pi / 2, np.pi / 2, 512))
    longitude, latitude = longitude.ravel(), latitude.ravel()
    directions = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=1
    )
    origins = np.zeros_like(directions)
    for multiple_hits in (False, True):
        locations, rays, triangles = sphere.ray.intersects_location(origins, directions, multiple_hits=multiple_hits)
        assert (rays == np.arange(1024 * 512)).all() and len(locations) == len(triangles) == 1024 * 512


def test_issue_1496_any_and_id_agree():
    """Rays through vertices and edges of the inner box, from its middle to the vertices of the outer one."""
    inner = with_kiln(trimesh.creation.box(extents=[40] * 3).subdivide_to_size(20))
    outer = trimesh.creation.box(extents=[60] * 3).subdivide_to_size(20)
    origins = np.zeros_like(outer.vertices)
    assert inner.ray.intersects_any(origins, outer.vertices).all()
    for multiple_hits in (False, True):
        _, rays = inner.ray.intersects_id(origins, outer.vertices, multiple_hits=multiple_hits)
        assert (rays == np.arange(len(origins))).all()


def test_issue_306_a_batch_has_the_hits_of_single_rays():
    mesh = with_kiln(trimesh.creation.icosphere(subdivisions=3))
    origins, directions = mesh.vertices + 0.01 * mesh.vertex_normals, -mesh.vertex_normals
    batch = mesh.ray.intersects_location(origins, directions, multiple_hits=False)
    assert (batch[1] == np.arange(len(origins))).all()
    # The vertices themselves, up to rounding of the sums above.
    assert np.abs(batch[0] - mesh.vertices).max() < 1e-14
    for index in range(0, len(origins), 97):
        single = mesh.ray.intersects_location(origins[[index]], directions[[index]], multiple_hits=False)
        assert (single[0][0] == batch[0][index]).all() and single[2][0] == batch[2][index]


def test_issue_2534_a_cavity_is_outside():
    """A cube with a cubic cavity, whose faces are turned inwards."""
    outer, inner = trimesh.creation.box(extents=[1] * 3), trimesh.creation.box(extents=[0.1] * 3)
    inner.invert()
    mesh = with_kiln(trimesh.util.concatenate([outer, inner]))
    assert mesh.contains([[0, 0, 0], [0.2, 0, 0], [0.04, 0.04, 0.04], [0.06, 0, 0]]).tolist() == [
        False,
        True,
        False,
        True,
    ]
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (100_000, 3))
    expected = (np.abs(points) < 0.5).all(axis=1) & ~(np.abs(points) < 0.05).all(axis=1)
    assert (mesh.contains(points) == expected).all()


def test_scale_and_place_do_not_matter():
    """Boxes from 1e-30 to 1e30 in size, and far from the origin, where f32 has steps of 1/16."""
    for scale in [1e-30, 1e-9, 1e9, 1e30]:
        mesh = with_kiln(trimesh.Trimesh(*box_arrays(scale), process=False))
        assert len(mesh.ray.intersects_id([[0, 0, scale]], [[0, 0, -1]])[0]) == 2
    vertices, faces = box_arrays(1.0)
    mesh = with_kiln(trimesh.Trimesh(vertices + [1e6 + 0.01, 0, 0], faces, process=False))
    locations, _, _ = mesh.ray.intersects_location([[1e6 - 9.0, 0.1, 0.2]], [[1, 0, 0]])
    assert np.allclose(locations[:, 0], [1e6 - 0.49, 1e6 + 0.51], rtol=0, atol=1e-9)


def box_arrays(size):
    box = trimesh.creation.box()
    return np.asarray(box.vertices) * size, np.asarray(box.faces)


def test_the_plugin_fails_tests_without_rays(tmp_path):
    """The plugin that runs trimesh's own tests with kiln."""
    test = """
import trimesh
import trimesh.ray.ray_pyembree

def test_calls():
    for use_embree in (True, False):
        mesh = trimesh.creation.box(use_embree=use_embree)
        assert mesh.ray.intersects_any([[0, 0, 5]], [[0, 0, -1]]).all()

def test_none():
    pass
"""
    (tmp_path / "test_ray.py").write_text(test)
    folder = Path(__file__).parent / "trimesh"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "kiln_backend", "-p", "no:cacheprovider", "test_ray.py"]
    done = subprocess.run(command, cwd=tmp_path, env={"PYTHONPATH": str(folder)}, capture_output=True, text=True)
    assert "1 failed, 1 passed" in done.stdout and "test_none" in done.stdout, done.stdout + done.stderr


@pytest.fixture
def installed():
    kiln.trimesh.install()
    yield
    kiln.trimesh.uninstall()


def test_install_reaches_every_mesh(installed):
    kiln.trimesh.install()  # again: nothing changes
    mesh = trimesh.creation.icosphere()
    half = mesh.slice_plane([0, 0, 0], [0, 0, 1])
    both = trimesh.util.concatenate([mesh, half])
    for other in (mesh, mesh.copy(), mesh.subdivide(), half, copy.deepcopy(mesh), both):
        assert type(other.ray) is kiln.trimesh.RayMeshIntersector and other.ray.mesh is other
        assert other.ray.intersects_any([[0.1, 0.2, 5]], [[0, 0, -1]]).all()
    kiln.trimesh.uninstall()
    assert not isinstance(trimesh.creation.box().ray, kiln.trimesh.RayMeshIntersector)
    assert isinstance(mesh.ray, kiln.trimesh.RayMeshIntersector)
    kiln.trimesh.install()
    assert isinstance(mesh.copy().ray, kiln.trimesh.RayMeshIntersector)


@pytest.mark.parametrize("mesh", [trimesh.creation.box(extents=[2, 2, 2]), trimesh.creation.icosphere(subdivisions=2)])
def test_every_query_says_of_the_same_rays_that_they_hit(mesh):
    """Rays along edges and in the planes of faces, past vertices, and from points of the surface."""
    mesh = with_kiln(mesh.copy())
    vertices, a, b = (np.asarray(part) for part in (mesh.vertices, *mesh.vertices[mesh.edges].transpose(1, 0, 2)))
    centres, axes = mesh.triangles_center, np.concatenate([np.eye(3), -np.eye(3)])
    origins = [a - 3 * (b - a), (a + b) / 2, centres, np.repeat(vertices, 6, axis=0), np.repeat(centres, 6, axis=0)]
    directions = [b - a, b - a, mesh.face_normals, np.tile(axes, (len(vertices), 1)), np.tile(axes, (len(centres), 1))]
    origins.append(np.repeat(vertices, 6, axis=0) - 5 * directions[3])
    directions.append(directions[3])
    rays = np.concatenate(origins), np.concatenate(directions)
    is_hit = mesh.ray.intersects_any(*rays)
    assert 0 < is_hit.sum() < len(is_hit)
    assert (is_hit == (mesh.ray.intersects_first(*rays) >= 0)).all()
    for multiple_hits in (True, False):
        locations, index, triangles = mesh.ray.intersects_location(*rays, multiple_hits=multiple_hits)
        assert np.unique(index).tolist() == np.flatnonzero(is_hit).tolist()
        assert (np.diff(index) >= 0).all() and len(locations) == len(triangles) == len(index)
        few, rays_of_few = mesh.ray.intersects_id(*rays, multiple_hits, 1)
        assert rays_of_few.tolist() == np.flatnonzero(is_hit).tolist()
