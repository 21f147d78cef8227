"""What hits say of their object, normal, texture coordinates and material; hits that are filtered."""

import copy
import pickle
import struct
import zlib

import numpy as np
import pytest
from conftest import TETRAHEDRON, icosphere

import kiln

VERTICES, FACES = icosphere(2)
QUAD = np.array([[-4, -3, -4], [4, -3, -4], [4, 3, -4], [-4, 3, -4]], float)
ATTRIBUTES = ["object", "instance", "primitive", "material", "normal", "shading_normal", "uv"]


def write_image(file, pixels):
    """A PNG of (h, w, 3) uint8."""
    height, width, _ = pixels.shape

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b"")]
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def placements():
    """Turned and stretched, mirrored, and moved."""
    matrices = np.tile(np.eye(4), (3, 1, 1))
    matrices[0, :3, :3] = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]) @ np.diag([1, 0.5, 1.2])
    matrices[1, :3, :3] = np.diag([-0.8, 0.8, 0.8])
    matrices[:, :3, 3] = [[-1.5, 0, 0], [1.5, 0.5, 0], [0, -1.6, 0.5]]
    return matrices


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A textured quad, smooth instances with its texture, and a sphere. Texel (x, y) has red x and green y."""
    folder = tmp_path_factory.mktemp("textured")
    y, x = np.mgrid[:256, :256].astype(np.uint8)
    write_image(folder / "ramp.png", np.stack([x, y, np.zeros_like(x)], axis=-1))
    (folder / "quad.mtl").write_text("newmtl ramp\nKd 1 1 1\nmap_Kd ramp.png\n")
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in QUAD) + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    (folder / "quad.obj").write_text("mtllib quad.mtl\nusemtl ramp\n" + corners + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")
    scene = kiln.Scene(folder / "quad.obj")
    uvs = VERTICES[:, :2] * 0.45 + 0.5
    scene.add(VERTICES, FACES, normals=VERTICES * 3, uvs=uvs, material="ramp", transforms=placements(), name="ball")
    ball = {"sphere": [{"centre": [0, 1.8, 0], "radius": 0.7, "material": "red"}]}
    scene.update({**ball, "material": {"red": {"colour": "#ff0000"}}})
    return scene


def test_attributes_are_those_of_pictures(scene):
    K, size = [180, 180, 79.5, 59.5], (160, 120)
    pose = np.diag([1.0, -1, -1, 1])
    pose[:3, 3] = [0.2, 0.1, 6]
    names = ["object", "material", "primitive", "normal", "shading-normal", "albedo", "distance"]
    prepared = kiln.Prepared(scene, numerics="double", with_=["textures=nearest"])
    (aovs,) = prepared.render_many([{"K": K, "pose": pose, "axes": "opencv"}], size=size, aovs=names)
    origins, directions = kiln.pinhole_rays(K, pose, size)
    hits = scene.mesh().first(origins, directions)
    for name in ("object", "material", "primitive"):
        assert (getattr(hits, name) == aovs[name]).mean() > 0.999, name
    same = (hits.primitive == aovs["primitive"]) & (hits.primitive >= 0)
    assert np.bincount(hits.object[same]).tolist() > [1000, 200, 200, 200, 200]
    # Those of pictures are on the side of the camera.
    side = -np.sign(np.einsum("hwk,hwk->hw", hits.normal, directions))[..., None]
    assert np.allclose((hits.normal * side)[same], aovs["normal"][same], atol=2e-7)
    assert np.allclose((hits.shading_normal * side)[same], aovs["shading-normal"][same], atol=2e-7)
    assert np.allclose(np.linalg.norm(hits.shading_normal[same], axis=-1), 1)
    # The front of a mirrored instance is seen, too.
    assert (side[same] == 1).all()
    # The texels that pictures show, encoded as in the file.
    albedo = aovs["albedo"][same][..., :2].astype(float)
    texels = 255 * np.where(albedo <= 0.0031308, 12.92 * albedo, 1.055 * albedo ** (1 / 2.4) - 0.055)
    is_textured = hits.object[same] < 4
    assert np.isnan(hits.uv[same][~is_textured]).all()
    expected = np.floor(hits.uv[same][is_textured] * 256)
    assert (np.abs(texels[is_textured] - expected) < 0.1).mean() > 0.999
    missed = hits.primitive < 0
    assert missed.any() and np.isnan(hits.normal[missed]).all() and np.isnan(hits.uv[missed]).all()
    assert np.isnan(hits.shading_normal[missed]).all()
    assert all((getattr(hits, name)[missed] == -1).all() for name in ("object", "instance", "material"))


def test_indices_of_objects(scene):
    """Objects: the quad, three balls and the sphere; of each a point near the middle, seen from the front."""
    targets = np.array([[3, 2.5, 0], *placements()[:, :3, 3], [0, 1.8, 0]]) + [0.03, 0.05, 9]
    mesh = scene.mesh()
    hits = mesh.first(targets, [0, 0, -1])
    assert hits.object.tolist() == [0, 1, 2, 3, 4]
    assert hits.instance.tolist() == [0, 0, 1, 2, 0]
    assert [scene.materials[index] for index in hits.material] == ["ramp"] * 4 + ["red"]
    count = len(FACES)
    assert (hits.primitive == hits.triangle + np.array([0, 2, 2 + count, 2 + 2 * count, 2 + 3 * count])).all()
    assert hits.triangle[0] in (0, 1) and hits.triangle[4] == 0 and (hits.triangle < count).all()
    # Other queries number in the same way.
    every = mesh.all(targets, [0, 0, -1])
    crossings = mesh.crossings(targets, [0, 0, -1])
    closest = mesh.closest_point(hits.location)
    for found in (every, crossings):
        first = np.searchsorted(found.ray, range(5))
        assert (found.object[first] == hits.object).all() and (found.triangle[first] == hits.triangle).all()
        assert (found.material[first] == hits.material).all() and (found.instance[first] == hits.instance).all()
    assert (closest.object == hits.object).all() and (closest.primitive == hits.primitive).all()
    far = mesh.closest_point([[0, 0, 90]], max_distance=1)
    assert far.triangle[0] == far.object[0] == far.material[0] == -1 and np.isnan(far.distance[0])


def test_closed_forms():
    """Of the tetrahedron, whose faces are the planes z = 0, y = 0, x = 0 and x + y + z = 1."""
    mesh = kiln.Mesh(*TETRAHEDRON)
    hits = mesh.first([0.2, 0.2, 0.2], [[0, 0, -1], [0, -1, 0], [-1, 0, 0], [1, 1, 1]])
    outwards = [[0, 0, -1], [0, -1, 0], [-1, 0, 0], np.full(3, 3**-0.5)]
    assert hits.triangle.tolist() == [0, 1, 2, 3] and np.allclose(hits.normal, outwards, atol=1e-15)
    assert (hits.shading_normal == hits.normal).all() and np.isnan(hits.uv).all() and hits.uv.shape == (4, 2)
    assert hits.object.tolist() == hits.instance.tolist() == [0] * 4 and hits.material.tolist() == [-1] * 4
    assert hits.primitive.tolist() == hits.triangle.tolist()
    # A triangle without area has no normal, and the shape of the rays is that of attributes.
    line = kiln.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]).first([[[0.5, 0, 1], [0.5, 9, 1]]], [0, 0, -1])
    assert np.isnan(line.normal).all() and line.normal.shape == (1, 2, 3) and line.object.shape == (1, 2)
    one = mesh.first([0.2, 0.2, 0.2], [0, 0, -1])
    assert one.object.shape == () and one.object == 0 and one.normal.tolist() == [0, 0, -1]


def test_closed_forms_of_scenes():
    scene = kiln.Scene()
    scene.add(VERTICES, FACES, normals=2 * VERTICES, uvs=VERTICES[:, :2])
    scene.update({"sphere": [{"centre": [5, 0, 0], "radius": 2}]})
    directions = np.random.default_rng(0).normal(size=(1000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    mesh = scene.mesh()
    hits = mesh.first(np.zeros(3), directions, max_distance=1.5)
    corners = VERTICES[FACES[hits.triangle]]
    # Vertex normals are the vertices, which have length 1, rounded to f32.
    smooth = np.einsum("rc,rck->rk", hits.barycentrics, corners)
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    assert (hits.object == 0).all() and np.allclose(hits.shading_normal, smooth, atol=2e-7)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.allclose(hits.normal, flat / np.linalg.norm(flat, axis=1, keepdims=True), atol=1e-13)
    # uv is linear in the position.
    assert np.allclose(hits.uv, hits.location[:, :2], atol=2e-7)
    of_sphere = mesh.first([5, 0, 0], directions, objects=1)
    assert np.allclose(of_sphere.normal, directions, atol=1e-15) and (of_sphere.object == 1).all()
    assert (of_sphere.shading_normal == of_sphere.normal).all() and np.isnan(of_sphere.uv).all()
    every = mesh.all([5, 0, 9], [0, 0, -1])
    assert every.normal.tolist() == [[0, 0, 1]] and every.object.tolist() == [1]


def test_attributes_are_of_the_mesh_at_the_query():
    vertices, faces = TETRAHEDRON
    mesh = kiln.Mesh(vertices, faces)
    hits = mesh.first([0.2, 0.2, 3], [0, 0, -1])
    mesh.update(vertices @ np.diag([1, 1, 7]))
    assert np.allclose(hits.normal, 3**-0.5)
    # The plane x + y + z / 7 = 1.
    assert np.allclose(mesh.first([0.2, 0.2, 9], [0, 0, -1]).normal, np.array([7, 7, 1]) / 99**0.5)
    del mesh
    assert np.allclose(hits.normal, 3**-0.5)


def test_results_are_tuples_that_are_pickled(sphere):
    hits = sphere.first(np.zeros(3), VERTICES)
    triangle, distance, location, barycentrics = hits
    assert isinstance(hits, tuple) and hits._fields == ("triangle", "distance", "location", "barycentrics")
    assert triangle is hits.triangle and len(hits) == 4 and repr(hits).startswith("Hits(triangle=")
    again = pickle.loads(pickle.dumps(hits))
    assert type(again) is type(hits) and all(np.array_equal(a, b) for a, b in zip(again, hits, strict=True))
    for name in ATTRIBUTES:
        assert np.array_equal(getattr(again, name), getattr(hits, name), equal_nan=True), name
    twice = pickle.loads(pickle.dumps(again))
    assert np.array_equal(twice.normal, hits.normal)
    crossings = sphere.crossings(np.zeros(3), VERTICES)
    assert np.array_equal(pickle.loads(pickle.dumps(crossings)).object, crossings.object)
    assert np.array_equal(copy.copy(hits).normal, hits.normal)
    with pytest.raises(AttributeError, match="Hits.object: only the result of a query has it, no changed"):
        pickle.loads(pickle.dumps(hits._replace(triangle=triangle))).object


def test_hits_of_some_objects(scene):
    """Those of a scene that has no others."""
    random = np.random.default_rng(5)
    origins, directions = random.normal(size=(2, 5000, 3)) * [[[4]], [[1]]]
    mesh = scene.mesh()
    for chosen in ([1, 3], [0], [4, 2], []):
        flags = np.isin(np.arange(5), chosen)
        # A far box of all that is left out keeps the numbers of objects.
        every = mesh.all(origins, directions)
        kept = flags[every.object]
        for objects in (chosen, flags, np.array(chosen, np.uint8)):
            found = mesh.all(origins, directions, objects=objects)
            for array, of_every in zip(found, every, strict=True):
                assert np.array_equal(array, of_every[kept])
            assert np.array_equal(found.object, every.object[kept])
        first = mesh.first(origins, directions, objects=chosen)
        rays, places = np.unique(found.ray, return_index=True)
        assert np.array_equal(np.flatnonzero(first.triangle >= 0), rays)
        assert np.array_equal(first.distance[rays], found.distance[places])
        assert np.array_equal(first.primitive[rays], found.primitive[places])
        assert np.array_equal(mesh.any(origins, directions, objects=chosen), first.triangle >= 0)
        counts = np.bincount(found.ray, minlength=len(origins))
        assert np.array_equal(mesh.count(origins, directions, objects=chosen), counts)
    # All of them are as none given, to the bit.
    for query in (mesh.first, mesh.all):
        given = query(origins, directions, objects=range(5))
        for array, other in zip(given, query(origins, directions), strict=True):
            assert np.array_equal(array, other, equal_nan=array.dtype.kind == "f")
    assert np.array_equal(mesh.count(origins, directions), np.bincount(every.ray, minlength=len(origins)))
    assert mesh.count(origins[0], directions[0]).shape == ()
    for mistake, message in [
        ([5], "there is no object 5 among 5"),
        (-1, "there is no object -1"),
        ([True], "1 flags, and there are 5 objects"),
        ([0.5], "expected integers"),
        ("ball", "expected integers"),
    ]:
        with pytest.raises(ValueError, match=f"objects: {message}"):
            mesh.first(origins, directions, objects=mistake)


def test_back_faces_are_passed(scene, sphere):
    outwards = np.random.default_rng(6).normal(size=(300, 3))
    assert sphere.any(np.zeros(3), outwards).all() and not sphere.any(np.zeros(3), outwards, cull_back_faces=True).any()
    found = sphere.all(outwards * 9, -outwards, cull_back_faces=True)
    assert found.ray.tolist() == list(range(300))
    assert np.array_equal(found.distance, sphere.first(outwards * 9, -outwards).distance)
    assert (sphere.count(outwards * 9, -outwards) == 2).all()
    assert (sphere.count(outwards * 9, -outwards, cull_back_faces=True) == 1).all()
    # Also of instances that are mirrored, and of spheres.
    mesh, centres = scene.mesh(), [*placements()[:, :3, 3], [0, 1.8, 0]]
    for number, centre in enumerate(centres, 1):
        assert (mesh.first(centre, outwards).object == number).any()
        assert not mesh.any(centre, outwards, objects=number, cull_back_faces=True).any()
        assert mesh.any(centre + outwards * 9, -outwards, objects=number, cull_back_faces=True).all()


def test_rays_pass_holes_of_textures(tmp_path):
    """As in pictures: a quad with holes by a texture, in the middle of which texels are interpolated, before another."""
    y, x = np.mgrid[:16, :16]
    mask = np.where((x // 4 + y // 4) % 2 == 0, 255, 0).astype(np.uint8)
    write_image(tmp_path / "mask.png", np.repeat(mask[..., None], 3, axis=-1))
    materials = "newmtl holes\nKd 1 0 0\nmap_d mask.png\nnewmtl plain\nKd 0 1 0\nnewmtl thin\nKd 0 0 1\nd 0.4\n"
    (tmp_path / "quads.mtl").write_text(materials)
    lines = ["mtllib quads.mtl", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    for number, (name, z) in enumerate([("thin", 0.5), ("holes", 0), ("plain", -1)]):
        lines += [f"v {x} {y} {z}" for x, y in [(-1, -1), (1, -1), (1, 1), (-1, 1)]] + [f"o {name}", f"usemtl {name}"]
        a, b, c, d = (f"{4 * number + k}/{k}" for k in (1, 2, 3, 4))
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    (tmp_path / "quads.obj").write_text("\n".join(lines) + "\n")
    scene = kiln.Scene(tmp_path / "quads.obj")
    K, size = [120, 120, 49.5, 49.5], (100, 100)
    pose = np.diag([1.0, -1, -1, 1])
    pose[:3, 3] = [0, 0, 3]
    prepared = kiln.Prepared(scene, numerics="double")
    camera = {"K": K, "pose": pose, "axes": "opencv"}
    (shown,) = prepared.render_many([camera], size=size, aovs=["primitive", "distance"])
    rays = kiln.pinhole_rays(K, pose, size)
    hits = scene.mesh().first(*rays, alpha=True)
    assert [list(np.unique(primitive)) for primitive in (hits.primitive, shown["primitive"])] == [[-1, 2, 3, 4, 5]] * 2
    assert (hits.primitive == shown["primitive"]).mean() > 0.999
    same = (hits.primitive == shown["primitive"]) & (hits.primitive >= 0)
    assert np.allclose(hits.distance[same], shown["distance"][same], rtol=1e-6)
    mesh = scene.mesh()
    assert (np.bincount(mesh.first(*rays).object[hits.primitive >= 0]) > 0).tolist() == [True]
    assert np.array_equal(mesh.any(*rays, alpha=True), hits.primitive >= 0)
    # All that is left of the hits of each ray: of the quad with holes, and of the one behind it.
    every = mesh.all(*rays, alpha=True)
    of_object = [np.isin(np.arange(size[0] * size[1]), every.ray[every.object == index]) for index in range(3)]
    assert not of_object[0].any() and np.array_equal(of_object[1], hits.object.ravel() == 1)
    assert np.array_equal(of_object[2], mesh.any(*rays, objects=2).ravel())
    assert np.array_equal(mesh.count(*rays, alpha=True).ravel(), np.bincount(every.ray, minlength=size[0] * size[1]))
    assert (mesh.first([0.1, 0.1, 9], [0, 0, -1], objects=[0], alpha=True).triangle) == -1
    # Without a scene, nothing is passed.
    assert kiln.Mesh(*TETRAHEDRON).any([0.2, 0.2, 9], [0, 0, -1], alpha=True)
