"""Files that a later run continues from: what is damaged is not believed, and made again.

Arrays lie in .npz archives, whose members have checksums; JSON objects have a seal.
"""

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.util.files import open_input, replacing

Arrays = dict[str, npt.NDArray[Any]]

SEAL = "seal"


def read_arrays(path: Path) -> Arrays:
    """The arrays that `write_arrays` wrote, by name; none where the file is missing or damaged."""
    # NumPy and zipfile raise whatever the damage leads them to: also RuntimeError, for what zipfile
    # cannot do, SyntaxError, since headers of arrays are parsed as Python, and TypeError.
    with suppress(Exception):
        return _arrays(path)
    return {}


def _arrays(path: Path) -> Arrays:
    # Opened here, since NumPy leaves a file that is no archive open.
    with open_input(path) as stream, np.load(stream, allow_pickle=False) as file:
        return {name: np.array(file[name]) for name in file.files}


def write_arrays(path: Path, **arrays: npt.ArrayLike) -> None:
    """Write arrays, whole or not at all.  Raises ImageError where that is not possible."""
    with replacing(path) as temporary:
        np.savez(temporary, **arrays)  # type: ignore[arg-type]


def sealed(data: dict[str, Any]) -> dict[str, Any]:
    """The object with a digest of all that it holds: against damage and edits by hand, not against
    forgers."""
    return data | {SEAL: _digest(data)}


def unsealed(data: Any) -> dict[str, Any]:
    """The object that was sealed.  Raises ValueError where it is not as it was."""
    if not isinstance(data, dict):
        raise ValueError("expected an object")
    inside = {name: value for name, value in data.items() if name != SEAL}
    if data.get(SEAL) != _digest(inside):
        raise ValueError("its seal is broken")
    return inside


def _digest(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
