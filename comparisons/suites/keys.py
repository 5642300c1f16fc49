"""Keys of stored cases: a hash of all that a case depends on."""

import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from comparisons.compare.budget import Budget
from comparisons.mitsuba.backend import Backend
from comparisons.mitsuba.parse import file_of
from comparisons.renderers import witness_facts
from comparisons.runs import provenance
from comparisons.runs.engine import key_of
from reference_rt.rendering.scene import Scene
from reference_rt.util.files import read_input, read_text

_APART = ("report", "commands", "gate", "truth", "experiments")
"""Folders of `comparisons` that do not affect the verdicts of a suite."""


def case_key(scene: Scene, budget: Budget, rungs: tuple[str, ...], backend: Backend) -> str:
    """SHA-256 of the scene and the files it names, the budget, the requested rungs, our sources,
    and the versions of the packages that compute.  Raises SceneError for a missing file."""
    return key_of(
        scene=scene.digest(),
        files=files_digest(scene),
        budget=budget.model_dump(),
        rungs=rungs,
        sources=code_fingerprint(),
        versions=provenance.package_versions(),
        variant=backend.variant,
        llvm=backend.llvm_path,
        witness=witness_facts(budget.witness),
    )


def files_digest(scene: Scene) -> str:
    """SHA-256 of the contents of every file that the scene names."""
    digest = hashlib.sha256()
    if (own := file_of(scene)) is not None:  # Mitsuba reads it, too
        digest.update(read_input(own) + repr(sorted(scene.defaults.items())).encode())
        digest.update(repr(scene.allows_missing).encode())
    for name, keys in sorted(dict(_named(scene.model_dump())).items()):
        for path in _with_parts(scene.folder / name):
            digest.update(os.fsencode(path.name) + b"\0")
            try:
                digest.update(hashlib.sha256(read_input(path)).digest())
            except (OSError, ValueError) as error:  # ValueError: not a valid file name
                reason = getattr(error, "strerror", None) or error
                raise scene.error(f"{path}: cannot be read: {reason}", *keys) from None
    return digest.hexdigest()


def _named(value: Any, *keys: str | int) -> Iterator[tuple[str, tuple[str | int, ...]]]:
    """The values of all keys `file` at any depth, each with the path of keys to it."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key == "file" and isinstance(item, str):
                yield item, (*keys, key)
            else:
                yield from _named(item, *keys, key)
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            yield from _named(item, *keys, k)


def _with_parts(path: Path) -> list[Path]:
    """The file, and for .gltf also the files that it names."""
    if path.suffix.lower() != ".gltf":
        return [path]
    try:
        data = json.loads(read_text(path))
        uris = [buffer["uri"] for buffer in data["buffers"] if "uri" in buffer]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return [path]
    return [path, *(path.parent / unquote(u) for u in uris if not u.startswith("data:"))]


def code_fingerprint() -> str:
    """The hash of the sources that verdicts depend on."""
    return provenance.code_fingerprint(*_APART)
