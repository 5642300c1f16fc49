"""Baselines: pictures that a person inspected and accepted, with their origin and the reason.

A baseline is a folder `NAME/` with its replicates, `picture-00.exr` and so on, and `baseline.json`,
which holds their SHA-256 and a checksum of itself.  Replicates are stored instead of a mean and its
variance, because the tests need to know how precise the variance is.  Only `accept` writes a
baseline: never a gate, and never in CI."""

import hashlib
import json
import os
import re
import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from comparisons.gate.copies import fingerprint
from comparisons.gate.pictures_in import Picture, read_candidate
from comparisons.gate.reference import Reference, stacked, usable
from comparisons.results.files import sealed, unsealed
from reference_rt.cli.options import adjusted
from reference_rt.core.exr import write_exr
from reference_rt.core.model import Description
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import (
    ImageError,
    ReferenceRtError,
    SceneError,
    UsageError,
    printable,
)
from reference_rt.util.files import (
    check_writable,
    kind_of,
    read_input,
    read_text,
    temporary_folder,
)

RECORD = "baseline.json"

MOST_KEPT = 8
"""Most stored pictures (7 degrees of freedom); more replicates are averaged in so many groups."""

_FILE = re.compile(r"picture-[0-9]{2}\.exr")
"""The names that `accept` gives to pictures.  A baseline may come from a stranger."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


class BaselineMissingError(ReferenceRtError):
    """There is no such baseline, or its scene has changed since it was accepted."""

    exit_code = 4


class BaselineEditedError(ImageError):
    """A baseline's files have changed since `accept` wrote them."""


class SceneOf(Description):
    """The scene that a baseline shows.  size, spp: those that were asked for instead of its own
    ("WIDTHxHEIGHT", samples per pixel)."""

    file: str
    digest: str
    size: str | None = None
    spp: int | None = None


class Former(Description):
    """The record of a replaced baseline."""

    date: str
    reason: str
    files: dict[str, str]


class Record(Description):
    """`baseline.json`.  files: SHA-256 by name;  sources: for each accepted picture its file, its
    SHA-256, the fingerprint of its pixels, and the text of its header (software, samples, seed, if
    the renderer wrote them)."""

    format: Annotated[int, Field(ge=1, le=1)] = 1
    name: str
    reason: str
    date: str
    width: int
    height: int
    replicates: int
    noise_free: bool
    quantised: bool
    scene: SceneOf | None
    sources: tuple[dict[str, Any], ...] = Field(strict=False)
    versions: dict[str, str]
    machine: str
    files: dict[str, str]
    history: tuple[Former, ...] = Field(default=(), strict=False)


@dataclass(frozen=True)
class Baseline:
    """A baseline as it was accepted: its record and its folder."""

    record: Record
    folder: Path

    def reference(self) -> Reference:
        """Its pictures.  Raises BaselineEditedError."""
        for name, digest in self.record.files.items():
            if not _FILE.fullmatch(name):
                raise BaselineEditedError(
                    f"{self.folder / RECORD}: names the file '{printable(name)}'; expected names "
                    "like picture-00.exr, of files beside it"
                )
            if _sha256(self.folder / name) != digest:
                raise BaselineEditedError(
                    f"{self.folder / name}: has changed since it was accepted (SHA-256 differs); "
                    "restore it, or accept a new baseline"
                )
        pictures = [read_candidate(self.folder / name) for name in sorted(self.record.files)]
        name = f"the baseline's, {self.record.name}"
        accepted = [str(source.get("pixels", "")) for source in self.record.sources]
        if "" in accepted:  # by a former version
            accepted = [fingerprint(picture.radiance) for picture in pictures]
        return Reference(
            stacked(pictures), None, self.record.noise_free, name, fingerprints=tuple(accepted)
        )


def check_name(name: str) -> None:
    """Refuse names that could be paths.  Raises UsageError."""
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"'{name}' is not a valid name of a baseline; expected letters, digits, '.', '_' and "
            "'-', beginning with a letter or a digit"
        )


def check_place(folder: Path, name: str) -> None:
    """Refuse a baseline that `accept` could not write.  Raises UsageError, ImageError."""
    check_name(name)
    place = folder / name
    there = kind_of(place) or ("is a link to nothing" if place.is_symlink() else "")
    if there not in ("", "is a folder"):
        raise ImageError(f"{place}: {there}; expected the folder of a baseline")
    check_writable(folder / "a baseline")


def load(folder: Path, name: str, candidates: Sequence[str] = ()) -> Baseline:
    """The baseline `name` in `folder`.

    candidates: files that the message proposes to accept if there is no such baseline.  Raises
    UsageError, BaselineMissingError, BaselineEditedError.
    """
    check_name(name)
    path = folder / name / RECORD
    if not path.exists():
        files = shlex.join(candidates) if candidates else "CANDIDATE..."
        options = shlex.join(["--name", name, "--baselines", str(folder)])
        raise BaselineMissingError(
            f"there is no baseline '{name}' in {folder}; inspect the candidate, and if it is "
            f'right: reference-rt accept {files} {options} --reason "..." [--scene SCENE]'
        )
    return Baseline(_record(path), folder / name)


def check_fresh(baseline: Baseline, digest: str, scene: str) -> None:
    """Refuse a baseline whose scene does not have this digest.  Raises BaselineMissingError."""
    accepted = baseline.record.scene
    if accepted is not None and accepted.digest != digest:
        raise BaselineMissingError(
            f"the baseline '{baseline.record.name}' is stale: {scene} has changed since it was "
            f"accepted on {baseline.record.date}; render the scene again and accept the picture"
        )


def all_in(folder: Path) -> list[Baseline]:
    """Every baseline in a folder, by name.  Raises BaselineEditedError."""
    return [Baseline(_record(path), path.parent) for path in sorted(folder.glob(f"[!.]*/{RECORD}"))]


def accept(
    folder: Path,
    name: str,
    reason: str,
    candidates: Sequence[Picture],
    *,
    scene: SceneOf | None,
    noise_free: bool,
    facts: dict[str, str],
    machine: str,
    date: str,
) -> Baseline:
    """Write the baseline `name`, whole or not at all; it replaces a former one.

    facts: versions, by package.  Raises UsageError (no reason, bad name, in CI) and ImageError
    (pictures that differ in size or cannot be a reference).
    """
    refuse_in_ci()
    check_place(folder, name)
    if not reason.strip():
        raise UsageError("--reason: is empty; expected why this picture is right")
    pictures = usable(candidates)
    former = folder / name / RECORD
    history: tuple[Former, ...] = ()
    if former.exists():
        with suppress(BaselineEditedError):  # accepting replaces an edited baseline
            old = _record(former)
            history = (*old.history, Former(date=old.date, reason=old.reason, files=old.files))
    if noise_free and len(pictures) > 1:
        raise UsageError(f"{len(pictures)} candidates without noise; expected one")
    groups = np.array_split(pictures, min(len(pictures), MOST_KEPT))
    kept = {f"picture-{k:02d}.exr": group.mean(axis=0) for k, group in enumerate(groups)}
    place = Path(os.path.realpath(folder / name))  # a link stays
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with temporary_folder(place.parent) as temporary:
            new = temporary / "new"
            for file, picture in kept.items():
                planes = dict(zip("RGB", np.moveaxis(picture, -1, 0), strict=True))
                write_exr(new / file, planes, {})
            record = Record(
                name=name,
                reason=reason.strip(),
                date=date,
                width=pictures.shape[2],
                height=pictures.shape[1],
                replicates=len(pictures),
                noise_free=noise_free,
                quantised=any(candidate.quantised for candidate in candidates),
                scene=scene,
                sources=tuple(_source(candidate) for candidate in candidates),
                versions=facts,
                machine=machine,
                files={file: _sha256(new / file) for file in kept},
                history=history,
            )
            (new / RECORD).write_text(_sealed(record), encoding="utf-8", newline="\n")
            if place.exists():
                place.rename(temporary / "old")
            new.rename(place)
    except OSError as error:
        raise ImageError(
            f"{folder / name}: cannot be written: {error.strerror}; expected a writable place"
        ) from None
    return Baseline(record, folder / name)


def refuse_in_ci() -> None:
    """Raise UsageError in an automatic run: CI services set the variable CI."""
    if os.environ.get("CI", "").lower() not in ("", "0", "false"):
        raise UsageError(
            "baselines cannot be accepted in CI (the variable CI is set); accept on your own "
            "machine, and commit the folder"
        )


def scene_of(record: Record, folder: Path) -> Scene | None:
    """The scene of a baseline in `folder`, if its file is still there.  Raises SceneError."""
    if record.scene is None:
        return None
    places = (Path(record.scene.file), folder.parent / record.scene.file)
    there = next((path for path in places if path.is_file()), None)
    if there is None:
        return None
    return adjusted(Scene.load(there), record.scene.spp, record.scene.size)


def used_in(results: Path) -> set[str]:
    """The names of the baselines that any `results.json` in or below a folder names."""
    names = set()
    for path in results.rglob("results.json"):
        with suppress(OSError, ValueError, AttributeError, KeyError, TypeError, RecursionError):
            document = json.loads(read_text(path))
            names.add(document["provenance"].get("baseline"))
    return {name for name in names if isinstance(name, str)}


def _source(picture: Picture) -> dict[str, Any]:
    source: dict[str, Any] = {"file": Path(picture.name).name}
    source["pixels"] = fingerprint(picture.radiance)
    with suppress(OSError):
        source["sha256"] = hashlib.sha256(read_input(Path(picture.name))).hexdigest()
    header = {key: value[:500] for key, value in list(picture.header.items())[:32]}
    return source | ({"header": header} if header else {})


def _sealed(record: Record) -> str:
    data = record.model_dump(mode="json")
    return json.dumps(sealed(data), indent=2, ensure_ascii=False) + "\n"


def _record(path: Path) -> Record:
    try:
        return Record.model_validate(unsealed(json.loads(read_text(path))))
    except (OSError, ValueError, KeyError, AttributeError, RecursionError, SceneError) as error:
        reason = "its fields" if isinstance(error, SceneError) else str(error)
        raise BaselineEditedError(
            f"{path}: has changed since `accept` wrote it ({' '.join(reason.split())[:100]}); "
            "restore it, or accept a new baseline"
        ) from None


def _sha256(path: Path) -> str:
    try:
        return hashlib.sha256(read_input(path)).hexdigest()
    except OSError:
        return "missing"
