"""Is a material of yours right, or a sampler?  Checks of functions of NumPy arrays, of any program.

    from comparisons.testing import check_material

    for found in check_material(evaluate, sample, pdf):
        assert found, found.reason

`check_material` runs what applies of `chi_square` (directions are drawn with the density that `pdf`
says), `weights` (a weight times the density is the value), `furnace` (no more light leaves than
comes) and `reciprocity`; `chi_square` takes any sampler of directions or of the unit square.  The
pytest fixture `material_gate` fails a test with what was found, and keeps the pictures.

The caller's functions take arrays of n rows and return such:

    evaluate(wo, wi) -> (n,) or (n, channels)   f |cos wi|, the cosine included
    pdf(wo, wi) -> (n,)                         per unit of solid angle, of wi
    sample(wo, u) -> wi (n, 3)                  or (wi, weight), weight as of `evaluate`

Directions (n, 3) have unit length and point away from the surface, whose normal is z; wo is towards
the viewer.  u (n, 3) are numbers from 0 to 1.  A row of `sample` that is not finite is a draw that
failed.  Perfect lobes, such as mirrors, have no density: leave them out.  What transmits has an
index `eta`, of the side below over that above; its values are of radiance, which is 1 / eta² as
dense where it leaves a medium of index eta.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy import special

from comparisons.gate.material_maps import GRID, Map, centres, draw, histograms, means
from comparisons.rungs.sampling import materials as of_rung
from comparisons.statistics import chi_square as statistics
from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import UsageError

Evaluate = Callable[[Any, Any], Any]
Sample = Callable[[Any, Any], Any]
Views = npt.ArrayLike | None

DRAWS = 1 << 15
"""Directions that are drawn for each view."""

FEWEST = 1280
"""Of them: a tenth tells where to look, in cells of 1/128 of them each."""

LEVEL = 1e-6
"""The chance that a check of a right material fails."""

ALLOWED = of_rung.CAREFUL.allowed
"""For the error of the quadrature."""

PAIRS = 4096
"""Pairs of directions of `reciprocity`, and directions whose weight is looked at."""

ROUNDINGS = of_rung.AMPLIFIED
"""Of the caller's own type: times the change of a value when its directions are moved by one."""

MOST_ALIKE = 16
"""Draws that may be equal.  Numbers of float32 repeat: of 2^15 points of 2^24 values along each
side two may be equal by chance, but not as many as these."""


@dataclass(frozen=True)
class Check:
    """What a check found; true if nothing is wrong.

    name: of the check;  reason: in words;  numbers: by view, or of all;  maps: what
    `write_picture` shows, of the view that is worst.
    """

    name: str
    passed: bool
    reason: str
    numbers: dict[str, Any] = field(default_factory=dict)
    maps: tuple[Map, ...] = field(default=(), repr=False)

    def __bool__(self) -> bool:
        return self.passed

    def write_picture(self, path: str | Path) -> None:
        """Maps over all directions wi, as .png or .svg: the cosine upwards, the azimuth across.
        Raises UsageError where there are none: a check that passed, or that is told in words."""
        if not self.maps:
            raise UsageError(f"{self.name}: there is no picture of this: {self.reason}")
        draw(self.maps, f"{self.name}: {self.reason}", path)


def views_of(views: Views = None, eta: float | None = None) -> FloatArray:
    """Directions wo (n, 3) that are looked from: the caller's, made unit vectors; default: four
    from above, one near to grazing, and two from below with an `eta`.  Raises UsageError."""
    _check_index(eta)
    if views is None:
        usual = [(c, a) for c, a, _ in of_rung.VIEWS if c > 0.0 or eta is not None]
        return np.array([_towards(c, a) for c, a in usual])
    found = np.atleast_2d(np.asarray(views, float))
    if found.ndim != 2 or found.shape[1] != 3 or not found.size or not np.isfinite(found).all():
        raise UsageError(f"views: got an array {np.shape(views)}; expected directions (n, 3)")
    lengths = np.linalg.norm(found, axis=1)
    if not lengths.all():
        raise UsageError("views: got one of length 0; expected directions (n, 3)")
    return np.asarray(found / lengths[:, None])


def _check_index(eta: float | None) -> None:
    if eta is not None and not 0.0 < eta < math.inf:
        raise UsageError(f"eta: got {eta:g}; expected an index of refraction above 0, or None")


def check_material(
    evaluate: Evaluate,
    sample: Sample,
    pdf: Evaluate,
    *,
    views: Views = None,
    eta: float | None = None,
    reciprocal: bool = True,
    precision: npt.DTypeLike | None = None,
    seed: int = 0,
) -> list[Check]:
    """All checks of a material; those of weights only where `sample` returns some.  reciprocal:
    false for one that is not meant to be, such as a bump;  precision: the type of floats that the
    functions compute with, such as "float32", where their arrays do not say it.  Raises
    UsageError."""
    found = [chi_square(sample, pdf, views=views_of(views, eta), seed=seed)]
    if _drawn(sample, _tiled(views_of(views, eta)[0], 1), np.full((1, 3), 0.5))[1] is not None:
        found.append(
            weights(evaluate, sample, pdf, views=views, eta=eta, precision=precision, seed=seed)
        )
    found.append(furnace(evaluate, sample, views=views, eta=eta, seed=seed))
    if reciprocal:
        found.append(reciprocity(evaluate, eta=eta, precision=precision, seed=seed))
    return found


def chi_square(
    sample: Callable[..., Any],
    pdf: Callable[..., Any],
    *,
    views: Views = None,
    domain: Literal["directions", "square"] = "directions",
    draws: int = DRAWS,
    seed: int = 0,
) -> Check:
    """Whether what `sample` draws has the density `pdf`: Pearson's test in cells that follow the
    density, whose integrals are by quadrature, and whether the density integrates to 1, but for
    draws that failed.

    With `views` it is a material's: sample(wo, u) and pdf(wo, wi).  Without, any sampler's:
    sample(u) and pdf(points), of directions (n, 3) per unit of solid angle, or of points (n, 2) of
    the unit square per unit of area.  Raises UsageError for arrays of other shapes.
    """
    if domain not in ("directions", "square"):
        raise UsageError(f"domain: got '{domain}'; expected 'directions' or 'square'")
    if draws < FEWEST:
        raise UsageError(f"draws: got {draws}; expected {FEWEST} or more")
    looked: list[FloatArray | None] = [None] if views is None else [*views_of(views)]
    chart = statistics.SPHERE if domain == "directions" else statistics.UNIT_SQUARE
    level = statistics.sidak(len(looked), LEVEL)
    sums: list[float] = []
    for k, wo in enumerate(looked):
        rng = np.random.default_rng((seed, k))
        points = _points(sample, wo, rng.random((draws, 3)), 3 if domain == "directions" else 2)
        failed = ~np.isfinite(points).all(axis=1)

        def density(at: FloatArray, wo: FloatArray | None = wo) -> FloatArray:
            found = pdf(at) if wo is None else pdf(_tiled(wo, len(at)), at)
            return _checked(found, len(at), "pdf", channels=False)[:, 0]

        if failed.all():
            if density(
                chart.points(
                    chart.low + rng.random((PAIRS, 2)) * np.subtract(chart.high, chart.low)
                )
            ).any():
                told = "every draw failed, where the density is not 0"
                return Check("chi_square", False, _seen(wo) + told)
            sums.append(0.0)
            continue
        beyond = 0 if domain == "directions" else int((np.abs(points - 0.5) > 0.5).any(1).sum())
        if beyond:
            return Check("chi_square", False, f"{beyond} of {draws} draws are beyond the square")
        places, counts = np.unique(points[~failed], axis=0, return_counts=True)
        if counts.max() > MOST_ALIKE:
            told = f"{counts.max()} of {draws} draws are {places[counts.argmax()].round(4)}"
            told += ": a perfect lobe, to be left out, or draws that failed, which are NaN"
            return Check("chi_square", False, _seen(wo) + told)
        try:
            fit = statistics.chi_square(density, points, chart)
        except ArithmeticError as error:
            return Check("chi_square", False, f"{_seen(wo)}{error}")
        lost = float(failed.mean())
        sums.append(fit.integral)
        sigmas = -float(special.ndtri(0.5 * level))
        sigmas *= math.sqrt(max(lost * (1.0 - lost), 1.0 / draws) / draws)
        wrong = ""
        if fit.outside:
            wrong = f"{fit.outside} of {draws} draws are where the density is 0"
        elif fit.p_value < level:
            wrong = (
                f"draws are not distributed as the density says (chi-square of {draws} in "
                f"{fit.cells} cells: p = {fit.p_value:.1g})"
            )
        if abs(fit.integral + lost - 1.0) > sigmas + ALLOWED:
            wrong += "; " * bool(wrong) + (
                f"the density integrates to {fit.integral:.4f}, and {lost:.4f} of the draws fail"
            )
        if wrong:
            maps = histograms(points[~failed], density, draws) if domain == "directions" else ()
            return Check("chi_square", False, _seen(wo) + wrong, {"integrals": sums}, maps)
    reason = f"{draws} draws have their density" + (
        f" in each of {len(looked)} views" if views is not None else ""
    )
    return Check("chi_square", True, reason, {"integrals": sums})


def weights(
    evaluate: Evaluate,
    sample: Sample,
    pdf: Evaluate,
    *,
    views: Views = None,
    eta: float | None = None,
    precision: npt.DTypeLike | None = None,
    seed: int = 0,
) -> Check:
    """Whether a weight times the density is the value, of directions that are drawn, to the
    rounding of the coarsest type of floats.  Raises UsageError if `sample` returns no weights."""
    looked = views_of(views, eta)
    one = _tiled(looked[0], 1)
    drawn = sample(one, np.full((1, 3), 0.5))
    drawn = drawn if isinstance(drawn, tuple) else (drawn,)
    unit = _unit(precision, *drawn, evaluate(one, one), pdf(one, one))
    for k, wo in enumerate(looked):
        rng = np.random.default_rng((seed, k, 1))
        rows = _tiled(wo, PAIRS)
        wi, weight = _drawn(sample, rows, rng.random((PAIRS, 3)))
        if weight is None:
            raise UsageError("weights: sample returned directions alone; expected (wi, weight)")
        kept = np.isfinite(wi).all(axis=1)
        wi, weight, rows = wi[kept], weight[kept], rows[kept]
        value, density = _values(evaluate, rows, wi), _densities(pdf, rows, wi)
        made = weight * density
        spread = np.zeros_like(value + made)
        for moved in _moved(wi, unit, rng):
            change = np.abs(_values(evaluate, rows, moved) - value)
            again = np.abs(_densities(pdf, rows, moved) - density)
            spread = np.maximum(spread, change + weight * again)
        bound = ROUNDINGS * (unit * (np.abs(value) + np.abs(made)) + spread)
        off = np.abs(value - made) - bound
        if not (off <= 0.0).all():
            row, channel = np.unravel_index(
                np.nanargmax(np.where(off == off, off, np.inf)), off.shape
            )
            told = (
                f"{_seen(wo)}towards {wi[row].round(4).tolist()} weight times density is "
                f"{made[row, channel]:.6g}, and the value is {value[row, channel]:.6g}"
            )
            wrong = int(np.count_nonzero(~(off <= 0.0).all(axis=1)))
            told += f" ({wrong} of {len(wi)} directions)"
            maps = means(
                wi, ("value", value.mean(axis=1)), ("weight times density", made.mean(axis=1))
            )
            return Check("weights", False, told, {"wrong": wrong}, maps)
    return Check("weights", True, "weight times density is the value of each direction drawn")


def furnace(
    evaluate: Evaluate,
    sample: Sample | None = None,
    *,
    views: Views = None,
    eta: float | None = None,
    seed: int = 0,
) -> Check:
    """Whether no more light leaves than comes, under a sky of 1, in each channel: the integral of
    the value by quadrature is at most 1.  With a `sample` that returns weights, their mean must be
    this integral (by the central limit).

    `Check.numbers` has the integrals, by view and channel.  Narrow lobes that are not about the
    mirrored direction are only found with a `sample`.  Raises UsageError.
    """
    albedos: list[list[float]] = []
    looked = views_of(views, eta)
    for k, wo in enumerate(looked):
        rng = np.random.default_rng((seed, k, 2))
        hints, power = _hints(wo, rng), None
        if sample is not None:
            wi, weight = _drawn(sample, _tiled(wo, DRAWS), rng.random((DRAWS, 3)))
            failed = np.asarray(~np.isfinite(wi).all(axis=1))
            hints = np.concatenate([wi[~failed], hints[:1024]])
            if weight is not None:
                seen = np.where(failed[:, None], 0.0, weight)
                power = seen * _denser(wo, np.where(failed[:, None], wo, wi), eta)[:, None]
        at = hints[rng.integers(0, len(hints), 1024)]
        first = _values(evaluate, _tiled(wo, len(at)), at)
        if not (np.isfinite(first).all() and (first >= 0.0).all()):
            bad = first[~(np.isfinite(first) & (first >= 0.0))][0]
            return Check("furnace", False, f"{_seen(wo)}a value is {bad:g}; expected 0 or more")
        row: list[float] = []
        for channel in range(first.shape[1]):

            def leaving(at: FloatArray, channel: int = channel, wo: FloatArray = wo) -> FloatArray:
                value = _values(evaluate, _tiled(wo, len(at)), at)[:, channel]
                return np.asarray(value * _denser(wo, at, eta))

            try:
                row.append(statistics.integrate(leaving, hints, tolerance=1e-6))
            except ArithmeticError as error:
                return Check("furnace", False, f"{_seen(wo)}{error}")
        albedos.append(row)
        wrong = ""
        if max(row) > 1.0 + ALLOWED:
            wrong = f"{max(row):.4f} of the light leaves, by quadrature"
        elif power is not None:
            sigmas = -float(special.ndtri(0.5 * LEVEL / (len(looked) * len(row))))
            bounds = sigmas * power.std(axis=0) / math.sqrt(DRAWS) + ALLOWED * np.array(row)
            for made, said, bound in zip(power.mean(axis=0), row, bounds, strict=True):
                if not abs(made - said) <= bound:
                    wrong = (
                        f"weights have the mean {made:.4f}, and the values' integral is {said:.4f}"
                    )
        if wrong:
            shown = centres()
            value = _values(evaluate, _tiled(wo, len(shown)), shown).mean(axis=1)
            maps = (("value", value.reshape(GRID)),)
            return Check("furnace", False, _seen(wo) + wrong, {"albedos": albedos}, maps)
    most = max(map(max, albedos))
    return Check("furnace", True, f"at most {most:.4f} of the light leaves", {"albedos": albedos})


def reciprocity(
    evaluate: Evaluate,
    *,
    eta: float | None = None,
    precision: npt.DTypeLike | None = None,
    seed: int = 0,
) -> Check:
    """Whether f(wo, wi) = f(wi, wo), and for light that passes to another side, with an `eta`,
    f(wo, wi) n(wi)² = f(wi, wo) n(wo)² (Walter et al. 2007), to the rounding of the caller's own
    type, at random pairs of directions, a third of them near to grazing.  Raises UsageError."""
    _check_index(eta)
    rng = np.random.default_rng((seed, 3))
    a, b = (_random_directions(rng, PAIRS, both=eta is not None) for _ in (0, 1))
    forth, back = _values(evaluate, a, b), _values(evaluate, b, a)
    unit = _unit(precision, evaluate(a[:1], b[:1]))
    scale = [np.abs(v[:, 2:]) / _index(v, eta)[:, None] ** 2 for v in (a, b)]
    left, right = forth * scale[0], back * scale[1]  # times both cosines, and over both indices
    spread = np.zeros_like(left)
    for one, two in zip(_moved(a, unit, rng), _moved(b, unit, rng), strict=True):
        spread += np.abs(_values(evaluate, one, two) - forth) * scale[0]
        spread += np.abs(_values(evaluate, two, one) - back) * scale[1]
    bound = ROUNDINGS * (unit * (np.abs(left) + np.abs(right)) + spread)
    wrong = np.asarray(~(np.abs(left - right) <= bound).all(axis=1))
    numbers = {"wrong": int(wrong.sum()), "pairs": PAIRS}
    if not wrong.any():
        return Check("reciprocity", True, f"the same both ways for {PAIRS} pairs", numbers)
    worst = int(np.argmax(np.abs(left - right).max(axis=1) - bound.max(axis=1)))
    x, y = left[worst].max(), right[worst].max()
    told = (
        f"f({a[worst].round(3).tolist()}, {b[worst].round(3).tolist()}) is {x / y:.6g} times that "
        f"of the directions exchanged ({numbers['wrong']} of {PAIRS} pairs)"
    )
    wo, shown = a[worst], centres()
    other = _tiled(wo, len(shown))
    one = _values(evaluate, other, shown).mean(axis=1) / np.abs(shown[:, 2])
    two = _values(evaluate, shown, other).mean(axis=1) / abs(wo[2])
    two *= (_index(shown, eta) ** -2.0 / _index(wo[None], eta) ** -2.0) if eta else 1.0
    maps = (("f(wo, wi)", one.reshape(GRID)), ("difference", (one - two).reshape(GRID)))
    return Check("reciprocity", False, told, numbers, maps)


def _checked(found: Any, n: int, name: str, channels: bool = True) -> FloatArray:
    """(n, channels), as float64.  Raises UsageError."""
    array = np.asarray(found)
    shape, array = array.shape, array[:, None] if array.ndim == 1 else array
    fits = array.ndim == 2 and len(array) == n and (channels or array.shape[1] == 1)
    if not fits or array.dtype.kind not in "fiu":
        expected = f"({n},)" + (f" or ({n}, channels)" if channels else "")
        raise UsageError(f"{name}: got an array {shape} of {array.dtype}; expected {expected}")
    return np.asarray(array, np.float64)


def _unit(precision: npt.DTypeLike | None, *found: Any) -> float:
    """The unit of rounding of the coarsest type of floats among what functions return, or of the
    type that the caller says that they compute with."""
    kinds = [np.dtype(np.float64), *(np.asarray(one).dtype for one in found)]
    if precision is not None:
        try:
            kinds.append(np.finfo(np.dtype(precision)).dtype)
        except (TypeError, ValueError):
            told = f"precision: got {precision!r}; expected a type of floats, such as 'float32'"
            raise UsageError(told) from None
    return max(float(np.finfo(kind).eps) for kind in kinds if kind.kind == "f") / 2.0


def _values(evaluate: Evaluate, wo: FloatArray, wi: FloatArray) -> FloatArray:
    return _checked(evaluate(wo, wi), len(wi), "evaluate")


def _densities(pdf: Evaluate, wo: FloatArray, wi: FloatArray) -> FloatArray:
    return _checked(pdf(wo, wi), len(wi), "pdf", channels=False)


def _drawn(sample: Sample, wo: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """Directions, and weights if there are."""
    found = sample(wo, u)
    weight = None
    if isinstance(found, tuple):
        found, weight = found[0], _checked(found[1], len(u), "sample's weight")
    return _rows(found, len(u), 3), weight


def _points(sample: Sample, wo: FloatArray | None, u: FloatArray, size: int) -> FloatArray:
    if wo is not None:
        return _drawn(sample, _tiled(wo, len(u)), u)[0]
    found = sample(u)  # type: ignore[call-arg]
    return _rows(found[0] if isinstance(found, tuple) else found, len(u), size)


def _rows(found: Any, n: int, size: int) -> FloatArray:
    points = np.asarray(found, np.float64)
    if points.shape != (n, size):
        raise UsageError(f"sample: got an array {points.shape}; expected ({n}, {size})")
    if size == 3:
        length = np.linalg.norm(points, axis=1)
        kept = np.isfinite(length)
        if (np.abs(length[kept] - 1.0) > 1e-4).any():
            raise UsageError(
                f"sample: got a direction of length {length[kept].max():.4g}; expected 1"
            )
        points = points / length[:, None]
    return points


def _towards(cosine: float, azimuth: float) -> tuple[float, float, float]:
    sine = math.sqrt(1.0 - cosine * cosine)
    return sine * math.cos(azimuth), sine * math.sin(azimuth), cosine


def _tiled(v: FloatArray, n: int) -> FloatArray:
    return np.tile(v, (n, 1))


def _seen(wo: FloatArray | None) -> str:
    if wo is None:
        return ""
    degrees = math.degrees(math.acos(min(1.0, abs(wo[2]))))
    return f"seen at {degrees:.0f} degrees from {'above' if wo[2] > 0.0 else 'below'}: "


def _index(v: FloatArray, eta: float | None) -> FloatArray:
    """Of the medium that a direction is in."""
    return np.where(v[:, 2] < 0.0, eta or 1.0, 1.0)


def _denser(wo: FloatArray, wi: FloatArray, eta: float | None) -> FloatArray:
    """What makes power of radiance: the square of the index of wi's side over wo's."""
    return np.asarray((_index(wi, eta) / _index(wo[None], eta)) ** 2)


def _random_directions(rng: np.random.Generator, n: int, both: bool) -> FloatArray:
    cosine = np.where(rng.random(n) < 1.0 / 3.0, 10.0 ** rng.uniform(-3, -1, n), rng.random(n))
    if both:
        cosine *= rng.choice([-1.0, 1.0], n)
    azimuth = rng.uniform(0.0, 2.0 * math.pi, n)
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1)


def _hints(wo: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Directions everywhere, and about the mirrored and the straight one by five widths."""
    found = [rng.normal(size=(4096, 3))]
    for side, width in product((1.0, -1.0), (0.003, 0.01, 0.03, 0.1, 0.3)):
        centre = np.array([-wo[0], -wo[1], side * wo[2]])
        found.append(centre + width * rng.normal(size=(512, 3)))
    every = np.concatenate(found)
    return np.asarray(rng.permutation(every / np.linalg.norm(every, axis=1)[:, None]))


def _moved(v: FloatArray, unit: float, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Directions moved by a few units of rounding, three times."""
    for _ in range(3):
        yield v + 4.0 * unit * rng.choice([-1.0, 1.0], v.shape)
