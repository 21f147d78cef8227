"""Results of queries: named tuples of numpy arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Hits(NamedTuple):
    """Closest hits: a row for each of n rays; of rays of another shape, (n,) is that shape."""

    triangle: NDArray[np.int64]
    """(n,) index of the triangle; -1 for a ray that hits nothing, whose other values are nan."""
    distance: NDArray[np.float64]
    """(n,) distance from the origin, whatever the length of the direction."""
    location: NDArray[np.float64]
    """(n, 3) point on the ray."""
    barycentrics: NDArray[np.float64]
    """(n, 3) weights of the triangle's corners; their sum is 1."""


class AllHits(NamedTuple):
    """Hits of rays: a row for each of m hits, sorted by ray, then distance, then triangle."""

    ray: NDArray[np.int64]
    """(m,) index of the ray."""
    triangle: NDArray[np.int64]
    """(m,) index of the triangle."""
    distance: NDArray[np.float64]
    """(m,) distance from the origin."""
    location: NDArray[np.float64]
    """(m, 3) point on the ray."""
    barycentrics: NDArray[np.float64]
    """(m, 3) weights of the triangle's corners."""


class Crossings(NamedTuple):
    """Crossings of rays and the surface: a row for each of m, sorted by ray, then distance."""

    ray: NDArray[np.int64]
    """(m,) index of the ray."""
    triangle: NDArray[np.int64]
    """(m,) index of a triangle there."""
    distance: NDArray[np.float64]
    """(m,) distance from the origin."""
    location: NDArray[np.float64]
    """(m, 3) point on the ray."""
    entering: NDArray[np.bool_]
    """(m,) whether the ray goes from the front, the side from which the corners run counterclockwise, to the back."""


class ClosestPoints(NamedTuple):
    """Closest points of the surface: a row for each of n points."""

    location: NDArray[np.float64]
    """(n, 3) closest point."""
    distance: NDArray[np.float64]
    """(n,) its distance."""
    triangle: NDArray[np.int64]
    """(n,) index of the triangle that it is on."""


class WindingNumbers(NamedTuple):
    """Generalised winding numbers: a row for each of n points."""

    value: NDArray[np.float64]
    """(n,) solid angle of the surface over 4 pi."""
    error: NDArray[np.float64]
    """(n,) bound on the error of the value; 0 for a closed surface."""


class Closedness(NamedTuple):
    """Edges that keep a surface from being closed: it is closed if no edge is unbalanced."""

    boundary_edges: int
    """Edges of one triangle."""
    non_manifold_edges: int
    """Edges of more than two triangles."""
    unbalanced_edges: int
    """Edges that triangles use more often in one direction than in the other."""

    @property
    def is_closed(self) -> bool:
        """Whether no edge is unbalanced."""
        return self.unbalanced_edges == 0
