"""Calls of kiln.Mesh with arguments of any kind: none may end the interpreter, or raise anything but ValueError,
TypeError and OverflowError.

    python fuzz.py [CALLS] [SEED]
"""

import sys
import warnings

import numpy as np

import kiln

calls = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
random = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 0)
warnings.simplefilter("ignore", kiln.KilnWarning)
DTYPES = ["f8", "f8", "f8", "f8", "f4", "f2", "i8", "i4", "u1", "u8", ">f8", "c16", "?", "O", "U3", "g", "M8[s]"]
EXTREMES = np.array([0, -0.0, np.nan, np.inf, -np.inf, 1e39, 1e300, -1e300, 3e38, 1e-310, 1e-45, 1, -1, 2**63])


def array(rows):
    """An array of mostly `rows` rows of three, of any type, order and content."""
    shape = [(rows, 3)] * 60 + [(rows,), (rows, 2), (rows, 4), (3,), (), (rows, 3, 1), (0, 3), (0,)]
    values = np.asarray(random.normal(size=shape[random.integers(len(shape))])) * 10.0 ** random.integers(-3, 3)
    if values.ndim and random.random() < 0.08:
        mask = random.random(values.shape) < 0.1
        values[mask] = random.choice(EXTREMES, mask.sum())
    if random.random() < 0.2:
        values = np.asarray(np.round(values))
    with np.errstate(all="ignore"):
        values = np.asarray(values).astype(DTYPES[random.integers(len(DTYPES))] if random.random() < 0.3 else "f8")
    change = random.integers(8)
    if change == 0:
        return np.asfortranarray(values)
    if change == 1 and values.ndim:
        return values[::-1]
    if change == 2:
        return values.tolist()
    if change == 3 and values.ndim == 2:
        return np.repeat(values, 2, axis=1)[:, ::2]
    if change == 4 and values.ndim:
        return np.broadcast_to(values[:1], values.shape)
    if change == 5 and random.random() < 0.1:
        return [None, "text", {}, object(), memoryview(b"123"), iter([]), 7][random.integers(7)]
    return values


def faces(vertices):
    if random.random() < 0.1:
        return array(5)
    return random.integers(0 if random.random() < 0.9 else -1, max(vertices, 1), (random.integers(40), 3))


def mesh():
    count = int(random.integers(30))
    vertices = array(count) if random.random() < 0.2 else np.round(random.normal(size=(count, 3)), random.integers(3))
    tier = ["watertight", "double", "exact", "none"][random.integers(4)]
    preset = ["fast-build", "balanced", "best-trace"][random.integers(3)]
    return kiln.Mesh(vertices, faces(count), tier=tier, preset=preset)


QUERIES = ["first", "any", "all", "crossings", "contains", "winding_number", "closest_point", "signed_distance"]
current, failed = kiln.Mesh([], []), 0
for _ in range(calls):
    try:
        if random.random() < 0.1:
            current = mesh()
        query = QUERIES[random.integers(8)]
        rows = int(random.integers(50))
        arguments = [array(rows), array(rows)] if query in QUERIES[:4] else [array(rows)]
        if len(arguments) == 2 and random.random() < 0.2:
            arguments.append([1.0, np.ones(rows), np.nan, -1, "far", array(rows)][random.integers(6)])
        getattr(current, query)(*arguments)
    except (ValueError, TypeError, OverflowError):
        failed += 1
print(f"{calls} calls, {failed} of them refused")
