"""The files of a Mitsuba scene before Mitsuba's parser gets them: it and all that it includes are
regular files within limits, in UTF-8, without cycles."""

import codecs
import re
import xml.parsers.expat
from pathlib import Path

from comparisons.mitsuba.reading.foreign import OLD_ELEMENT
from reference_rt.util.errors import SceneError
from reference_rt.util.files import read_input

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
                    lambda found: self.values.get(found[1], found[0]),
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
