"""The real numbers of a scene's description: what a picture has derivatives by.

A parameter is named by its path: `materials.red.reflectance[0]`, `shapes[3].radius`,
`camera.eye[1]`, `shapes[0].transform[1].rotate.degrees`.  Which there are follows from the
description itself: every field below `PARTS` that holds a float, in tuples and arrays too.  A value
that one number may stand for (grey for a colour, one factor of a scale) is a parameter as a whole
as well: all its numbers move alike, along (1, 1, 1).  Whole numbers, names and what is not set are
none.
"""

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, reduce
from itertools import islice
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from reference_rt.core.model import Description
from reference_rt.scene.model import SceneModel
from reference_rt.util.errors import UsageError, meant

PARTS = ("camera", "textures", "materials", "media", "shapes", "groups", "lights")
"""The parts of a scene that say what is seen.  The others (film, sampler, integrator) say how."""

Keys = tuple[str | int, ...]


class Parameter(NamedTuple):
    """path: its name;  value: a number, or those of a whole that move alike;  keys: the path as
    keys;  scale: the size of what it is a part of, above 0, in the parameter's unit."""

    path: str
    value: float | tuple[float, ...]
    keys: Keys
    scale: float


def parameters(scene: SceneModel) -> Iterator[Parameter]:
    """All parameters, in the order of the description."""
    for name in PARTS:
        yield from _below(scene, (name,))


def parameter(scene: SceneModel, path: str) -> Parameter:
    """The parameter of a path.  Raises UsageError, which names those that are near."""
    value, keys, rest = _walked(scene, path)
    if rest:
        why, advice = _missing(value, keys, rest)
        raise UsageError(f"{path}: {why}{_near(scene, path, keys)}{advice}")
    if _is_number(value) or _is_whole(scene, keys, value):
        return _made(scene, keys, value)
    raise UsageError(f"{path}: {_no_number(value)}{_near(scene, path, keys)}")


S = TypeVar("S", bound=SceneModel)


def moved(scene: S, path: str | Parameter, step: float) -> S:
    """The scene with `step` added to a parameter, checked again.  Raises UsageError for a path that
    is none, SceneError for a value that the scene may not have."""
    of = parameter(scene, path) if isinstance(path, str) else path

    def add(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(x + step for x in value)
        return float(value) + step

    first, *rest = of.keys
    return scene.changed(**{str(first): _put(getattr(scene, str(first)), rest, add)})


# ---- the description as a tree ------------------------------------------------------------------


def _children(part: Any) -> Iterator[tuple[str | int, Any]]:
    if isinstance(part, SceneModel):
        yield from ((name, getattr(part, name)) for name in PARTS)
    elif isinstance(part, Description):
        yield from ((name, getattr(part, name)) for name in type(part).__pydantic_fields__)
    elif isinstance(part, Mapping):
        yield from part.items()
    elif isinstance(part, tuple) or (isinstance(part, np.ndarray) and part.dtype.kind == "f"):
        yield from enumerate(part)


def _child(part: Any, key: str | int) -> Any:
    return getattr(part, str(key)) if isinstance(part, Description) else part[key]


def _is_number(value: Any) -> bool:
    """Strict validation makes floats of the numbers of real fields, and of no others."""
    return isinstance(value, float)


def _is_whole(scene: SceneModel, keys: Keys, value: Any) -> bool:
    """Whether one number may stand for these."""
    if not isinstance(value, tuple) or len(value) < 2 or not all(map(_is_number, value)):
        return False
    # The field of a description that holds it, and the keys within the field.
    part: Any = scene
    owner: Description = scene
    at = 0
    for k, key in enumerate(keys):
        if isinstance(part, Description):
            owner, at = part, k
        part = _child(part, key)
    field, within = str(keys[at]), keys[at + 1 :]
    one = _put(getattr(owner, field), within, lambda numbers: numbers[0])
    try:
        _validator(type(owner), field).validate_python(one)
    except ValidationError:
        return False
    return True


@cache
def _validator(cls: type[Description], field: str) -> TypeAdapter[Any]:
    info = cls.__pydantic_fields__[field]
    kind: Any = Annotated[(info.annotation, *info.metadata, None)]
    return TypeAdapter(kind, config=ConfigDict(strict=True))


def _below(scene: SceneModel, keys: Keys) -> Iterator[Parameter]:
    value = reduce(_child, keys, scene)
    if _is_number(value):
        yield _made(scene, keys, value)
        return
    if _is_whole(scene, keys, value):
        yield _made(scene, keys, value)
    for key, _ in _children(value):
        yield from _below(scene, (*keys, key))


def _made(scene: SceneModel, keys: Keys, value: Any) -> Parameter:
    number = value if isinstance(value, tuple) else float(value)
    return Parameter(_text(keys), number, keys, _scale(scene, keys, number))


def _scale(scene: SceneModel, keys: Keys, value: float | tuple[float, ...]) -> float:
    """A number's own magnitude, or 1.  A number of a vector has that of the vector, but at most
    that of the single numbers beside it: a ball far away moves by parts of its radius; where the
    vector is 0, the least that is beside it.  An array has its extent."""
    holder = reduce(_child, keys[:-1], scene)
    if isinstance(value, float) and isinstance(holder, Description):
        return abs(value) or 1.0
    part: Any = scene
    owner: Description = scene
    array = None
    for key in keys:
        owner = part if isinstance(part, Description) else owner
        array = part if isinstance(part, np.ndarray) and part.ndim == 2 else array
        part = _child(part, key)
    if array is not None:
        return float(np.ptp(array, axis=0).max()) or 1.0
    fields = [field for _, field in _children(owner)]
    beside = [abs(x) for x in fields if _is_number(x)]
    if size := _size(value if isinstance(value, tuple) else holder):
        beside.append(size)
    else:
        beside += [_size(x) for x in fields if isinstance(x, tuple)]
    return min((x for x in beside if x > 0.0), default=1.0)


def _size(numbers: Any) -> float:
    return max((abs(x) for x in numbers if _is_number(x)), default=0.0)


def _put(part: Any, keys: Sequence[str | int], change: Callable[[Any], Any]) -> Any:
    """A copy of a part with what is at the keys changed, checked again."""
    if not keys:
        return change(part)
    key, rest = keys[0], keys[1:]
    new = _put(_child(part, key), rest, change)
    if isinstance(part, Description):
        given = {name: getattr(part, name) for name in part.model_fields_set}
        return type(part)(**given | {str(key): new})
    if isinstance(part, Mapping):
        return {**part, key: new}
    if isinstance(part, tuple):
        return tuple(new if k == key else old for k, old in enumerate(part))
    copy = part.copy()
    copy[key] = new
    return copy


# ---- paths --------------------------------------------------------------------------------------


def _text(keys: Keys) -> str:
    return "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in keys).lstrip(".")


def _walked(scene: SceneModel, path: str) -> tuple[Any, Keys, str]:
    """What a path leads to, its keys, and what of the path leads nowhere.  A name may hold dots:
    the longest one that fits is meant."""
    part: Any = scene
    keys: Keys = ()
    rest = f".{path.strip()}"
    while rest:
        fits = [
            (len(text), key, child)
            for key, child in _children(part)
            if rest.startswith(text := f"[{key}]" if isinstance(key, int) else f".{key}")
            and rest[len(text) :][:1] in ("", ".", "[")
        ]
        if not fits:
            break
        length, key, part = max(fits, key=lambda found: found[0])
        keys, rest = (*keys, key), rest[length:]
    return part, keys, rest


def _missing(part: Any, keys: Keys, rest: str) -> tuple[str, str]:
    """Why what is left of a path leads nowhere, and what was meant."""
    where = f"'{_text(keys)}'" if keys else "the scene"
    known = [key for key, _ in _children(part)]
    if not known:
        return f"{where} {'is a number' if _is_number(part) else _no_number(part)}", ""
    if isinstance(known[0], int):
        return f"{where} has the numbers 0 to {known[-1]}, got '{rest.lstrip('.')}'", ""
    name = rest.lstrip(".").partition(".")[0].partition("[")[0]
    return f"{where} has no '{name}'", meant(name, map(str, known))


def _no_number(value: Any) -> str:
    if value is None:
        return "is not set: what stands for it does not move; give it a value"
    if isinstance(value, bool | int):
        return f"is {value}, which is no real number: a picture has no derivative by it"
    if isinstance(value, str):
        return f"is '{value}', a name: a picture has no derivative by it"
    return "holds several values"


_SEARCHED = 20_000
"""Parameters among which near ones are looked for: a mesh has millions."""


def _near(scene: SceneModel, path: str, keys: Keys) -> str:
    """What can be asked instead: the nearest below the longest part of the path that exists."""
    for length in range(len(keys), -1, -1):
        below = _below(scene, keys[:length]) if length else parameters(scene)
        paths = [one.path for one in islice(below, _SEARCHED)]
        if paths:
            near = difflib.get_close_matches(path, paths, n=4, cutoff=0.0)
            return f"; expected such as {', '.join(near)}"
    return "; the scene has no parameters"
