"""Results of queries: named tuples of numpy arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import disjoint_base

    from ._kiln import Found
else:

    def disjoint_base(cls):
        """The mark of classes of which no class inherits beside another one, for type checkers."""
        return cls


class _Located:
    """Attributes that are computed when they are read, from the mesh as it was at the query."""

    _computed: tuple[str, ...] = ("object", "instance", "primitive", "material")

    def _of(self, name: str, *arguments: NDArray[np.float64]) -> NDArray[Any]:
        found: Found | dict[str, NDArray[Any]] | None = self.__dict__.get("_found")
        if found is None:
            raise AttributeError(f"{type(self).__name__}.{name}: only the result of a query has it, no changed copy")
        # Of a pickled result they are arrays.
        value: NDArray[Any] = found[name] if isinstance(found, dict) else getattr(found, name)(*arguments)
        return value

    @property
    def object(self) -> NDArray[np.int64]:
        """Index of the object, as in Scene.objects, or the number that Instances.add returned; 0 in a mesh of arrays, -1
        where there is no triangle."""
        return self._of("object")

    @property
    def instance(self) -> NDArray[np.int64]:
        """Index of the object among the placements of one Scene.add(transforms=...), or of a mesh that a file places
        and the scene stores once, or the number of its copies in Instances that were added before it and not removed; 0
        for other objects, -1 where there is no triangle."""
        return self._of("instance")

    @property
    def primitive(self) -> NDArray[np.int64]:
        """Index of the triangle among those of all objects, as in the AOV `primitive`; -1 where there is none."""
        return self._of("primitive")

    @property
    def material(self) -> NDArray[np.int64]:
        """Index of the material, as in Scene.materials; -1 in a mesh of arrays, and where there is no triangle."""
        return self._of("material")

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled beside the arrays: what is computed from them and the mesh."""
        if self.__dict__.get("_found") is None:
            return {}
        return {"_found": {name: getattr(self, name) for name in self._computed}}

    def __copy__(self) -> _Located:
        return self


class _OnSurface(_Located):
    """Attributes of hits that are computed when they are read."""

    _computed = (*_Located._computed, "normal", "shading_normal", "uv")

    location: Any
    barycentrics: Any

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal of the triangle, on the side from which its corners run counterclockwise, in a mirrored instance
        clockwise; outwards of a sphere. nan for a triangle without area, and where nothing is hit."""
        return self._of("normal", self.location)

    @property
    def shading_normal(self) -> NDArray[np.float64]:
        """Normal interpolated between those of the vertices, of length 1, on the side of `normal`; `normal` where there
        are none. Without normal maps."""
        return self._of("shading_normal", self.location, self.barycentrics)

    @property
    def uv(self) -> NDArray[np.float64]:
        """Texture coordinates of the first set, as in Scene.add: (n, 2), nan where there are none."""
        return self._of("uv", self.barycentrics)


class _Hits(NamedTuple):
    triangle: NDArray[np.int64]
    distance: NDArray[np.float64]
    location: NDArray[np.float64]
    barycentrics: NDArray[np.float64]


@disjoint_base
class Hits(_Hits, _OnSurface):
    """Closest hits: a row for each of n rays; of rays of another shape, (n,) is that shape.

    triangle: (n,) index of the triangle in its object; -1 for a ray that hits nothing, whose other values are nan.
    distance: (n,) distance from the origin, whatever the length of the direction.
    location: (n, 3) point on the ray.
    barycentrics: (n, 3) weights of the triangle's corners; their sum is 1.
    """


class _AllHits(NamedTuple):
    ray: NDArray[np.int64]
    triangle: NDArray[np.int64]
    distance: NDArray[np.float64]
    location: NDArray[np.float64]
    barycentrics: NDArray[np.float64]


@disjoint_base
class AllHits(_AllHits, _OnSurface):
    """Hits of rays: a row for each of m hits, sorted by ray, then distance, then triangle.

    ray: (m,) index of the ray. triangle: (m,) index of the triangle in its object.
    distance: (m,) distance from the origin. location: (m, 3) point on the ray.
    barycentrics: (m, 3) weights of the triangle's corners.
    """


class _Crossings(NamedTuple):
    ray: NDArray[np.int64]
    triangle: NDArray[np.int64]
    distance: NDArray[np.float64]
    location: NDArray[np.float64]
    entering: NDArray[np.bool_]


@disjoint_base
class Crossings(_Crossings, _Located):
    """Crossings of rays and the surface: a row for each of m, sorted by ray, then distance.

    ray: (m,) index of the ray. triangle: (m,) index of a triangle there, in its object.
    distance: (m,) distance from the origin. location: (m, 3) point on the ray.
    entering: (m,) whether the ray goes from the front, the side from which the corners run counterclockwise, to the
    back.
    """


class _ClosestPoints(NamedTuple):
    location: NDArray[np.float64]
    distance: NDArray[np.float64]
    triangle: NDArray[np.int64]


@disjoint_base
class ClosestPoints(_ClosestPoints, _Located):
    """Closest points of the surface: a row for each of n points.

    location: (n, 3) closest point. distance: (n,) its distance.
    triangle: (n,) index of the triangle that it is on, in its object; -1 for none, and nan in the other arrays.
    """


class _NearPoints(NamedTuple):
    point: NDArray[np.int64]
    triangle: NDArray[np.int64]
    distance: NDArray[np.float64]
    location: NDArray[np.float64]


@disjoint_base
class NearPoints(_NearPoints, _Located):
    """Triangles near points: a row for each of m pairs, sorted by point, then distance, then triangle.

    point: (m,) index of the point. triangle: (m,) index of the triangle in its object.
    distance: (m,) distance of the point and the triangle. location: (m, 3) closest point of the triangle.
    """


class Primitives(NamedTuple):
    """Triangles: a row for each of m, sorted by object, then triangle."""

    object: NDArray[np.int64]
    """(m,) index of the object, as in Scene.objects; 0 in a mesh of arrays."""
    triangle: NDArray[np.int64]
    """(m,) index of the triangle in its object."""


class IntersectingTriangles(NamedTuple):
    """Triangles of two meshes that have a point in common: a row for each of m pairs."""

    object: NDArray[np.int64]
    """(m,) index of the object of the first mesh."""
    triangle: NDArray[np.int64]
    """(m,) index of the triangle of the first mesh, in its object."""
    other_object: NDArray[np.int64]
    """(m,) index of the object of the other mesh."""
    other_triangle: NDArray[np.int64]
    """(m,) index of the triangle of the other mesh, in its object."""


class WindingNumbers(NamedTuple):
    """Generalised winding numbers: a row for each of n points."""

    value: NDArray[np.float64]
    """(n,) solid angle of the surface over 4 pi."""
    error: NDArray[np.float64]
    """(n,) bound on the error of the value; 0 for a closed surface."""


class _Containment(NamedTuple):
    inside: NDArray[np.bool_]
    margin: NDArray[np.float64]


@disjoint_base
class Containment(_Containment):
    """Whether points are inside of a mesh: a row for each of n points.

    inside: (n,) whether each is. margin: (n,) how far the winding number is from 1/2 or -1/2 beyond the bound on its
    error, so that the point is decided where this is above 0: at least 0.5 for a closed mesh, small near holes, 0 for a
    vote.
    """

    rule: Literal["crossings", "generalised winding number", "vote"]
    """What decides: crossings of a closed mesh; the generalised winding number of an open one; a vote of rays for
    triangles that are wound in opposite directions."""


class Closedness(NamedTuple):
    """Edges that keep a surface from being closed: it is closed if no edge is unbalanced."""

    boundary_edges: int
    """Edges of one triangle."""
    non_manifold_edges: int
    """Edges of more than two triangles."""
    unbalanced_edges: int
    """Edges that triangles use more often in one direction than in the other."""
    inconsistent_edges: int
    """Edges between triangles that are wound in opposite directions."""

    @property
    def is_closed(self) -> bool:
        """Whether no edge is unbalanced."""
        return self.unbalanced_edges == 0
