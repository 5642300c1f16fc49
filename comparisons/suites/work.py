"""The requested cases of a run: scenes, changes to them, and budgets."""

import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field

from comparisons.compare.budget import Budget
from reference_rt.cli.adjusted import adjusted
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import SceneError, SceneWarning, printable


class Changes(BaseModel):
    """Changes to a scene by command-line options; see `reference_rt.cli.adjusted.adjusted`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    spp: int | None = None
    size: str | None = None
    seed: int | None = None
    defaults: dict[str, str] = Field(default_factory=dict)
    allow_missing: bool = False

    def on(self, path: Path) -> Self:
        """The changes that apply to a file: only Mitsuba's have defaults."""
        if path.suffix.lower() == ".xml":
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
