"""Planted faults: a small change of a picture, of a scene, or of the renderer's source."""

from collections.abc import Callable
from dataclasses import dataclass

from comparisons.results.case import FloatArray
from reference_rt.rendering.scene import Scene


@dataclass(frozen=True)
class PictureFault:
    """name: in a few words;  scene: name of the scene;  change: applied to the replicates
    (replicates, height, width, 3) of the correct renderer."""

    name: str
    scene: str
    change: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class SceneFault:
    """change: applied to the scene that we render; Mitsuba renders the original."""

    name: str
    scene: str
    change: Callable[[Scene], Scene]


@dataclass(frozen=True)
class SourceFault:
    """The text `old`, which must occur once in `file` of the package, is replaced by `new`."""

    name: str
    scene: str
    file: str
    old: str
    new: str


Fault = PictureFault | SceneFault | SourceFault
