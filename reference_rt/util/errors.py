"""The errors that a user can cause, each with its exit code on the command line."""

import difflib
import inspect
import sys
from collections.abc import Iterable, Sequence


def printable(text: str, kept: str = "") -> str:
    """The text with characters that do not print (newlines, terminal codes, lone surrogates from
    file names that are not UTF-8) replaced by Python's escapes; those in `kept` stay.

    Names of files, scenes and materials may contain any characters.  All code that displays or
    writes them calls this: terminals execute such characters, XML and UTF-8 cannot represent them.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else ascii(c)[1:-1] for c in text)


_MOST_KEYS = 16
"""The most keys of a path into a scene that a message shows; the middle ones are left out."""


_OURS = """
eye origin center: position location origin from
target: look_at lookat to
reflectance base_colour radiance intensity irradiance: color colour albedo
radiance intensity irradiance: emission brightness power intensity radiance strength energy
reflectance: texture map
alpha: roughness
interior_ior eta: ior index
exponent: shininess
aperture_radius: aperture lens_radius f_stop
fov: field_of_view fovy angle
cutoff_angle: angle cone_angle
degrees: angle
file: filename
first: color1 colour1 color0 colour0
second: color2 colour2
sigma_t: density extinction
spp: samples samples_per_pixel
--spp: --samples
--size: --resolution
width+height: resolution size
max_depth: max_bounces bounces depth
transform: rotation
v0+v1+v2: vertices points
of: children operands shapes a
group: of object ref
shapes: objects world
lights: background
box: cube
disk: circle
rectangle: quad
mesh: obj ply gltf
diffuse: lambertian matte
dielectric: glass
conductor: metal
mirror: specular
principled: disney
emissive lights: light emitter area_light
directional: sun
constant: sky
environment_map: envmap hdri
bitmap: image
independent: random
path: path_tracer pathtracer
"""
"""Our words, and those of other programs and of beginners for the same.  Of several of ours the
first that is possible is meant; a plus joins two keys that are both meant."""


def meant(name: str, known: Iterable[str]) -> str:
    """ "; did you mean 'NAME'?", with the names of `meant_by`; nothing if there are none."""
    quoted = " and ".join(f"'{one}'" for one in meant_by(name, known))
    return f"; did you mean {quoted}?" if quoted else ""


def meant_by(name: str, known: Iterable[str]) -> list[str]:
    """The known names, mostly one, that mean the same as `name`, or the one that is near."""
    known = [*known]
    return means(name, known) or difflib.get_close_matches(name, known, n=1)


def means(name: str, known: Iterable[str]) -> list[str]:
    """The known names, mostly one, that mean the same as `name`."""
    lines = [line.split(":") for line in _OURS.strip().splitlines()]
    ours = [word for word, theirs in lines if name.lower() in theirs.split()]
    words = [word.split("+") for word in " ".join(ours).split()]
    same = [word for word in words if {*word} <= {*known} and word != [name]]
    return same[0] if same else []


class Brief(type):
    """Of its classes `help` shows no names that begin with an underscore."""

    def __dir__(cls) -> list[str]:
        names = [*super().__dir__()]
        return [name for name in names if name[0] != "_"] if is_help() else names


def is_help() -> bool:
    """Whether the caller was called by `help`, for the names of a class."""
    return sys._getframe(2).f_code is inspect.classify_class_attrs.__code__


class ReferenceRtError(Exception, metaclass=Brief):
    """An error whose message is one line for users; `exit_code` is what `reference-rt` returns."""

    exit_code = 5

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class UsageError(ReferenceRtError):
    """The command line asks for something that the command does not do."""

    exit_code = 2


class SceneError(ReferenceRtError):
    """A scene, or a file that it names, is invalid.

    The message is about the first problem; `others` are errors about the others, if several are
    known.  `path` are the keys that lead to the error in the scene, e.g. ``("shapes", 2,
    "radius")``; `file` and `line` (1-based) are set if the scene was read from a file.
    """

    exit_code = 3

    def __init__(
        self,
        message: str,
        path: Sequence[str | int] = (),
        file: str | None = None,
        line: int | None = None,
        others: Sequence["SceneError"] = (),
    ) -> None:
        self.message, self.path, self.file, self.line = message, tuple(path), file, line
        self.others = tuple(others)
        super().__init__(self._text())

    def _text(self) -> str:
        where = "" if self.file is None else self.file + (f":{self.line}" if self.line else "")
        names = [f"[{k}]" if isinstance(k, int) else f".{k}" for k in self.path]
        if len(names) > _MOST_KEYS:
            names[_MOST_KEYS // 2 : -_MOST_KEYS // 2] = ["..."]
        keys = "".join(names).lstrip(".")
        return ": ".join(part for part in (where, keys, self.message) if part)


MOST_TOLD = 20
"""The most errors of a scene that are told at once: one wrong default may spoil 100,000 shapes, and
the line of each takes a walk through the text."""


def together(errors: Iterable[SceneError]) -> SceneError:
    """The first of some errors, of parts that were checked one by one; `others` are the rest, each
    once, up to MOST_TOLD in all."""
    first, *rest = dict.fromkeys(one for error in errors for one in (error, *error.others))
    first.others = tuple(rest[: MOST_TOLD - 1])
    return first


class SceneWarning(UserWarning, metaclass=Brief):
    """A scene is valid, but probably not what its author meant.

    The message has the form of a `SceneError`: file, line, keys, what was found, what was expected.
    Issued through the `warnings` module; the command line prints it.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class CacheWarning(RuntimeWarning):
    """Kernels are not kept, so that each run compiles them.  Issued through the `warnings` module;
    the command line prints it."""


class ImageError(ReferenceRtError):
    """An image cannot be read, written or used."""

    exit_code = 3


class ReferenceUnavailableError(ReferenceRtError):
    """The reference renderer is missing or could not run."""

    exit_code = 4


class WorkersError(ReferenceRtError):
    """Processes or machines that a render was to be computed on are missing, differ, or died."""

    exit_code = 4
