"""Files for machines, each written whole or not at all."""

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from reference_rt.util.files import open_input, replacing

# ---- values in the types of strict JSON (RFC 8259) -----------------------------------------------


def plain(value: Any, not_finite: Callable[[float], Any] = lambda value: None) -> Any:
    """`value` in JSON's types: NumPy types become Python's, dataclasses objects, and numbers that
    are not finite what `not_finite` makes of them."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return {field.name: plain(getattr(value, field.name), not_finite) for field in fields}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist(), not_finite)
    if isinstance(value, Mapping):
        return {str(key): plain(item, not_finite) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, not_finite) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return not_finite(value)
    return value


# Files with checksums that a later run continues from: a damaged file is ignored and made again.
#
# Arrays are stored in .npz archives, whose members have checksums; JSON objects get a "seal", the
# SHA-256 of their contents.


Arrays = dict[str, npt.NDArray[Any]]

SEAL = "seal"


def read_arrays(path: Path) -> Arrays:
    """The arrays that `write_arrays` wrote, by name; empty if the file is missing or damaged."""
    # A damaged file makes NumPy and zipfile raise almost anything: also RuntimeError (unsupported
    # by zipfile), SyntaxError (headers of arrays are parsed as Python) and TypeError.
    with suppress(Exception):
        return _arrays(path)
    return {}


def _arrays(path: Path) -> Arrays:
    # Opened here, since NumPy does not close a file that is no archive.
    with open_input(path) as stream, np.load(stream, allow_pickle=False) as file:
        return {name: np.array(file[name]) for name in file.files}


def write_arrays(path: Path, **arrays: npt.ArrayLike) -> None:
    """Write arrays, whole or not at all.  Raises ImageError if they cannot be written."""
    with replacing(path) as temporary:
        np.savez(temporary, **arrays)  # type: ignore[arg-type]


def sealed(data: dict[str, Any]) -> dict[str, Any]:
    """The object with a SHA-256 of its contents, against damage and edits by hand (not against
    forgery)."""
    return data | {SEAL: _digest(data)}


def unsealed(data: Any) -> dict[str, Any]:
    """The object without its seal.  Raises ValueError if its contents have changed."""
    if not isinstance(data, dict):
        raise ValueError("expected an object")
    inside = {name: value for name, value in data.items() if name != SEAL}
    if data.get(SEAL) != _digest(inside):
        raise ValueError("its seal is broken")
    return inside


def _digest(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def write_json(path: Path, document: Any) -> None:
    """Write strict JSON (RFC 8259).  Raises ValueError for a number that is not finite."""
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    with replacing(path) as temporary:
        # A lone surrogate, from a file name that is not UTF-8, becomes JSON's escape for it.
        temporary.write_text(text + "\n", encoding="utf-8", errors="backslashreplace", newline="\n")
