"""`explain --units`: what other renderers' lamps are given for the same light.

Each row was measured by rendering a wall or the lamp itself (docs/conventions.md), unless it says
that it is a specification's: pbrt's, which no package brings, and one of USD's.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import Any

from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import printable


@dataclass(frozen=True)
class Row:
    """renderer, lamp: whose lamp of what type;  write: the number that it is given, in words;
    factor: that number over ours, None where it needs a length or an angle that ours lacks;
    measured: the version that was rendered, "" for what a specification says."""

    renderer: str
    lamp: str
    write: str
    factor: float | None
    measured: str


_CYCLES, _LUX, _MITSUBA = "5.0.1", "2.11.2", "3.9.1"
_POVRAY, _RADIANCE, _TACHYON = "3.7.0.10", "6.0a", "0.99b6"
_PAGES = "three.js 0.187.0 and Babylon.js 9.28.0"
_BLENDER = "Blender 5.0.1"
"""Readers of files that were rendered."""

UNITS = {
    "point": ("intensity", "I", "W/sr"),
    "spot": ("intensity", "I", "W/sr"),
    "directional": ("irradiance", "E", "W/m²"),
    "constant": ("radiance", "L", "W/sr/m²"),
    "area": ("radiance", "L", "W/sr/m²"),
}
"""By type of lamp: our field, its letter in `ROWS`, and its unit."""


def _gltf(lamp: str, letter: str) -> tuple[Row, Row]:
    """Its units are candela and lux: browsers keep them, Blender divides them by 683 lm/W."""
    return (
        Row("glTF", lamp, f"intensity {letter}", 1.0, _PAGES),
        Row("glTF", lamp, f"intensity 683 {letter}", 683.0, _BLENDER),
    )


ROWS: dict[str, tuple[Row, ...]] = {
    "point": (
        Row("Cycles", "point", "power 4π I, W", 4.0 * pi, _CYCLES),
        Row("LuxCore", "point", "gain 4π I", 4.0 * pi, _LUX),
        Row("Mitsuba", "point", "intensity I", 1.0, _MITSUBA),
        Row("POV-Ray", "fade_power 2, fade_distance d", "rgb I / (2π d²), d small", None, _POVRAY),
        Row("Radiance", "sphere of radius r", "light I / (π r²)", None, _RADIANCE),
        Row("tachyon", "ATTENUATION 0 0 1", "COLOR I / π", 1.0 / pi, _TACHYON),
        *_gltf("point", "I"),
        Row("pbrt", "point", "I", 1.0, ""),
        Row("USD", "SphereLight of radius r", "intensity I / (π r²)", None, _BLENDER),
    ),
    "spot": (
        Row("Cycles", "spot", "power 4π I, W, whatever the cone", 4.0 * pi, _CYCLES),
        Row("LuxCore", "spot", "gain I", 1.0, _LUX),
        Row("Mitsuba", "spot", "intensity I", 1.0, _MITSUBA),
        Row("POV-Ray", "spotlight, faded as points", "rgb I / (2π d²), d small", None, _POVRAY),
        Row("Radiance", "spotlight sphere of radius r", "I / (π r²)", None, _RADIANCE),
        Row("tachyon", "SPOTLIGHT with ATTENUATION 0 0 1", "COLOR I / π", 1.0 / pi, _TACHYON),
        *_gltf("spot", "I"),
        Row("USD", "SphereLight with shaping:cone", "intensity I / (π r²)", None, _BLENDER),
        Row("pbrt", "spot", "I", 1.0, ""),
    ),
    "directional": (
        Row("Cycles", "sun", "strength E", 1.0, _CYCLES),
        Row("LuxCore", "sharpdistant", "gain E", 1.0, _LUX),
        Row("LuxCore", "distant of theta", "gain E / (π sin² theta)", None, _LUX),
        Row("Mitsuba", "directional", "irradiance E", 1.0, _MITSUBA),
        Row("POV-Ray", "parallel", "rgb E / π", 1.0 / pi, _POVRAY),
        Row("Radiance", "source of angle a", "light E / (π sin² a/2)", None, _RADIANCE),
        Row("tachyon", "DIRECTIONAL_LIGHT", "COLOR E / π", 1.0 / pi, _TACHYON),
        *_gltf("directional", "E"),
        Row("USD", "DistantLight of angle a", "intensity E / (π sin² a/2)", None, ""),
        Row("USD", "the same", "intensity E / (16π sin² a/2)", None, _BLENDER),
        Row("pbrt", "distant", "L, which is E", 1.0, ""),
    ),
    "constant": (
        Row("Cycles", "Background", "strength L", 1.0, _CYCLES),
        Row("LuxCore", "constantinfinite", "gain L", 1.0, _LUX),
        Row("Mitsuba", "constant", "radiance L", 1.0, _MITSUBA),
        Row("POV-Ray", "background, with radiosity", "rgb L", 1.0, _POVRAY),
        Row("Radiance", "glow, source of 360 degrees", "L", 1.0, _RADIANCE),
        Row("tachyon", "-add_skylight, of one colour", "L", 1.0, _TACHYON),
        Row("pbrt", "infinite", "L", 1.0, ""),
        Row("USD", "DomeLight with a color", "intensity L", 1.0, _BLENDER),
    ),
    "area": (
        Row("Cycles", "Emission", "strength L", 1.0, _CYCLES),
        Row("Cycles", "area of m² A", "power π A L, W", None, _CYCLES),
        Row("LuxCore", "emission", "gain L", 1.0, _LUX),
        Row("LuxCore", "emission of m² A", "power times efficency π A L, at theta 90", None, _LUX),
        Row("Mitsuba", "area", "radiance L", 1.0, _MITSUBA),
        Row("POV-Ray", "finish", "emission times pigment L", 1.0, _POVRAY),
        Row("Radiance", "light", "L", 1.0, _RADIANCE),
        Row("raysect", "UniformSurfaceEmitter", "L per nanometre", None, "0.9.1"),
        Row("tachyon", "AMBIENT times COLOR", "L", 1.0, _TACHYON),
        Row("pbrt", "diffuse", "L", 1.0, ""),
        Row("glTF", "emissive factor times strength", "L", 1.0, f"{_PAGES}, {_BLENDER}"),
        Row("USD", "RectLight, DiskLight", "intensity L", 1.0, _BLENDER),
    ),
}
"""By our types of lamps, what the other renderers' are given."""


def lines_of(scene: Scene) -> Iterator[str]:
    """A table for each light, and each material that emits, in text."""
    lamps: list[tuple[str, Any]] = [(f"lights[{k}]", one) for k, one in enumerate(scene.lights)]
    lamps += [
        (f"materials.{name}", material)
        for name, material in scene.materials.items()
        if material.type == "emissive"
    ]
    for place, lamp in lamps:
        kind = "area" if lamp.type == "emissive" else lamp.type
        if kind not in ROWS:
            yield f"{place}: {kind}: no row"
            continue
        name, letter, unit = UNITS[kind]
        given = getattr(lamp, name)
        values: tuple[float, ...] = given if isinstance(given, tuple) else ()
        said = " ".join(f"{v:.6g}" for v in values) if values else printable(str(given))
        yield f"{place}: {kind}, {name} {letter} = {said} {unit}"
        for row in ROWS[kind]:
            source = row.measured or "from the specification, not rendered"
            numbers = ""
            if values and row.factor is not None:
                numbers = " = " + " ".join(f"{row.factor * v:.6g}" for v in values)
            yield f"  {row.renderer} ({source}): {row.lamp}: {row.write}{numbers}"
