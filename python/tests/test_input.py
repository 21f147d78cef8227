"""Input of any type, order and content: the result of the same numbers in C order, or a ValueError that names the
argument."""

import numpy as np
import pytest
from conftest import TETRAHEDRON
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import kiln

VERTICES, FACES = TETRAHEDRON


def layouts(array: np.ndarray) -> list:
    """The same numbers in other orders and containers."""
    wide = np.zeros((2 * len(array), 5), array.dtype)
    wide[::2, 1:4] = array
    packed = np.zeros(len(array), np.dtype([("pad", "u1"), ("row", array.dtype, 3)]))
    packed["row"] = array
    read_only = array.copy()
    read_only.flags.writeable = False
    return [
        np.asfortranarray(array),
        wide[::2, 1:4],
        array[::-1][::-1],
        packed["row"],  # not aligned
        array.astype(array.dtype.newbyteorder()),
        read_only,
        array.tolist(),
        [list(row) for row in array],
        array.view(type("Derived", (np.ndarray,), {})),
    ]


def equal(a, b):
    return all(np.array_equal(x, y, equal_nan=x.dtype.kind == "f") for x, y in zip(a, b))


@pytest.mark.parametrize("number", range(9))
def test_layouts(number):
    origins = np.random.default_rng(3).normal(size=(40, 3))
    directions = np.array([0.2, 0.2, 0.2]) - origins
    mesh = kiln.Mesh(VERTICES, FACES)
    expected = mesh.first(origins, directions)
    assert (expected.triangle >= 0).any()
    other = kiln.Mesh(layouts(VERTICES)[number], layouts(FACES)[number])
    assert equal(other.first(layouts(origins)[number], layouts(directions)[number]), expected)
    assert (other.contains(layouts(origins)[number]) == mesh.contains(origins)).all()


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", "g", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", ">f4", ">i8"])
def test_types(dtype):
    # Small integers are exact in every type.
    mesh = kiln.Mesh((VERTICES * 4).astype(dtype), FACES.astype(dtype if "f" not in dtype and dtype != "g" else "i4"))
    hits = mesh.first(np.array([[1, 1, 9]], dtype), np.array([[0, 0, 1]], dtype) * -1.0)
    assert hits.triangle.tolist() == [3] and hits.distance.tolist() == [7]


def test_masked_arrays_without_masked_entries_are_arrays():
    assert len(kiln.Mesh(np.ma.array(VERTICES), np.ma.array(FACES, mask=False))) == 4


def test_nothing():
    empty = kiln.Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert len(empty) == 0 == len(kiln.Mesh([], []))
    assert empty.first([[0, 0, 0]], [[1, 0, 0]]).triangle.tolist() == [-1]
    assert not empty.any([[0, 0, 0]], [[1, 0, 0]]).any() and not empty.contains([[0, 0, 0]]).any()
    assert empty.closest_point([[0, 0, 0]]).triangle.tolist() == [-1]
    assert np.isnan(empty.signed_distance([[0, 0, 0]])).all()
    mesh = kiln.Mesh(VERTICES, FACES)
    for none in ([], np.zeros((0, 3))):
        assert mesh.first(none, none).location.shape == (0, 3)
        assert mesh.all(none, none).location.shape == mesh.crossings(none, none).location.shape == (0, 3)
        assert mesh.any(none, none).shape == mesh.contains(none).shape == mesh.signed_distance(none).shape == (0,)


def masked(array: np.ndarray) -> np.ma.MaskedArray:
    """The array with a masked entry in row 1."""
    return np.ma.array(array, mask=np.arange(array.size).reshape(array.shape) == array.shape[1])


ROW = [[0.0, 0.0, 1.0]]
MISTAKES = [
    ("vertices", lambda m: kiln.Mesh([[0, 0]], FACES), r"shape \(n, 3\), not \(1, 2\)"),
    ("vertices", lambda m: kiln.Mesh(VERTICES[None], FACES), "shape"),
    ("vertices", lambda m: kiln.Mesh(VERTICES.astype(complex), FACES), "numbers, not the dtype complex128"),
    ("vertices", lambda m: kiln.Mesh([["a", "b", "c"]], FACES), "numbers"),
    ("vertices", lambda m: kiln.Mesh([[0, 0, None]], FACES), "object"),
    ("vertices", lambda m: kiln.Mesh(VERTICES > 0, FACES), "bool"),
    ("vertices", lambda m: kiln.Mesh(VERTICES * np.nan, FACES), "not finite"),
    ("vertices", lambda m: kiln.Mesh(VERTICES * 1e39, FACES), "too large for f32"),
    ("vertices", lambda m: kiln.Mesh([[1, 2, 3], [4]], FACES), "not an array"),
    ("faces", lambda m: kiln.Mesh(VERTICES, [[0, 1, 2, 3]]), r"\(1, 4\)"),
    ("faces", lambda m: kiln.Mesh(VERTICES, FACES.astype(float)), "integers, not the dtype float64"),
    ("faces", lambda m: kiln.Mesh(VERTICES, [[0, 1, 4]]), "row 0 has the vertex 4, and there are 4 vertices"),
    ("faces", lambda m: kiln.Mesh(VERTICES, [[0, 1, -1]]), "vertex -1"),
    ("faces", lambda m: kiln.Mesh(VERTICES, np.array([[0, 1, 2], [0, 1, 2**63]], "u8")), f"row 1 .*{2**63}, and"),
    ("faces", lambda m: kiln.Mesh(VERTICES, np.array([[0, 2**64 - 1, 2]], "u8")), f"row 0 has the vertex {2**64 - 1}"),
    ("faces", lambda m: kiln.Mesh(VERTICES, masked(FACES)), "row 1 has masked entries"),
    ("vertices", lambda m: kiln.Mesh(masked(VERTICES), FACES), "row 1 has masked entries"),
    ("vertices", lambda m: kiln.Scene().add(VERTICES * [[1], [1], [1e39], [1]], FACES), "row 2 .*too large for f32"),
    ("colours", lambda m: kiln.Scene().add(VERTICES, FACES, colours=masked(FACES[:, :3] * 0.1)), "masked"),
    ("colours", lambda m: kiln.Scene().add(VERTICES, FACES, colours=masked(VERTICES.astype("u1"))), "masked"),
    ("uvs", lambda m: kiln.Scene().add(VERTICES, FACES, uvs=[[0, 0]] * 3 + [[np.nan, 0]]), "row 3 is not finite"),
    ("transforms", lambda m: kiln.Scene().add(VERTICES, FACES, transforms=np.ma.masked_less([np.eye(4)], 1)), "masked"),
    ("transforms", lambda m: kiln.Scene().add(VERTICES, FACES, transforms=[[[1j]]]), "numbers, not .* complex128"),
    ("transforms", lambda m: kiln.Scene().add(VERTICES, FACES, transforms=5), r"shape \(k, 4, 4\), not \(\)"),
    ("tier", lambda m: kiln.Mesh(VERTICES, FACES, tier="slow"), "none of watertight, double, exact"),
    ("preset", lambda m: kiln.Mesh(VERTICES, FACES, preset="best"), "best-trace"),
    ("origins", lambda m: m.first([[0, 0, np.nan]], ROW), "row 0"),
    ("origins", lambda m: m.first(np.float64(1e39) * np.ones((1, 3)), ROW), "too large"),
    ("origins", lambda m: m.first([0, 0], ROW), r"shape \(\.\.\., 3\), not \(2,\)"),
    ("directions", lambda m: m.first([ROW] * 2, ROW), r"shape is \[1\], and that of origins \[2, 1\]"),
    ("max_distance", lambda m: m.first([ROW] * 2, [ROW] * 2, [1.0]), r"shape is \[1\], and that of origins \[2, 1\]"),
    ("directions", lambda m: m.any(ROW, ROW + ROW), "2 rows, and origins has 1"),
    ("directions", lambda m: m.all(ROW * 3, [[0, 0, 1], [0, 0, 0], [0, 0, 0]]), "rows 1, 2: the direction"),
    ("directions", lambda m: m.crossings(ROW, [[0, np.inf, 0]]), "not finite"),
    ("max_distance", lambda m: m.any(ROW, ROW, 0), "above 0"),
    ("max_distance", lambda m: m.any(ROW, ROW, [1.0, 2.0]), "2 rows, and origins has 1"),
    ("max_distance", lambda m: m.any(ROW, ROW, "far"), "numbers"),
    ("max_distance", lambda m: m.any(ROW, ROW, np.ma.masked_all(1)), "row 0 has masked entries"),
    ("max_distance", lambda m: m.any(ROW, ROW, np.ma.masked), "masked"),
    ("points", lambda m: m.contains([[0, 0, np.inf]]), "row 0"),
    ("points", lambda m: m.closest_point([[0, 0, 1e200]]), "too large"),
    ("points", lambda m: m.signed_distance(5), r"\(\)"),
    ("points", lambda m: m.contains(np.diag([np.nan, 0, np.inf])), "rows 0, 2 are not finite"),
    ("points", lambda m: m.contains(np.full((20, 3), np.nan)), "rows 0, 1, 2, 3, 4, 5, 6, 7 and 12 others are"),
    ("origins", lambda m: m.first(np.full((99, 3), np.nan), ROW[0]), "rows 0, 1, .* and 91 others: the origin"),
    ("beta", lambda m: m.generalised_winding_number(ROW, np.nan), "NaN is not 1 or more"),
    ("beta", lambda m: m.generalised_winding_number(ROW, 0.5), "not 1 or more"),
    ("count", lambda m: m.nearest(ROW, -1), "-1 is not 0 or more"),
]


@pytest.mark.parametrize("argument, call, what", MISTAKES)
def test_mistakes_name_the_argument(argument, call, what):
    with pytest.raises(ValueError, match=f"^{argument}: .*{what}"):
        call(kiln.Mesh(VERTICES, FACES))


# Coordinates that make degenerate triangles likely, and extreme ones.
COORDINATES = st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-30, 1e30, -1e30, 3e38, 1e-300])
ANY = COORDINATES | st.floats(width=64)


@st.composite
def meshes(draw):
    vertices = draw(hnp.arrays(np.float64, (draw(st.integers(1, 9)), 3), elements=COORDINATES))
    faces = draw(hnp.arrays(np.int64, (draw(st.integers(0, 12)), 3), elements=st.integers(0, len(vertices) - 1)))
    return vertices, faces


@settings(max_examples=300, deadline=None)
@given(
    meshes(),
    st.sampled_from(["watertight", "double", "exact"]),
    st.integers(0, 20).flatmap(lambda n: hnp.arrays(np.float64, (2, n, 3), elements=ANY)),
)
@pytest.mark.filterwarnings("ignore::kiln.KilnWarning")
def test_degenerate_meshes(mesh, tier, rays):
    """No query fails but by a ValueError, and queries agree with each other."""
    mesh = kiln.Mesh(*mesh, tier=tier)
    origins, directions = rays
    with np.errstate(over="ignore"):
        valid = np.isfinite(origins.astype(np.float32)).all(axis=1)
    valid &= np.isfinite(directions).all(axis=1) & (directions != 0).any(axis=1)
    if not valid.all():
        with pytest.raises(ValueError, match="^(origins|directions): row"):
            mesh.first(origins, directions)
        origins, directions = origins[valid], directions[valid]
    first, every = mesh.first(origins, directions), mesh.all(origins, directions)
    assert (first.triangle < len(mesh)).all()
    assert (np.unique(every.ray) == np.flatnonzero(first.triangle >= 0)).all()
    assert (mesh.any(origins, directions) == (first.triangle >= 0)).all()
    assert (np.diff(every.ray) >= 0).all()
    crossings = mesh.crossings(origins, directions)
    winding = mesh.winding_number(origins)
    answer = mesh.contains(origins, return_margin=True)
    assert (mesh.contains(origins) == answer.inside).all()
    assert (answer.rule == "crossings") == mesh.closedness().is_closed
    if mesh.closedness().is_closed:
        assert (answer.inside == (winding != 0)).all()
        # Leaving ones less entering ones, of any ray.
        sides = np.where(crossings.entering, -1, 1)
        assert (np.bincount(crossings.ray, sides, len(origins)) == winding).all()
    assert (mesh.closest_point(origins).triangle >= (0 if len(mesh) else -1)).all()
