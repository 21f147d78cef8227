"""trimesh's interface of ray queries.

`mesh.ray = kiln.trimesh.RayMeshIntersector(mesh)` is all that changes. trimesh itself is not imported.
"""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING

import numpy as np

from ._kiln import Mesh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def _rows(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """An argument as (n, 3) float64, from the types that Mesh takes."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: not an array: {error}") from None
    if np.ma.is_masked(value):
        row = np.atleast_1d(np.ma.getmaskarray(np.ma.asarray(value))).nonzero()[0][0]
        raise ValueError(f"{name}: row {row} has masked entries")
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected numbers, not the dtype {array.dtype}")
    with np.errstate(over="ignore", invalid="ignore"):
        rows = array.astype(np.float64, copy=False)
    if rows.shape == (0,):
        return rows.reshape(0, 3)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{name}: expected the shape (n, 3), not {rows.shape}")
    return rows


def _rays(ray_origins: ArrayLike, ray_directions: ArrayLike) -> tuple[NDArray[np.bool_], NDArray, NDArray]:
    """Whether each ray is valid, finite with a direction that is not 0; origins and directions of the valid rays."""
    origins, directions = _rows(ray_origins, "ray_origins"), _rows(ray_directions, "ray_directions")
    if len(origins) != len(directions):
        raise ValueError(f"ray_directions: {len(directions)} rows, and ray_origins has {len(origins)}")
    is_valid = np.isfinite(origins).all(axis=1) & np.isfinite(directions).all(axis=1) & (directions != 0).any(axis=1)
    is_beyond = is_valid & (np.abs(origins) > np.finfo(np.float32).max).any(axis=1)
    if is_beyond.any():
        raise ValueError(f"ray_origins: row {np.argmax(is_beyond)} is too large for f32")
    if is_valid.all():
        return is_valid, origins, directions
    return is_valid, origins[is_valid], directions[is_valid]


class RayMeshIntersector:
    """Ray queries on a mesh of trimesh.

    Rays whose direction is 0 or whose numbers are not finite hit nothing, and no mesh contains points whose numbers are
    not finite, as in trimesh. Raises ValueError for origins beyond f32. A copy of a trimesh mesh uses trimesh's own
    intersector again.

    geometry: the mesh. It may change: the tree is built at the first query after a change.
    tier: the arithmetic that decides hits, in float64 by default, as trimesh's own.
    scale_to_box: ignored; no result depends on the scale of the mesh.
    """

    def __init__(self, geometry, scale_to_box: bool = True, *, tier: str = "double") -> None:
        Mesh([], [], tier=tier)  # checks the tier
        self.mesh = geometry
        self.tier = tier
        self._built: tuple[int, Mesh] | None = None

    def _queries(self) -> Mesh:
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            self._built = state, Mesh(self.mesh.vertices, self.mesh.faces, tier=self.tier)
        return self._built[1]

    def _answer(self, query: str, ray_origins: ArrayLike, ray_directions: ArrayLike):
        """The result of a query of Mesh for the valid rays, and the indices of these; None for all."""
        answer = getattr(self._queries(), query)
        try:
            return answer(ray_origins, ray_directions), None
        except ValueError:
            is_valid, origins, directions = _rays(ray_origins, ray_directions)
            return answer(origins, directions), np.flatnonzero(is_valid)

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[NDArray, ...]:
        """The triangles that rays hit, the rays, and with `return_locations` the points.

        multiple_hits: every crossing of the surface, sorted by ray and distance, else the closest hit of each ray.
        A ray through an edge or a corner crosses once. max_hits: the number of closest hits that are kept of each ray.

        Returns index_tri (m,), index_ray (m,) and locations (m, 3).
        """
        if max_hits is not None:
            try:
                max_hits = operator.index(max_hits)
            except TypeError:
                raise TypeError(f"max_hits: expected an integer, not {type(max_hits).__name__}") from None
        if multiple_hits:
            crossings, valid = self._answer("crossings", ray_origins, ray_directions)
            index_ray, index_tri, locations = crossings.ray, crossings.triangle, crossings.location
        else:
            hits, valid = self._answer("first", ray_origins, ray_directions)
            index_ray = np.flatnonzero(hits.triangle >= 0)
            index_tri, locations = hits.triangle[index_ray], hits.location[index_ray]
        if max_hits is not None and len(index_ray) > 0:
            first = np.searchsorted(index_ray, index_ray)
            kept = np.arange(len(index_ray)) - first < max_hits
            index_ray, index_tri, locations = index_ray[kept], index_tri[kept], locations[kept]
        if valid is not None:
            index_ray = valid[index_ray]
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
        hits, valid = self._answer("first", ray_origins, ray_directions)
        if valid is None:
            return hits.triangle
        triangles = np.full(np.shape(ray_origins)[0], -1, np.int64)
        triangles[valid] = hits.triangle
        return triangles

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits the mesh: (n,)."""
        is_hit, valid = self._answer("any", ray_origins, ray_directions)
        if valid is None:
            return is_hit
        hit = np.zeros(np.shape(ray_origins)[0], np.bool_)
        hit[valid] = is_hit
        return hit

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether the mesh contains points: (n,). Warns (KilnWarning) of a mesh that is not closed."""
        points = _rows(points, "points")
        # Vertices are finite in f32.
        is_near = (np.abs(points) <= np.finfo(np.float32).max).all(axis=1)
        inside = np.zeros(len(points), np.bool_)
        inside[is_near] = self._queries().contains(points[is_near])
        return inside

    def __getstate__(self) -> dict:
        return {**self.__dict__, "_built": None}

    def __deepcopy__(self, _memo) -> RayMeshIntersector:
        return self.__copy__()

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, tier=self.tier)
