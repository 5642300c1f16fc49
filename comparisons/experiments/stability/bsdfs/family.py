"""The series of F11; the folder's docstring states the law."""

from comparisons.experiments.stability.bsdfs.digits import EDGE, INDEX, MASKING, NORMALS
from comparisons.experiments.stability.bsdfs.pairs import GRAZING, MATCHED, ROUGHNESS
from comparisons.experiments.stability.bsdfs.samples import CONSISTENCY, DENSITY
from comparisons.experiments.stability.harness.family import Family

FAMILY = Family(
    id="F11",
    name="reciprocity and sampling of materials",
    law="light goes either way alike, samples have the density that is said, and the formulae keep "
    "their digits at grazing angles, in narrow lobes and at matched indices",
    anchors="Nori: 15 cases of chi-square; pbrt: its reciprocity test of hair is switched off",
    series=(GRAZING, ROUGHNESS, MATCHED, CONSISTENCY, DENSITY, INDEX, EDGE, NORMALS, MASKING),
)
