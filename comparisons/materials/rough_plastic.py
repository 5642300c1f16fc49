"""Rough plastics, whose coat is tabulated by us as well as by Mitsuba."""

import functools
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.materials.both_sides import both_sides, directions
from comparisons.materials.coat import (
    COAT,
    PASSED,
    base_off,
    look_of_coat,
    of_vertices,
    write_coated,
)
from comparisons.materials.glass import OF_FRESNEL, relative_index
from comparisons.materials.material import MOST, Errors, Gltf, MaterialType
from comparisons.materials.microfacets import ALPHA, DISTRIBUTION, SAMPLING, read_alpha
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.plugin_table import NUMBER, PluginTable, Row
from reference_rt.materials import RoughPlastic
from reference_rt.materials.microfacet.ggx_and_smith import MIN_ALPHA

WIDTH = Row("alpha", "alpha", NUMBER, ALPHA)
TABLE = PluginTable("roughplastic", (*COAT, DISTRIBUTION, WIDTH), SAMPLING)


def _to_mitsuba(material: RoughPlastic, context: TranslationContext) -> dict[str, Any]:
    rough = {"distribution": material.distribution, "alpha": material.alpha}
    return write_coated(TABLE, material, context, rough)


def _from_mitsuba(reading: Reading, node: Node) -> RoughPlastic:
    alpha = read_alpha(reading, node)
    if isinstance(alpha, tuple):
        if alpha[0] != alpha[1]:
            raise node.error("is anisotropic, which Mitsuba refuses, too; expected one 'alpha'")
        alpha = alpha[0]
    if isinstance(alpha, str):
        raise node.error("'alpha' is a texture, which Mitsuba refuses, too; expected a number")
    return RoughPlastic(**TABLE.read(reading, node, but=("alpha",)), alpha=alpha)


def _note(material: RoughPlastic, context: TranslationContext) -> str:
    eta = relative_index(material)
    alpha = max(material.alpha, MIN_ALPHA)
    return (
        "Mitsuba's tables of a rough coat's transmittance and internal reflectance, which make the "
        f"base {base_off(eta, material.distribution, alpha)} at alpha {alpha:g} "
        f"({material.distribution}) and a relative index of {eta:.4g}, are replaced by finer ones"
        f"{of_vertices(material, context)}"
    )


# ---- the error of our tables ---------------------------------------------------------------------

PAIRS = 256
"""Pairs of directions at which tables are compared with the integrals that they tabulate."""

MARGIN = 1.5
"""Factor on the largest error found, for directions in between."""

FAINT = 1e-5
"""Least light of a pair of directions that is compared, as a fraction of the brightest pair's: some
forty times PASSED."""


@functools.lru_cache(maxsize=64)
def table_error(material: RoughPlastic) -> float:
    """The largest relative difference of our rough plastic from its counterpart with finer
    tables."""
    exact = _to_mitsuba(material, TranslationContext({}, {}, Path()))
    ours, theirs = both_sides(material, *directions(PAIRS, seed=0), exact)
    # Beyond the critical angle of a coat with an index below 1 there is no light but rounding.
    passes = theirs > FAINT * theirs.max()
    return float(np.abs(ours[passes] / theirs[passes] - 1.0).max(initial=0.0))


def _relative(material: RoughPlastic) -> float:
    """But for the Fresnel factor: of the base alone, which is tabulated.  White maximises
    interreflection between base and coat."""
    white = {"reflectance": (1.0, 1.0, 1.0), "specular": (0.0, 0.0, 0.0)}
    base = min(MOST, MARGIN * table_error(material.model_copy(update=white)))
    return base + OF_FRESNEL.relative(material)


COARSE = 0.03
"""Absolute error of light that passes a rough coat with an index below 1 or above 3, or with alpha
above 1.  Next to the critical angle our tables are up to 1e-2 off for each of two directions
(measured: 2.4e-2; see `reference_rt.materials.bsdfs.rough_plastic`)."""


def _absolute(material: RoughPlastic) -> float:
    return PASSED if 1.0 <= relative_index(material) <= 3.0 and material.alpha <= 1.0 else COARSE


ROUGH_PLASTIC = MaterialType(
    description=RoughPlastic,
    table=TABLE,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"roughplastic": _from_mitsuba},
    note=_note,
    errors=Errors(_relative, _absolute),
    to_cycles=None,
    to_gltf=Gltf(look_of_coat, nearly="a diffuse base below a highlight"),
    to_pbrt=None,
)
