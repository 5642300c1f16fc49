"""What a translation to Mitsuba knows of its scene, and what it writes differently to a scene file
than into Mitsuba's memory: maps are the steps that the scene has, images are files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.files import Files, matrix_step
from comparisons.mitsuba.parse import LookAt, Step
from comparisons.renderers import NoCounterpartError
from reference_rt.core import transform
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr
from reference_rt.materials.material import Material
from reference_rt.media import AnyMedium
from reference_rt.rendering.scene import Scene
from reference_rt.textures import Texture


class UntranslatableError(NoCounterpartError):
    """A part of a scene has no counterpart in Mitsuba."""

    def __init__(self, part: Any, kind: str) -> None:
        name = part if isinstance(part, str) else type(part).__name__
        self.part, self.kind = name, kind
        super().__init__(
            f"the {kind} {name} cannot be compared: comparisons.translator has no "
            "translation for it"
        )


@dataclass(frozen=True)
class TranslationContext:
    """The context of a translation: the scene's materials, textures and media, by name; the folder
    of its files;  has_colours: whether the material belongs to a mesh with vertex colours;
    native: use Mitsuba's own materials even where our plugins are more exact;  images: cache of
    Mitsuba's bitmaps;  files: those of the scene file that is written, None in memory;  notes: what
    the reader of that file should know."""

    materials: Mapping[str, Material]
    textures: Mapping[str, Texture]
    folder: Path
    media: Mapping[str, AnyMedium] = field(default_factory=dict)
    has_colours: bool = False
    native: bool = False
    images: dict[Any, Any] = field(default_factory=dict)
    files: Files | None = None
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, scene: Scene, native: bool = False, files: Files | None = None) -> Self:
        parts = scene.materials, scene.textures, scene.folder, scene.media
        return cls(*parts, native=native, files=files)

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    def image(self, stem: str, texels: FloatArray) -> dict[str, Any]:
        """Linear texels (height, width, channels) as parameters of a plugin: Mitsuba's image, or
        the name of a file;  stem: of that name."""
        if self.files is None:
            return {"bitmap": mitsuba().Bitmap(np.ascontiguousarray(texels, dtype=np.float32))}
        planes = dict(zip("RGB", np.moveaxis(texels, -1, 0), strict=True))
        write = self.files.write
        return {"filename": write(f"{stem}.exr", lambda file: write_exr(file, planes, {}))}

    def to_world(self, *steps: Step | LookAt, double: bool = False) -> Any:
        """The map that begins with the first step, of scales, translations and looks;  double: in
        memory of float64."""
        if self.files is not None:
            return steps
        known = mitsuba().ScalarTransform4d if double else mitsuba().ScalarTransform4f
        found = known()
        for step in reversed(steps):
            if isinstance(step, LookAt):
                found = found @ known().look_at(*map(list, step))
            else:
                found = found @ getattr(known(), step.kind)(list(step.numbers))
        return found


NO_CONTEXT = TranslationContext(materials={}, textures={}, folder=Path())
"""Of what needs none, such as filters and integrators."""


def rgb(colour: tuple[float, float, float]) -> dict[str, Any]:
    """Linear sRGB, which rgb variants use unchanged."""
    return {"type": "rgb", "value": list(colour)}


def transform_steps(steps: Any) -> tuple[Step, ...]:
    """Our transform as steps of Mitsuba's: a rotation about any axis but x, y and z as a matrix, as
    Mitsuba does not make the axis a unit vector."""
    found = []
    for step in steps:
        match step:
            case transform.Translate(translate=v):
                found.append(Step("translate", v))
            case transform.Scale(scale=v):
                found.append(Step("scale", v))
            case transform.Rotate(rotate=turn) if sorted(map(abs, turn.axis)) == [0.0, 0.0, 1.0]:
                found.append(Step("rotate", (*turn.axis, turn.degrees)))
            case _:
                found.append(matrix_step(step.matrix_of()))
    return tuple(found)
