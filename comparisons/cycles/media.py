"""Media for Cycles, whose volumes are exact where each point of space is in one at most.

Cycles adds the coefficients of all volumes that a point is in, where our medium takes the place of
the one around it; and where the ends of two volumes coincide it may count one of them twice
(measured: a box of the optical depth 1 on another one).  So volumes must be apart from each other.
The world's volume, which is everywhere, is the medium of a camera, if no surface bounds any.
"""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from comparisons.cycles.surfaces import type_name
from comparisons.geometry.flatten import Leaf
from comparisons.media import type_of as type_of_phase
from comparisons.renderers import NoCounterpartError
from comparisons.renderers.vocabulary import Data
from comparisons.shapes import type_of as type_of_shape
from reference_rt.core.arrays import FloatArray
from reference_rt.materials import Emissive
from reference_rt.media import AnyMedium
from reference_rt.rendering.scene import Scene

MOST_VOLUMES = 256
"""Shapes with media, each of which is compared with each other one."""


def volume_of(medium: AnyMedium) -> list[Data]:
    """Parts whose coefficients Cycles adds: each has a phase function of its own.  Raises
    NoCounterpartError."""
    to_cycles = type_of_phase(medium.phase).to_cycles
    if to_cycles is None:
        raise NoCounterpartError(f"the phase function {medium.phase.type}")
    sigma_t = np.array(medium.sigma_t) * medium.scale
    scattered = sigma_t * np.array(medium.albedo)
    absorbed = (sigma_t - scattered).tolist()
    return [
        {
            "absorption": absorbed if k == 0 else [0.0] * 3,
            "scatter": (share * scattered).tolist(),
            **function,
        }
        for k, (share, function) in enumerate(to_cycles(medium.phase))
    ]


@dataclass
class Volumes:
    """The media of a scene as volumes.  outlines: the vertices (n, 3) of shapes with media in
    them."""

    scene: Scene
    outlines: list[FloatArray] = field(default_factory=list)

    def world(self) -> list[Data] | None:
        """The volume of the world; None without a medium around the camera.  Raises
        NoCounterpartError."""
        name = self.scene.camera.medium
        if name is None:
            return None
        members = [s for shapes in self.scene.groups.values() for s in shapes]
        for shape in (*self.scene.shapes, *members):
            if getattr(shape, "interior", None) or getattr(shape, "exterior", None):
                raise NoCounterpartError("surfaces that bound media around a camera in a medium")
        return volume_of(self.scene.media[name])

    def inside(self, leaf: Leaf, vertices: FloatArray, shader: Data) -> list[Data] | None:
        """The volume of a shape with these vertices; None where no light gets.  Raises
        NoCounterpartError."""
        shape = leaf.shape
        if leaf.exterior is not None:
            raise NoCounterpartError("a medium outside of a surface")
        if leaf.interior is None:
            return None
        if not type_of_shape(shape).encloses(shape):
            raise NoCounterpartError(
                f"a medium in the shape {type_name(shape)}, which may not be closed"
            )
        if shader["type"] != "clear" and "'glass'" not in str(shader):
            return None
        if len(self.outlines) == MOST_VOLUMES:
            raise NoCounterpartError(f"more than {MOST_VOLUMES} shapes with media in them")
        self.outlines.append(vertices)
        return volume_of(self.scene.media[leaf.interior])

    def check_lamps(self) -> None:
        """Cycles loses light that a medium scatters back to the lamp that reflected it (findings,
        `cycles-lamps-in-fog`).  Raises NoCounterpartError."""
        scatter = any(any(medium.albedo) for medium in self.scene.media.values())
        materials = self.scene.materials.values()
        if scatter and any(isinstance(m, Emissive) and m.base is not None for m in materials):
            raise NoCounterpartError("lamps that reflect, beside media that scatter")

    def check_places(self) -> None:
        """Raises NoCounterpartError for volumes that are not apart, and for a camera in one."""
        if any(not _apart(a, b) for a, b in combinations(self.outlines, 2)):
            raise NoCounterpartError("media in shapes that are not apart from each other")
        if any(not _apart(outline, np.array([self.scene.camera.eye])) for outline in self.outlines):
            raise NoCounterpartError("a camera in the hull of a shape with a medium")


def _apart(a: FloatArray, b: FloatArray) -> bool:
    """Whether a plane across an axis, or across the line between their middles, is between two sets
    of points."""
    for axis in (*np.eye(3), a.mean(axis=0) - b.mean(axis=0)):
        one, other = a @ axis, b @ axis
        if one.max() < other.min() or other.max() < one.min():
            return True
    return False
