"""trimesh's interface of ray queries.

`kiln.trimesh.install()` gives it to all meshes that are made from then on, `mesh.ray =
kiln.trimesh.RayMeshIntersector(mesh)` to one. trimesh itself is imported by `install` alone.
"""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING

import numpy as np

from ._kiln import Mesh

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

    from ._kiln import _Tier


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


def _rays(
    ray_origins: ArrayLike, ray_directions: ArrayLike
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
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

    A ray hits the mesh, in every query, if a triangle, its edges and corners included, is at a distance above 0 on it:
    `intersects_any` is true for exactly the rays that `intersects_id` and `intersects_location` return.

    Rays whose direction is 0 or whose numbers are not finite hit nothing, and no mesh contains points whose numbers are
    not finite, as in trimesh. Raises ValueError for origins beyond f32. A copy of a trimesh mesh uses trimesh's own
    intersector again, but after `install()`.

    geometry: the mesh. It may change: the tree is built at the first query after a change.
    tier: the arithmetic that decides hits, in float64 by default, as trimesh's own.
    scale_to_box: ignored; no result depends on the scale of the mesh.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True, *, tier: _Tier = "double") -> None:
        Mesh([], [], tier=tier)  # checks the tier
        self.mesh = geometry
        self.tier = tier
        self._built: tuple[int, Mesh] | None = None

    def _queries(self) -> Mesh:
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            self._built = state, Mesh(self.mesh.vertices, self.mesh.faces, tier=self.tier)
        return self._built[1]

    def _answer(
        self, query: str, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[Any, NDArray[np.int64] | None]:
        """The result of a query of Mesh for the valid rays, and the indices of these; None for all."""
        answer = getattr(self._queries(), query)
        # Mesh takes rays of other shapes, too.
        if getattr(ray_origins, "ndim", None) == getattr(ray_directions, "ndim", None) == 2:
            try:
                return answer(ray_origins, ray_directions), None
            except ValueError:
                pass
        is_valid, origins, directions = _rays(ray_origins, ray_directions)
        return answer(origins, directions), None if is_valid.all() else np.flatnonzero(is_valid)

    def _answer_all(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]], NDArray[np.int64] | None]:
        """The rays, the triangles and the points of all hits of the valid rays, and the indices of these."""
        is_hit, valid = self._answer("any", ray_origins, ray_directions)
        origins, directions = (np.asarray(rays) for rays in (ray_origins, ray_directions))
        if valid is not None:
            origins, directions = origins[valid], directions[valid]
        found, _ = self._answer("crossings", origins, directions)
        index_ray, index_tri, locations = found.ray, found.triangle, found.location
        # Crossings are decided by a perturbation, which may move a ray off the mesh, or onto it.
        is_crossing = np.zeros(len(is_hit), np.bool_)
        is_crossing[index_ray] = True
        if (is_crossing & ~is_hit).any():
            kept = is_hit[index_ray]
            index_ray, index_tri, locations = index_ray[kept], index_tri[kept], locations[kept]
        touching = np.flatnonzero(is_hit & ~is_crossing)
        if len(touching) > 0:
            hits, _ = self._answer("first", origins[touching], directions[touching])
            index_ray = np.concatenate([index_ray, touching])
            order = np.argsort(index_ray, kind="stable")
            index_ray = index_ray[order]
            index_tri = np.concatenate([index_tri, hits.triangle])[order]
            locations = np.concatenate([locations, hits.location])[order]
        return (index_ray, index_tri, locations), valid

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[NDArray[Any], ...]:
        """The triangles that rays hit, the rays, and with `return_locations` the points.

        multiple_hits: every crossing of the surface, sorted by ray and distance, else the closest hit of each ray.
        A ray through an edge or a corner crosses once; one that touches the mesh without crossing it has its closest
        hit. max_hits: the number of closest hits that are kept of each ray.

        Returns index_tri (m,), index_ray (m,) and locations (m, 3).
        """
        if max_hits is not None:
            try:
                max_hits = operator.index(max_hits)
            except TypeError:
                raise TypeError(f"max_hits: expected an integer, not {type(max_hits).__name__}") from None
        if multiple_hits:
            (index_ray, index_tri, locations), valid = self._answer_all(ray_origins, ray_directions)
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
        max_hits: int | None = None,
        return_locations: bool = True,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """The points where rays hit the mesh, the rays and the triangles: locations (m, 3), index_ray (m,) and
        index_tri (m,). Options as those of `intersects_id`; `return_locations` is ignored."""
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, max_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int64]:
        """The first triangle that each ray hits, or -1: (n,)."""
        hits, valid = self._answer("first", ray_origins, ray_directions)
        found: NDArray[np.int64] = hits.triangle
        if valid is None:
            return found
        triangles = np.full(np.shape(ray_origins)[0], -1, np.int64)
        triangles[valid] = found
        return triangles

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits the mesh: (n,)."""
        is_hit: NDArray[np.bool_]
        is_hit, valid = self._answer("any", ray_origins, ray_directions)
        if valid is None:
            return is_hit
        hit = np.zeros(np.shape(ray_origins)[0], np.bool_)
        hit[valid] = is_hit
        return hit

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether the mesh contains points, by the rule of Mesh.contains: (n,). Warns (KilnWarning) of a mesh that is
        not closed. trimesh's own takes an odd number of hits for inside: within a shell in a shell, both turned
        outwards, it says outside."""
        points = _rows(points, "points")
        # Vertices are finite in f32.
        is_near = (np.abs(points) <= np.finfo(np.float32).max).all(axis=1)
        inside = np.zeros(len(points), np.bool_)
        inside[is_near] = self._queries().contains(points[is_near])
        return inside

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_built": None}

    def __deepcopy__(self, _memo: Any) -> RayMeshIntersector:
        return self.__copy__()

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, tier=self.tier)


_replaced: list[tuple[Any, Any]] = []


def install() -> None:
    """Makes `RayMeshIntersector` the ray queries of every mesh of trimesh that is made from now on in this process,
    also of copies, parts and files that are read. Meshes that exist keep theirs. `uninstall` undoes it."""
    from trimesh import ray

    if _replaced:
        return
    modules: list[Any] = [ray.ray_triangle, *([ray.ray_pyembree] if ray.has_embree else [])]
    for module in modules:
        _replaced.append((module, module.RayMeshIntersector))
        module.RayMeshIntersector = RayMeshIntersector


def uninstall() -> None:
    """Gives meshes that are made from now on trimesh's own ray queries again."""
    while _replaced:
        module, own = _replaced.pop()
        module.RayMeshIntersector = own
