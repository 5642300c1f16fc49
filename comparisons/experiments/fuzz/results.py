"""The results of a run in its folder: a file for each scene, and for each reduced finding."""

import json
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from comparisons.experiments.fuzz.finding import Checked, Reduced
from reference_rt.util.files import discard, replacing

M = TypeVar("M", Checked, Reduced)


def _file(folder: Path, kind: type[Checked] | type[Reduced], number: int | str) -> Path:
    return folder / ("findings" if kind is Reduced else "scenes") / f"{number}.json"


def add(folder: Path, one: Checked | Reduced) -> None:
    """Store what came of a scene, or a reduced finding."""
    with replacing(_file(folder, type(one), one.number)) as temporary:
        temporary.write_text(one.model_dump_json(indent=1), encoding="utf-8")


def read(folder: Path, kind: type[M], number: int) -> M | None:
    """What is stored of a scene; None where nothing is, or nothing whole."""
    with suppress(OSError, ValidationError):
        return kind.model_validate_json(_file(folder, kind, number).read_bytes())
    return None


def every(folder: Path, kind: type[M]) -> Iterator[M]:
    """All that is stored, by number."""
    files = _file(folder, kind, 0).parent.glob("*.json")
    found = (read(folder, kind, number) for number in sorted(int(file.stem) for file in files))
    yield from (one for one in found if one is not None)


def check_settings(folder: Path, settings: dict[str, object]) -> bool:
    """Whether the folder holds results of the same settings, or none; then they are stored."""
    path = folder / "settings.json"
    text = json.dumps(settings, indent=1, sort_keys=True)
    if path.exists():
        return path.read_text(encoding="utf-8") == text
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return True


def remove(folder: Path) -> None:
    """Remove the results of earlier runs."""
    discard(folder / "settings.json")
    for kind in (Checked, Reduced):
        shutil.rmtree(_file(folder, kind, 0).parent, ignore_errors=True)
