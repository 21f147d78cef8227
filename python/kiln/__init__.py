"""Ray queries on triangle meshes (Mesh, Instances), pictures (render, Scene), trimesh's interface (kiln.trimesh)."""

from typing import TYPE_CHECKING

from ._kiln import Instances, KilnWarning, Mesh, Picture, __version__
from ._scene import Prepared, Scene, camera_rays, pinhole_rays, render

if TYPE_CHECKING:
    from . import trimesh as trimesh
else:

    def __getattr__(name: str):
        # kiln.trimesh imports numpy, which takes longer than kiln.
        if name == "trimesh":
            from importlib import import_module

            return import_module(".trimesh", __name__)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "Instances",
    "KilnWarning",
    "Mesh",
    "Picture",
    "Prepared",
    "Scene",
    "__version__",
    "camera_rays",
    "pinhole_rays",
    "render",
]
