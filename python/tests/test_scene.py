"""Changes of scenes: whole or not at all, from any thread; copies."""

import copy
import pickle
import threading
import warnings

import numpy as np
import pytest
from conftest import TETRAHEDRON

import kiln

VERTICES, FACES = TETRAHEDRON
RED = {"colour": "#ff0000"}
FRONT = {"position": [0, 0, 5], "look_at": [0, 0, 0], "vertical_fov": 40}
FAR = VERTICES * 1e19


def state(scene: kiln.Scene) -> tuple:
    return len(scene), scene.objects, scene.materials, scene.cameras, scene.bounds


@pytest.fixture
def scene() -> kiln.Scene:
    scene = kiln.Scene()
    scene.add(VERTICES, FACES, material=RED, name="first")
    return scene


@pytest.mark.parametrize(
    "arguments",
    [
        {"material": "gold"},
        {"material": {"hue": "#ff0000"}},
        {"material": 5},
        {"material": RED, "faces": [[0, 1, 4]]},
        {"material": RED, "vertices": VERTICES[:, :2]},
        {"material": RED, "vertices": VERTICES * 1e39},
        {"material": RED, "normals": VERTICES[:2]},
        {"material": RED, "uvs": VERTICES},
        {"material": RED, "colours": VERTICES * 2},
        {"material": RED, "transforms": np.ones((1, 4, 4))},
        {"material": RED, "name": 5},
        {"normals": VERTICES * np.nan},
    ],
)
def test_add_that_raises_changes_nothing(scene, arguments):
    before = state(scene)
    with pytest.raises((ValueError, TypeError)):
        scene.add(**{"vertices": VERTICES, "faces": FACES, **arguments})
    assert state(scene) == before


def test_changes_whose_warning_is_an_error_are_not_made(scene):
    before = state(scene)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for change in (
            lambda: scene.add(FAR, FACES, material=RED),
            lambda: scene.update({"sphere": [{"centre": [1e19, 0, 0], "radius": 1}]}),
        ):
            with pytest.raises(kiln.KilnWarning, match="left out"):
                change()
            assert state(scene) == before


@pytest.mark.parametrize("transforms", [None, [np.eye(4)] * 2])
def test_indices_are_those_that_were_given(transforms):
    """Also with triangles that no ray hits, because two corners are equal."""
    scene = kiln.Scene()
    given = [[0, 1, 1], *FACES]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.add(VERTICES, given, name="part", transforms=transforms)
    assert len(scene) == 5 * len(transforms or [0])
    ray = [[0.25, 0.25, -1]], [[0, 0, 1]]
    expected = kiln.Mesh(VERTICES, given).first(*ray).triangle.tolist()
    assert expected == [1] and scene.mesh().first(*ray).triangle.tolist() == expected
    camera = {"position": ray[0][0], "look_at": [0.25, 0.25, 0], "vertical_fov": 1}
    assert kiln.render(scene, camera=camera, size=(1, 1), aovs="primitive").aovs["primitive"] == [[1]]


def test_materials_of_dicts(scene):
    # A name that is taken: the object gets the material that was given with it.
    scene.add(VERTICES + [2, 0, 0], FACES, material="first 0", name="second")
    scene.add(VERTICES + [4, 0, 0], FACES, material={"colour": "#0000ff"}, name="third")
    front = {"position": [2, 0, 9], "look_at": [2, 0, 0], "vertical_fov": 40}
    picture = kiln.render(scene, size=(60, 30), camera=front, shading="flat", draft=True, aovs="object")
    shown = picture.aovs["object"]
    colours = [set(map(tuple, picture.pixels[shown == index])) for index in range(3)]
    assert colours == [{(255, 0, 0)}, {(255, 0, 0)}, {(0, 0, 255)}]
    assert scene.materials == ["first 0", "third 1"]


class Reader:
    """An array whose conversion runs `work` in another thread, to its end."""

    def __init__(self, array, work):
        self.array, self.work = array, work

    def __array__(self, dtype=None, copy=None):
        thread = threading.Thread(target=self.work)
        thread.start()
        thread.join()
        return self.array


def test_a_scene_is_used_while_arguments_are_converted(scene):
    failures = []

    def work():
        try:
            scene.add(VERTICES, FACES, name="other")
            kiln.render(scene, size=(4, 4))
            scene.update(scene)
        except Exception as error:  # of a thread
            failures.append(error)

    scene.add(Reader(VERTICES, work), FACES, name="outer")
    assert failures == []
    assert scene.objects == ["first", "other"] * 2 + ["outer"]


def test_threads():
    """Adding, reading and rendering at the same time loses nothing and raises nothing."""
    scene, failures, count = kiln.Scene(), [], 20
    vertices = np.repeat(VERTICES[None], 500, axis=0).reshape(-1, 3)
    faces = (FACES + 4 * np.arange(500)[:, None, None]).reshape(-1, 3)

    def repeated(work):
        def run():
            try:
                for _ in range(count):
                    work()
            except Exception as error:  # of a thread
                failures.append(error)

        return threading.Thread(target=run)

    works = [
        lambda: scene.add(vertices, faces, material=RED),
        lambda: scene.add(vertices.astype("f4"), faces.tolist(), transforms=[np.eye(4)] * 2),
        lambda: scene.update({"sphere": [{"centre": [0, 0, 0], "radius": 1}]}),
        lambda: (len(scene), scene.objects, scene.mesh()),
        lambda: kiln.render(scene, size=(4, 4), draft=True, camera=FRONT),
    ]
    threads = [repeated(work) for work in works]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nothing is in the first pictures
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert failures == []
    assert len(scene) == count * (2000 + 2 * 2000 + 1)
    assert len(scene.objects) == count * (1 + 2 + 1)


@pytest.mark.parametrize("copied", [kiln.Scene, copy.copy, copy.deepcopy])
def test_copies_are_independent(scene, copied):
    other = copied(scene)
    assert state(other) == state(scene)
    other.add(VERTICES, FACES, name="of the copy")
    scene.add(VERTICES, FACES, name="of the original")
    assert (other.objects, scene.objects) == (["first", "of the copy"], ["first", "of the original"])


def test_options_of_reading_are_errors_for_a_scene_that_is_read(scene):
    for call in (lambda: kiln.Scene(scene, up="z"), lambda: kiln.Scene().update(scene, up="z")):
        with pytest.raises(ValueError, match="has read them"):
            call()


def test_scenes_and_pictures_are_not_pickled(scene):
    objects = [scene, scene.mesh(), kiln.Instances(), kiln.render(scene, size=(4, 4))]
    for value in objects:
        with pytest.raises(TypeError, match=f"cannot pickle '?(kiln\\.)?.*{type(value).__name__}"):
            pickle.dumps(value)
