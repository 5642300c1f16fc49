"""A stored case: `case.json` and `pictures.exr`, which are read back exactly or refused.

Stored cases let a report be rendered again, and a run continue without repeating finished cases.
`results.json` is the summary for other programs.
"""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from comparisons.results.case import Case, FloatArray, Images
from comparisons.results.files import plain, sealed, unsealed, write_json
from reference_rt.core.exr import read_exr, write_exr
from reference_rt.util.errors import ImageError
from reference_rt.util.files import discard, read_input, read_text

CASE, PICTURES = "case.json", "pictures.exr"

SCHEMA = 4
"""Version of the layout; raised whenever a reader of the former layout would misread the new
one."""

_NUMBER = "number"
"""The only key of an object that encodes a number that JSON lacks: {"number": "nan"}."""

_CHANNELS = "RGB"

_SIDES, _OTHERS = ("candidate", "reference"), "others"

_KEYS = {
    f.name: {"rungs": "tiers"}.get(f.name, f.name)
    for f in dataclasses.fields(Case)
    if f.name != "images"
}
"""The key in `case.json` of each field of `Case`, the pictures left out."""

_hints = get_type_hints(Case)
_CaseFields: type[BaseModel] = create_model(  # type: ignore[call-overload]
    "_CaseFields",
    __config__=ConfigDict(extra="forbid"),
    **{key: (_hints[name], ...) for name, key in _KEYS.items()},
)


class StoredCaseError(ImageError):
    """A stored case is missing, damaged, or not of this version."""


class StoredCase(BaseModel):
    """The contents of `case.json`."""

    model_config = ConfigDict(extra="forbid", strict=True)

    version: int = Field(alias="schema")
    key: str
    """Fingerprint of everything that the case depends on (`comparisons.suites.keys`); "" if it was
    not computed."""
    wall: float
    """Seconds that the case took in total."""
    case: dict[str, Any]
    pictures: dict[str, tuple[int, int]]
    """Height and width of each picture in `pictures.exr`, by name; empty without pictures."""
    sha256: str
    """Checksum of `pictures.exr`; "" without pictures."""


def write_case(folder: Path, case: Case, key: str = "", wall: float = 0.0) -> None:
    """Write `case` into `folder`, replacing the one that is there.  Raises ImageError.

    An interruption leaves the former case, the new one, or one that `read_case` refuses.
    """
    images = case.images
    document = {
        "schema": SCHEMA,
        "key": key,
        "wall": wall,
        "case": plain(
            {key: getattr(case, name) for name, key in _KEYS.items()},
            not_finite=lambda value: {_NUMBER: str(value)},
        ),
        "pictures": {},
        "sha256": "",
    }
    if images is not None:
        sizes = _write_pictures(folder / PICTURES, images, {"scene": case.scene, "key": key})
        document["pictures"] = sizes
        document["sha256"] = _digest(folder / PICTURES)
    write_json(folder / CASE, sealed(document))
    if images is None:
        discard(folder / PICTURES)


def read_case(folder: Path) -> Case:
    """The case that `write_case` wrote.  Raises RecordError.

    Pictures come back rounded to float32; arrays and tuples among the numbers of a rung as lists.
    """
    path = folder / CASE
    record = read_stored_case(folder)
    try:
        fields = _CaseFields.model_validate(_decoded(record.case))
    except ValidationError as error:
        raise StoredCaseError(f"{path}: is not a stored case: {_first(error)}") from None
    images = _read_pictures(folder / PICTURES, record) if record.pictures else None
    return Case(**{name: getattr(fields, key) for name, key in _KEYS.items()}, images=images)


def read_stored_case(folder: Path) -> StoredCase:
    """The contents of `case.json`, without the pictures.  Raises RecordError."""
    path = folder / CASE
    try:
        data = json.loads(read_text(path))
        if isinstance(data, dict) and data.get("schema") != SCHEMA:
            raise StoredCaseError(f"{path}: has another schema; expected schema {SCHEMA}")
        data = unsealed(data)
        data["pictures"] = {name: tuple(size) for name, size in data["pictures"].items()}
        return StoredCase.model_validate(data)
    except OSError as error:
        raise StoredCaseError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise StoredCaseError(f"{path}: is not a stored case: {_first(error)}") from None
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise StoredCaseError(f"{path}: is not a stored case") from None


# ---- pictures -----------------------------------------------------------------------------------


def _write_pictures(
    path: Path, images: Images, header: Mapping[str, str]
) -> dict[str, tuple[int, int]]:
    """All pictures as channels of one file, in its upper left corner; smaller ones are padded with
    NaN."""
    named = ("layers", "others")
    names = [f.name for f in dataclasses.fields(images) if f.name not in named]
    pictures = {n: getattr(images, n) for n in names if getattr(images, n) is not None}
    for layer, pair in images.layers.items():
        pictures |= {f"{side}/{layer}": one for side, one in zip(_SIDES, pair, strict=True)}
    pictures |= {f"{_OTHERS}/{whose}": picture for whose, picture in images.others.items()}
    for name, picture in pictures.items():
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
            raise ValueError(f"{name}: expected (height, width, 3), got {picture.shape}")
    height, width = (max(p.shape[axis] for p in pictures.values()) for axis in (0, 1))
    channels: dict[str, FloatArray] = {}
    for name, picture in pictures.items():
        for k, letter in enumerate(_CHANNELS):
            plane = np.full((height, width), np.nan)
            plane[: picture.shape[0], : picture.shape[1]] = picture[..., k]
            channels[f"{name}.{letter}"] = plane
    write_exr(path, channels, header)
    return {name: picture.shape[:2] for name, picture in pictures.items()}


def _read_pictures(path: Path, record: StoredCase) -> Images:
    try:
        if _digest(path) != record.sha256:
            raise StoredCaseError(f"{path}: does not have the checksum in {CASE}")
    except OSError as error:
        raise StoredCaseError(f"{path}: cannot be read: {error.strerror}") from None
    channels, _ = read_exr(path)
    try:
        pictures = {
            name: np.stack([channels[f"{name}.{c}"][:height, :width] for c in _CHANNELS], axis=-1)
            for name, (height, width) in record.pictures.items()
        }
        layers = [name.partition("/")[2] for name in pictures if name.startswith("candidate/")]
        pairs = {
            n: (pictures.pop(f"candidate/{n}"), pictures.pop(f"reference/{n}")) for n in layers
        }
        whose = [name for name in pictures if name.startswith(f"{_OTHERS}/")]
        others = {name.partition("/")[2]: pictures.pop(name) for name in whose}
        return Images(**pictures, layers=pairs, others=others)
    except (KeyError, TypeError):
        raise StoredCaseError(f"{path}: lacks a picture that {CASE} lists") from None


def _digest(path: Path) -> str:
    return hashlib.sha256(read_input(path)).hexdigest()


# ---- values -------------------------------------------------------------------------------------


def _decoded(value: Any) -> Any:
    if isinstance(value, list):
        return [_decoded(item) for item in value]
    if isinstance(value, dict):
        if value.keys() == {_NUMBER} and value[_NUMBER] in ("nan", "inf", "-inf"):
            return float(value[_NUMBER])
        return {key: _decoded(item) for key, item in value.items()}
    return value


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return f"{'.'.join(str(key) for key in first['loc'])}: {first['msg']}"
