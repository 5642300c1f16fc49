"""`reference-rt selftest`: does the harness fail if the renderer is wrong, and only then?

Sensitivity: faults are planted in pictures (`of_pictures`), scenes (`of_scenes`) and the renderer's
source (`of_sources`; `of_readers` and `of_transport`: those that both renderers may share; of media
both kinds in `of_media`), and compared with a suite's budgets; a `fault.Finding` says whether a
fault was caught, and at which rung.  `power`: the fraction of runs that catch a fault, by its size;
`calibration`: how often the bias that a verdict states as detectable is detected.  `mutation`:
random changes of the kernels (`mutants`), and what the rungs say to them.  `specificity`: right
renderers of twelve kinds (`right`) are judged with many seeds, and false alarms are counted.

`mirrored`: mistakes in our renderer and in our code on Mitsuba's side at once (`of_mirrored`):
which other sources and cases of truth see them.

`of_limits`: gross faults in stress scenes, of which no limit may excuse any (slow tests).

To add a fault of pictures: a function with `planted`, or a row of `FAULTS`, in `of_pictures`.  Of
scenes and sources: a row of their tables, which says what is planted, where, and if one rung must
see it, which; a source fault's old text must occur exactly once.
"""

from comparisons.experiments.selftest import (
    of_media,
    of_pictures,
    of_readers,
    of_scenes,
    of_sources,
    of_transport,
)
from comparisons.experiments.selftest.fault import Fault, PictureFault, SceneFault, SourceFault

FAULTS: tuple[Fault, ...] = (
    *of_pictures.FAULTS,
    *(*of_scenes.FAULTS, *of_scenes.OF_MATERIALS, *of_scenes.OF_SHAPES),
    *(*of_sources.FAULTS, *of_sources.OF_KERNELS, *of_readers.FAULTS),
    *of_transport.FAULTS,
    *of_media.FAULTS,
)

__all__ = ["FAULTS", "Fault", "PictureFault", "SceneFault", "SourceFault"]
