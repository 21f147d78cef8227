"""Where warnings point: the line outside of kiln and trimesh from which kiln was called."""

import warnings

import numpy as np
import pytest
import trimesh
from conftest import TETRAHEDRON

import kiln
import kiln.trimesh

VERTICES, FACES = TETRAHEDRON
POINT = [[0.1, 0.1, 0.1]]
# Beyond 1e18, where spheres and triangles are left out.
FAR = {"sphere": [{"centre": [1e19, 0, 0], "radius": 1}]}
BALL = {"sphere": [{"centre": [0, 0, 0], "radius": 1}]}
AWAY = {"position": [0, 0, 5], "look_at": [0, 0, 9], "vertical_fov": 40}


def of_trimesh() -> trimesh.Trimesh:
    """A mesh that is not closed, with kiln's ray queries."""
    mesh = trimesh.Trimesh(VERTICES, FACES[1:], process=False)
    mesh.ray = kiln.trimesh.RayMeshIntersector(mesh)
    return mesh


def of_scene() -> kiln.Mesh:
    scene = kiln.Scene()
    scene.add(VERTICES, FACES[1:])
    return scene.mesh()


CALLS = {
    "render": lambda: kiln.render(BALL, camera=AWAY, size=(8, 8)),
    "render, which reads": lambda: kiln.render({**FAR, **BALL, "sphere": FAR["sphere"] + BALL["sphere"]}, size=(8, 8)),
    "Scene": lambda: kiln.Scene(FAR),
    "Scene.add": lambda: kiln.Scene().add(VERTICES * 1e19, FACES),
    "Scene.update": lambda: kiln.Scene().update(FAR),
    "Scene.mesh": lambda: of_scene().contains(POINT),
    "Mesh.contains": lambda: kiln.Mesh(VERTICES, FACES[1:]).contains(POINT),
    "Mesh.signed_distance": lambda: kiln.Mesh(VERTICES, FACES[1:]).signed_distance(POINT),
    "contains_points": lambda: kiln.trimesh.RayMeshIntersector(of_trimesh()).contains_points(POINT),
    "mesh.ray.contains_points": lambda: of_trimesh().ray.contains_points(POINT),
    "mesh.contains": lambda: of_trimesh().contains(POINT),
}


@pytest.mark.parametrize("name", CALLS)
def test_warnings_point_at_the_line_of_the_caller(name):
    call = CALLS[name]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    caught = [w for w in caught if w.category is kiln.KilnWarning]
    assert caught
    assert {(w.filename, w.lineno) for w in caught} == {(__file__, call.__code__.co_firstlineno)}


def test_a_package_whose_name_begins_as_kiln_is_the_caller():
    names = {"__name__": "kiln_of_a_user", "mesh": kiln.Mesh(VERTICES, FACES[1:]), "points": np.array(POINT)}
    with pytest.warns(kiln.KilnWarning) as caught:
        exec(compile("mesh.contains(points)", "user.py", "exec"), names)
    assert [w.filename for w in caught] == ["user.py"]
