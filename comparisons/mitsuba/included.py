"""A Mitsuba scene before it is read: its files, and what Mitsuba 3 refuses or changes.

The files are read before Mitsuba's parser gets them: the scene and all that it includes are
regular files within limits, in UTF-8, without cycles.  What Mitsuba 3 refuses or renders in another
way though its meaning is known (spellings of
Mitsuba 0.4 to 0.6, integrators for derivatives, sensors that group others) is changed in
Mitsuba's own description of the scene, so that both renderers get the same one.
"""

import codecs
import re
import xml.parsers.expat
from pathlib import Path
from typing import Any

from reference_rt.util.errors import SceneError
from reference_rt.util.files import read_input

Note = tuple[int, str]
"""The index of an element, and what was changed."""

OLD_ELEMENT = re.compile(rb"(</?)lookAt\b")
"""Mitsuba 0.6 and Mitsuba 3 spell it differently.  Everything else in camel case is upgraded by
Mitsuba's own parser."""

PRIMAL = {
    "prb": "path",
    "prb_basic": "path",
    "prb_projective": "path",
    "prbvolpath": "volpath",
    "direct_projective": "direct",
}
"""Integrators for derivatives, and those whose pictures theirs are."""

_ONLY_OF_DERIVATIVES = ("sppc", "sppp", "sppi", "guiding", "guiding_proj", "guiding_rounds",
                        "project_seed")  # fmt: skip

_WITHOUT_EFFECT = {"bitmap": ("cache", "max_anisotropy"), "hdrfilm": ("attach_log",)}
"""Parameters of Mitsuba 0.x that change no expected picture."""

LEAST_ALPHA = 1e-4
"""What Mitsuba takes for a smaller roughness (include/mitsuba/render/microfacet.h)."""


def adapt(mi: Any, state: Any) -> list[Note]:
    """Change the description; what was changed."""
    notes: list[Note] = []
    for index, node in enumerate(state.nodes):
        props, plugin = node.props, str(node.props.plugin_name())
        if plugin in PRIMAL and node.type.name == "Integrator":
            notes.append((index, _primal(props, plugin)))
        elif plugin == "batch" and node.type.name == "Sensor":
            notes += _first_of_batch(mi, state, index)
        elif plugin in ("roughconductor", "roughdielectric", "roughplastic"):
            for key in ("alpha", "alpha_u", "alpha_v"):
                value = props.get(key, 1.0)
                if isinstance(value, int | float) and 0.0 <= value < LEAST_ALPHA:
                    props[key] = LEAST_ALPHA
                    notes.append((index, f"'{key}' is {value:g}, for which Mitsuba takes 0.0001"))
        elif plugin == "bitmap" and props.get("filter_type", "") in ("trilinear", "ewa"):
            old = props["filter_type"]
            props["filter_type"] = "bilinear"
            notes.append((index, f"'{old}' filtering of Mitsuba 0.x becomes bilinear"))
        for key in _WITHOUT_EFFECT.get(plugin, ()):
            if key in props:
                del props[key]
    return notes


def _primal(props: Any, plugin: str) -> str:
    new = PRIMAL[plugin]
    for key in _ONLY_OF_DERIVATIVES:
        if key in props:
            del props[key]
    props.set_plugin_name(new)
    note = f"stands for '{plugin}', on both sides"
    if new == "direct":
        return note
    # Mitsuba's default of these (python/ad/integrators/common.py); they show what lights emit at
    # max_depth 0, too.
    depth = props.get("max_depth", 6)
    props["max_depth"] = 1 if depth == 0 else depth
    if plugin == "prbvolpath" and depth != -1:
        note += (
            ", but 'prbvolpath' counts a part of the light of paths that are one edge longer than "
            f"'max_depth' {depth}"
        )
    if plugin == "prb_basic":
        note += ", but 'prb_basic' does not meet lights without a surface"
    return note


def _children(state: Any, props: Any, kind: str) -> list[tuple[str, int]]:
    """The keys and indices of nested elements."""
    values = ((str(key), props[key]) for key in props.keys())  # noqa: SIM118
    references = [(k, v.index()) for k, v in values if type(v).__name__ == "ResolvedReference"]
    return [(k, index) for k, index in references if state.nodes[index].type.name == kind]


def _first_of_batch(mi: Any, state: Any, index: int) -> list[Note]:
    """Its first sensor in place of a batch, with the batch's sampler and its share of the film."""
    batch = state.nodes[index].props
    sensors = _children(state, batch, "Sensor")
    if not sensors:
        return []
    first = mi.Properties(state.nodes[sensors[0][1]].props)
    for kind in ("Film", "Sampler"):
        for key, _ in _children(state, first, kind):
            del first[key]
        for key, child in _children(state, batch, kind)[:1]:
            first[f"{key}_of_batch"] = mi.Properties.ResolvedReference(child)
            if kind == "Film":
                film = state.nodes[child].props
                film["width"] = int(film.get("width", 768)) // len(sensors)
    state.nodes[index].props = first
    return [(index, f"is the first of {len(sensors)} sensors of a batch; the others are left out")]


MOST_NESTED = 200
"""Most elements within each other, in a file and in the files that it includes: Mitsuba's parser
calls itself for each, and a file of a million ends the process."""

MOST_BYTES = 1 << 28
"""Of a file and all that it includes, each as often as it is included."""

MOST_FILES = 1000
"""Most files that are read for a scene, each as often as it is included."""


_LATIN = re.compile(rb"<\?xml[^>]*encoding\s*=\s*[\"'](iso-8859-1|latin1)[\"']", re.IGNORECASE)


def as_utf8(content: bytes) -> bytes:
    """A file as Mitsuba's parser converts it, with its byte order mark.  Raises ValueError."""
    for mark, encoding in (
        (codecs.BOM_UTF16_LE, "utf-16-le"),
        (codecs.BOM_UTF16_BE, "utf-16-be"),
    ):
        if content.startswith(mark):
            return content.decode(encoding).encode()
    return content.decode("latin-1").encode() if _LATIN.match(content) else content


class _TooDeepError(Exception):
    pass


class Included:
    """What `read` has found in a file and all that it includes.

    is_old: whether one has spellings of Mitsuba 0.x;  copied: the files, in whose place copies are
    parsed then, by the name under which they are included.
    """

    def __init__(self, folder: Path, values: dict[str, str]) -> None:
        self.folders, self.values = [folder], values
        self.files = self.bytes = 0
        self.is_old = False
        self.copied: dict[str, tuple[Path, bytes]] = {}

    def read(self, path: Path, name: str, around: tuple[Path, ...], depth: int) -> None:
        """Check that a file and its includes are regular, of limited size and number, in UTF-8, do
        not include themselves, and nest less deep than MOST_NESTED.  name: under which it is
        included;  around: the files that include it;  depth: of elements around it.

        Everything else that is wrong with them, Mitsuba's parser says better.  Raises SceneError.
        """
        try:
            content = read_input(path, MOST_BYTES)
        except OSError as error:
            if depth == 0:
                raise SceneError(
                    f"cannot be read: {error.strerror}; expected a scene file", file=str(path)
                ) from None
            return
        self.files, self.bytes = self.files + 1, self.bytes + len(content)
        if self.files > MOST_FILES or self.bytes > MOST_BYTES:
            raise SceneError(
                f"includes more than {MOST_FILES} files or {MOST_BYTES >> 20} MB, each as "
                "often as it is included; expected fewer",
                file=str((*around, path)[0]),
            )
        _check_utf8(path, content)
        is_inside = not Path(name).is_absolute() and ".." not in Path(name).parts
        if is_inside:
            self.copied[name] = path, content
        if OLD_ELEMENT.search(content):
            self.is_old = True
            if not is_inside:  # its copy would be written beside the folder of copies
                raise SceneError(
                    f"has <lookAt> of Mitsuba 0.x and is included as '{name}'; expected <lookat>, "
                    "or a name within the scene's folder",
                    file=str(path),
                )
        parser = xml.parsers.expat.ParserCreate()
        level, includes = 0, list[tuple[str, int, int]]()

        def start(tag: str, attributes: dict[str, str]) -> None:
            nonlocal level
            level += 1
            if depth + level > MOST_NESTED:
                raise _TooDeepError
            if tag == "default":
                self.values.setdefault(attributes.get("name", ""), attributes.get("value", ""))
            elif tag == "path" and "value" in attributes:
                self.folders += [path.parent / attributes["value"], Path(attributes["value"])]
            elif tag == "include" and "filename" in attributes:
                known = re.sub(
                    r"\$(\w+)",
                    lambda match: self.values.get(match[1], match[0]),
                    attributes["filename"],
                )
                includes.append((known, level, parser.CurrentLineNumber))

        def end(tag: str) -> None:
            nonlocal level
            level -= 1

        parser.StartElementHandler, parser.EndElementHandler = start, end
        try:
            parser.Parse(content, True)
        except _TooDeepError:
            raise SceneError(
                f"column {parser.CurrentColumnNumber + 1}: elements nest deeper than {MOST_NESTED}"
                "; expected fewer levels",
                file=str(path),
                line=parser.CurrentLineNumber,
            ) from None
        except (xml.parsers.expat.ExpatError, ValueError) as error:
            if b"<include" in content:  # Mitsuba's parser might read on where this one ends
                raise SceneError(f"is no well-formed XML: {error}", file=str(path)) from None
        around = (*around, path.resolve())
        for other, inside, line in includes:
            folders = (path.parent, *self.folders, Path())
            place = next((folder / other for folder in folders if (folder / other).is_file()), None)
            if place is None:
                continue
            if place.resolve() in around:
                cycle = [*around[around.index(place.resolve()) :], place]
                raise SceneError(
                    f"<include> of '{other}' makes a cycle ({' > '.join(p.name for p in cycle)}); "
                    "expected none",
                    file=str(path),
                    line=line,
                )
            self.read(place, other, around, depth + inside)


def _check_utf8(path: Path, content: bytes) -> None:
    """Mitsuba's parser hands on what is no UTF-8, but for comments."""
    try:
        re.sub(rb"<!--.*?-->", b"", as_utf8(content), flags=re.DOTALL).decode()
    except UnicodeDecodeError as error:
        raise SceneError(
            f"is no UTF-8 ({error.reason}: {error.object[error.start : error.start + 1]!r}); "
            "expected UTF-8, or the encoding in the <?xml ...?> line",
            file=str(path),
        ) from None
