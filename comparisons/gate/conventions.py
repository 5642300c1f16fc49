"""What other renderers' pictures have otherwise than ours, as data, each measured.

A convention of the picture (mirrored, a shift, a falloff of the camera) is undone by `Changes`
exactly; what numbers of lights mean is a convention of the scene's text, which is undone only where
the numbers were copied as they stand.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, fields, replace
from typing import Literal

import numpy as np

from comparisons.results.case import FloatArray

LIGHTS = {
    "point": "intensity",
    "spot": "intensity",
    "directional": "irradiance",
    "constant": "radiance",
}
"""The types of lights whose numbers other renderers have too, and the field of ours."""


@dataclass(frozen=True)
class Changes:
    """What happened to a right picture.

    mirrored, upside_down: it was turned so, before anything else is measured;  right, down: pixels
    by which what it shows lies further right and down, once it is turned back;  cosine: its values
    are multiplied by the cosine between the pixel's ray and the direction of view;  lights: by
    type, how many times as bright as ours with the same number;  fov: the side that the number of
    the angle of view spans, if that is not the width;  unfaded: light of a point does not fall with
    the square of the distance;  codes: one of CODES, "" for none.
    """

    mirrored: bool = False
    upside_down: bool = False
    right: float = 0.0
    down: float = 0.0
    cosine: bool = False
    lights: dict[str, float] = field(default_factory=dict)
    fov: Literal["", "larger", "y"] = ""
    unfaded: bool = False
    codes: str = ""

    def __bool__(self) -> bool:
        return self != Changes()

    def parts(self) -> "list[Changes]":
        """Each change alone, and all; a shift is one change."""
        alone = [
            Changes(**{f.name: getattr(self, f.name)})
            for f in fields(self)
            if f.name not in ("right", "down")
        ]
        found = [Changes(right=self.right, down=self.down), *alone, self]
        return [one for k, one in enumerate(found) if one and one not in found[:k]]

    def seen(self, kinds: Collection[str]) -> "Changes":
        """Those that a scene with these types of lights shows."""
        return replace(self, lights={k: v for k, v in self.lights.items() if k in kinds})

    def words(self) -> tuple[str, ...]:
        """Each change for people, such as "one pixel low"."""
        said = ["mirrored left to right"] if self.mirrored else []
        said += ["upside down"] if self.upside_down else []
        shifts = ((self.right, "to the right", "to the left"), (self.down, "low", "high"))
        moved = [f"{_pixels(x)} {plus if x > 0.0 else minus}" for x, plus, minus in shifts if x]
        said += [" and ".join(moved)] if moved else []
        said += ["darker by the cosine to the direction of view"] if self.cosine else []
        said += [
            f"numbers of {type_} lights {_times(factor)} as bright"
            for type_, factor in sorted(self.lights.items())
        ]
        sides = {"larger": "longer side", "y": "height"}
        said += [f"the angle of view spans the {sides[self.fov]}"] if self.fov else []
        said += ["lights of points do not fade with distance"] if self.unfaded else []
        said += [self.codes] if self.codes else []
        return tuple(said)


def _shared_exponent(p: FloatArray) -> FloatArray:
    """Mantissas of 8 bits below the exponent of the largest channel, cut off."""
    step = np.exp2(np.frexp(p.max(axis=-1, keepdims=True))[1] - 8.0)
    return np.asarray(np.floor(p / step) * step)


CODES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "an exponent for three channels, mantissas cut off": _shared_exponent,
    "mantissas of 8 bits over 255": lambda p: p * (256.0 / 255.0),
}
"""What files, or those who read them, make of values (height, width, 3)."""


_NAMED = {0.5: "half a pixel", 0.25: "a quarter of a pixel", 1.0: "one pixel"}


def _pixels(shift: float) -> str:
    return _NAMED.get(abs(shift), f"{abs(shift):.3g} pixels")


def _times(factor: float) -> str:
    known = {math.pi: "π times", 1.0 / (4.0 * math.pi): "1/(4π) times"}
    near = [word for value, word in known.items() if math.isclose(value, factor, rel_tol=1e-12)]
    return near[0] if near else f"{factor:.4g} times"


@dataclass(frozen=True)
class Known:
    """A renderer that was measured.

    title: its name;  version: which was measured;  glass: whether radiance in glass is divided by
    the square of the index, None: unknown;  said: what a picture has besides that cannot be undone;
    changes: of its pictures, and of numbers of lights;  also: others, of its defaults, files or
    memory, which are named where they are left in, and not undone by `--from`.
    """

    title: str
    version: str
    glass: bool | None
    said: tuple[str, ...]
    changes: Changes = Changes()
    also: tuple[Changes, ...] = ()

    @property
    def whose(self) -> str:
        """Such as "LuxCore 2.11.2's"."""
        return f"{self.title} {self.version}'s"

    @property
    def picture(self) -> Changes:
        """The changes that hold for any scene's text."""
        return replace(self.changes, lights={})


_QUARTER = 1.0 / (4.0 * math.pi)
BOTTOM_FIRST = Changes(upside_down=True)
LONGER, TALL = Changes(fov="larger"), Changes(fov="y")
UNFADED = Changes(lights={"point": math.pi}, unfaded=True)

RENDERERS = {
    "babylon": Known(
        "Babylon.js",
        "9.35.0",
        None,
        (
            "pictures that are read back have the bottom row first",
            "lights of a StandardMaterial do not fade with distance, and its values are shown as "
            "they are, without an encoding; a PBRMaterial's are radiance, with directional lights "
            "as ours",
            "a StandardMaterial's highlights are Blinn's without the cosine",
            "the angle of view is vertical",
        ),
        Changes(mirrored=True, lights={"directional": math.pi}),
        (BOTTOM_FIRST, TALL, UNFADED),
    ),
    "cycles": Known(
        "Cycles",
        "5.0.1",
        False,
        (
            "its first sample of each pixel lies at the pixel's centre",
            "its default filter is Blackman-Harris, 1.5 pixels wide",
            "the angle of view spans the longer side",
        ),
        Changes(lights={"point": _QUARTER, "spot": _QUARTER}),
        (LONGER,),
    ),
    "luxcore": Known(
        "LuxCore",
        "2.11.2",
        True,
        ("the angle of view spans the longer side", "memory has the bottom row first"),
        Changes(down=1.0, lights={"point": _QUARTER}),
        (BOTTOM_FIRST, LONGER),
    ),
    "mitsuba": Known(
        "Mitsuba",
        "3.9.1",
        True,
        (
            "its default filter is a Gaussian of 0.5 pixels",
            "its integrator `direct` adds up the samples of point and directional lamps",
        ),
    ),
    "povray": Known(
        "POV-Ray",
        "3.7.0.10",
        False,
        (
            "its light sources do not fade with distance unless they are told to, and then as "
            "2 / (1 + (distance / fade_distance)^fade_power): a point's number is that of a light "
            "that fades so beyond a small fade_distance, whose square over 2 it is divided by",
            "a camera whose `right` is positive mirrors right-handed scenes",
            "a background lights nothing without `radiosity`",
        ),
        Changes(lights={"point": math.pi, "spot": math.pi, "directional": math.pi}),
        (
            UNFADED,
            Changes(mirrored=True),
            Changes(codes="an exponent for three channels, mantissas cut off"),
        ),
    ),
    "radiance": Known(
        "Radiance",
        "6.0a",
        True,
        (
            "its samples are moved at random within pixels by -pj, and left out by -ps",
            "its lamps are spheres, rings and discs, and are seen",
            "a spotlight's direction is as long as the point lies behind the lamp from which its "
            "light spreads",
        ),
    ),
    "raysect": Known(
        "raysect",
        "0.9.1",
        False,
        ("frames are indexed by column and row", "the angle of view spans the longer side"),
        Changes(cosine=True),
        (LONGER,),
    ),
    "tachyon": Known(
        "tachyon",
        "0.99b6",
        None,
        (
            "its files of 8 bits have codes in proportion to radiance, rounded down",
            "its point lights are seen as balls, and do not fade with distance without ATTENUATION",
            "highlights are Blinn's, with the exponent of Phong's, without -shade_phong",
        ),
        Changes(
            mirrored=True,
            right=0.5,
            down=0.5,
            lights={"point": math.pi, "spot": math.pi, "directional": math.pi},
        ),
        (UNFADED,),
    ),
    "three": Known(
        "three.js",
        "0.187.0",
        None,
        (
            "pictures that are read back have the bottom row first",
            "highlights of MeshPhongMaterial are Blinn's times (n + 2) / (8π) and the cosine",
            "a Reflector without a colour shows 0.42 of what it mirrors below 0.5, and "
            "1.58 times as much less 0.58 above",
            "the angle of view is vertical",
        ),
        also=(BOTTOM_FIRST, TALL, Changes(codes="mantissas of 8 bits over 255")),
    ),
}
"""By the name that `gate --from` takes; measured by `python docs/measure_conventions.py NAME`."""
