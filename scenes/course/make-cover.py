#!/usr/bin/env python3
"""Writes cover.toml and sky.hdr, the final scene of Ray Tracing in One Weekend (version 4, section 14), beside this file.

Its spheres are placed and coloured by random numbers. Those of the book come from C's rand(), whose sequence no standard
fixes; these come from Python's random.Random(1).random(), which is the same everywhere, in the order of the book's
program. `make-cover.py` without arguments reproduces both files byte for byte.
"""
import math
import pathlib
import random

HEADER = """\
# The final scene of Ray Tracing in One Weekend (P. Shirley, T. D. Black, S. Hollasch, version 4, section 14), written by
# make-cover.py; README.md says what differs.

[image]
width = 1200
height = 675
samples = 500
filter = "box"
transport = "path"

[effects]
path = 50

[environment]
file = "sky.hdr"

[[camera]]
position = [13, 2, 3]
look_at = [0, 0, 0]
vertical_fov = 20
# A defocus angle of 0.6 degrees at the focus distance 10: 10 tan(0.3 degrees).
aperture_radius = {aperture}
focus_distance = 10
"""


def colour(albedo):
    """A colour of a scene file, sRGB in 8 bits, of a linear one."""
    encoded = (12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in albedo)
    return '"#' + "".join(f"{round(255 * c):02x}" for c in encoded) + '"'


def diffuse(albedo):
    return f"{{ colour = {colour(albedo)}, specular = 0 }}"


def metal(albedo, fuzz):
    """A GGX lobe whose reflection seen straight on deviates by the same median as the book's.

    The book adds a vector of length `fuzz` in a uniform direction to the reflected one. Its median component across it is
    sqrt(3)/2 fuzz. A GGX normal is tilted by a median of atan(alpha), the reflection by twice that; alpha is roughness^2.
    """
    alpha = math.sqrt(3) / 4 * fuzz
    return f"{{ colour = {colour(albedo)}, metallic = 1, roughness = {math.sqrt(alpha):.4f} }}"


GLASS = '{ colour = "#ffffff", roughness = 0, layers = { ior = 1.5, transmission = 1, volume = true } }'


def spheres():
    """Centre, radius and material of each sphere, in the book's order."""
    rand = random.Random(1).random
    between = lambda low, high: low + (high - low) * rand()
    yield (0, -1000, 0), 1000, diffuse([0.5] * 3)
    for a in range(-11, 11):
        for b in range(-11, 11):
            choice = rand()
            centre = (a + 0.9 * rand(), 0.2, b + 0.9 * rand())
            if math.dist(centre, (4, 0.2, 0)) <= 0.9:
                continue
            if choice < 0.8:
                first, second = [rand() for _ in range(3)], [rand() for _ in range(3)]
                material = diffuse([x * y for x, y in zip(first, second)])
            elif choice < 0.95:
                albedo = [between(0.5, 1) for _ in range(3)]
                material = metal(albedo, between(0, 0.5))
            else:
                material = GLASS
            yield centre, 0.2, material
    yield (0, 1, 0), 1, GLASS
    yield (-4, 1, 0), 1, diffuse([0.4, 0.2, 0.1])
    yield (4, 1, 0), 1, metal([0.7, 0.6, 0.5], 0)


def scene():
    materials, lines = {}, []
    for centre, radius, material in spheres():
        name = materials.setdefault(material, f"m{len(materials)}")
        place = ", ".join(f"{c:.6g}" for c in centre)
        lines.append(f'    {{ centre = [{place}], radius = {radius:g}, material = "{name}" }},\n')
    text = HEADER.format(aperture=f"{10 * math.tan(math.radians(0.3)):.8f}")
    text += "\n[material]\n" + "".join(f"{name} = {material}\n" for material, name in materials.items())
    return text.replace("\n[image]", "\nsphere = [\n" + "".join(lines) + "]\n\n[image]", 1)


def sky(rows=64):
    """The book's background, white below to (0.5, 0.7, 1) above by the height y of a direction, as an environment map of
    one column. Radiance's RGBE stores values beside a blue of 1 in steps of 1/128; kiln interpolates between rows."""
    texels = bytearray()
    for row in range(rows):
        share = (math.cos(math.pi * (row + 0.5) / rows) + 1) / 2
        values = [(1 - share) + share * c for c in (0.5, 0.7, 1.0)]
        fraction, exponent = math.frexp(max(values))
        texels += bytes(min(255, round(c * 256 / 2**exponent)) for c in values) + bytes([exponent + 128])
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X 1\n" % rows + texels


if __name__ == "__main__":
    here = pathlib.Path(__file__).resolve().parent
    (here / "cover.toml").write_text(scene())
    (here / "sky.hdr").write_bytes(sky())
