"""Readers of other programs' scenes, which installed packages add.

A package names a module in the entry-point group `reference_rt.scene_readers`, under the suffix
without its dot.  The module has

- `read_file(path, cls, defaults, allow_missing)`: the scene in a file, an object of `cls`;
  `defaults`: the values of `-D name=value`, by name; `allow_missing`: whether to leave out what is
  not supported;
- `read_dict(scene, cls, folder)`: the same from the program's own dictionaries.
"""

import importlib.metadata
from pathlib import Path
from typing import Any

from reference_rt.util.errors import ReferenceUnavailableError, SceneError

GROUP = "reference_rt.scene_readers"

OWN = (".yaml", ".yml", ".json")
"""The suffixes of our own scenes."""

_PACKAGES = {".xml": "scenes of Mitsuba need Mitsuba: pip install 'reference-rt[compare]'"}
"""What to do about a suffix that nobody reads."""


def reader_of(path: Path) -> Any:
    """The module that reads a file of this suffix.  Raises SceneError, and
    ReferenceUnavailableError where a package is missing."""
    suffix = path.suffix.lower()
    for entry in importlib.metadata.entry_points(group=GROUP, name=suffix.removeprefix(".")):
        try:
            return entry.load()
        except ImportError as error:
            advice = _PACKAGES.get(suffix, f"{error.name} is not installed")
            raise ReferenceUnavailableError(f"{path}: {advice}") from None
    if suffix in _PACKAGES:
        raise ReferenceUnavailableError(f"{path}: {_PACKAGES[suffix]}")
    raise SceneError("is not a scene file; expected .yaml or .json", file=str(path))
