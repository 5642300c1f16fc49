"""Does the harness fail when the renderer is wrong, and pass when only the noise differs?

Sensitivity: faults are planted, and the suites are asked whether they see them.  Specificity: the
right renderer is judged with many seeds, and the false alarms are counted.
"""

from comparisons.experiments.selftest import of_pictures, of_scenes, of_sources
from comparisons.experiments.selftest.fault import Fault, PictureFault, SceneFault, SourceFault

FAULTS: tuple[Fault, ...] = (*of_pictures.FAULTS, *of_scenes.FAULTS, *of_sources.FAULTS)

__all__ = ["FAULTS", "Fault", "PictureFault", "SceneFault", "SourceFault"]
