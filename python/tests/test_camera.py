"""Cameras by intrinsics and pose."""

import numpy as np
import pytest
from conftest import TETRAHEDRON

import kiln

K = np.array([[500.0, 0, 310.2], [0, 610.5, 250.9], [0, 0, 1]])
SIZE = (640, 480)


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def poses():
    for seed, scale in enumerate([0, 1, 1e3, 1e6]):
        pose = np.eye(4)
        pose[:3, :3] = rotation(seed)
        pose[:3, 3] = np.random.default_rng(seed).normal(size=3) * scale
        yield pose


def closed_form(k, pose, size):
    """Direction of pixel (i, j): R ((i - cx) / fx, (j - cy) / fy, 1)."""
    i, j = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    d = np.stack([(i - k[0, 2]) / k[0, 0], (j - k[1, 2]) / k[1, 1], np.ones(i.shape)], -1) @ pose[:3, :3].T
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


@pytest.mark.parametrize("pose", list(poses()))
def test_rays_are_those_of_the_closed_form(pose):
    origins, directions = kiln.pinhole_rays(K, pose, SIZE)
    assert origins.shape == directions.shape == (480, 640, 3) and directions.dtype == np.float64
    assert (origins == pose[:3, 3]).all()
    assert np.abs(directions - closed_form(K, pose, SIZE)).max() < 1e-12
    flipped = pose @ np.diag([1, -1, -1, 1])
    assert np.abs(kiln.pinhole_rays(K, flipped, SIZE, axes="opengl")[1] - directions).max() < 1e-12
    of_numbers = kiln.pinhole_rays([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], pose, SIZE)
    assert (of_numbers[1] == directions).all()


def test_pictures_see_what_the_rays_hit():
    vertices, faces = TETRAHEDRON
    centre = np.mean(vertices, axis=0)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1]])
    pose[:3, 3] = centre + [0.1, 0.2, 4]
    k = np.array([[120.0, 0, 70], [0, 90, 20], [0, 0, 1]])
    scene = kiln.Scene()
    scene.add(vertices, faces)
    camera = {"K": k, "pose": pose, "axes": "opencv"}
    options = {"aovs": ["depth", "distance"], "ground": False, "numerics": "double"}
    picture = kiln.render(scene, size=(96, 64), camera=camera, **options)
    origins, directions = kiln.pinhole_rays(k, pose, (96, 64))
    hits = kiln.Mesh(vertices, faces, tier="double").first(origins.reshape(-1, 3), directions.reshape(-1, 3))
    t, distance = hits.distance, picture.aovs["distance"].reshape(-1)
    seen = np.isfinite(t)
    assert 100 < seen.sum() < 96 * 64
    assert (seen == np.isfinite(distance)).all()
    assert np.allclose(t[seen], distance[seen], rtol=1e-5)
    # Depth is z of the camera, whose third axis looks ahead.
    depth = (hits.location - pose[:3, 3]) @ pose[:3, 2]
    assert np.allclose(depth[seen], picture.aovs["depth"].reshape(-1)[seen], rtol=1e-5)


def test_oblong_pixels_see_what_the_rays_hit():
    """The rectangle (W / fx, H / fy) at distance 1 has the rays of a K with the principal point in the middle, if
    pixels may be oblong; else the picture shows more, and says so."""
    vertices, faces = TETRAHEDRON
    (width, height), (fx, fy), position = (96, 64), (120.0, 90.0), [0.4, 0.3, 4]
    camera = {"position": position, "look_at": [0.4, 0.3, 0], "viewpoint_distance": 1}
    camera["viewing_rectangle"] = [width / fx, height / fy]
    scene = kiln.Scene()
    scene.add(vertices, faces)
    pose = np.diag([1.0, -1, -1, 1])
    pose[:3, 3] = position
    k = [fx, fy, (width - 1) / 2, (height - 1) / 2]
    hits = kiln.Mesh(vertices, faces).first(*kiln.pinhole_rays(k, pose, (width, height)))
    options = {"size": (width, height), "aovs": ["primitive"], "numerics": "double"}
    picture = kiln.render(scene, camera=camera | {"oblong_pixels": True}, **options)
    assert (picture.aovs["primitive"] == hits.triangle).all() and (hits.triangle >= 0).sum() > 100
    shows_more = kiln.render(scene, camera=camera, **options)
    assert (shows_more.aovs["primitive"] != hits.triangle).any()
    says_so = [any("rectangle" in note for note in each.notes) for each in (shows_more, picture)]
    assert says_so == [True, False]


def test_cameras_say_what_is_wrong_with_them():
    for call, text in [
        (lambda: kiln.pinhole_rays(np.eye(4), np.eye(4), SIZE), r"^K: expected the shape \(3, 3\) or \(4,\), not"),
        (lambda: kiln.pinhole_rays(K, np.eye(4)[:3], SIZE), r"^pose: expected the shape \(4, 4\), not \(3, 4\)"),
        (lambda: kiln.pinhole_rays(K, np.eye(4), (4.5, 3)), "^size: expected width and height"),
    ]:
        with pytest.raises(ValueError, match=text):
            call()
    with pytest.raises(ValueError, match="no rotation"):
        kiln.pinhole_rays(K, np.diag([2.0, 2, 2, 1]), SIZE)
    with pytest.raises(ValueError, match="axes"):
        kiln.camera_rays({"K": K, "pose": np.eye(4)}, SIZE)
    with pytest.raises(ValueError, match="size"):
        kiln.pinhole_rays(K, np.eye(4), (0, 4))
