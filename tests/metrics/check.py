"""Holds `kiln compare` against flip-evaluator, OpenImageIO and, where it is installed, ImageMagick.

usage: check.py KILN FOLDER: renders five pairs of pictures into FOLDER with KILN and compares each by all of them.
"""

import json
import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

import flip_evaluator
import numpy
import OpenImageIO as oiio

KILN, FOLDER = sys.argv[1], Path(sys.argv[2])
EFFECTS = "scenes/effects/"
# A scene, and the settings of both of its pictures.
PAIRS = [
    ("scenes/assignment.toml", ["--size", "200x200"], ["--size", "200x200", "--samples", "8"]),
    (EFFECTS + "shadows.toml", ["--size", "160x120"], ["--size", "160x120", "--without", "shadows"]),
    (EFFECTS + "glaze.toml", ["--size", "160x120"], ["--size", "160x120", "--without", "glaze"]),
    ("scenes/zone-plate.toml", ["--size", "128x128", "--samples", "4"], ["--size", "128x128", "--samples", "64"]),
    ("scenes/sunflower.toml", ["--size", "150x100", "--samples", "1"],
     ["--size", "150x100", "--samples", "16", "--filter", "mitchell"]),
]


def render(scene, settings, file):
    subprocess.run([KILN, "render", scene, *settings, "--progress", "none", "-o", file], check=True)


def compare(a, b, *options):
    done = subprocess.run([KILN, "compare", a, b, "--json", *options], capture_output=True, text=True)
    assert done.returncode in (0, 1, 2), done.stderr
    return done.returncode, json.loads(done.stdout)["errors"]


def pixels(file):
    return oiio.ImageBuf(str(file)).get_pixels(oiio.FLOAT)[..., :3].astype(numpy.float64)


def agree(name, ours, theirs, within):
    apart = abs(ours - theirs)
    print(f"    {name:<24} {ours:.7f}  {theirs:.7f}  apart {apart:.1e}")
    assert apart <= within, f"{name}: {ours} is not {theirs}"


def magick(metric, a, b):
    # A list of figures ends in the one of all channels; the normalised one stands in brackets where there are two.
    said = subprocess.run(["compare", "-metric", metric, a, b, "null:"], capture_output=True, text=True).stderr
    return float(re.findall(r"[-+\d.e]+", said.replace("inf", "nan"))[-1])


for number, (scene, first, second) in enumerate(PAIRS):
    print(f"{scene}: {' '.join(first)} against {' '.join(second)}")
    a, b = FOLDER / f"{number}-a.png", FOLDER / f"{number}-b.png"
    render(scene, first, a)
    render(scene, second, b)
    code, errors = compare(a, b)
    assert code == 1 and compare(a, a)[0] == 0
    ours = errors["figures"]
    theirs = flip_evaluator.evaluate(str(a), str(b), "LDR")[1]
    agree("FLIP, flip-evaluator", ours["flip"], theirs, 1e-4)
    result = oiio.ImageBufAlgo.compare(oiio.ImageBuf(str(a)), oiio.ImageBuf(str(b)), 0, 0)
    # Figures are printed with six digits, PSNR with four.
    agree("RMSE, OpenImageIO", ours["rmse"], result.rms_error, 5e-7)
    agree("max, OpenImageIO", ours["max"], result.maxerror, 5e-7)
    agree("PSNR, OpenImageIO", ours["psnr"], result.PSNR, 5e-4)
    if shutil.which("compare"):
        agree("RMSE, ImageMagick", ours["rmse"], magick("RMSE", a, b), 5e-7)
        agree("PSNR, ImageMagick", ours["psnr"], magick("PSNR", a, b), 5e-4)
    x, y = pixels(a), pixels(b)
    agree("relMSE, numpy", ours["rel_mse"], ((y - x) ** 2 / (x ** 2 + 0.01)).mean(), 5e-7)
    agree("differing, numpy", ours["differing"], (x != y).any(axis=-1).mean(), 0)

print("EXR, in linear light")
a, b = FOLDER / "a.exr", FOLDER / "b.exr"
for file, settings in ((a, []), (b, ["--samples", "8"])):
    render("scenes/effects/textures.toml", ["--size", "128x96", *settings], file)
errors = compare(a, b)[1]
x, y = pixels(a), pixels(b)
assert errors["values"] == "linear"
agree("RMSE, numpy", errors["figures"]["rmse"], math.sqrt(((y - x) ** 2).mean()), 5e-7)
agree("relMSE, numpy", errors["figures"]["rel_mse"], ((y - x) ** 2 / (x ** 2 + 0.01)).mean(), 5e-7)


def displayed(light):
    light = numpy.maximum(light, 0)
    encoded = numpy.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return numpy.clip(encoded, 0, 1).astype(numpy.float32)


theirs = flip_evaluator.evaluate(displayed(x), displayed(y), "LDR", inputsRGB=True)[1]
agree("FLIP, flip-evaluator", errors["figures"]["flip"], theirs, 1e-4)

print("a pixel that is not a number")
values = y.astype(numpy.float32)
values[3, 5, 1] = numpy.nan
broken = oiio.ImageBuf(oiio.ImageSpec(values.shape[1], values.shape[0], 3, oiio.FLOAT))
broken.set_pixels(oiio.ROI(), values)
broken.write(str(FOLDER / "nan.exr"))
code, errors = compare(a, FOLDER / "nan.exr")
print("   ", errors["non_finite"], errors["figures"])
assert code == 2 and errors["figures"] is None
assert errors["non_finite"] == {"reference": 0, "test": 1, "first": [5, 3]}
print("all agree")
