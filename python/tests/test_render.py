"""Pictures and scenes."""

import io
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import TETRAHEDRON, icosphere

import kiln

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "scenes" / "assignment.toml"
BALL = {"sphere": [{"centre": [0, 0, 0], "radius": 1, "material": "red"}], "material": {"red": {"colour": "#ff0000"}}}
NANS = np.full((4, 4), np.nan)
FRONT = {"position": [0, 0, 5], "look_at": [0, 0, 0], "vertical_fov": 40}


def test_a_picture_is_that_of_the_command(tmp_path):
    options = ["--size", "80x60", "--samples", "4", "--filter-radius", "0.75", "--without", "shadows"]
    command = [sys.executable, "-m", "kiln", "render", SCENE, "-o", tmp_path / "command.png", *options]
    subprocess.run(command, check=True, capture_output=True)
    picture = kiln.render(SCENE, size=(80, 60), samples=4, filter_radius=0.75, without=["shadows"])
    assert picture.pixels.shape == (60, 80, 3) and picture.pixels.dtype == np.uint8
    picture.save(tmp_path / "module.png")
    assert (tmp_path / "module.png").read_bytes() == (tmp_path / "command.png").read_bytes()
    assert picture._repr_png_() == (tmp_path / "command.png").read_bytes()
    assert (np.asarray(picture) == picture.pixels).all()


def test_values_and_aovs(tmp_path):
    """A ball of radius 1 seen from 5 away: the middle pixel of an odd size looks along the axis."""
    picture = kiln.render(
        BALL, camera=FRONT, size=(41, 41), dtype="float32", aovs=["depth", "normal", "object"], background="transparent"
    )
    assert picture.pixels.shape == (41, 41, 4) and picture.pixels.dtype == np.float32
    assert list(picture.aovs) == ["depth", "normal", "object"]
    depth, normal, objects = picture.aovs.values()
    assert depth.shape == (41, 41) and normal.shape == (41, 41, 3)
    assert depth[20, 20] == pytest.approx(4, abs=1e-6) and np.isinf(depth[0, 0])
    assert normal[20, 20] == pytest.approx([0, 0, 1], abs=1e-6)
    # Alpha is the part of the picture that the ball covers, and objects are counted from 0.
    assert (picture.pixels[..., 3] == (objects == 0)).all() and (objects[0] == -1).all()
    red, green, blue = picture.pixels[20, 20, :3]
    assert red > 0 and green == blue == 0
    picture.save(tmp_path / "ball.exr")
    picture.save(tmp_path / "ball.png")
    assert (tmp_path / "ball.exr").read_bytes()[:4] == b"\x76\x2f\x31\x01"
    of_bytes = kiln.render(BALL, camera=FRONT, size=(41, 41), aovs=["depth"], background="transparent")
    assert of_bytes.pixels.shape == (41, 41, 4) and (of_bytes.aovs["depth"] == depth).all()
    with pytest.raises(ValueError, match="OpenEXR holds f32 values"):
        of_bytes.save(tmp_path / "bytes.exr")


def test_pictures_are_written_to_objects_and_print_what_they_are(tmp_path):
    picture = kiln.render(BALL, size=(6, 4), aovs=["normal", "depth"])
    assert repr(picture) == "<kiln.Picture 6 x 4, uint8, AOVs depth, normal>"
    of_floats = kiln.render(BALL, size=(6, 4), dtype="float32")
    assert repr(of_floats) == "<kiln.Picture 6 x 4, float32>"
    for made, format in ((picture, "png"), (picture, "jpg"), (of_floats, "exr"), (of_floats, "PNG")):
        memory, file = io.BytesIO(), tmp_path / "picture"
        made.save(memory, format=format)
        made.save(file, format=format)
        assert memory.getvalue() == file.read_bytes()
        made.save(tmp_path / f"named.{format}")
        assert memory.getvalue() == (tmp_path / f"named.{format}").read_bytes()
    for mistake, kind, said in (
        (lambda: picture.save(io.BytesIO()), ValueError, "^format: give"),
        (lambda: picture.save(io.BytesIO(), format="gif"), ValueError, "^format: `gif` is not png, jpg or exr$"),
        (lambda: picture.save(io.BytesIO(), format="exr"), ValueError, "^OpenEXR holds f32 values"),
        (lambda: picture.save(3, format="png"), TypeError, "PathLike"),
    ):
        with pytest.raises(kind, match=said):
            mistake()


def test_scenes_of_arrays():
    vertices, faces = icosphere(2)
    scene = kiln.Scene()
    scene.add(vertices, faces, name="ball", material={"colour": "#00ff00"})
    moves = np.tile(np.eye(4), (2, 1, 1))
    moves[:, 0, 3] = [3, -3]
    colours = np.full((4, 3), [255, 0, 0], np.uint8)
    scene.add(*TETRAHEDRON, name="piece", transforms=moves, colours=colours, material={"colour": "#ffffff"})
    scene.update({"camera": [{"name": "front", "position": [0, 0, 12], "look_at": [0, 0, 0], "vertical_fov": 40}]})
    assert len(scene) == len(faces) + 2 * 4
    assert scene.objects == ["ball", "piece", "piece"] and scene.cameras == ["front"]
    assert np.allclose(scene.bounds, [[-3, -1, -1], [4, 1, 1]])
    # Queries of the same scene, in its order.
    mesh = scene.mesh(tier="double")
    hits = mesh.first([[3.2, 0.2, -5]], [[0, 0, 1]])
    assert hits.primitive.tolist() == [len(faces)] and (hits.object, hits.triangle) == ([1], [0])
    picture = kiln.render(scene, size=(90, 60), shading="flat", aovs=["object"])
    shown = picture.aovs["object"]
    # Flat colours are those of the material and of the vertices.
    assert set(map(tuple, picture.pixels[shown == 0])) == {(0, 255, 0)}
    assert set(map(tuple, picture.pixels[shown == 1])) == {(255, 0, 0)}
    assert set(map(tuple, picture.pixels[shown == -1])) == {(0, 0, 0)}


def test_scenes_of_trimesh_and_bytes():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.icosphere()
    scene = kiln.Scene(trimesh.Scene([mesh, mesh.copy().apply_translation([3, 0, 0])]))
    assert len(scene) == 2 * len(mesh.faces) and np.allclose(scene.bounds, [[-1, -1, -1], [4, 1, 1]], atol=1e-6)
    assert len(kiln.Scene(mesh)) == len(mesh.faces)
    for kind in ("ply", "stl", "obj", "off", "glb"):
        contents = mesh.export(file_type=kind)
        assert len(kiln.Scene(contents.encode() if isinstance(contents, str) else contents)) == len(mesh.faces)
    assert kiln.Scene(mesh)._repr_png_()[1:4] == b"PNG"


def test_files_and_their_options():
    mesh = ROOT / "assets" / "import" / "tetrahedron.stl"
    y_up, z_up = kiln.Scene(mesh, up="y"), kiln.Scene([mesh], up="z")
    assert len(y_up) == len(z_up) == 4
    # z up: (x, y, z) becomes (x, z, -y).
    (low, high), turned = y_up.bounds, z_up.bounds
    assert np.allclose(turned, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]])
    assert kiln.render(mesh, up="z", size=(8, 8), draft=True).pixels.shape == (8, 8, 3)


@pytest.mark.parametrize("yes, no", [(True, False), (np.True_, np.False_), (np.array(True), np.array(False))])
def test_switches(yes, no):
    pictures = [kiln.render(SCENE, size=(8, 6), draft=draft) for draft in (yes, no)]
    assert [picture.metadata.get("kiln:look") for picture in pictures] == ["draft", None]


@pytest.mark.parametrize(
    "call, error, what",
    [
        (lambda: kiln.render("missing.obj"), FileNotFoundError, "missing.obj"),
        (lambda: kiln.render(BALL, sampels=4), ValueError, "^unknown option `sampels`; did you mean `samples`\\?$"),
        (lambda: kiln.render(BALL, sampels=None), ValueError, "^unknown option `sampels`"),
        (lambda: kiln.Scene(BALL, smoth=None), ValueError, "^unknown option `smoth`; did you mean `smooth`"),
        (lambda: kiln.render(BALL, witout="shadows"), ValueError, "did you mean `without`"),
        (lambda: kiln.render(BALL, wiht=["shadows"]), ValueError, "did you mean `with_`"),
        (lambda: kiln.render(BALL, help=True), ValueError, "^unknown option `help`"),
        (lambda: kiln.render(BALL, samples__=4), ValueError, "^unknown option `samples__`; did you mean `samples`"),
        (lambda: kiln.render(BALL, samples_=4), ValueError, "^unknown option `samples_`"),
        (lambda: kiln.render(BALL, output="a.png"), ValueError, "^unknown option `output`"),
        (lambda: kiln.render(BALL, spp=4), ValueError, "^unknown option `spp`; use samples N$"),
        (lambda: kiln.render(BALL, tonemap="agx"), ValueError, "^unknown option `tonemap`; use tone_map$"),
        (lambda: kiln.render(BALL, layers="depth"), ValueError, "^unknown option `layers`; .* by aovs$"),
        (lambda: kiln.render(BALL, shadows=True), ValueError, '; use with_ shadows or without shadows$'),
        (lambda: kiln.render(BALL, samples=0), ValueError, "'0' for 'samples': give .* from 1 to 65536$"),
        (lambda: kiln.render(BALL, samples=True, size=(8, 8)), ValueError, "^`samples` takes a value, not True$"),
        (lambda: kiln.render(BALL, fov=True, size=(8, 8)), ValueError, "^`fov` takes a value, not True$"),
        (lambda: kiln.render(BALL, exposure=False), ValueError, "^`exposure` takes a value, not False$"),
        (lambda: kiln.render(BALL, samples=1.5), ValueError, "'1.5' for 'samples'"),
        (lambda: kiln.render(BALL, view=chr(0xD800)), ValueError, r"^view: '\\ud800' has surrogates"),
        (lambda: kiln.render(BALL, without=[chr(0xD800)]), ValueError, "^without: .* has surrogates"),
        (lambda: kiln.render(BALL, aovs=chr(0xD800)), ValueError, "^aovs: .* has surrogates"),
        (lambda: kiln.render(BALL, dtype=chr(0xD800)), ValueError, "^dtype: "),
        (lambda: kiln.render(BALL, **{chr(0xD800): 1}), ValueError, "^options: .* has surrogates"),
        (lambda: kiln.render(BALL, camera={"name": chr(0xD800)}), ValueError, "^camera.name: .* has surrogates"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, name=chr(0xD800)), ValueError, "^name: .* has surrogates"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, material=chr(0xD800)), ValueError, "^material: .* has surrogates"),
        (lambda: kiln.Scene(up="z"), ValueError, "^up: a Scene without a source is empty and has no options$"),
        (lambda: kiln.render(BALL, size=(60000, 60000)), MemoryError, "^a picture of 60000 x 60000 pixels needs"),
        (lambda: kiln.render(BALL, size=(8, 8)).save("-"), ValueError, "^-: not a picture format .* ends in .png"),
        (lambda: kiln.render(BALL, size=(8, 8)).save(""), ValueError, "^no name of a file; .* ends in .png"),
        (lambda: kiln.render(BALL, view="side"), ValueError, "'side' for 'view': known here: front, "),
        (lambda: kiln.render(BALL, without="path=2"), ValueError, "^without takes no value.*by `with_`$"),
        (lambda: kiln.render(BALL, draft="yes"), ValueError, "^invalid value 'yes' for 'draft': give true or false$"),
        (lambda: kiln.render(BALL, aov="depth"), ValueError, "^unknown option `aov`; did you mean `aovs`"),
        (lambda: kiln.render(BALL, aovs=None), TypeError, "^aovs: expected names, not NoneType$"),
        (lambda: kiln.render(BALL, aovs=["depth", 5]), TypeError, "^aovs: expected names, not int$"),
        (lambda: kiln.render(BALL, size=np.ones((2, 2))), TypeError, "^size: .*, not ndarray$"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, material={"hue": 1}), ValueError, "^material: .*`hue`"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, material=5), TypeError, "^material: .*, not int$"),
        (lambda: kiln.render(BALL, view="top", camera="auto"), ValueError, "^both camera and view; give one of the two$"),
        (lambda: kiln.render(BALL, transport="path", with_="fog"), ValueError, "fog"),
        (lambda: kiln.render({}, camera=None), ValueError, "^source: "),
        (lambda: kiln.render("-"), FileNotFoundError, "-"),
        (lambda: kiln.render(BALL, size=(8,)), ValueError, "WIDTHxHEIGHT"),
        (lambda: kiln.render(BALL, camera="back"), ValueError, "camera"),
        (lambda: kiln.render(BALL, aovs=["depht"]), ValueError, "did you mean `depth`"),
        (lambda: kiln.render(BALL, dtype="float64"), ValueError, "neither uint8 nor float32"),
        (lambda: kiln.render(BALL, samples=object()), TypeError, "^samples: .*, not object$"),
        (lambda: kiln.render(BALL, size=[8, True]), TypeError, "^size: .*, not bool$"),
        (lambda: kiln.render(BALL, size=np.array([True, False])), TypeError, "^size: .*, not bool$"),
        (lambda: kiln.render(kiln.Scene(BALL), up="z"), ValueError, "Scene"),
        (lambda: kiln.render(BALL, progress=True), TypeError, "^progress: expected a function, not bool"),
        (lambda: kiln.render(BALL, dtype="f8"), ValueError, "`float64` is neither uint8 nor float32"),
        (lambda: kiln.render(BALL, dtype="float"), ValueError, "`float64` is neither uint8 nor float32"),
        (lambda: kiln.render(BALL, dtype="pixels"), ValueError, "^dtype: 'pixels' is neither uint8 nor float32$"),
        (lambda: kiln.render(BALL, dtype=3), TypeError, "^dtype: expected a type of numpy or its name, not int$"),
        (lambda: kiln.render(BALL, dtype=np.float64), ValueError, "neither uint8 nor float32"),
        (lambda: kiln.render(BALL, camera={"position": 1j}), TypeError, "type complex for key `camera.position`"),
        (lambda: kiln.Scene({"light": [{"type": b""}]}), TypeError, "type bytes for key `light.type`"),
        (lambda: kiln.render(5), TypeError, "^source: expected a file, Scene, dict, bytes or .*, not int$"),
        (lambda: kiln.render(None), TypeError, "not NoneType$"),
        (lambda: kiln.Scene([1]), TypeError, "not list of int$"),
        (lambda: kiln.Scene(np.zeros((2, 3))), TypeError, "not ndarray of ndarray$"),
        (lambda: kiln.render({"spere": []}), ValueError, "unknown key `spere`; did you mean `sphere`"),
        (lambda: kiln.Scene(BALL, samples=4), ValueError, "options of the picture"),
        (lambda: kiln.Scene(b"nonsense"), ValueError, "^source: not a kind of file"),
        (lambda: kiln.Scene().add([[0, 0]], []), ValueError, "^vertices"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, material="gold"), ValueError, "^material: .*`gold`"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, colours=[[2, 0, 0]] * 4), ValueError, "^colours: row 0"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, normals=[[1, 0, 0]]), ValueError, "^normals: 1 rows"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, transforms=np.eye(4)), ValueError, r"^transforms: .*\(4, 4\)"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, transforms=[np.ones((4, 4))]), ValueError, "matrix 0: .* 0, 0, 0, 1$"),
        (lambda: kiln.Scene().add(*TETRAHEDRON, transforms=[np.eye(4), NANS]), ValueError, "matrix 1 is not finite$"),
    ],
)
def test_mistakes(call, error, what):
    with pytest.raises(error, match=what):
        call()


def test_values_of_none_are_left_out():
    ball = {**BALL, "sphere": [{**BALL["sphere"][0], "name": None}], "light": None}
    assert len(kiln.Scene(ball)) == 1
    pictures = [
        kiln.render(scene, camera=camera, size=(8, 8), aovs="depth").aovs["depth"]
        for scene, camera in [(BALL, FRONT), (ball, {**FRONT, "roll": None})]
    ]
    assert (pictures[0] == pictures[1]).all()


@pytest.mark.parametrize("dtype", ["float32", "f4", np.float32, np.dtype("f4"), "uint8", "u1", np.uint8])
def test_types_of_pixels(dtype):
    picture = kiln.render(BALL, camera=FRONT, size=(8, 8), dtype=dtype, aovs="depth")
    assert picture.pixels.dtype == np.dtype(dtype) and list(picture.aovs) == ["depth"]


def test_whole_floats_and_lists_in_one_text():
    """16.0 is 16, and names with commas are lists."""
    pictures = [
        kiln.render(BALL, camera=FRONT, **options)
        for options in [
            {"samples": 4, "size": (16, 12), "without": ["shadows", "glaze"], "aovs": ["depth", "normal"]},
            {"samples": 4.0, "size": np.array([16.0, 12.0]), "without": "shadows,glaze", "aovs": "depth, normal"},
        ]
    ]
    assert pictures[0].metadata == pictures[1].metadata and list(pictures[1].aovs) == ["depth", "normal"]
    assert (pictures[0].pixels == pictures[1].pixels).all() and pictures[1].pixels.shape == (12, 16, 3)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of the address space")
def test_errors_of_memory_give_no_advice_for_a_shell():
    code = f"""
import kiln, resource
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
try:
    kiln.render({BALL!r}, size=(20000, 20000), dtype="float32")
except MemoryError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.endswith("; give a smaller size, render it in parts with crop\n"), done


def test_warnings():
    with pytest.warns(kiln.KilnWarning, match="nothing is in the picture"):
        kiln.render(BALL, camera={**FRONT, "look_at": [0, 0, 9]}, size=(8, 8))
    with pytest.warns(kiln.KilnWarning, match="^min_samples changes nothing without noise$"):
        kiln.render(BALL, min_samples=4, size=(8, 8))
    scene = kiln.Scene()
    with pytest.warns(kiln.KilnWarning, match="far: left out 1 primitive"):
        scene.add([[0, 0, 0], [1e19, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="far")


def test_messages_name_options_as_arguments():
    with pytest.warns(kiln.KilnWarning, match="nothing is in the picture: .*try `camera auto`"):
        kiln.render(BALL, camera={**FRONT, "look_at": [0, 0, 9]}, size=(8, 8))
    notes = kiln.render(kiln.Scene({"sphere": BALL["sphere"], "material": BALL["material"]}), size=(8, 8)).notes
    assert not any("--" in note for note in notes)


def test_a_file_of_the_name_of_standard_input(tmp_path, monkeypatch):
    """Python's standard input is not read."""
    monkeypatch.chdir(tmp_path)
    Path("-").write_bytes(b"nonsense")
    with pytest.raises(ValueError, match="^./-: "):
        kiln.Scene("-")


def test_arrays_of_a_picture_are_read_only():
    picture = kiln.render(BALL, camera=FRONT, size=(4, 3), aovs=["depth", "normal"])
    for array in (picture.pixels, *picture.aovs.values(), np.asarray(picture)):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    # A copy is independent, of any type.
    for copied in (np.array(picture), picture.__array__(copy=True), picture.__array__(np.float64, copy=True)):
        assert (copied == picture.pixels).all()
        copied[:] = 1 + copied[0, 0, 0]
        assert (copied != picture.pixels).any()
    assert picture.__array__(copy=False) is picture.pixels
    with pytest.raises(ValueError, match="float64"):
        picture.__array__(np.float64, copy=False)


def test_progress():
    calls = []
    main = threading.get_ident()
    kiln.render(
        SCENE, size=(320, 240), samples=64, progress=lambda *tiles: calls.append((*tiles, threading.get_ident()))
    )
    done, total, threads = zip(*calls)
    assert list(done) == sorted(set(done)) and done[-1] == total[-1] == 300 and set(threads) == {main}


class Stop(Exception):
    pass


def test_an_exception_of_progress_ends_the_picture():
    def stop(_done, _total):
        raise Stop

    start = time.monotonic()
    with pytest.raises(Stop):
        kiln.render(SCENE, size=(2000, 2000), samples=4096, progress=stop)
    assert time.monotonic() - start < 10


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT to one process")
@pytest.mark.parametrize("transport", ["whitted", "path"])
def test_keyboard_interrupt(transport):
    """Within a second of the signal, also where a tile takes longer."""
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        kiln.render(SCENE, size=(2000, 2000), samples=65536, transport=transport)
    assert time.monotonic() - start < 1.5
    # The next picture is not disturbed.
    assert kiln.render(SCENE, size=(16, 16)).pixels.any()


def test_other_threads_run_while_a_picture_is_rendered():
    ticks = []
    stop = threading.Event()

    def tick():
        while not stop.wait(0.01):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    kiln.render(SCENE, size=(640, 480), samples=64)
    stop.set()
    thread.join()
    assert len(ticks) > 10


def test_features_after_ambient_occlusion():
    """`variance` renders with ambient occlusion and `shading-normal` without, by turns, over several tiles of one thread."""
    scene = kiln.Scene()
    scene.add(*TETRAHEDRON)
    options = {"size": (64, 64), "samples": 2, "ground": False, "threads": 1}
    both = kiln.render(scene, aovs=["shading-normal", "variance"], **options).aovs
    for name in both:
        assert np.array_equal(both[name], kiln.render(scene, aovs=name, **options).aovs[name])
