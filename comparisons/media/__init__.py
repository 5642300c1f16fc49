"""Media and phase functions for the comparison: to and from Mitsuba, and the media of shapes.

`phases.py` has a row for each type of phase function, `homogeneous.py` the only type of media.  To
add a phase function: a row in `phases.PHASES`.

Contract: the media inside and outside of a shape, and the camera's medium, are parts of Mitsuba's
dictionaries, each with a medium of its own.  Mitsuba's volpath and volpathmis follow them, and so
does our `comparisons.mitsuba.plugins.media_of_solids`.  Its other integrators do not: a file with
one of these is read as if it had no media.
"""

from comparisons.media.homogeneous import HOMOGENEOUS as HOMOGENEOUS
from comparisons.media.homogeneous import media_names as media_names
from comparisons.media.homogeneous import media_of_shape as media_of_shape
from comparisons.media.homogeneous import medium_of_sensor as medium_of_sensor
from comparisons.media.homogeneous import translate_medium as translate_medium
from comparisons.media.phases import PHASES as PHASES
from comparisons.media.phases import PhaseType as PhaseType
from comparisons.media.phases import type_of as type_of
from comparisons.renderers import NoCounterpartError
from reference_rt.scene.model import SceneModel


def refuse_media(scene: SceneModel) -> None:
    """For renderers that are given none.  Raises NoCounterpartError."""
    if scene.media:
        raise NoCounterpartError("media")
