"""Reads the files of `check-aovs` with OpenImageIO, OpenEXR and cryptomatte-api, and compares them with what the scenes
say: the AOVs of the assignment scene, view2; windows, matrices, half floats and mattes of `scenes/effects/glaze.toml`.
"""

import sys

import cryptomatte_api
import numpy
import OpenEXR
import OpenImageIO as oiio

folder = sys.argv[1]
picture = oiio.ImageInput.open(f"{folder}/all.exr")
assert picture, oiio.geterror()
spec = picture.spec()
pixels = picture.read_image("float")
channels = {name: pixels[:, :, i].astype(numpy.float64) for i, name in enumerate(spec.channelnames)}
print(spec.width, "x", spec.height, picture.format_name(), ", ".join(spec.channelnames))
assert not picture.seek_subimage(1, 0), "one part"
assert all(str(spec.channelformat(i)) == "float" for i in range(spec.nchannels))


def layer(name, letters):
    return numpy.stack([channels[f"{name}.{letter}"] for letter in letters], axis=-1)


position, normal, flat = layer("Position", "XYZ"), layer("ShadingNormal", "XYZ"), layer("Normal", "XYZ")
depth, distance, thing = channels["Z"], channels["Distance.X"], channels["Object.X"]
assert numpy.array_equal(depth, channels["Depth.Z"]) and spec.z_channel == spec.channelnames.index("Z")
hit = thing >= 0
assert (thing[~hit] == -1).all() and numpy.isinf(depth[~hit]).all() and numpy.isfinite(depth[hit]).all()
assert set(numpy.unique(thing)) == {-1.0, 0.0, 1.0, 2.0, 3.0}, "spheres, plane and tetrahedron, and background"

# The camera of view2 stands at (0, -200, 500): how far the points are from there.
far = numpy.linalg.norm(position - [0, -200, 500], axis=-1)
assert numpy.allclose(distance[hit], far[hit], rtol=1e-6)
# The plane is y = -500, and is seen from above.
assert numpy.allclose(position[thing == 2][:, 1], -500) and numpy.allclose(normal[thing == 2], [0, 1, 0])
# The left sphere: centre (-300, -425, 1200), radius 75, and its normals are those of a sphere.
out = (position[thing == 0] - [-300, -425, 1200]) / 75
assert numpy.allclose(out, normal[thing == 0], atol=1e-5)
assert numpy.array_equal(normal, flat), "nothing is smoothed"
# Wild Blue Yonder, in display values.
assert numpy.allclose(layer("Albedo", "RGB")[thing == 2], numpy.array([156, 181, 203]) / 255, atol=1e-6)
assert (channels["Samples.X"] == 1).all() and (channels["NodeTests.X"] >= 1).all()
# Each of the four objects has a material of its own.
material = channels["Material.X"]
assert (material[~hit] == -1).all() and (material[hit] >= 0).all()
pairs = set(zip(thing[hit].tolist(), material[hit].tolist()))
assert len(pairs) == 4 and len({m for _, m in pairs}) == 4, pairs
assert set(numpy.unique(channels["Primitive.X"])) <= set(range(-1, 7))
parts = layer("Base", "RGB") + layer("EffectShadows", "RGB") + layer("EffectGlaze", "RGB")
whole = numpy.stack([channels[c] for c in "RGB"], axis=-1)
assert numpy.allclose(parts, whole, atol=1e-6), numpy.abs(parts - whole).max()
assert (layer("EffectShadows", "RGB") <= 0).all(), "shadows only take light away"
assert spec.getattribute("kiln:camera") == "view2"
print("every AOV has the values that the scene file states")


def with_openexr(name):
    file = OpenEXR.File(f"{folder}/{name}.exr", separate_channels=True)
    return file.header(), {key: channel.pixels for key, channel in file.channels().items()}


# A crop lies in the whole picture. Colours are half floats, the nearest to those of 32 bits; all else is the same.
header, whole = with_openexr("whole")
of_crop, crop = with_openexr("crop")
assert [tuple(map(int, corner)) for corner in of_crop["dataWindow"]] == [(16, 8), (65, 48)]
assert [tuple(map(int, corner)) for corner in of_crop["displayWindow"]] == [(0, 0), (95, 71)]
spec = oiio.ImageInput.open(f"{folder}/crop.exr").spec()
assert (spec.x, spec.y, spec.width, spec.height) == (16, 8, 50, 41)
assert (spec.full_x, spec.full_y, spec.full_width, spec.full_height) == (0, 0, 96, 72)
for name, values in crop.items():
    part = whole[name][8:49, 16:66]
    is_colour = name.split(".")[-1] in "RGB" and not name.startswith("Variance")
    assert values.dtype == (numpy.float16 if is_colour else numpy.float32), name
    assert numpy.array_equal(values, part.astype(values.dtype)), name
assert {"R", "Albedo.G", "EffectGlaze.B", "Z", "CryptoObject00.r", "Object.X"} <= set(crop)

# Matrices of row vectors, as in Imath: OpenEXR's array m has the elements m[row][column].
camera, ndc = (numpy.array(header[name], dtype=float).reshape(4, 4) for name in ("worldToCamera", "worldToNDC"))
at = [numpy.array([0.4, 1.7, 5.4, 1]) @ camera, numpy.array([0.15, 0.62, 0, 1]) @ camera]
far = numpy.linalg.norm(numpy.array([0.4, 1.7, 5.4]) - [0.15, 0.62, 0])
assert numpy.allclose(at, [[0, 0, 0, 1], [0, 0, far, 1]], atol=1e-5), "the camera looks along z"
points = numpy.stack([whole[f"Position.{axis}"] for axis in "XYZ"] + [numpy.ones((72, 96))], axis=-1)
hit = whole["Object.X"] >= 0
assert numpy.allclose((points @ camera)[hit][:, 2], whole["Z"][hit], rtol=1e-5)
projected = points @ ndc
y, x = (numpy.mgrid[:72, :96] + 0.5) / [[[72]], [[96]]]
assert numpy.allclose((projected[..., :2] / projected[..., 3:])[hit], numpy.stack([x, y], axis=-1)[hit], atol=1e-5)
assert header["worldToCamera"].__class__ is of_crop["worldToCamera"].__class__
assert (numpy.array(header["worldToNDC"]) == numpy.array(of_crop["worldToNDC"])).all(), "of the whole picture"
assert numpy.allclose(header["chromaticities"], [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329])

# A reader of Cryptomattes finds the mattes by their names. Where the filter does not reach an edge, they are 1 or 0.
mattes = {matte.metadata().name(): matte for matte in cryptomatte_api.Cryptomatte.load(f"{folder}/whole.exr")}
assert sorted(mattes) == ["CryptoMaterial", "CryptoObject"], sorted(mattes)
for kind, aov in (("CryptoObject", "Object.X"), ("CryptoMaterial", "Material.X")):
    masks, index = mattes[kind].masks(), whole[aov]
    total = sum(masks.values())
    assert total.max() <= 1 + 1e-6
    inner = numpy.ones_like(hit)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            inner &= numpy.roll(index, (dy, dx), (0, 1)) == index
    inner[:2] = inner[-2:] = inner[:, :2] = inner[:, -2:] = False
    assert inner.sum() > 1000 and numpy.allclose(total[inner & hit], 1, atol=1e-6)
    assert numpy.abs(total[inner & ~hit]).max(initial=0) == 0
    seen = set()
    for name, mask in masks.items():
        of_name = numpy.unique(index[inner & (mask > 0.5)])
        assert len(of_name) <= 1, (name, of_name)
        seen |= set(of_name.tolist())
        assert ((mask == 0) | (mask == 1))[inner].mean() > 0.99, name
    assert len(seen) > 2, seen
    edges = (total > 0.99) & (masks[max(masks, key=lambda name: masks[name].sum())] % 1 > 0.01)
    assert edges.any(), "pixels of two names"
print("windows, matrices, half floats and mattes are read by OpenEXR, OpenImageIO and cryptomatte-api")
