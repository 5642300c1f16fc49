"""Suites: YAML files with the budgets of the scenes in a folder, and the cases that a run makes of
them."""

import re
import warnings
from collections.abc import Iterable
from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path
from typing import Annotated, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator

from comparisons.compare.budget import Budget, Seconds
from reference_rt.cli.options import adjusted
from reference_rt.core.model import Description
from reference_rt.rendering.scene import Scene
from reference_rt.scene.model import OWN
from reference_rt.util import yaml_text
from reference_rt.util.errors import SceneError, SceneWarning, UsageError, printable
from reference_rt.util.files import not_utf8, read_text
from reference_rt.util.yaml_text import line_of

# ---- cases: scenes, changes to them, budgets ----------------------------------------------------


class Changes(BaseModel):
    """Changes to a scene by command-line options; see `reference_rt.cli.options.adjusted`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spp: int | None = None
    size: str | None = None
    seed: int | None = None
    defaults: dict[str, str] = Field(default_factory=dict)
    allow_missing: bool = False

    def on(self, path: Path) -> Self:
        """The changes that apply to a file: our own scenes have no defaults."""
        if path.suffix.lower() not in OWN:
            return self
        return self.model_copy(update={"defaults": {}, "allow_missing": False})

    def load(self, path: Path) -> Scene:
        """The scene in the file at `path`, changed.  Raises SceneError, UsageError."""
        scene = Scene.load(path, self.defaults, self.allow_missing)
        return adjusted(scene, self.spp, self.size, None, self.seed)


class Work(NamedTuple):
    """One requested case.

    name: the case's;  path: the scene's file;  scene: as read and changed, or why it is invalid;
    again: the command that repeats the case.
    """

    name: str
    path: Path
    scene: Scene | SceneError
    budget: Budget
    changes: Changes = Changes()
    again: str = ""


class Plan(NamedTuple):
    """work: the cases in order;  skipped: why other cases are not run, by name."""

    work: tuple[Work, ...]
    skipped: dict[str, str]


def read(path: Path, changes: Changes | None = None) -> Scene | SceneError:
    """The scene in the file at `path`, or why it is invalid: an invalid scene must not stop a run.
    Warnings are suppressed here; the worker reports them.  Raises UsageError."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        try:
            return (changes or Changes()).load(path)
        except SceneError as error:
            return error


def plan_of_files(paths: Iterable[Path], changes: Changes, budget: Budget) -> Plan:
    """A case for each of these files, in their order, without repeated files.

    A case is named after its file without the suffix; further cases of the same name are "NAME (2)"
    and so on.  Raises UsageError for changes that do not apply to a scene.
    """
    work: list[Work] = []
    for path in dict.fromkeys(paths):
        own = printable(path.stem)
        double = sum(printable(w.path.stem) == own for w in work)
        name = f"{own} ({double + 1})" if double else own
        work.append(Work(name, path, read(path, changes), budget, changes))
    return Plan(tuple(work), {})


def control_name(scene: str) -> str:
    """The name of the case that compares Mitsuba with itself."""
    return f"{scene} (control)"


def folder_name(case: str) -> str:
    """The folder name of a case, which needs no quoting in a shell."""
    return re.sub(r" \((\w+)\)$", r".\1", case)


# ---- suites -------------------------------------------------------------------------------------


_Scenes = dict[str, tuple[Path, Scene | SceneError]]

BUILT_IN = ("smoke", "standard", "full")

_SUFFIXES = (*OWN, ".xml", ".gltf", ".glb")


class Entry(Budget):
    """A scene's budget: the fields given here replace the defaults."""

    skip: Annotated[str, Field(min_length=1)] | None = None
    """Why the scene is not compared."""

    @field_validator("control")
    @classmethod
    def _is_not_a_field(cls, control: bool) -> bool:
        raise ValueError("cannot be set for a scene; expected the scene under 'controls' instead")

    def over(self, defaults: Budget) -> Budget:
        """`defaults`, with the fields given here replaced."""
        given = self.model_fields_set - {"skip"}
        return defaults.model_copy(update={name: getattr(self, name) for name in given})


class Part(Description):
    """Cases of one kind: comparisons, or controls."""

    defaults: Budget = Budget()
    """The budget of scenes that are not listed, and of fields that listed scenes do not set."""
    only: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    """Names of the scenes to compare; None: every scene of the folder."""
    scenes: dict[str, Entry] = Field(default_factory=dict)
    """Budgets of single scenes, by name."""


class Suite(Part):
    """Every scene of a folder, each with a budget."""

    about: str
    """A one-line description."""
    case_seconds: Seconds = 900.0
    """Time after which a case's process is ended."""
    controls: Part | None = None
    """Cases of Mitsuba against itself; None: no such cases."""


class Source(NamedTuple):
    """A suite;  argument: its name on the command line;  file, text: for error messages."""

    suite: Suite
    name: str
    argument: str
    file: str
    text: str

    def error(self, message: str, *keys: str | int) -> SceneError:
        """An error about the part at `keys`, with file and line."""
        return SceneError(message, keys, self.file, line_of(self.text, keys))


def load_suite(name: str) -> Source:
    """The suite of this name, or in the YAML file of this name.

    Raises UsageError for an unknown name, SceneError with file and line for its contents.
    """
    if name in BUILT_IN:
        file = f"{name}.yaml"
        text = (resources.files("comparisons.suites") / file).read_text(encoding="utf-8")
        return Source(parse_suite(text, file), name, name, file, text)
    path = Path(name)
    if path.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(
            f"there is no suite '{name}'; expected {', '.join(BUILT_IN)} or a .yaml file"
        )
    try:
        text = read_text(path)
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror}", file=name) from None
    except UnicodeDecodeError as error:
        raise SceneError(not_utf8(error), file=name) from None
    return Source(parse_suite(text, name), printable(path.stem), name, name, text)


def parse_suite(text: str, file: str) -> Suite:
    """A suite from YAML text; `file` is named in errors.  Raises SceneError."""
    try:
        data = yaml_text.load(text)
    except yaml_text.MalformedError as error:
        raise SceneError(f"malformed: {error}", file=file, line=error.line) from None
    if not isinstance(data, dict):
        raise SceneError("expected keys such as about, defaults, scenes", file=file, line=1)
    try:
        return Suite.model_validate(data)
    except SceneError as error:
        line = line_of(text, error.path)
        raise SceneError(error.message, error.path, file, line) from None


def plan(
    source: Source,
    folder: Path,
    only: tuple[str, ...] = (),
    rungs: tuple[str, ...] = (),
    changes: Changes | None = None,
) -> Plan:
    """The cases of a suite for a folder of scenes, ordered by name.  Reads all the scenes.

    only: shell patterns, one of which the name of a case must match;  rungs: only these, empty:
    all;  changes: to the scenes, as far as they apply.  An invalid scene is a case too.  Raises
    SceneError if the suite names a scene that does not exist, UsageError if there is nothing to
    run.
    """
    suite = source.suite
    changes = changes or Changes()
    scenes = _scenes(folder, changes)
    work: list[Work] = []
    skipped: dict[str, str] = {}
    for part, control in ((suite, False), (suite.controls, True)):
        if part is None or (control and rungs and not {"statistics", "images"} & set(rungs)):
            continue
        _check_names(part, scenes, source, *(["controls"] if control else []))
        for name, (path, scene) in scenes.items():
            if part.only is not None and printable(path.stem) not in part.only:
                continue
            case = control_name(name) if control else name
            if only and not any(fnmatchcase(case, pattern) for pattern in only):
                continue
            entry = part.scenes.get(printable(path.stem), Entry())
            if entry.skip is not None:
                skipped[case] = entry.skip
                continue
            budget = entry.over(part.defaults).model_copy(update={"control": control})
            work.append(Work(case, path, scene, budget, changes.on(path)))
    if not work:
        raise UsageError(
            f"nothing to run: no case matches {', '.join(only)}" if only else "nothing to run"
        )
    return Plan(tuple(sorted(work, key=lambda w: w.name)), skipped)


def _scenes(folder: Path, changes: Changes) -> _Scenes:
    """The scenes of a folder by case name.  Budgets name scenes without the file's suffix;
    therefore of two files with the same name only the first is valid."""
    if not folder.is_dir():
        raise UsageError(f"--scenes: there is no folder '{folder}'; expected one with scenes in it")
    found: _Scenes = {}
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES):
        name = printable(path.stem)
        if name in found:
            reason = f"has the same name as {found[name][0].name}; expected a unique name"
            found[path.name] = path, SceneError(reason, file=str(path))
        else:
            found[name] = path, read(path, changes.on(path))
    if not found:
        raise UsageError(
            f"--scenes: '{folder}' holds no scene; expected .yaml, .json, .xml, .gltf or .glb files"
        )
    return found


def _check_names(part: Part, scenes: _Scenes, source: Source, *place: str) -> None:
    """Raise SceneError for a named scene that does not exist."""
    named: list[tuple[str, tuple[str | int, ...]]] = [(n, ("scenes", n)) for n in part.scenes]
    named += [(name, ("only", k)) for k, name in enumerate(part.only or ())]
    for name, keys in named:
        if name not in scenes:
            raise source.error(f"there is no scene '{name}' in the folder", *place, *keys)
