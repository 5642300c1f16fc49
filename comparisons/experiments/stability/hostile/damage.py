"""Hostile numbers and values, and ways to damage data, text and bytes."""

import copy
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz.assets import FILES, MESHES
from comparisons.experiments.fuzz.data import Way, at, named_in, numbers_in
from comparisons.experiments.fuzz.fields import Draw
from comparisons.experiments.fuzz.generate import Assembly

TINY, LEAST, MOST = 2.0**-1022, 5e-324, 1.7976931348623157e308

NUMBERS: tuple[float, ...] = (
    float("nan"), float("inf"), float("-inf"), 0.0, -0.0, LEAST, -LEAST, TINY, 1e-300, 1e-200,
    1e-160, 1e-100, 1e-30, 1e-12, 1e-6, 1e-4, 0.5, 1.0 - 2.0**-53, 1.0, 1.0 + 2.0**-52, -1.0, 2.0,
    90.0, 179.999, 180.0, 360.0, 1e6, 1e9, -1e9, 2.0**31, 2.0**53, 2.0**63, 1e30, 1e100, 1e154,
    1e160, 1e200, 1e300, -1e300, MOST, -MOST,
)  # fmt: skip
"""Limits of float64, of its squares, and of what fields allow."""

INTEGERS = (0, 1, -1, 2, 3, 64, 1024, 4096, 2**31 - 1, 2**31, 2**53 + 1, 2**63, -(2**63), 10**400)

TEXTS = (
    "", " ", "a", "1", "nan", "null", "sphere", "no such name", "ball.obj", "tiles.png", ".", "..",
    "/", "/dev/null", "/etc/hostname", "a\0b.obj", "x" * 5000, "\ud83d\ude00.png", "line\nbreak",
    "folder/ball.obj", "no.ply", "sky.exr", "C:\\ball.obj", "file:///ball.obj", "\u202egnp.obj",
)  # fmt: skip
"""Names of files and of nothing, long ones, control characters, writing from right to left."""

KEYS = ("type", "", "radius", "of", "base", "file", "transform", "\0", "x" * 300, "__class__")


@contextmanager
def deep() -> Iterator[None]:
    """Within it, trees may be copied and written that are deeper than what reads them allows."""
    usual = sys.getrecursionlimit()
    sys.setrecursionlimit(20 * usual)
    try:
        yield
    finally:
        sys.setrecursionlimit(usual)


def nodes_in(data: Any, path: Way = ()) -> Iterator[Way]:
    """The ways to everything but the whole."""
    if path:
        yield path
    if isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from nodes_in(value, (*path, key))


def pick(rng: np.random.Generator, choices: Any) -> Any:
    return choices[int(rng.integers(len(choices)))]


def number(rng: np.random.Generator, old: float) -> float | int:
    """A hostile number in place of `old`: of the list, or `old` moved by many powers of two, or by
    one unit in its last place, or with the other sign."""
    way = rng.integers(8)
    if way < 5:
        return float(pick(rng, NUMBERS)) if isinstance(old, float) else _whole(rng)
    size = float(min(max(old, -MOST), MOST))  # integers may be larger
    with np.errstate(all="ignore"):
        if way == 5:
            return float(np.ldexp(size, int(rng.integers(-1100, 1100))))
        if way == 6:
            return float(np.nextafter(size, pick(rng, (-np.inf, np.inf))))
    return -old


def _whole(rng: np.random.Generator) -> int | float:
    return pick(rng, INTEGERS) if rng.random() < 0.8 else float(pick(rng, NUMBERS))


def with_numbers(rng: np.random.Generator, base: Any, count: int) -> Any:
    """`count` of the numbers replaced by hostile ones."""
    data = copy.deepcopy(base)
    ways = list(numbers_in(data))
    for k in rng.permutation(len(ways))[:count].tolist():
        *outer, key = ways[k]
        parent = at(data, tuple(outer))
        parent[key] = number(rng, parent[key])
    return data


def anything(rng: np.random.Generator) -> Any:
    """A value of any type."""
    return pick(
        rng,
        (
            None, True, False, [], {}, [[]], [None], {"": None}, {"type": "sphere"}, [1, 2, 3],
            [0.0] * 100, pick(rng, TEXTS), pick(rng, INTEGERS), float(pick(rng, NUMBERS)),
        ),
    )  # fmt: skip


def with_structure(rng: np.random.Generator, base: Any, count: int) -> Any:
    """`count` changes of what is where: values of other types, keys that are missing, new or
    moved, parts copied to other places, lists that are long, trees that are deep."""
    data = copy.deepcopy(base)
    for _ in range(count):
        ways = list(nodes_in(data))
        if not ways:
            break
        *outer, key = pick(rng, ways)
        parent = at(data, tuple(outer))
        _change(rng, data, ways, parent, key)
    return data


def _change(rng: np.random.Generator, data: Any, ways: list[Way], parent: Any, key: Any) -> None:
    way = int(rng.integers(9))
    old = parent[key]
    if way == 0:
        parent[key] = anything(rng)
    elif way == 1:
        del parent[key]
    elif way == 2 and isinstance(parent, dict):
        parent[pick(rng, KEYS)] = anything(rng)
    elif way == 3:
        parent[key] = copy.deepcopy(at(data, pick(rng, ways)))
    elif way == 4 and isinstance(old, list) and old:
        parent[key] = old * int(pick(rng, (2, 3, 20)))
    elif way == 5 and isinstance(old, dict) and "type" in old:
        parent[key] = nested(rng, old)
    elif way == 6:
        parent[key] = [old]
    elif way == 7 and isinstance(old, str):
        parent[key] = pick(rng, TEXTS)
    elif isinstance(old, int | float) and not isinstance(old, bool):
        parent[key] = number(rng, old)
    else:
        parent[key] = anything(rng)


def nested(rng: np.random.Generator, part: Any) -> Any:
    """Set operations of it, one in the other."""
    for _ in range(int(pick(rng, (1, 3, 60, 300)))):
        part = {"type": pick(rng, ("union", "intersection", "difference")), "of": [part]}
    return part


def as_text(data: Any) -> str:
    """As JSON; NaN and infinity as JavaScript writes them, which Python's reader takes."""
    return json.dumps(data)


def as_yaml(data: Any) -> str:
    """As YAML, a key of the whole per line."""
    if not isinstance(data, dict) or not data:
        return as_text(data)
    text = "\n".join(f"{json.dumps(str(key))}: {as_text(value)}" for key, value in data.items())
    for name, yaml in (("-Infinity", "-.inf"), ("Infinity", ".inf"), ("NaN", ".nan")):
        text = text.replace(name, yaml)
    return text + "\n"


_BYTES = b"\0\xff\x7f\x80\xc3 \n\t0123456789-+.einf/\\#:,[]{}&*!|>'\"%@`"

YAML_PIECES = (
    b"&a [*a]", b"*a", b"&a ", b"<<: *a\n", b"!!python/object/apply:os.getcwd []", b"!!binary aGk=",
    b"!!set {a, b}", b"---\n", b"...\n", b"\xef\xbb\xbf", b"\xff\xfe", b"? ", b"- ", b"{" * 2000,
    b"[" * 2000, b"&x [" * 40, b"%YAML 9.9\n", b"0o777", b"1e999", b"2001-99-99", b"12:30:45", b"~",
    b"9" * 5000, b"\xe2\x80\xa8", b"\xed\xa0\x80", b"'", b"|\n", b"shapes: []\n", b"\x07",
)  # fmt: skip
"""What YAML gives a meaning to: anchors, aliases, tags, marks of order, other documents."""


def damaged(rng: np.random.Generator, content: bytes, count: int, pieces: Any = ()) -> bytes:
    """`count` damages of bytes: flipped bits, others put in place, cut out, repeated, cut off."""
    data = bytearray(content)
    for _ in range(count):
        if not data:
            break
        where = int(rng.integers(len(data)))
        way = int(rng.integers(7 if pieces else 6))
        if way == 0:
            data[where] ^= 1 << int(rng.integers(8))
        elif way == 1:
            data[where] = _BYTES[int(rng.integers(len(_BYTES)))]
        elif way == 2:
            del data[where : where + int(rng.integers(1, 40))]
        elif way == 3:
            data[where:where] = data[where : where + int(rng.integers(1, 400))]
        elif way == 4:
            data[where : where + 4] = _number_bytes(rng)
        elif way == 5:
            del data[where:]
        else:
            data[where:where] = pick(rng, pieces)
    return bytes(data)


def _number_bytes(rng: np.random.Generator) -> bytes:
    """A hostile number as files hold it: as text, as float32, as an integer."""
    way = rng.integers(3)
    if way == 0:
        return str(pick(rng, NUMBERS)).encode()
    if way == 1:
        with np.errstate(over="ignore"):
            return np.float32(pick(rng, NUMBERS)).tobytes()
    return np.uint32(pick(rng, (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 10**9))).tobytes()


def sentence(rng: np.random.Generator, share: float, folder: Path) -> Any:
    """A scene of the fuzzer in which each number is hostile, and each name another one of the
    scene's, which may be the part's own, with the chance `share`; a third as often is a value of
    another type, or what is where has changed.

    Never of a fine mesh or rough plastic: plain Python takes 10 s to make their tables; `LAYERS`
    has the latter."""
    scene = Assembly(Draw(rng), {}, folder)
    scene.names.files = FILES | {"mesh": MESHES}
    data = scene.data()
    for material in data.get("materials", {}).values():
        if material["type"] == "rough_plastic":
            material.clear()
            material["type"] = "plastic"
    names = [name for key in ("materials", "textures", "groups") for name in data.get(key, ())]
    for part, key in [*named_in(data)]:
        if names and rng.random() < share:
            part[key] = pick(rng, names)
    data = with_numbers(rng, data, int(rng.binomial(sum(1 for _ in numbers_in(data)), share)))
    count = int(rng.binomial(sum(1 for _ in nodes_in(data)), share / 3.0))
    return with_structure(rng, data, count)
