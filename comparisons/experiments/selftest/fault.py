"""What a planted fault is: a small patch of a picture, of a scene, or of the renderer's source."""

from collections.abc import Callable
from dataclasses import dataclass

from comparisons.results.case import FloatArray
from reference_rt.rendering.scene import Scene


@dataclass(frozen=True)
class PictureFault:
    """name: in a few words;  scene: whose pictures;  change: of the replicates (replicates, height,
    width, 3) of the right renderer, given also a random generator."""

    name: str
    scene: str
    change: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class SceneFault:
    """change: of the scene that we render; Mitsuba keeps the right one."""

    name: str
    scene: str
    change: Callable[[Scene], Scene]


@dataclass(frozen=True)
class SourceFault:
    """old, new: the text of `file` of the package that is patched, which must hold `old` once."""

    name: str
    scene: str
    file: str
    old: str
    new: str


Fault = PictureFault | SceneFault | SourceFault
