"""The results of a run in its folder: a line for each scene, a file for each reduced finding."""

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from pydantic import ValidationError

from comparisons.experiments.fuzz.finding import Checked, Reduced
from reference_rt.util.files import replacing

SCENES = "scenes.jsonl"
FINDINGS = "findings"


def add(folder: Path, checked: Checked) -> None:
    """Append what came of a scene.  Processes append whole lines at the same time."""
    line = checked.model_dump_json().encode() + b"\n"
    folder.mkdir(parents=True, exist_ok=True)
    file = os.open(folder / SCENES, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(file, line)
    finally:
        os.close(file)


class Reader:
    """Reads what processes append: each call returns what is new."""

    def __init__(self, folder: Path) -> None:
        self._path, self._read = folder / SCENES, 0

    def new(self) -> dict[int, Checked]:
        """What was stored since the last call, by number.  A line that is not whole, of a process
        that died, is left out."""
        found: dict[int, Checked] = {}
        if not self._path.exists():
            return found
        with self._path.open("rb") as file:
            file.seek(self._read)
            text = file.read()
        whole = text[: text.rfind(b"\n") + 1]
        self._read += len(whole)
        for line in whole.splitlines():
            with suppress(ValidationError):
                checked = Checked.model_validate_json(line)
                found[checked.number] = checked
        return found


def add_reduced(folder: Path, reduced: Reduced) -> None:
    """Store a reduced finding."""
    with replacing(folder / FINDINGS / f"{reduced.number}.json") as temporary:
        temporary.write_text(reduced.model_dump_json(indent=1), encoding="utf-8")


def reduced(folder: Path) -> Iterator[Reduced]:
    """All reduced findings, by number."""
    files = sorted((folder / FINDINGS).glob("*.json"), key=lambda file: int(file.stem))
    for file in files:
        yield Reduced.model_validate_json(file.read_text(encoding="utf-8"))


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
    for name in (SCENES, "settings.json"):
        (folder / name).unlink(missing_ok=True)
    for file in (folder / FINDINGS).glob("*.json"):
        file.unlink()
