"""Prepared scenes: pictures by many cameras."""

import numpy as np
import pytest
from conftest import TETRAHEDRON

import kiln

CAMERAS = [
    {"position": [0, 1, 6], "look_at": [0, 0, 0], "vertical_fov": 40},
    {"position": [3, 2, 5], "look_at": [0, 0.2, 0], "vertical_fov": 30},
    # Below an added ground, which is left out of its pictures.
    {"position": [1, -4, 5], "look_at": [0, 0, 0], "vertical_fov": 40},
]


def scene():
    scene = kiln.Scene()
    scene.add(*TETRAHEDRON, name="first")
    moved = np.eye(4)
    moved[:3, 3] = [1.5, 0.3, -0.5]
    scene.add(*TETRAHEDRON, name="second", transforms=[moved])
    return scene


@pytest.mark.parametrize("offset", [0, 1e6])
@pytest.mark.parametrize("dtype", ["uint8", "float32"])
def test_pictures_are_those_of_render(offset, dtype):
    moved = kiln.Scene()
    vertices, faces = TETRAHEDRON
    moved.add(np.asarray(vertices) + offset, faces)
    prepared = kiln.Prepared(moved, samples=2)
    names = ["depth", "object", "normal", "shading-normal"]
    for camera in [None, *CAMERAS]:
        if camera is not None:
            ends = {key: [x + offset for x in camera[key]] for key in ("position", "look_at")}
            camera = {**camera, **ends}
        options = {} if camera is None else {"camera": camera}
        expected = kiln.render(moved, size=(40, 30), samples=2, dtype=dtype, aovs=names, **options)
        picture = prepared.render(camera, size=(40, 30), dtype=dtype, aovs=names)
        assert (picture.pixels == expected.pixels).all() and picture.metadata == expected.metadata
        assert picture.notes == expected.notes
        (alone,) = prepared.render_many([camera], size=(40, 30), samples=2, aovs=names)
        for name in names:
            assert np.array_equal(picture.aovs[name], expected.aovs[name])
            assert np.array_equal(alone[name], expected.aovs[name])


def test_changes_of_options_and_of_the_scene():
    changing = scene()
    prepared = kiln.Prepared(changing)
    before = prepared.render(size=(24, 24))
    double = prepared.render(size=(24, 24), numerics="double", background="red")
    assert (double.pixels == kiln.render(scene(), size=(24, 24), numerics="double", background="red").pixels).all()
    for background in ("red", "blue", "transparent", None):
        picture = prepared.render(size=(24, 24), background=background)
        assert np.array_equal(picture.pixels, kiln.render(scene(), size=(24, 24), background=background).pixels)
    assert prepared.render(size=(24, 24), azimuth=30).metadata["kiln:azimuth"] == "30"
    assert prepared.render(size=(24, 24)).metadata == before.metadata
    changing.add(*TETRAHEDRON, name="later")
    assert (prepared.render(size=(24, 24)).pixels == before.pixels).all()
    assert prepared.objects == ["first", "second"] and changing.objects == ["first", "second", "later"]


def test_data_leaves_out_the_added_ground():
    names = ["depth", "object", "material", "primitive", "position"]
    of_scene = scene()
    for aovs in (
        kiln.render(of_scene, camera=CAMERAS[0], size=(64, 48), aovs=names).aovs,
        *kiln.Prepared(of_scene).render_many([CAMERAS[0]], size=(64, 48), aovs=names),
        kiln.render(of_scene, camera=CAMERAS[0], size=(64, 48), aovs=names, ground=True, draft=True).aovs,
    ):
        assert [list(np.unique(aovs[name])) for name in ("object", "material")] == [[-1, 0, 1]] * 2
        assert aovs["object"].dtype == aovs["primitive"].dtype == np.int32
        assert ((aovs["object"] == -1) == np.isinf(aovs["depth"])).all()
        assert ((aovs["primitive"] == -1) == np.isinf(aovs["depth"])).all()


def test_rays_and_progress():
    prepared = kiln.Prepared(scene(), samples=1)
    K, pose = [40, 44, 31.5, 23.5], np.eye(4)
    pose[:3, :3] = np.diag([1, -1, -1])
    pose[:3, 3] = [0.8, 0.5, 3]
    seen = []
    camera = {"K": K, "pose": pose, "axes": "opencv"}
    views = prepared.render_many(
        [camera, camera], size=(64, 48), aovs=["distance", "primitive"], progress=lambda *done: seen.append(done)
    )
    assert seen == []
    aovs = next(views)
    assert seen == [(1, 2)] and len(list(views)) == 1 and seen == [(1, 2), (2, 2)]
    origins, directions = kiln.pinhole_rays(K, pose, (64, 48))
    hits = scene().mesh().first(origins.reshape(-1, 3), directions.reshape(-1, 3))
    # Rays beside edges may hit either triangle, or none, in the tier of pictures.
    same = hits.primitive.reshape(48, 64) == aovs["primitive"]
    assert same.mean() > 0.99
    hit = same & (hits.triangle.reshape(48, 64) >= 0)
    distances = hits.distance.reshape(48, 64)[hit]
    assert hit.sum() > 100 and np.allclose(distances, aovs["distance"][hit], rtol=1e-6)
    (picture,) = prepared.render_many([CAMERAS[0]], size=(8, 8), picture=True)
    assert picture.pixels.shape == (8, 8, 3)


def test_mistakes():
    prepared = kiln.Prepared(scene())
    with pytest.raises(ValueError, match="there is no AOV `depht`; did you mean `depth`"):
        next(prepared.render_many([None], size=(8, 8), aovs=["depht"]))
    with pytest.raises(ValueError, match="no camera `nowhere`"):
        prepared.render("nowhere")
    with pytest.raises(ValueError, match="both camera and view; give one of the two"):
        kiln.Prepared(scene(), view="iso").render("front")
    with pytest.raises(TypeError, match="camera: expected text or numbers, not bool"):
        prepared.render_many([True], size=(8, 8))
    for mistake in (prepared.render, lambda **options: kiln.Prepared(scene(), **options)):
        with pytest.raises(ValueError, match="unknown option `sampels`"):
            mistake(sampels=4)
