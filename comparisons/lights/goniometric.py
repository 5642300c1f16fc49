"""Lamps with measured intensities: our plugin `comparisons.mitsuba.plugins.goniometric`."""

import re
from pathlib import Path

import numpy as np

from comparisons.lights.light import (
    Data,
    LightType,
    Motion,
    brighter,
    check_size,
    check_upright,
    look_of,
    plain,
    similarity,
)
from comparisons.mitsuba.context import TranslationContext, rgb
from comparisons.mitsuba.node import Node, Reading, triple
from comparisons.mitsuba.parse import LookAt
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import Goniometric


def table_of(light: Goniometric, folder: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The angles in degrees, vertical (m,) and horizontal (k,), and the values (k, m) of a
    description, of a file as this second reader reads it.  Raises ValueError for a file that ours
    refuses, which says why."""
    if light.file is not None:
        light.read(folder)
        return second_reading((folder / light.file).read_bytes())
    horizontal = (0.0,) if light.horizontal_angles is None else light.horizontal_angles
    return np.array(light.vertical_angles), np.array(horizontal), np.array(light.values)


def second_reading(content: bytes) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The same of a sound LM-63 file, by the order of its numbers alone."""
    head, _, tail = content.partition(b"TILT=")
    how, _, rest = tail.replace(b"\r", b"\n").partition(b"\n")
    numbers = np.array(re.findall(rb"[-+.\deE]+", rest), np.float64)
    if how.strip() == b"INCLUDE":
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    m, k = int(numbers[3]), int(numbers[4])
    # Since 1995 the second number of the line of the ballast is no factor.
    factor = numbers[2] * numbers[10] * (1.0 if b":LM-63-" in head[:16] else numbers[11])
    vertical, horizontal, values, _ = np.split(numbers[13:], np.cumsum([m, k, k * m]))
    return vertical, horizontal, factor * values.reshape(k, m)


def _to_mitsuba(light: Goniometric, context: TranslationContext) -> Data:
    vertical, horizontal, values = table_of(light, context.folder)
    return {
        "type": "goniometric",
        "to_world": context.to_world(LookAt(light.origin, light.target, light.c0), double=True),
        "intensity": rgb(light.intensity),
        "vertical_angles": _numbers(vertical),
        "horizontal_angles": _numbers(horizontal),
        "values": _numbers(values.ravel()),
    }


def _numbers(values: FloatArray) -> str:
    return " ".join(map(repr, values.tolist()))


def _from_mitsuba(reading: Reading, node: Node) -> Goniometric:
    m, (look, _) = node.transform(), look_of(node)
    check_size(node, m[:, 2])
    rotation = similarity(node, m[:, :3])
    check_upright(node, rotation)
    origin, target, c0 = look or (
        triple(m[:, 3]),
        triple(m[:, 3] + rotation[:, 2]),
        triple(rotation[:, 1]),
    )
    vertical, horizontal, values = (
        _read_numbers(node, name) for name in ("vertical_angles", "horizontal_angles", "values")
    )
    starts = range(0, len(values), max(len(vertical), 1))
    return Goniometric(
        origin=origin,
        target=target,
        c0=c0,
        vertical_angles=vertical,
        horizontal_angles=horizontal,
        values=tuple(values[k : k + len(vertical)] for k in starts),
        intensity=plain(node, "intensity"),
    )


def _read_numbers(node: Node, name: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in node.text(name, "").split())
    except ValueError:
        raise node.error(f"'{name}' has a word that is no number; expected numbers") from None


def _moved(light: Goniometric, motion: Motion) -> Goniometric | None:
    if motion.mirrors:
        return None
    there = {"origin": motion.point(light.origin), "target": motion.point(light.target)}
    there["c0"] = motion.direction(light.c0)
    return light.model_copy(update=there | {"intensity": brighter(light.intensity, motion)})


def _brightest(light: Goniometric) -> float:
    greatest = 1.0 if light.values is None else max(map(max, light.values))
    return greatest * max(light.intensity)


GONIOMETRIC = LightType(
    description=Goniometric,
    table=None,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"goniometric": _from_mitsuba},
    to_cycles=None,
    to_gltf=None,
    to_pbrt=None,
    to_povray=None,
    moved=_moved,
    at=lambda light: light.origin,
    along=None,
    surrounds=False,
    is_bounded=True,
    projects=lambda light: True,
    brightest=_brightest,
    float32=None,
)
