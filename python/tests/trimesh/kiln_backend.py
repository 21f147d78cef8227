"""A plugin of pytest that puts kiln in the place of both of trimesh's ray intersectors:

    PYTHONPATH=python/tests/trimesh pytest -p kiln_backend TRIMESH/tests/test_ray.py TRIMESH/tests/test_ray_upstream.py

Tests in files named test_ray* fail if they make no call of kiln.
"""

import functools
import sys
import types

import pytest
import trimesh
from trimesh import ray

import kiln
import kiln.trimesh

calls = 0


def counted(function):
    @functools.wraps(function)
    def call(*arguments, **options):
        global calls
        calls += 1
        return function(*arguments, **options)

    return call


for name in ["intersects_id", "intersects_location", "intersects_first", "intersects_any", "contains_points"]:
    query = getattr(kiln.trimesh.RayMeshIntersector, name)
    setattr(kiln.trimesh.RayMeshIntersector, name, counted(query))

if not ray.has_embree:
    # Tests of embree's class import this module, whether or not embree is installed.
    embree = types.ModuleType("trimesh.ray.ray_pyembree")
    embree.RayMeshIntersector = None
    sys.modules[embree.__name__] = ray.ray_pyembree = embree
    ray.has_embree = True
kiln.trimesh.install()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    global calls
    calls = 0
    result = yield
    if item.path.name.startswith("test_ray") and calls == 0:
        pytest.fail("the test made no call of kiln", pytrace=False)
    return result


def pytest_report_header():
    return f"rays by kiln {kiln.__version__} in trimesh {trimesh.__version__}"
