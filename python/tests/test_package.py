"""The package: import, command, types, examples of the documentation."""

import ast
import importlib.metadata
import inspect
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import kiln

ROOT = Path(__file__).parents[2]
PACKAGE = Path(kiln.__file__).parent


def python(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout


def test_import_is_fast_and_imports_neither_numpy_nor_trimesh():
    code = """
import sys, time
start = time.perf_counter()
import kiln
print(time.perf_counter() - start, {"numpy", "trimesh"} & set(sys.modules))
import kiln.trimesh
print("trimesh" in sys.modules)
"""
    runs = [python(code).split() for _ in range(3)]
    assert min(float(seconds) for seconds, *_ in runs) < 0.1
    assert all(rest == ["set()", "False"] for _, *rest in runs)


def test_kiln_trimesh_is_imported_where_it_is_used():
    code = """
import kiln
print(kiln.trimesh.RayMeshIntersector.__name__, kiln.trimesh is __import__("kiln.trimesh").trimesh)
try:
    kiln.trimsh
except AttributeError as error:
    print(error)
"""
    assert python(code).splitlines() == ["RayMeshIntersector True", "module 'kiln' has no attribute 'trimsh'"]


def test_command(tmp_path):
    command = Path(sys.executable).with_name("kiln")
    version = subprocess.run([command, "--version"], check=True, capture_output=True, text=True).stdout
    assert version == f"kiln {kiln.__version__}\n"
    assert kiln.__version__ == importlib.metadata.version("kiln-bvh")
    missing = subprocess.run(
        [command, "render", "missing.obj", "-o", tmp_path / "a.png"], capture_output=True, text=True
    )
    assert missing.returncode == 3 and "missing.obj: no such file" in missing.stderr
    assert subprocess.run([command, "rendr"], capture_output=True).returncode == 2


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT to one process")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_command_ends_as_the_binary_does(tmp_path, number):
    """Exit code 128 + number, the last message of `--progress json`, no traceback and no file."""
    command = [Path(sys.executable).with_name("kiln"), "render", ROOT / "scenes" / "assignment.toml"]
    options = ["-o", tmp_path / "a.png", "--size", "2000x2000", "--samples", "65536", "--progress", "json"]
    with subprocess.Popen([*command, *options], stderr=subprocess.PIPE, text=True) as process:
        first = process.stderr.readline()  # the picture is begun
        process.send_signal(number)
        _, rest = process.communicate(timeout=30)
    events = [json.loads(line) for line in (first + rest).splitlines()]
    assert events[-1] == {"event": "interrupted", "exit_code": 128 + number}
    assert process.returncode == 128 + number
    assert list(tmp_path.iterdir()) == []


def test_licences_are_in_the_wheel():
    files = [file for file in importlib.metadata.files("kiln-bvh") if "licenses" in file.parts]
    texts = {file.name: file.read_text() for file in files}
    for name in ("LICENSE-APACHE", "LICENSE-MIT"):
        assert texts[name] == (ROOT / name).read_text()


def members(tree: ast.AST) -> set[str]:
    """The public names of a stub, with those of its classes."""
    found = set()
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{item.name}" for item in node.body if isinstance(item, ast.FunctionDef)}
    return {name for name in found if not name.split(".")[-1].startswith("__")}


def test_stubs_have_what_the_module_has():
    from kiln import _kiln

    assert (PACKAGE / "py.typed").exists()
    actual = {name for name, _ in inspect.getmembers(_kiln) if not name.startswith("__")}
    for name in list(actual):
        value = getattr(_kiln, name)
        if inspect.isclass(value) and not issubclass(value, Warning):
            actual |= {f"{name}.{item}" for item in vars(value) if not item.startswith("__")}
    assert members(ast.parse((PACKAGE / "_kiln.pyi").read_text())) == actual


MISTAKES_OF_TYPES = [
    'kiln.Mesh([], [], tier="nonsense")',
    'kiln.Mesh([], [], teir="double")',
    'kiln.Mesh([], [], preset="best")',
    'kiln.Scene().mesh(tier="nonsense")',
    'kiln.Mesh([], []).first([], [], max_distanze=1.0)',
    'kiln.trimesh.RayMeshIntersector(None, tier="nonsense")',
    'kiln.trimesh.RayMeshIntersector(None).intersects_location([], [], max_hit=1)',
    'kiln.trimesh.RayMeshIntersector(None).intersects_any([], [], multiple=1)',
    'kiln.render("a.obj", siez=(64, 48))',
    'kiln.render("a.obj", transport="paths")',
    'kiln.Scene("a.obj", smoth=30)',
    'kiln.Scene("a.obj", samples=4)',
    'kiln.Prepared("a.obj", siez=(64, 48))',
    'kiln.Prepared("a.obj").render(siez=(64, 48))',
    'kiln.Prepared("a.obj").render_many([None], size=(64, 48), siez=1)',
]


def test_type_checkers_refuse_mistakes(tmp_path):
    pytest.importorskip("mypy")
    right = [
        'kiln.Mesh([], [], tier="exact", preset="fast-build")',
        "kiln.trimesh.install()",
        'kiln.render("a.obj", size=(64, 48), camera={"position": [0, 0, 5]}, with_=["shadows"], up="z", smooth=True)',
        'kiln.Prepared("a.obj", up="z").render("front", samples=4, transport="path", draft=True).save(io.BytesIO())',
        'kiln.Prepared("a.obj").render_many([None], size=(64, 48), aovs=["depth"], exposure=-1.5).__next__()["depth"]',
    ]
    lines = ["import io, kiln", "import kiln.trimesh", *right, *MISTAKES_OF_TYPES]
    (tmp_path / "user.py").write_text("\n".join(lines) + "\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "user.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    wrong = {int(line.split(":")[1]) for line in done.stdout.splitlines() if line.startswith("user.py:")}
    assert wrong == set(range(len(right) + 3, len(lines) + 1)), done.stdout


def test_stubs_are_those_of_the_module():
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy.stubtest", "kiln", "--ignore-missing-stub"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_everything_public_is_documented():
    for owner in (kiln, kiln.Mesh, kiln.Instances, kiln.Picture, kiln.Scene, kiln.Prepared):
        for name, value in inspect.getmembers(owner):
            if not name.startswith("_"):
                assert inspect.getdoc(value), name


def test_examples(tmp_path, monkeypatch):
    """The examples of docs/python.md, one after the other."""
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.DOTALL)
    assert len(examples) >= 10
    names = {}
    for number, code in enumerate(examples):
        exec(compile(code, f"example {number}", "exec"), names)
    # That of the package index.
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "python" / "README.md").read_text(), re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
