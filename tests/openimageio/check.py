"""Reads the AOVs of the assignment scene, view2, with OpenImageIO, and compares them with what the scene file says."""

import sys

import numpy
import OpenImageIO as oiio

picture = oiio.ImageInput.open(sys.argv[1])
assert picture, oiio.geterror()
spec = picture.spec()
pixels = picture.read_image("float")
channels = {name: pixels[:, :, i].astype(numpy.float64) for i, name in enumerate(spec.channelnames)}
print(spec.width, "x", spec.height, picture.format_name(), ", ".join(spec.channelnames))
assert not picture.seek_subimage(1, 0), "one part"
assert all(str(spec.channelformat(i)) == "float" for i in range(spec.nchannels))


def layer(name, letters):
    return numpy.stack([channels[f"{name}.{letter}"] for letter in letters], axis=-1)


position, normal, flat = layer("Position", "XYZ"), layer("Normal", "XYZ"), layer("GeometricNormal", "XYZ")
depth, thing = channels["Depth.Z"], channels["Object.X"]
hit = thing >= 0
assert (thing[~hit] == -1).all() and numpy.isinf(depth[~hit]).all() and numpy.isfinite(depth[hit]).all()
assert set(numpy.unique(thing)) == {-1.0, 0.0, 1.0, 2.0, 3.0}, "spheres, plane and tetrahedron, and background"

# The camera of view2 stands at (0, -200, 500): depth is how far the points are from there.
far = numpy.linalg.norm(position - [0, -200, 500], axis=-1)
assert numpy.allclose(depth[hit], far[hit], rtol=1e-6)
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
