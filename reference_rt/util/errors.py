"""The errors that a person can cause, each with the exit code that the command line gives it."""

from collections.abc import Sequence


def printable(text: str, kept: str = "") -> str:
    """The text with Python's escapes in place of characters that do not print, such as newlines,
    terminal codes and lone surrogates (the bytes of a file name that is not UTF-8); but of `kept`.

    Names of files, scenes and materials may hold any.  What shows such a name passes it through
    here: a terminal would obey it, XML cannot hold it, UTF-8 cannot encode it.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else ascii(c)[1:-1] for c in text)


_MOST_KEYS = 16
"""Of a way through a scene that a message spells out."""


class ReferenceRtError(Exception):
    """An error with one clear line for people; `exit_code` is what `reference-rt` returns."""

    exit_code = 5

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class UsageError(ReferenceRtError):
    """A command was asked for something that it does not do."""

    exit_code = 2


class SceneError(ReferenceRtError):
    """A scene, or a file that it names, is not what it must be.

    `path` is the way through the scene's keys to the culprit, e.g. ``("shapes", 2, "radius")``;
    `file` and `line` (1-based) are added where the scene was read from a file.
    """

    exit_code = 3

    def __init__(
        self,
        message: str,
        path: Sequence[str | int] = (),
        file: str | None = None,
        line: int | None = None,
    ) -> None:
        self.message, self.path, self.file, self.line = message, tuple(path), file, line
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

    The text has the form of a `SceneError`: file, line, keys, what was found and what was expected.
    Python code sees it through the `warnings` module; the command line prints it.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))


class ImageError(ReferenceRtError):
    """An image cannot be read, written or used."""

    exit_code = 3


class ReferenceUnavailableError(ReferenceRtError):
    """The reference renderer is missing or could not run."""

    exit_code = 4
