"""The options of `kiln render` for type checkers, from the command. After a change of them,
`KILN_BLESS=1 cargo test --lib options_of_python` writes this file again."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Union

if TYPE_CHECKING:
    from typing import TypeAlias

    import numpy as np
    from numpy.typing import NDArray

    _Value: TypeAlias = Union[
        str, float, os.PathLike[str], Sequence[Any], Mapping[str, Any], np.generic, NDArray[Any], None
    ]


class ReadOptions(TypedDict, total=False):
    """How files are read."""

    time: _Value
    variant: _Value
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] | None
    smooth: bool | _Value
    clip: str | int | Sequence[str | int] | None
    material: str | int | Sequence[str | int] | None
    hide: str | int | Sequence[str | int] | None
    isolate: str | int | Sequence[str | int] | None
    ignore_required_extensions: bool | None
    allow_outside_references: bool | None


class ViewOptions(ReadOptions, total=False):
    """Those of pictures but for camera, size and samples."""

    view: Literal["front", "back", "left", "right", "top", "bottom", "iso"] | None
    look_at: _Value
    projection: Literal["perspective", "orthographic", "panoramic"] | None
    crop: _Value
    environment: _Value
    environment_rotation: _Value
    environment_intensity: _Value
    hide_environment: bool | None
    with_: str | int | Sequence[str | int] | None
    without: str | int | Sequence[str | int] | None
    azimuth: _Value
    elevation: _Value
    zoom: _Value
    fov: _Value
    numerics: Literal["fast", "watertight", "double", "exact"] | None
    shading: Literal["flat", "ambient", "diffuse", "phong"] | None
    transport: Literal["whitted", "path"] | None
    clamp: _Value
    depth_specular: _Value
    filter: Literal["box", "tent", "gaussian", "mitchell"] | None
    filter_radius: _Value
    noise: _Value
    min_samples: _Value
    same_grain: bool | None
    seed: _Value
    sampler: Literal["sobol", "independent"] | None
    colour: Literal["display", "u8", "linear"] | None
    exposure: _Value
    tone_map: Literal["none", "pbr-neutral", "agx", "filmic"] | None
    bits: _Value
    dither: bool | None
    light: Literal["head", "none"] | None
    ground: bool | None
    cull: bool | None
    background: _Value
    bvh: Literal["fast-build", "balanced", "best-trace"] | None
    depth: _Value
    draft: bool | None
    threads: _Value


class SizedOptions(ViewOptions, total=False):
    """Those of pictures but for the camera."""

    size: _Value
    samples: _Value


class RenderOptions(SizedOptions, total=False):
    """All."""

    camera: _Value
