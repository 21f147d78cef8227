"""Ray queries on triangle meshes (Mesh), pictures (render, Scene), and trimesh's interface (kiln.trimesh)."""

from ._kiln import KilnWarning, Mesh, Picture, __version__
from ._scene import Scene, render

__all__ = ["KilnWarning", "Mesh", "Picture", "Scene", "__version__", "render"]
