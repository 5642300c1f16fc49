"""What a suite is: a YAML file that gives the scenes of a folder their budgets."""

from fnmatch import fnmatchcase
from importlib import resources
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field, field_validator

from comparisons.compare.budget import Budget
from comparisons.suites.work import Plan, Work, control_name, read
from reference_rt.core.model import Description, Positive
from reference_rt.rendering.scene import Scene
from reference_rt.scene import yaml_text
from reference_rt.scene.yaml_lines import line_of
from reference_rt.util.errors import SceneError, UsageError, printable
from reference_rt.util.files import read_text

_Scenes = dict[str, tuple[Path, Scene | SceneError]]

BUILT_IN = ("smoke", "standard", "full")

_SUFFIXES = (".yaml", ".yml", ".json")


class Entry(Budget):
    """What of the defaults is another for one scene."""

    skip: Annotated[str, Field(min_length=1)] | None = None
    """Why the scene is not compared."""

    @field_validator("control")
    @classmethod
    def _is_told_by_the_place(cls, control: bool) -> bool:
        raise ValueError("is told by the place; expected the scene under 'controls' instead")

    def over(self, defaults: Budget) -> Budget:
        """`defaults`, changed by what is given here."""
        given = self.model_fields_set - {"skip"}
        return defaults.model_copy(update={name: getattr(self, name) for name in given})


class Part(Description):
    """Cases of one kind."""

    defaults: Budget = Budget()
    """The budget of scenes that are not named, and of what named ones do not say."""
    only: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    """Names of scenes, all others being left out;  none: every scene of the folder."""
    scenes: dict[str, Entry] = Field(default_factory=dict)
    """Scenes by name with budgets of their own."""


class Suite(Part):
    """Every scene of a folder, each with a budget."""

    about: str
    """A line for people."""
    case_seconds: Positive = 900.0
    """How long one case may take before its process is ended."""
    controls: Part | None = None
    """Mitsuba against itself;  none: no such cases."""


class Source(NamedTuple):
    """A suite, its name, what the command line calls it, and the file it was read from with its
    text, for errors."""

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
    except UnicodeDecodeError:
        raise SceneError("is not text; expected UTF-8", file=name) from None
    return Source(parse_suite(text, name), printable(path.stem), name, name, text)


def parse_suite(text: str, file: str) -> Suite:
    """A suite from YAML text; `file` stands in errors.  Raises SceneError."""
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
    source: Source, folder: Path, only: tuple[str, ...] = (), rungs: tuple[str, ...] = ()
) -> Plan:
    """What the suite means for the scenes of a folder, all of which are read; cases are in the
    order of their names.

    only: patterns as of a shell, one of which the name of a case must fit;  rungs: only these, all
    if none.  A scene that is invalid is a case all the same.  Raises SceneError: the suite names a
    scene that is not there;  UsageError: there is nothing to run.
    """
    suite = source.suite
    scenes = _scenes(folder)
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
            work.append(Work(case, path, scene, budget))
    if not work:
        raise UsageError(
            f"nothing to run: no case fits {', '.join(only)}" if only else "nothing to run"
        )
    return Plan(tuple(sorted(work, key=lambda w: w.name)), skipped)


def _scenes(folder: Path) -> _Scenes:
    """The scenes of a folder by the names of their cases.  The suite's budgets name scenes without
    the suffix, so that of two files with the same name only the first is valid."""
    if not folder.is_dir():
        raise UsageError(f"--scenes: there is no folder '{folder}'; expected one with scenes in it")
    found: _Scenes = {}
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES):
        name = printable(path.stem)
        if name in found:
            reason = f"has the name of {found[name][0].name}; expected one of its own"
            found[path.name] = path, SceneError(reason, file=str(path))
        else:
            found[name] = path, read(path)
    if not found:
        raise UsageError(f"--scenes: '{folder}' holds no scene; expected .yaml or .json files")
    return found


def _check_names(part: Part, scenes: _Scenes, source: Source, *place: str) -> None:
    """Raise SceneError for a scene that is named but not there."""
    named: list[tuple[str, tuple[str | int, ...]]] = [(n, ("scenes", n)) for n in part.scenes]
    named += [(name, ("only", k)) for k, name in enumerate(part.only or ())]
    for name, keys in named:
        if name not in scenes:
            raise source.error(f"there is no scene '{name}' in the folder", *place, *keys)
