"""Simpler numbers, and smaller pictures."""

import math
from collections.abc import Iterator
from typing import Any

from comparisons.experiments.fuzz.data import Data, copy_of
from comparisons.experiments.fuzz.reduce.edits import fixes_view

_FIXED = {"faces", "seed", "spp", "width", "height"}


def simpler_numbers(scene: Data) -> Iterator[Data]:
    """Each number as 0, 1, a whole number, or one of fewer digits."""
    for path in [*_numbers(scene, ())]:
        value = _at(scene, path)
        for other in simpler(float(value), digits_only=fixes_view(path)):
            smaller = copy_of(scene)
            _at(smaller, path[:-1])[path[-1]] = other
            yield smaller


def simpler(x: float, digits_only: bool = False) -> list[float]:
    """Numbers to try in place of x, the simplest first; none as long as x itself.  digits_only:
    only those near x."""
    size = len(_short(x))
    found = [] if digits_only else [0.0, 1.0, -1.0]
    found.append(float(round(x)))
    if x != 0.0 and math.isfinite(x):
        found += [float(f"{x:.1g}"), float(f"{x:.2g}")]
    kept = [y for y in dict.fromkeys(found) if y != x and len(_short(y)) < size]
    if x == -1.0:
        kept = [] if digits_only else [1.0, 0.0]
    return [] if x in (0.0, 1.0) else kept


def _short(x: float) -> str:
    return repr(x).replace("-", "").removesuffix(".0")


def _numbers(part: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    if isinstance(part, bool):
        return
    if isinstance(part, int | float):
        yield path
    elif isinstance(part, dict):
        for key, value in part.items():
            if key not in _FIXED:
                yield from _numbers(value, (*path, key))
    elif isinstance(part, list):
        for k, value in enumerate(part):
            yield from _numbers(value, (*path, k))


def _at(part: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        part = part[key]
    return part


def smaller_pictures(scene: Data) -> Iterator[Data]:
    """Half as wide, half as high, both."""
    film = scene.get("film", {})
    width, height = film.get("width", 256), film.get("height", 256)
    for w, h in ((width // 2, height // 2), (width // 2, height), (width, height // 2)):
        if w >= 3 and h >= 3 and (w, h) != (width, height):
            smaller = copy_of(scene)
            smaller["film"] = {**film, "width": w, "height": h}
            yield smaller
