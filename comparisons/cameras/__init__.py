"""Cameras, film, filters and samplers for the comparison: to and from Mitsuba, and what Cycles and
the resolved data need; a file per type of cameras, whose contract is `CameraType`.

To add a camera: its file here, and a line in `CAMERAS`.  A filter: a line in `film.FILTERS`.
"""

from typing import Any, NamedTuple

from comparisons.cameras.camera import CLIP, CameraType, Data
from comparisons.cameras.central import focal
from comparisons.cameras.film import read_film
from comparisons.cameras.orthographic import ORTHOGRAPHIC
from comparisons.cameras.perspective import PERSPECTIVE
from comparisons.cameras.pinhole import PINHOLE
from comparisons.cameras.samplers import read_sampler
from comparisons.cameras.thin_lens import THIN_LENS
from comparisons.media import medium_of_sensor
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.node import Node, Reading
from reference_rt.cameras import AnyCamera, Perspective
from reference_rt.cameras.film import Film
from reference_rt.sampling import AnySampler

CAMERAS: tuple[CameraType[Any], ...] = (PERSPECTIVE, PINHOLE, THIN_LENS, ORTHOGRAPHIC)
"""All types of cameras."""

_BY_TYPE = {one.description: one for one in CAMERAS}

_BY_PLUGIN = {plugin: read for one in CAMERAS for plugin, read in one.from_mitsuba.items()}

_NO_CAMERAS = {
    "distant": "its rays start on a disk around the whole scene, or at a target from there; ",
    "irradiancemeter": "it measures on a surface, not an image; ",
}


def type_of(camera: Any) -> CameraType[Any]:
    """What is known of a camera's type.  Raises UntranslatableError for one not in CAMERAS."""
    found = _BY_TYPE.get(type(camera))
    if found is None:
        raise UntranslatableError(camera, "camera")
    return found


def translate_camera(camera: Any, film: Film, context: TranslationContext) -> Data:
    """A sensor's dict, without film and sampler.  Raises UntranslatableError."""
    return type_of(camera).to_mitsuba(camera, film, context)


class View(NamedTuple):
    """What a sensor says: `sampler` is never None."""

    camera: AnyCamera
    film: Film
    sampler: AnySampler


def read_sensor(reading: Reading, node: Node | None) -> View:
    """A sensor with its film and sampler; without one, Mitsuba's default.  Raises SceneError."""
    if node is None:
        near, far = CLIP.values()
        default = Perspective(eye=(0, 0, 0), target=(0, 0, 1), **focal(50.0), near=near, far=far)
        return View(default, read_film(reading, None)[1], read_sampler(None))
    if node.plugin not in _BY_PLUGIN:
        why = _NO_CAMERAS.get(node.plugin, "")
        raise node.unsupported(f"{why}expected one of: {', '.join(sorted(_BY_PLUGIN))}")
    medium = medium_of_sensor(reading, node)
    # The shutter has no effect: nothing moves.
    node.ignore("shutter_open", "shutter_close")
    frame, film = read_film(reading, node.only("Film"))
    sampler = read_sampler(node.only("Sampler"))
    with node.checking():
        camera = _BY_PLUGIN[node.plugin](reading, node, frame)
    node.finish()
    if medium:
        camera = camera.model_copy(update=medium)
    return View(camera, film, sampler)
