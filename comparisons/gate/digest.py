"""Digests that say what has not changed: of a scene, of our sources, and of pictures."""

import hashlib
import json
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

import reference_rt
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.util.files import read_input

_URI = re.compile(rb'"uri"\s*:\s*"([^"]+)"')


def scene_digest(scene: Scene) -> str:
    """SHA-256 of all that the expected picture depends on: the files that the scene names, and its
    description, without fields that do not change the expected value."""
    description = json.loads(scene.to_json())
    for key in ("description", "hierarchy"):
        description.pop(key, None)
    if not (scene.integrator.deterministic or isinstance(scene.sampler, Grid)):
        description.pop("sampler", None)
    digest = hashlib.sha256(json.dumps(description, sort_keys=True).encode())
    for path in _files(description, scene.folder):
        with suppress(OSError):  # the loader reports a missing file
            digest.update(hashlib.sha256(read_input(path)).digest())
    return digest.hexdigest()


def _files(part: Any, folder: Path) -> Iterator[Path]:
    """The files that a description names, and those that glTF files among them name."""
    if isinstance(part, dict):
        if isinstance(part.get("file"), str):
            path = folder / part["file"]
            yield path
            if path.suffix.lower() == ".gltf":
                with suppress(OSError):
                    for uri in _URI.findall(read_input(path)):
                        if not uri.startswith(b"data:"):
                            yield path.parent / unquote(uri.decode("utf-8", "replace"))
        for value in part.values():
            yield from _files(value, folder)
    elif isinstance(part, list):
        for value in part:
            yield from _files(value, folder)


@cache
def source_digest() -> str:
    """SHA-256 of the sources of `reference_rt` and of NumPy's version."""
    package = Path(reference_rt.__file__).parent
    digest = hashlib.sha256(np.__version__.encode())
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()
