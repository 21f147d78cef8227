"""trimesh's interface of ray queries.

`mesh.ray = kiln.trimesh.RayMeshIntersector(mesh)` is all that changes. trimesh itself is not imported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._kiln import Mesh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class RayMeshIntersector:
    """Ray queries on a mesh of trimesh.

    geometry: the mesh. It may change: the tree is built at the first query after a change.
    tier: the arithmetic that decides hits, in float64 by default, as trimesh's own.
    scale_to_box: ignored; no result depends on the scale of the mesh.
    """

    def __init__(self, geometry, scale_to_box: bool = True, *, tier: str = "double") -> None:
        self.mesh = geometry
        self.tier = tier
        self._built: tuple[int, Mesh] | None = None

    def _queries(self) -> Mesh:
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            self._built = state, Mesh(self.mesh.vertices, self.mesh.faces, tier=self.tier)
        return self._built[1]

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[NDArray, ...]:
        """The triangles that rays hit, the rays, and with `return_locations` the points.

        multiple_hits: every passage through the surface, sorted by ray and distance, else the closest hit of each ray.
        A ray through an edge or a corner passes once. max_hits: of each ray, the closest ones.

        Returns index_tri (m,), index_ray (m,) and locations (m, 3).
        """
        if multiple_hits:
            index_ray, index_tri, _, locations, _ = self._queries().crossings(ray_origins, ray_directions)
            if max_hits is not None and len(index_ray) > 0:
                first = np.searchsorted(index_ray, index_ray)
                kept = np.arange(len(index_ray)) - first < max_hits
                index_ray, index_tri, locations = index_ray[kept], index_tri[kept], locations[kept]
        else:
            hits = self._queries().first(ray_origins, ray_directions)
            index_ray = np.flatnonzero(hits.triangle >= 0)
            index_tri, locations = hits.triangle[index_ray], hits.location[index_ray]
        return (index_tri, index_ray, locations) if return_locations else (index_tri, index_ray)

    def intersects_location(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        **options,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """The points where rays hit the mesh, the rays and the triangles: locations (m, 3), index_ray (m,) and
        index_tri (m,). Options as those of `intersects_id`."""
        options["return_locations"] = True
        index_tri, index_ray, locations = self.intersects_id(ray_origins, ray_directions, multiple_hits, **options)
        return locations, index_ray, index_tri

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int64]:
        """The first triangle that each ray hits, or -1: (n,)."""
        return self._queries().first(ray_origins, ray_directions).triangle

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits the mesh: (n,)."""
        return self._queries().any(ray_origins, ray_directions)

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether the mesh contains points: (n,). Warns (KilnWarning) of a mesh that is not closed."""
        return self._queries().contains(points)

    def __getstate__(self) -> dict:
        return {**self.__dict__, "_built": None}

    def __deepcopy__(self, _memo) -> RayMeshIntersector:
        return self.__copy__()

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, tier=self.tier)
