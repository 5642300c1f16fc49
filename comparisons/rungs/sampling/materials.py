"""What a material says of the directions that it draws, against the directions.

For each view of a material (a direction, a place on its textures) the density is integrated over
the sphere by quadrature, in cells that follow it, and directions are drawn.  Then

- cells hold as many directions as their integral says (chi-square), reflected and transmitted;
- the integral, what perfect lobes claim and the share of draws that failed add up to 1;
- each perfect lobe is drawn as often as it claims;
- the density that came with a direction is the one that is evaluated for it, and weight times
  density is the value f cos.

So the histogram of what is drawn and the integral of what is claimed are two numbers of the same
material by different code: `sample` and `pdf`.  Values are held against Mitsuba by the rung
`direct`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from comparisons.results.case import RungResult
from comparisons.statistics.chi_square import chi_square
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.query import Bsdf, BsdfSamples
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.scene import Scene

VIEWS = (
    (0.9, 0.3, (0.13, 0.37)),
    (0.35, 2.2, (0.71, 0.89)),
    (-0.6, 4.0, (0.47, 0.06)),
    (0.12, 5.5, (0.92, 0.55)),
    (-0.97, 1.1, (0.31, 0.68)),
    (0.6, 3.3, (0.58, 0.22)),
)
"""The cosine and azimuth of a view, and the place on textures: both sides, and near to grazing."""

ALL_VIEWS, FEWEST = 16, 3
"""About how many views of all materials together, and the fewest of one: three, one from behind."""

MOST_MATERIALS = 64
"""Of a scene with more, so many are taken, evenly spread over its list."""

COLOUR = (0.2, 0.5, 0.8)
"""Of vertices, where a texture asks for it."""

FAMILY = 1e-6
"""The chance of a false alarm of a scene, of all views together."""


class Effort(NamedTuple):
    """strata: of the three numbers of a draw, two draws in each;  cells, tolerance, points: see
    `chi_square`;  allowed: for the error of the quadrature, of an integral that is about 1.

    The tolerance is the change of one box of some hundred by halving, of which the halves' own
    error is a fraction.  Where light begins to be refracted, the density has a step, and there the
    quick quadrature is off by up to 2e-3 (measured at `alpha` 0.3, 73 degrees): the careful one by
    2e-4.
    """

    strata: tuple[int, int, int]
    cells: int
    tolerance: float
    points: int
    allowed: float


QUICK = Effort((8, 32, 32), 64, 3e-5, 4, 1e-3)
CAREFUL = Effort((12, 64, 64), 128, 1e-7, 8, 1e-3)
"""What the quick one suspects is looked at again, with other numbers: only that is reported."""

SUSPICIOUS = 1e-3
"""The chance with which a right view is looked at again."""

CHECKED = 256
"""Directions whose density and value are computed twice."""

FEW = 16
"""Pairs of draws that differ, of which there are at least so many for an error: the fewer there are
the less do they follow a normal distribution."""

SAME = 1e-9
"""A relative difference of two ways to compute a density, a hundred times what was met."""

MIXED = np.array([1.0, 3.1, 9.7, 31.3, 97.9, 313.7, 971.3])
"""Makes one number of a direction, a probability and a weight, to tell lobes apart."""

MOVED, AMPLIFIED = 1e-15, 64.0
"""A density is the less certain the more it changes by rounding its direction: directions are moved
by a few units of rounding, and the change is taken so many times (of the steps in between, each of
which rounds)."""


@dataclass(frozen=True)
class View:
    """A material's number and name, and how it is looked at."""

    number: int
    name: str
    wo: FloatArray
    uv: tuple[float, float]
    lobes: int
    """How many leaves may have a perfect lobe in the same direction."""

    @property
    def place(self) -> tuple[Any, ...]:
        """The arguments of a query of a BSDF behind its directions.  One thread: starting others
        takes longer."""
        return self.uv, COLOUR, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1

    def __str__(self) -> str:
        degrees = math.degrees(math.acos(abs(self.wo[2])))
        side = "in front" if self.wo[2] > 0.0 else "behind"
        return f"material '{self.name}', seen at {degrees:.0f} degrees from {side}"


class OfTables(Bsdf):
    """A material of tables, by its number."""

    def __init__(self, tables: SceneTables, number: int) -> None:
        self._tables, self._number = tables, number


BsdfOf = Callable[[View], Bsdf]


def check(scene: Scene, tables: SceneTables, of: BsdfOf | None = None, seed: int = 5) -> RungResult:
    """Check all materials of a scene.  of: makes the BSDF of a view; default: that of the tables.

    Raises SceneError.
    """
    views = views_of(scene, tables)
    of = of or (lambda view: OfTables(tables, view.number))
    unsettled: list[View] = []
    for k, view in enumerate(views):
        bsdf = of(view)
        try:
            fault = of_view(bsdf, view, QUICK, SUSPICIOUS, (seed, k))
            if fault:
                fault = of_view(bsdf, view, CAREFUL, FAMILY / len(views), (seed, k, 1))
        except ArithmeticError:
            unsettled.append(view)
            continue
        if fault:
            return RungResult("sampling", "differ", f"{view}: {fault}")
    numbers = {"materials": len({view.number for view in views}), "views": len(views)}
    if not views:
        return RungResult("sampling", "not-applicable", "no material scatters", numbers)
    reason = f"{numbers['materials']} materials draw directions as they say, in {len(views)} views"
    if unsettled:
        reason += f" ({len(unsettled)} of them with densities too narrow for the quadrature)"
    return RungResult("sampling", "agree", reason, numbers)


def views_of(scene: Scene, tables: SceneTables) -> list[View]:
    """Views of each material, more of each where there are few."""
    names = [*scene.materials, "(default)"][: len(tables.materials.shown.value)]
    chosen = range(len(names))
    if len(names) > MOST_MATERIALS:
        chosen = np.linspace(0, len(names) - 1, MOST_MATERIALS).astype(int).tolist()
    count = min(len(VIEWS), max(FEWEST, ALL_VIEWS // len(chosen)))
    flat = tables.materials.flat_leaves
    found = []
    for number in chosen:
        lobes = 1 if flat is None else max(1, int(flat.number[number]))
        for cosine, azimuth, uv in VIEWS[:count]:
            sine = math.sqrt(1.0 - cosine * cosine)
            wo = np.array([sine * math.cos(azimuth), sine * math.sin(azimuth), cosine])
            found.append(View(number, names[number], wo, uv, lobes))
    return found


def stratified(strata: tuple[int, int, int], rng: np.random.Generator) -> FloatArray:
    """Two random points in each cell of the unit cube, one after the other: (2 n, 3)."""
    cells = np.stack(np.meshgrid(*map(np.arange, strata), indexing="ij"), axis=-1).reshape(-1, 3)
    twice = np.repeat(cells, 2, axis=0)
    return np.asarray(np.minimum((twice + rng.random(twice.shape)) / strata, 1.0 - 2.0**-53))


def share(counted: BoolArray) -> tuple[float, float]:
    """The share of draws of `stratified`, and its standard error, from the two of each cell."""
    pairs = counted.reshape(-1, 2)
    apart = max(FEW, int(np.count_nonzero(pairs[:, 0] != pairs[:, 1])))
    return float(counted.mean()), math.sqrt(apart) / len(counted)


def of_view(bsdf: Bsdf, view: View, effort: Effort, level: float, seed: tuple[int, ...]) -> str:
    """What is wrong with one view, at a false alarm's chance of `level`; empty: nothing.

    Raises ArithmeticError for a density that the quadrature cannot follow.
    """
    rng = np.random.default_rng(seed)
    place = view.place
    drawn = bsdf.sample(view.wo, stratified(effort.strata, rng), *place)
    failed = ~(drawn.pdf > 0.0)
    smooth = ~failed & ~drawn.is_delta
    if fault := _computed_twice(bsdf, view, drawn, smooth, rng):
        return fault

    def density(wi: FloatArray) -> FloatArray:
        return np.asarray(bsdf.pdf(view.wo, wi, *place))

    if not smooth.any():
        at = rng.normal(size=(CHECKED, 3))
        if density(at).any():
            return "draws no directions, but has a density"
        integral = 0.0
    else:
        order = rng.permutation(len(failed))  # the first tenth of which are pilots
        kept = np.where(smooth[:, None], drawn.wi, np.nan)[order]
        fit = chi_square(
            density, kept, cells=effort.cells, tolerance=effort.tolerance, points=effort.points
        )
        if fit.outside:
            return f"{fit.outside} of {len(kept)} directions are drawn where the density is 0"
        integral = fit.integral
        if fit.p_value < level and fit.cells > 1:
            return (
                f"directions are not distributed as their density says (chi-square of "
                f"{len(kept)} directions in {fit.cells} cells: p = {fit.p_value:.1g})"
            )
    # Normal: the sum of many cells that the border crosses.
    sigmas = -float(special.ndtri(0.5 * level))
    claimed, fault = _perfect(view, drawn, ~failed & drawn.is_delta, sigmas, effort)
    if fault:
        return fault
    lost, error = share(failed)
    total = integral + claimed + lost
    if abs(total - 1.0) > sigmas * error + effort.allowed:
        return (
            f"the density integrates to {integral:.4f}, perfect lobes claim {claimed:.4f} and "
            f"{lost:.4f} of the draws fail: together {total:.4f}"
        )
    return ""


def _perfect(
    view: View, drawn: BsdfSamples, delta: BoolArray, sigmas: float, effort: Effort
) -> tuple[float, str]:
    """What all perfect lobes claim, and what is wrong with one."""
    rows = np.flatnonzero(delta)
    if not len(rows):
        return 0.0, ""
    # A lobe: one direction with one probability and weight.
    keys = np.column_stack([drawn.wi, drawn.pdf, drawn.weight])[rows]
    _, of = np.unique(np.round(keys, 6) @ MIXED, return_inverse=True)
    claimed = 0.0
    for lobe in range(of.max() + 1):
        members = rows[of == lobe]
        counted = np.zeros(len(delta), bool)
        counted[members] = True
        often, error = share(counted)
        says = float(drawn.pdf[members].mean())
        same = min(view.lobes, max(1, round(often / says)))
        claimed += same * says
        if abs(often - same * says) > sigmas * error + effort.allowed * says:
            wi = drawn.wi[members[0]].round(3).tolist()
            return claimed, (
                f"the perfect lobe along {wi} says that it is drawn with a probability of "
                f"{says:.4f}; it is with {often:.4f}"
            )
    return claimed, ""


def _computed_twice(
    bsdf: Bsdf, view: View, drawn: BsdfSamples, smooth: BoolArray, rng: np.random.Generator
) -> str:
    """Density and value of drawn directions, evaluated again."""
    rows = np.flatnonzero(smooth)
    if not len(rows):
        return ""
    rows = rng.choice(rows, min(CHECKED, len(rows)), replace=False)
    place = view.place
    wi = drawn.wi[rows]
    density, value = bsdf.pdf(view.wo, wi, *place), bsdf.evaluate(view.wo, wi, *place)
    spread, value_spread = np.zeros_like(density), np.zeros_like(value)
    for _ in range(3):
        moved = wi + MOVED * rng.choice([-1.0, 1.0], wi.shape)
        spread = np.maximum(spread, np.abs(bsdf.pdf(view.wo, moved, *place) - density))
        moved_value = bsdf.evaluate(view.wo, moved, *place)
        value_spread = np.maximum(value_spread, np.abs(moved_value - value))
    with np.errstate(invalid="ignore", over="ignore"):
        off = ~(np.abs(density - drawn.pdf[rows]) <= SAME * density + AMPLIFIED * spread)
        product = drawn.weight[rows] * drawn.pdf[rows, None]
        uncertain = AMPLIFIED * (value_spread + drawn.weight[rows] * spread[:, None])
        off_value = ~(np.abs(value - product) <= SAME * np.abs(value) + uncertain)
    for k in np.flatnonzero(off)[:1]:
        return (
            f"a direction is drawn with the density {drawn.pdf[rows[k]]:.9g}, and evaluated "
            f"with {density[k]:.9g}"
        )
    for k in np.flatnonzero(off_value.any(axis=1))[:1]:
        return (
            f"weight times density of a direction is {product[k].tolist()}, its value is "
            f"{value[k].tolist()}"
        )
    return ""
