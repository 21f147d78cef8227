"""Scenes and their pictures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Union, overload

from . import _kiln, _toml

if TYPE_CHECKING:
    from typing import TypeAlias

    import numpy as np
    from numpy.typing import ArrayLike, DTypeLike, NDArray

    from typing_extensions import Unpack

    from ._kiln import _Preset, _Tier
    from ._options import ReadOptions, RenderOptions, SizedOptions, ViewOptions

    # Any is a mesh or a scene of trimesh.
    _Source: TypeAlias = str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | bytes | Mapping[str, Any] | Any


def _is_bool(value: Any) -> bool:
    """Whether a value is a bool of Python or numpy."""
    is_scalar = getattr(value, "ndim", None) == 0
    return isinstance(value, bool) or is_scalar and value.dtype.kind == "b"


def _text(value: Any, name: str) -> str:
    if getattr(value, "ndim", None) == 0:
        value = value.item()
    if isinstance(value, (str, os.PathLike)):
        return _toml.unicode(os.fspath(value), name)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        # Beyond 2**53, where not all integers are floats, they keep their exponent.
        is_whole = isinstance(value, float) and value.is_integer() and abs(value) <= 2**53
        return repr(int(value) if is_whole else value)
    raise TypeError(f"{name}: expected text or numbers, not {type(value).__name__}")


def _options(options: Mapping[str, Any]) -> list[tuple[str, bool | list[str] | None]]:
    """Options as their names and the texts of their values."""

    def texts(name: str, value: Any) -> bool | list[str] | None:
        if value is None:
            return None
        if _is_bool(value):
            return bool(value)
        if isinstance(value, Mapping):
            return [_toml.value(value, name)]
        if isinstance(value, (list, tuple)) or getattr(value, "ndim", 0) > 0:
            return [_text(part, name) for part in value]
        return [_text(value, name)]

    return [(_toml.unicode(name, "options"), texts(name, value)) for name, value in options.items()]


def _dtype(given: Any) -> str:
    """The name of a type of pixels."""
    if isinstance(given, str) and given in ("uint8", "float32"):
        return given
    from numpy import dtype  # importing kiln does not import numpy

    try:
        name: str = dtype(given).name
        return name
    except Exception:  # of a type that depends on what is given
        if isinstance(given, str):
            raise ValueError(f"dtype: {given!a} is neither uint8 nor float32") from None
        raise TypeError(f"dtype: expected a type of numpy or its name, not {type(given).__name__}") from None


def _files(source: Any) -> list[str | os.PathLike[str]]:
    """The files of a source that is one or several."""
    files = [source] if isinstance(source, (str, os.PathLike)) else source
    wrong = type(source).__name__
    if isinstance(files, Iterable):
        files = list(files)
        others = [type(file).__name__ for file in files if not isinstance(file, (str, os.PathLike))]
        if not others:
            # The command's name of standard input is a file here.
            return [os.path.join(os.curdir, "-") if os.fspath(file) == "-" else file for file in files]
        wrong = f"{wrong} of {others[0]}"
    raise TypeError(f"source: expected a file, Scene, dict, bytes or a mesh of trimesh, not {wrong}")


def _load(source: _Source, options: Mapping[str, Any], with_picture: bool) -> _kiln.Scene:
    """Reads a scene; without `with_picture`, options of the picture are an error."""
    named = _options(options)
    if isinstance(source, Scene):
        if any(value is not None for _, value in named):
            raise ValueError("options of how files are read are for the Scene() that has read them")
        return _kiln.Scene(source._scene)
    if isinstance(source, Mapping):
        source = _toml.document(source).encode()
    elif hasattr(source, "export"):  # of trimesh
        source = source.export(file_type="glb")
    if isinstance(source, (bytes, bytearray, memoryview)):
        return _kiln.Scene.parse(bytes(source), named, with_picture)
    files = _files(source)
    for file in files:
        os.stat(file)  # raises FileNotFoundError and the like
    return _kiln.Scene.load(files, named, with_picture)


class Scene:
    """A scene: meshes, spheres, disks, materials, lights and cameras.

    source: a file or several (.toml, .obj, .gltf, .glb, .ply, .stl, .off, .3mf), the contents of a file as bytes, the
    keys of a scene file as a dict (docs/scene-files.md), a mesh or a scene of trimesh, a Scene to copy, or nothing.
    options: those of `kiln render` that say how files are read, such as up="z" or smooth=30.

    Scenes from a scene file or a dict are rendered as these say; others get a default look: light, ground, background.
    Raises ValueError for contents that cannot be used, OSError for files that cannot be opened; warns (KilnWarning)
    of what is left out. Any number of threads may use and change a scene.
    """

    def __init__(self, source: _Source = None, **options: Unpack[ReadOptions]) -> None:
        if source is None and options:
            names = ", ".join(ascii(name)[1:-1] for name in options)
            raise ValueError(f"{names}: a Scene without a source is empty and has no options")
        self._scene = _kiln.Scene() if source is None else _load(source, options, False)

    def add(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        material: str | Mapping[str, Any] | None = None,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        colours: ArrayLike | None = None,
        transforms: ArrayLike | None = None,
        name: str = "mesh",
    ) -> None:
        """Adds triangles; nothing if it raises.

        Triangles with a coordinate beyond 1e18 are left out, with a warning (KilnWarning), and the indices are those of
        the other triangles.

        vertices: (n, 3) float64. faces: (m, 3) integers, counterclockwise seen from the front.
        material: the name of a material of the scene, or the keys of one in scene files, such as {"colour": "#b5651d"}.
        normals: (n, 3) shading normals. uvs: (n, 2) texture coordinates, (0, 0) at the texture's top left corner.
        colours: (n, 3), multiplied with the material's: uint8 in sRGB, or float in linear light, 0 to 1.
        transforms: (k, 4, 4) affine maps, one for each instance. name: the object's.
        """
        chosen: str | _kiln.Scene | None
        if isinstance(name, str):
            _toml.unicode(name, "name")
        if isinstance(material, Mapping):
            try:
                chosen = _load({"material": {f"{name} {len(self.materials)}": dict(material)}}, {}, False)
            except ValueError as error:
                raise ValueError("material" + str(error).removeprefix("source:1")) from None
        else:
            chosen = _toml.unicode(material, "material") if isinstance(material, str) else material
        self._scene.add(vertices, faces, name, chosen, normals, uvs, colours, transforms)

    def update(self, source: _Source, **options: Unpack[ReadOptions]) -> None:
        """Adds all of another scene, given as for Scene(): for example cameras and lights from a dict. Of settings of
        the whole picture that both have, the earlier ones stay."""
        self._scene.append(_load(source, options, False))

    def mesh(self, *, tier: _Tier = "double", preset: _Preset = "balanced") -> _kiln.Mesh:
        """The triangles, spheres and disks of the scene as it is now, for queries.

        The `triangle` of a result is the index in its `object`; that of a sphere or a disk is 0. `all` returns the
        nearer hit of a sphere, `crossings` both.
        """
        return self._scene.mesh(tier, preset)

    @property
    def bounds(self) -> list[list[float]] | None:
        """The least and the greatest corner of the bounding box; None without objects."""
        return self._scene.bounds()

    @property
    def cameras(self) -> list[str]:
        """The names of the cameras."""
        return self._scene.names()[0]

    @property
    def materials(self) -> list[str]:
        """The names of the materials."""
        return self._scene.names()[1]

    @property
    def objects(self) -> list[str]:
        """The names of the objects, by the indices of the AOV `object`."""
        return self._scene.names()[2]

    def __copy__(self) -> Scene:
        return Scene(self)

    def __deepcopy__(self, _memo: Any) -> Scene:
        return Scene(self)

    def __len__(self) -> int:
        """The number of triangles, spheres and disks."""
        return len(self._scene)

    def __repr__(self) -> str:
        return f"<kiln.Scene of {len(self)} primitives in {len(self.objects)} objects>"

    def _repr_png_(self) -> bytes | None:
        """A picture for notebooks."""
        return render(self, size=(512, 384))._repr_png_() if len(self) else None


def camera_rays(
    camera: Mapping[str, Any], size: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rays through the pixel centres of a picture: origins and directions of length 1, each (height, width, 3)
    float64.

    camera: the keys of one in scene files, such as {"position": [0, 0, 5], "look_at": [0, 0, 0], "vertical_fov": 40}.
    size: width and height in pixels.
    """
    from operator import index  # takes integers of numpy, too

    try:
        width, height = map(index, size)
    except (TypeError, ValueError):
        raise ValueError(f"size: expected width and height in pixels, not {size!a}") from None
    return _kiln.camera_rays(_toml.value(camera, "camera"), (width, height))


def pinhole_rays(
    K: ArrayLike, pose: ArrayLike, size: tuple[int, int], *, axes: Literal["opencv", "opengl"] = "opencv"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rays of a pinhole camera, as camera_rays() returns them.

    K: (3, 3) intrinsic matrix in pixels, in which the centre of the first pixel, top left, is (0, 0) as in OpenCV; or
    [fx, fy, cx, cy]. pose: (4, 4), world from camera. size: width and height in pixels.
    axes: those of the camera: "opencv" has y down and z ahead, "opengl" y up and z backwards.
    """
    from numpy import shape  # importing kiln does not import numpy

    for name, value, shapes in (("K", K, [(3, 3), (4,)]), ("pose", pose, [(4, 4)])):
        if shape(value) not in shapes:
            expected = " or ".join(map(str, shapes))
            raise ValueError(f"{name}: expected the shape {expected}, not {shape(value)}")
    return camera_rays({"K": K, "pose": pose, "axes": axes}, size)


def render(
    source: Scene | _Source,
    *,
    dtype: Literal["uint8", "float32"] | DTypeLike = "uint8",
    aovs: str | Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[RenderOptions],
) -> _kiln.Picture:
    """Renders a picture as the command `kiln render` does.

    source: a Scene, or what Scene() takes.
    dtype: "uint8" for display values, "float32" for values before exposure, tone map and encoding; or numpy's types.
    aovs: the names of further arrays, such as "depth" and "normal" (docs/aovs.md), or "all".
    progress: called with the number of finished tiles and of all tiles, from the calling thread.
    options: those of `kiln render` (docs/command-line.md), `-` as `_`: size=(640, 480), samples=64, camera="front",
    view="iso", transport="path", background="transparent", with_=["shadows"], draft=True, ... A camera may be a dict
    with the keys of one in scene files.

    Raises ValueError for options and scenes that cannot be used, and KeyboardInterrupt at once; warns (KilnWarning) of
    what the command warns of.
    """
    _check_progress(progress)
    scene = source._scene if isinstance(source, Scene) else _load(source, options, True)
    return _kiln.render(scene, _options(options), _dtype(dtype), _aov_names(aovs), progress)


def _check_progress(progress: Any) -> None:
    if progress is not None and not callable(progress):
        raise TypeError(f"progress: expected a function, not {type(progress).__name__}")


def _aov_names(aovs: str | Sequence[str]) -> list[str]:
    if isinstance(aovs, str):
        aovs = [name.strip() for name in aovs.split(",")]
    names = list(aovs) if isinstance(aovs, Iterable) else [aovs]
    for name in names:
        if not isinstance(name, str):
            raise TypeError(f"aovs: expected names, not {type(name).__name__}")
        _toml.unicode(name, "aovs")
    return names


Camera = Union[str, Mapping[str, Any]]


def _with_camera(options: _kiln.Options, camera: Camera | None) -> _kiln.Options:
    if camera is None:
        return options
    text = _toml.value if isinstance(camera, Mapping) else _text
    return options.with_camera(text(camera, "camera"))


class Prepared:
    """A scene prepared for pictures by many cameras. Its trees are built at the first picture, and again for options
    that change tier, preset, colours, environment, background or look. Later changes of the scene have no effect. Any
    number of threads may use it.

    source: a Scene, or what Scene() takes. options: as for render(), for all pictures that have no others.
    """

    def __init__(self, source: Scene | _Source, **options: Unpack[RenderOptions]) -> None:
        self._scene = _kiln.Scene(source._scene) if isinstance(source, Scene) else _load(source, options, True)
        self._options = options
        self._prepared = _kiln.Prepared(self._scene, self._parsed({}))

    def render(
        self,
        camera: Camera | None = None,
        *,
        dtype: Literal["uint8", "float32"] | DTypeLike = "uint8",
        aovs: str | Sequence[str] = (),
        progress: Callable[[int, int], None] | None = None,
        **options: Unpack[SizedOptions],
    ) -> _kiln.Picture:
        """Renders the picture that render() does with the same options.

        camera: the name of one of the scene, or a dict with the keys of one in scene files, such as {"K": ...,
        "pose": ..., "axes": "opencv"}; None for the default one. The rest is as for render().
        """
        _check_progress(progress)
        parsed = _with_camera(self._parsed(options), camera)
        return self._prepared.render(parsed, _dtype(dtype), _aov_names(aovs), progress)

    @overload
    def render_many(
        self,
        cameras: Iterable[Camera | None],
        *,
        size: tuple[int, int],
        samples: int | None = None,
        aovs: str | Sequence[str] = (),
        picture: Literal[False] = False,
        progress: Callable[[int, int], None] | None = None,
        **options: Unpack[ViewOptions],
    ) -> Iterator[dict[str, NDArray[np.float32] | NDArray[np.int32]]]: ...
    @overload
    def render_many(
        self,
        cameras: Iterable[Camera | None],
        *,
        size: tuple[int, int],
        samples: int | None = None,
        aovs: str | Sequence[str] = (),
        picture: Literal[True],
        progress: Callable[[int, int], None] | None = None,
        **options: Unpack[ViewOptions],
    ) -> Iterator[_kiln.Picture]: ...
    def render_many(
        self,
        cameras: Iterable[Camera | None],
        *,
        size: tuple[int, int],
        samples: int | None = None,
        aovs: str | Sequence[str] = (),
        picture: bool = False,
        progress: Callable[[int, int], None] | None = None,
        **options: Unpack[ViewOptions],
    ) -> Iterator[Any]:
        """An iterator over pictures by each camera, rendered as it advances: a dict of AOVs by name, as those of a
        Picture; with `picture` a Picture.

        cameras: as for render(). size: width and height in pixels. samples: 1 if neither this nor the options of the
        scene give another number. aovs: the names of arrays, such as "depth" and "object". progress: called with the
        number of finished pictures and of all.
        """
        _check_progress(progress)
        number: Any = self._options.get("samples", 1) if samples is None else samples
        parsed, names = self._parsed({"size": size, "samples": number, **options}), _aov_names(aovs)
        return self._rendered([_with_camera(parsed, camera) for camera in cameras], names, picture, progress)

    def _rendered(
        self,
        options: list[_kiln.Options],
        aovs: list[str],
        picture: bool,
        progress: Callable[[int, int], None] | None,
    ) -> Iterator[Any]:
        for done, parsed in enumerate(options, 1):
            result: Any
            if picture:
                result = self._prepared.render(parsed, "uint8", aovs, None)
            else:
                result = self._prepared.aovs(parsed, aovs)
            if progress is not None:
                progress(done, len(options))
            yield result

    @property
    def objects(self) -> list[str]:
        """The names of the objects, by the indices of the AOV `object`."""
        return self._scene.names()[2]

    def _parsed(self, options: Mapping[str, Any]) -> _kiln.Options:
        return _kiln.Options(_options({**self._options, **options}))
