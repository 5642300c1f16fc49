"""The scene that a command is about: its argument, and options that change it."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reference_rt.util.errors import SceneError, UsageError

if TYPE_CHECKING:
    from reference_rt.rendering.scene import Scene


# ---- `-D name=value`: values for a scene of another program, whose format has such defaults ------


Defaults = Annotated[
    list[str] | None,
    typer.Option(
        "-D",
        metavar="NAME=VALUE",
        help="A value for a <default> of a Mitsuba scene; of glTF: camera, scene, environment (a "
        "file or a radiance); repeatable.",
    ),
]

AllowMissing = Annotated[
    bool,
    typer.Option(
        "--allow-missing",
        help="Leave out or replace what of an .xml, .gltf or .glb scene is not supported.",
    ),
]


def by_name(given: Sequence[str] | None) -> dict[str, str]:
    """The values by name.  Raises UsageError."""
    found: dict[str, str] = {}
    for text in given or ():
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise UsageError(f"-D: expected NAME=VALUE, such as spp=64, got '{text}'")
        if name in found:
            raise UsageError(f"-D: '{name}' is given twice; expected one value")
        found[name] = value
    return found


SceneArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE", help="A .yaml or .json scene, a glTF one, or a Mitsuba .xml one."
    ),
]

_OPTIONS = (("spp",), ("size",), ("integrator",), ("seed",))
"""Settings that errors of `with_settings` name."""


def adjusted(
    scene: "Scene",
    spp: int | None = None,
    size: str | None = None,
    integrator: str | None = None,
    seed: int | None = None,
) -> "Scene":
    """The scene with the options of the command line.  Raises UsageError."""
    from reference_rt.rendering.render import with_settings

    pixels = None
    if size is not None:
        width, _, height = size.lower().partition("x")
        if not all(n.isdecimal() and len(n) < 11 for n in (width, height)):
            raise UsageError(f"--size: expected WIDTHxHEIGHT, such as 640x480, got '{size}'")
        pixels = int(width), int(height)
    try:
        return with_settings(scene, spp=spp, size=pixels, integrator=integrator, seed=seed)
    except SceneError as error:
        if error.path in _OPTIONS:
            raise UsageError(f"--{error.path[0]}: {error.message}") from None
        raise


@contextmanager
def without_blas() -> Iterator[None]:
    """Stop Numba from importing SciPy with its first kernel to look for BLAS: 0.1 s for a feature
    that no kernel of ours uses."""
    name = "scipy.linalg.cython_blas"
    absent = name not in sys.modules
    if absent:
        sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            del sys.modules[name]
