#!/usr/bin/env python3
"""Makes the hard cases: closed meshes, rays, and answers in rational arithmetic.

Needs nothing beyond Python 3.9. Writes NAME.obj and NAME.csv of each case beside itself; README.md describes both.
All coordinates are f32 numbers, so no library has to round its input. `make.py --check` compares with the files that
are there instead.
"""
import math
import random
import struct
import sys
from collections import Counter
from fractions import Fraction
from pathlib import Path

RAYS = 480


def f32(x):
    return struct.unpack("f", struct.pack("f", x))[0]


def point(p):
    return tuple(f32(x) for x in p)


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def middle(a, b):
    return tuple((x + y) / 2 for x, y in zip(a, b))


def lerp(a, b, s):
    return tuple(x + (y - x) * s for x, y in zip(a, b))


def unit(v):
    length = math.sqrt(dot(v, v))
    return tuple(x / length for x in v)


# ---- Meshes: (vertices, triangles), counter-clockwise from outside ----


class Builder:
    """Collects triangles, with equal vertices stored once."""

    def __init__(self):
        self.vertices, self.triangles, self.index = [], [], {}

    def vertex(self, p):
        p = point(p)
        if p not in self.index:
            self.index[p] = len(self.vertices)
            self.vertices.append(p)
        return self.index[p]

    def triangle(self, *corners):
        self.triangles.append(tuple(self.vertex(p) for p in corners))

    def quad(self, a, b, c, d):
        self.triangle(a, b, c)
        self.triangle(a, c, d)

    def box(self, low, high):
        corner = lambda i: tuple((low, high)[i >> k & 1][k] for k in range(3))
        for side in [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]:
            self.quad(*map(corner, side))

    def mesh(self):
        return self.vertices, self.triangles


def sphere(centre, radius, level=3):
    """A subdivided icosahedron: 20 * 4^level triangles."""
    phi = (1 + math.sqrt(5)) / 2
    corners = [unit(p) for s in (1, -1) for t in (phi, -phi) for p in ((0, s, t), (s, t, 0), (t, 0, s))]
    edge = min(math.dist(corners[0], p) for p in corners[1:]) * 1.01
    near = lambda a, b: a is not b and math.dist(a, b) < edge
    faces = []
    for i, a in enumerate(corners):
        for j in range(i):
            for k in range(j):
                b, c = corners[j], corners[k]
                if near(a, b) and near(b, c) and near(c, a):
                    faces.append((a, b, c) if dot(cross(sub(b, a), sub(c, a)), a) > 0 else (a, c, b))
    for _ in range(level):
        split = []
        for a, b, c in faces:
            ab, bc, ca = unit(middle(a, b)), unit(middle(b, c)), unit(middle(c, a))
            split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = split
    made = Builder()
    for face in faces:
        made.triangle(*(tuple(m + radius * x for m, x in zip(centre, p)) for p in face))
    return made.mesh()


def octahedron(n):
    """|x| + |y| + |z| = n, each face in n^2 triangles: vertices are even integers, edge midpoints integers."""
    made = Builder()
    for sx in (2, -2):
        for sy in (2, -2):
            for sz in (2, -2):
                at = lambda i, j: (sx * i, sy * j, sz * (n - i - j))
                turn = (lambda *t: t) if sx * sy * sz > 0 else (lambda a, b, c: (a, c, b))
                for i in range(n):
                    for j in range(n - i):
                        made.triangle(*turn(at(i, j), at(i + 1, j), at(i, j + 1)))
                        if i + j + 1 < n:
                            made.triangle(*turn(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)))
    return made.mesh()


def needles(n):
    """Two fans of n needles each, with their hubs above and below the middle."""
    made = Builder()
    rim = [(math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n), 0) for k in range(n)]
    for k in range(n):
        made.triangle((0, 0, 0.7), rim[k], rim[(k + 1) % n])
        made.triangle((0, 0, -0.7), rim[(k + 1) % n], rim[k])
    return made.mesh()


def slivers():
    """A cube whose every face is a fan around a vertex on one of its edges: triangles of no area close it."""
    made = Builder()
    corner = lambda i: tuple((-1, 1)[i >> k & 1] for k in range(3))
    for side in [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]:
        a, b, c, d = map(corner, side)
        hub = middle(a, b)
        made.triangle(a, b, hub)  # all on one line
        for p, q in ((b, c), (c, d), (d, a)):
            made.triangle(hub, p, q)
    return made.mesh()


def sheets():
    """Eight closed boxes, one step of f32 thick and one step apart."""
    made = Builder()
    step = 2.0**-23
    for k in range(8):
        made.box((-1, -1, 1 + 2 * k * step), (1, 1, 1 + (2 * k + 1) * step))
    return made.mesh()


def crevice():
    """Two boxes 16 steps of f32 apart, far from the origin, inside a third."""
    made = Builder()
    x, gap = 4096.0, 16 * 2.0**-11
    made.box((x - 1, 0, 0), (x, 1, 1))
    made.box((x + gap, 0, 0), (x + gap + 1, 1, 1))
    made.box((x - 2, -1, -1), (x + 2, 2, 2))
    return made.mesh()


def slab():
    """A floor of 20,000 x 110,000."""
    made = Builder()
    made.box((-1e4, -501, -1e4), (1e4, -500, 1e5))
    return made.mesh()


def doubled():
    vertices, triangles = sphere((0, 0, 0), 1, 2)
    return vertices, [t for t in triangles for _ in range(2)]


# ---- Rays: (origin, direction) ----


def target(mesh, rng, k):
    """A vertex, the middle of an edge, or another point of an edge, in turn."""
    vertices, triangles = mesh
    corners = [vertices[i] for i in rng.choice(triangles)]
    first = rng.randrange(3)
    return lerp(corners[first], corners[(first + 1) % 3], (0, 0.5, rng.random())[k % 3])


def aimed(mesh, centre, radii):
    """Rays at targets from origins at one of the distances from a centre; every fourth ray is parallel to an axis."""

    def rays(rng, k):
        way = unit([rng.gauss(0, 1) for _ in range(3)])
        radius = rng.uniform(*radii[k // 4 % len(radii)])
        origin = point(c + radius * x for c, x in zip(centre, way))
        goal = target(mesh, rng, k)
        if k % 4 == 3:
            axis = max(range(3), key=lambda i: abs(goal[i] - centre[i]))
            origin = point(origin[i] if i == axis else goal[i] for i in range(3))
            away = 1.0 if rng.random() < 0.5 else -1.0
            return origin, tuple(away if i == axis else rng.choice((0.0, -0.0)) for i in range(3))
        return origin, point(unit(sub(goal, origin)))

    return rays


def lattice(mesh, n):
    """Rays that pass exactly through vertices and edge midpoints: all coordinates are integers."""

    def rays(rng, k):
        vertices, triangles = mesh
        corners = [vertices[i] for i in rng.choice(triangles)]
        goal = corners[0] if k % 2 else middle(corners[0], corners[1])
        reach = n // 2 if k % 4 < 2 else 4 * n
        while True:
            origin = tuple(float(rng.randint(-reach, reach)) for _ in range(3))
            if k % 3 == 0:
                axis = rng.randrange(3)
                origin = tuple(origin[i] if i == axis else goal[i] for i in range(3))
            # Not on the surface: |x| + |y| + |z| is not 2 n.
            if sum(map(abs, origin)) != 2 * n and origin != goal:
                return origin, sub(goal, origin)

    return rays


def at_sheets(rng, k):
    origin = point((rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.choice((-1, 0, 0.5, 2, 3))))
    goal = (rng.uniform(-0.9, 0.9), rng.uniform(-0.9, 0.9), 1)
    away = -1.0 if origin[2] > 1 else 1.0
    return origin, (0.0, 0.0, away) if k % 2 else point(sub(goal, origin))


def in_crevice(rng, k):
    x, gap = 4096.0, 16 * 2.0**-11
    origin = point((x + gap * rng.choice((0.25, 0.5, 0.75)), rng.random(), rng.random()))
    tilt = rng.choice((0, 1e-3, 1e-6, 1)) * rng.choice((1, -1))
    angle = rng.uniform(0, 2 * math.pi)
    return origin, point((tilt, math.cos(angle), math.sin(angle)))


def grazing(rng, k):
    origin = point((-300, -500 + 2.0 ** -rng.randint(0, 14), 200))
    goal = (rng.uniform(-9e3, 9e3), -500, rng.uniform(300, 9.9e4))
    return origin, point(unit(sub(goal, origin)))


# ---- Answers ----


def integers(points, scale):
    return [tuple(int(Fraction(x) * scale) for x in p) for p in points]


def common_scale(points):
    return max(Fraction(x).denominator for p in points for x in p)


def answers(mesh, rays):
    """For each ray the distance and the triangles hit there, closest and beyond 0, and whether its origin is inside.

    A triangle is hit in its interior, on its edges and at its vertices, but not if the ray is parallel to its plane.
    """
    vertices, triangles = mesh
    scale = common_scale(vertices + [o for o, _ in rays])
    scale_of_directions = common_scale([d for _, d in rays])
    corners = integers(vertices, scale)
    for origin, direction in rays:
        (o,), (d,) = integers([origin], scale), integers([direction], scale_of_directions)
        from_origin = [sub(p, o) for p in corners]
        nearest, which = None, []
        for index, triangle in enumerate(triangles):
            hit = crossing(d, *(from_origin[i] for i in triangle))
            if hit is None or hit[0] <= 0 or (nearest is not None and hit[0] > nearest):
                continue
            which = which + [index] if hit[0] == nearest else [index]
            nearest = hit[0]
        distance = None if nearest is None else float(nearest * scale_of_directions / scale)
        yield distance, which, winding(from_origin, triangles) > 0


def crossing(d, a, b, c):
    """Distance and orientation of the triangle's plane along a ray from 0; whether an edge or a vertex is met."""
    u, v, w = dot(d, cross(c, b)), dot(d, cross(a, c)), dot(d, cross(b, a))
    if (u < 0 or v < 0 or w < 0) and (u > 0 or v > 0 or w > 0):
        return None
    volume = u + v + w
    if volume == 0:
        return None
    return Fraction(dot(a, cross(c, b)), volume), volume, 0 in (u, v, w)


def winding(from_origin, triangles):
    """How often the surface is around 0, by a ray that meets no edge: directions are tried until one does not."""
    rng = random.Random(1)
    while True:
        d = tuple(rng.randint(-(10**9), 10**9) for _ in range(3))
        hits = [crossing(d, *(from_origin[i] for i in triangle)) for triangle in triangles]
        hits = [hit for hit in hits if hit is not None and hit[0] > 0]
        if not any(on_edge for _, _, on_edge in hits):
            return sum(1 if volume < 0 else -1 for _, volume, _ in hits)


# ---- Files ----


def cases():
    unit_sphere = sphere((0, 0, 0), 1)
    yield "sphere", unit_sphere, aimed(unit_sphere, (0, 0, 0), [(0, 0.3), (2, 4)])
    for name, centre, radius in [("far", (1000, -500, 2000), 1), ("tiny", (0, 0, 0), 1e-5), ("huge", (0, 0, 0), 1e5)]:
        mesh = sphere(centre, radius)
        yield "sphere-" + name, mesh, aimed(mesh, centre, [(0, 0.3 * radius), (2 * radius, 4 * radius)])
    mesh = octahedron(8)
    yield "lattice", mesh, lattice(mesh, 8)
    mesh = needles(360)
    yield "needles", mesh, aimed(mesh, (0, 0, 0), [(0, 0.1), (2, 4)])
    mesh = slivers()
    yield "slivers", mesh, aimed(mesh, (0, 0, 0), [(0, 0.5), (2, 4)])
    mesh = doubled()
    yield "doubled", mesh, aimed(mesh, (0, 0, 0), [(0, 0.3), (2, 4)])
    yield "sheets", sheets(), at_sheets
    yield "crevice", crevice(), in_crevice
    yield "grazing", slab(), grazing


def number(x):
    return f"{x:.9g}"


def files(name, mesh, rays):
    vertices, triangles = mesh
    edges = Counter(pair for t in triangles for pair in zip(t, t[1:] + t[:1]))
    assert all(edges[b, a] == count for (a, b), count in edges.items()), f"{name} is not closed"
    yield name + ".obj", [
        *("v " + " ".join(map(number, p)) for p in vertices),
        *("f " + " ".join(str(i + 1) for i in t) for t in triangles),
    ]
    rng = random.Random(name)
    cast = [rays(rng, k) for k in range(RAYS)]
    lines = ["ox,oy,oz,dx,dy,dz,t,triangles,inside"]
    for (origin, direction), (distance, which, inside) in zip(cast, answers(mesh, cast)):
        t = "" if distance is None else repr(distance)
        lines.append(",".join([*map(number, origin + direction), t, " ".join(map(str, which)), str(int(inside))]))
    yield name + ".csv", lines


def main():
    here, differing = Path(__file__).parent, []
    for case in cases():
        for name, lines in files(*case):
            text = "\n".join(lines) + "\n"
            if "--check" not in sys.argv:
                (here / name).write_text(text)
            elif (here / name).read_text() != text:
                differing.append(name)
    sys.exit(f"not as made: {', '.join(differing)}" if differing else 0)


if __name__ == "__main__":
    main()
