"""The errors that a user can cause, each with its exit code on the command line."""

import difflib
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


_OURS = {
    "albedo": "reflectance base_colour",
    "area_light": "emissive",
    "background": "lights",
    "bounces": "max_depth",
    "brightness": "radiance intensity irradiance",
    "circle": "disk",
    "color": "reflectance base_colour radiance intensity irradiance",
    "colour": "reflectance base_colour radiance intensity irradiance",
    "cube": "box",
    "depth": "max_depth",
    "diffuse_color": "reflectance base_colour diffuse",
    "disney": "principled",
    "emission": "radiance intensity irradiance",
    "emitter": "emissive",
    "envmap": "environment_map",
    "filename": "file",
    "from": "eye origin position",
    "glass": "dielectric",
    "gltf": "mesh",
    "hdri": "environment_map",
    "index": "interior_ior eta",
    "intensity": "radiance irradiance",
    "ior": "interior_ior eta",
    "lambertian": "diffuse",
    "light": "emissive lights",
    "location": "eye position center origin",
    "look_at": "target",
    "lookat": "target",
    "matte": "diffuse",
    "max_bounces": "max_depth",
    "metal": "conductor",
    "obj": "mesh",
    "objects": "shapes",
    "origin": "eye position",
    "path_tracer": "path",
    "pathtracer": "path",
    "ply": "mesh",
    "position": "eye origin center",
    "power": "intensity radiance irradiance",
    "quad": "rectangle",
    "radiance": "intensity irradiance",
    "resolution": "width+height",
    "rotation": "transform",
    "roughness": "alpha",
    "--samples": "--spp",
    "samples": "spp",
    "samples_per_pixel": "spp",
    "scale": "transform",
    "size": "width+height",
    "--resolution": "--size",
    "sky": "constant",
    "specular": "mirror",
    "sun": "directional",
    "to": "target",
    "translate": "transform",
    "world": "shapes",
}
"""Words of other programs, and of beginners: ours in their place, the first that is possible; with
a plus between those of two keys."""


def meant(name: str, known: Iterable[str]) -> str:
    """ "; did you mean 'NAME'?", with the names of `meant_by`; nothing if there are none."""
    quoted = " and ".join(f"'{one}'" for one in meant_by(name, known))
    return f"; did you mean {quoted}?" if quoted else ""


def meant_by(name: str, known: Iterable[str]) -> list[str]:
    """The known names, mostly one, that mean the same as `name`, or the one that is near."""
    known = [*known]
    words = [one.split("+") for one in _OURS.get(name.lower(), "").split()]
    same = [word for word in words if {*word} <= {*known}]
    return same[0] if same else difflib.get_close_matches(name, known, n=1)


class ReferenceRtError(Exception):
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


class SceneWarning(UserWarning):
    """A scene is valid, but probably not what its author meant.

    The message has the form of a `SceneError`: file, line, keys, what was found, what was expected.
    Issued through the `warnings` module; the command line prints it.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class ImageError(ReferenceRtError):
    """An image cannot be read, written or used."""

    exit_code = 3


class ReferenceUnavailableError(ReferenceRtError):
    """The reference renderer is missing or could not run."""

    exit_code = 4


class WorkersError(ReferenceRtError):
    """Processes or machines that a render was to be computed on are missing, differ, or died."""

    exit_code = 4
