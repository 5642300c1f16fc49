"""Defaults of commands from a project's file: [tool.reference_rt.COMMAND] of its pyproject.toml."""

import os
import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from reference_rt.util.errors import UsageError, meant_by

FILE = "pyproject.toml"

SECTION = "reference_rt"
"""Of the table `tool`."""

SHARED = ("threads",)
"""Options that may stand in the section itself, for every command that has them."""


NEVER = frozenset({"command", "pair", "browser", "renderer", "scheduler", "cluster"})
"""Options that run programs, or reach others: the file may have come with somebody's scenes, and
who stands in its folder has not asked for that."""


IN_TEXTS = {
    "beside": re.compile("[^=]+=(?P<file>.+)"),
    "tone-curve": re.compile(r"(?P<file>.+?)(:[\d.eE+-]+)?"),
    "to": re.compile("(?P<file>.+)"),
    "scene": re.compile("(?P<file>.+)"),
}
"""Options whose texts may hold a path, and where.  What has no dot and no slash is the name of
something else, unless there is such a file."""


def find(folder: Path) -> Path | None:
    """The file of the project that a folder is in: the nearest with our section."""
    for parent in (folder, *folder.parents):
        path = parent / FILE
        with suppress(OSError):  # somebody else's, which may not be read
            if path.is_file() and _is_ours(path.read_bytes()):
                return path
    return None


def _is_ours(data: bytes) -> bool:
    """Whether a file has our section, or would if it were TOML."""
    if SECTION.encode() not in data:
        return False
    try:
        tool = tomllib.loads(data.decode("utf-8")).get("tool")
    except ValueError:
        return bool(_OUR_SECTION.search(data))
    return isinstance(tool, dict) and SECTION in tool


_OUR_SECTION = re.compile(
    rb"""tool["']?\s*\.\s*["']?reference_rt|^\s*["']?reference_rt["']?\s*[.=]""", re.MULTILINE
)


def read(path: Path) -> dict[str, Any]:
    """Our section of a file that has one.  Raises UsageError."""
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))["tool"][SECTION]
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: cannot be read: {error}") from None
    if not isinstance(found, dict):
        raise UsageError(f"{path}: tool.{SECTION}: expected a table")
    return found


def of_command(
    path: Path, name: str, commands: Mapping[str, Any], context: Any, complete: bool
) -> dict[str, Any]:
    """The values of the options of a command, by their parameters' names.  Paths are relative to
    the file's folder.  commands: by name;  complete: whether these are all.  Raises UsageError for
    what is no option, and for a value that is none of it."""
    section = read(path)
    shared = {key: section.pop(key) for key in SHARED if key in section}
    where = f"{path}: tool.{SECTION}"
    for table in section if complete else ():
        if table not in commands:
            raise UsageError(f"{where}.{table}: is no command{_meant(table, [*commands, *SHARED])}")
    own = section.get(name, {})
    if not isinstance(own, dict):
        raise UsageError(f"{where}.{name}: expected a table of the command's options")
    options = {
        opt.removeprefix("--"): parameter
        for parameter in commands[name].params
        for opt in parameter.opts
        if opt.startswith("--")
    }
    found = {}
    for key, value in (shared | own).items():
        option = options.get(key.replace("_", "-"))
        if option is None:
            if key in own:
                known = [option for option in options if option not in NEVER]
                raise UsageError(f"{where}.{name}.{key}: is no option{_meant(key, known)}")
            continue
        if NEVER.intersection(opt.removeprefix("--") for opt in option.opts):
            told = "expected on the command line alone, since it may run programs"
            raise UsageError(f"{where}.{name}.{key}: {told}")
        try:
            cast = option.process_value(context, value)
        except Exception as error:
            told = getattr(error, "message", str(error))
            raise UsageError(f"{where}.{name}.{key}: {told}") from None
        try:
            in_text = IN_TEXTS.get(key.replace("_", "-"))
            found[option.name] = _placed(value, cast, path.parent, in_text)
        except ValueError:
            told = f"expected a path within the file's folder, got '{value}'"
            raise UsageError(f"{where}.{name}.{key}: {told}") from None
    return found


def _placed(value: Any, cast: Any, folder: Path, in_text: re.Pattern[str] | None = None) -> Any:
    """A value; where it means a path, relative to `folder`, the path as seen from here.  Raises
    ValueError for one that leaves the folder, by a link too.  in_text: where a text holds one."""
    if isinstance(cast, list | tuple):
        return [_placed(*pair, folder, in_text) for pair in zip(value, cast, strict=True)]
    if isinstance(cast, str) and in_text and (found := in_text.fullmatch(cast)):
        file, (start, end) = found["file"], found.span("file")
        if not ("." in file or Path(file).name != file or (folder / file).is_file()):
            return value
        return f"{cast[:start]}{_placed(file, Path(file), folder)}{cast[end:]}"
    if not isinstance(cast, Path):
        return value
    (folder / cast).resolve().relative_to(folder.resolve())
    return os.path.relpath(folder / cast)


def _meant(name: str, known: list[str]) -> str:
    close = meant_by(name, known)
    return f"; expected {close[0]}" if close else f"; expected one of {', '.join(sorted(known))}"
