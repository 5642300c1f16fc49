"""Materials evaluated and sampled for arrays of directions: ours and Mitsuba's, by one interface.

Directions are local, unit, (n, 3); `wo` towards the viewer.  Mitsuba sees them rounded to float32.
"""

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from scipy import stats

from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, FloatArray
from comparisons.experiments.stability.harness.series import Draw, Sweep
from comparisons.geometry.exact.crossings import IntArray
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.materials import (
    Conductor,
    Dielectric,
    Diffuse,
    Material,
    Mirror,
    Phong,
    Plastic,
    Principled,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinDielectric,
)
from reference_rt.materials.bsdfs import dispatch
from reference_rt.materials.bsdfs.tables import TABLES, Leaves
from reference_rt.textures import NO_TEXTURES, At


class Samples(NamedTuple):
    """wi (n, 3);  weight (n, 3) f |cos wi| / pdf;  pdf (n,), 0 where there is none;  eta (n,);
    is_delta (n,)."""

    wi: FloatArray
    weight: FloatArray
    pdf: FloatArray
    eta: FloatArray
    is_delta: Any


class Bsdf(Protocol):
    """f |cos wi| (n, 3), its density (n,), and samples for numbers u (n, 3): lobe, direction."""

    def evaluate(self, wo: FloatArray, wi: FloatArray) -> FloatArray: ...
    def pdf(self, wo: FloatArray, wi: FloatArray) -> FloatArray: ...
    def sample(self, wo: FloatArray, u: FloatArray) -> Samples: ...


@entry_kernel
def _evaluate(table: Any, kind: int, wo: Any, wi: Any, values: Any, densities: Any) -> None:
    at = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    for i in range(len(wo)):
        a, b = row(wo, i), row(wi, i)
        scattered = dispatch.eval_pdf(table, kind, 0, at, a, b)
        values[i, 0], values[i, 1], values[i, 2] = scattered.value
        densities[i] = scattered.density


@entry_kernel
def _sample(table: Any, kind: int, wo: Any, u: Any, out: Any) -> None:
    at = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    for i in range(len(wo)):
        found = dispatch.sample(table, kind, 0, at, row(wo, i), u[i, 0], u[i, 1], u[i, 2])
        out[i, 0], out[i, 1], out[i, 2] = found.wi
        out[i, 3], out[i, 4], out[i, 5] = found.weight
        out[i, 6], out[i, 7], out[i, 8] = found.pdf, found.eta, found.is_delta


@functools.cache
def _plain() -> Leaves:
    """A row of every material, so that one compiled kernel serves them all."""
    some: Mapping[type[Material], Any] = {
        Conductor: {"eta": 1.5, "k": 1.0},
        RoughConductor: {"eta": 1.5, "k": 1.0},
        Phong: {"diffuse": 0.1},
    }
    rows = {field: cls(**some.get(cls, {})).tabulate(NO_TEXTURES) for _, field, cls, _, _ in TABLES}
    return Leaves(**rows)


@dataclass(frozen=True)
class Ours:
    table: Leaves
    kind: int

    @staticmethod
    def of(material: Material) -> "Ours":
        for code, field, cls, _, _ in TABLES:
            if isinstance(material, cls):
                row_of = {field: material.tabulate(NO_TEXTURES)}
                return Ours(_plain()._replace(**row_of), code)
        raise TypeError(f"{type(material).__name__} does not scatter by itself")

    def _both(self, wo: FloatArray, wi: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, densities = np.empty((len(wo), 3)), np.empty(len(wo))
        o, i = _rows(wo, wi)
        _evaluate(self.table, self.kind, o, i, values, densities)
        return values, densities

    def evaluate(self, wo: FloatArray, wi: FloatArray) -> FloatArray:
        return self._both(wo, wi)[0]

    def pdf(self, wo: FloatArray, wi: FloatArray) -> FloatArray:
        return self._both(wo, wi)[1]

    def sample(self, wo: FloatArray, u: FloatArray) -> Samples:
        out = np.empty((len(wo), 9))
        o, numbers = _rows(wo, u)
        _sample(self.table, self.kind, o, numbers, out)
        return Samples(out[:, :3], out[:, 3:6], out[:, 6], out[:, 7], out[:, 8] != 0.0)


def _rows(*arrays: FloatArray) -> list[FloatArray]:
    return [np.require(a, np.float64, ("C", "A", "W")) for a in arrays]


@dataclass(frozen=True)
class Theirs:
    """Mitsuba's own material, not one written to stand in for it."""

    bsdf: Any

    @staticmethod
    def of(material: Material) -> "Theirs":
        around = TranslationContext({}, {}, Path(), native=True)
        return Theirs(mitsuba().load_dict(translate_material(material, around)))

    def _seen(self, wo: Any) -> Any:
        import drjit as dr

        mi = mitsuba()
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t, si.wi = 1.0, wo
        return si

    def evaluate(self, wo: FloatArray, wi: FloatArray) -> FloatArray:
        context = mitsuba().BSDFContext()
        return for_rays(lambda o, i: (self.bsdf.eval(context, self._seen(o), i),), wo, wi)[0]

    def pdf(self, wo: FloatArray, wi: FloatArray) -> FloatArray:
        context = mitsuba().BSDFContext()
        return for_rays(lambda o, i: (self.bsdf.pdf(context, self._seen(o), i),), wo, wi)[0]

    def sample(self, wo: FloatArray, u: FloatArray) -> Samples:
        mi = mitsuba()
        context = mi.BSDFContext()

        def draw(o: Any, v: Any) -> tuple[Any, ...]:
            drawn, weight = self.bsdf.sample(context, self._seen(o), v.x, mi.Point2f(v.y, v.z))
            is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
            return drawn.wo, weight, drawn.pdf, drawn.eta, mi.Float(is_delta)

        # The largest float32 below 1: u never rounds up to it.
        u = np.minimum(u, 1.0 - 2.0**-24)
        wi, weight, pdf, eta, is_delta = for_rays(draw, wo, u)
        return Samples(wi, weight, pdf, eta, is_delta != 0.0)


def contestants(material: Material, draw: Draw) -> Iterator[tuple[str, Bsdf]]:
    yield OURS, Ours.of(material)
    if draw.mitsuba:
        yield MITSUBA, Theirs.of(material)


GOLD: dict[str, Any] = {"eta": (0.143, 0.375, 1.442), "k": (3.983, 2.386, 1.603)}
LOSSLESS: dict[str, Any] = {"eta": 1.0, "k": 1e9}
"""A metal that mirrors all but 4e-18."""

WHITE = (1.0, 1.0, 1.0)


def _rough(cls: Any, **fields: Any) -> Callable[[float], Material]:
    return lambda alpha: cls(**fields, alpha=alpha)


def _burley(**fields: Any) -> Callable[[float], Material]:
    """Its roughness is the root of alpha."""
    return lambda alpha: Principled(**fields, roughness=float(np.sqrt(alpha)))


ROUGH: dict[str, Callable[[float], Material]] = {
    "metal ggx": _rough(RoughConductor, **GOLD),
    "metal beckmann": _rough(RoughConductor, **GOLD, distribution="beckmann"),
    "brushed metal": lambda a: RoughConductor(**GOLD, alpha=(a, min(1.0, 4.0 * a))),
    "glass ggx": _rough(RoughDielectric),
    "glass beckmann": _rough(RoughDielectric, distribution="beckmann"),
    "bubble ggx": _rough(RoughDielectric, interior_ior=1.0, exterior_ior=1.5),
    "plastic ggx": _rough(RoughPlastic),
    "principled metal": _burley(base_colour=(0.9, 0.6, 0.2), metallic=1.0),
    "principled glass": _burley(base_colour=(0.9, 0.6, 0.2), spec_trans=1.0, eta=1.5),
    "principled": _burley(base_colour=(0.6, 0.4, 0.2), sheen=0.5, clearcoat=0.5, metallic=0.2),
}
"""By alpha."""

EVEN: dict[str, Material] = {
    "diffuse": Diffuse(),
    "plastic": Plastic(),
}
"""Those without a roughness, and of which something scatters to a continuum of directions."""

SMOOTH: dict[str, Material] = {
    "mirror": Mirror(),
    "conductor": Conductor(**GOLD),
    "dielectric": Dielectric(),
    "thin dielectric": ThinDielectric(),
}


ALPHA = partial(
    Sweep, "1 / alpha", (1.0, 3.0, 10.0, 30.0, 1e2, 3e2, 1e3, 3e3, 1e4), (1.0, 1e2, 1e4)
)
"""Ever smoother; of so many cases."""


def index_of(material: Material) -> float:
    """Index of refraction inside over outside; 1 for opaque materials."""
    if isinstance(material, RoughDielectric | Dielectric):
        return material.interior_ior / material.exterior_ior
    if isinstance(material, Principled) and material.transmits:
        return material.relative_ior
    return 1.0


def towards(cosine: FloatArray, phi: FloatArray) -> FloatArray:
    """Unit vectors (n, 3), with no digit of small cosines lost."""
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)


# ---- chi-square tests of samples against their stated density, at any roughness ------------------
#
# The chart is that of half vectors: with t = 1 - 1 / sqrt(1 + s²), s the slope over alpha, and phi,
# the lobes of all roughnesses look alike, and fixed cells hold them; visible normals of GGX, of
# a density of s / (1 + s²)² at most, are bounded there up to t = 1.
#
# A direction wi mirrored about h has dwi = 4 (wo·h) dh;  one refracted
# dwi = (wo·h + eta wi·h)² / (eta² |wi·h|) dh, eta the index on wi's side over wo's (Walter et al.
# 2007, eq. 14 and 17).


CELLS = 16
"""Along t and along phi."""

RULES = (10, 7)
"""Nodes along either side of a cell; where the two differ, the finer is not to be relied on."""


Density = Callable[[FloatArray, FloatArray], FloatArray]


class Fit(NamedTuple):
    """p_value: of the samples, given the stated density;  integral: of the density over
    reflected and refracted directions;  doubt: by how much two rules differ in it."""

    p_value: float
    integral: float
    doubt: float


def _nodes(rule: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """t, phi (CELLS² rule²,) and weights (rule²,) of Gauss and Legendre's rule in each cell."""
    nodes, weights = np.polynomial.legendre.leggauss(rule)
    x, w = 0.5 * (nodes + 1.0), 0.5 * weights
    edge = np.arange(CELLS)
    along = (edge[:, None] + x) / CELLS
    n = len(x)
    t = np.broadcast_to(along[:, None, :, None], (CELLS, CELLS, n, n))
    phi = 2.0 * math.pi * np.broadcast_to(along[None, :, None, :], (CELLS, CELLS, n, n))
    area = 2.0 * math.pi / CELLS**2
    return t.reshape(-1), phi.reshape(-1), np.outer(w, w).reshape(-1) * area


def _normals(t: FloatArray, phi: FloatArray, alpha: float) -> tuple[FloatArray, FloatArray]:
    """h (n, 3) and dh / (dt dphi): dh = cos³ dslopes, dslopes = alpha² / (1 - t)³ dt dphi."""
    s = alpha * np.sqrt(t * (2.0 - t)) / (1.0 - t)
    z = 1.0 / np.sqrt(1.0 + s * s)
    h = np.stack([s * z * np.cos(phi), s * z * np.sin(phi), z], axis=1)
    return h, z**3 * alpha**2 / (1.0 - t) ** 3


def _directions(
    wo: FloatArray, h: FloatArray, eta: float, through: bool
) -> tuple[FloatArray, FloatArray]:
    """wi (n, 3) and dwi / dh; 0 where there is none.  wo above."""
    cos_o = h @ wo
    if not through:
        return 2.0 * cos_o[:, None] * h - wo, 4.0 * np.maximum(cos_o, 0.0)
    cos2_t = 1.0 - (1.0 - cos_o * cos_o) / eta**2
    cos_t = np.sqrt(np.maximum(cos2_t, 0.0))
    wi = h * (cos_o / eta - cos_t)[:, None] - wo / eta
    refracts = (cos_o > 0.0) & (cos2_t > 0.0)
    spread = (cos_o - eta * cos_t) ** 2 / (eta**2 * np.where(refracts, cos_t, 1.0))
    return wi, np.where(refracts, spread, 0.0)


def _cell_of(wo: FloatArray, wi: FloatArray, alpha: float, eta: float) -> IntArray:
    """The numbers of the cells of directions on one side."""
    h = wo + eta * wi
    h *= np.copysign(1.0, h[:, 2:])
    x, y = h[:, 0] / (alpha * h[:, 2]), h[:, 1] / (alpha * h[:, 2])
    s2 = x * x + y * y
    turn = np.arctan2(y, x) / (2.0 * math.pi) % 1.0
    row = np.minimum(((1.0 - 1.0 / np.sqrt(1.0 + s2)) * CELLS).astype(int), CELLS - 1)
    column = np.minimum((turn * CELLS).astype(int), CELLS - 1)
    return np.asarray(row * CELLS + column)


class _Chart(NamedTuple):
    """there (m,): which nodes of the cells have a direction on that side;  wo, wi (k, 3): that, and
    where the light comes from;  measure (k,): dwi / (dt dphi);  weights (rule²,): of a cell's."""

    there: npt.NDArray[np.bool_]
    wo: FloatArray
    wi: FloatArray
    measure: FloatArray
    weights: FloatArray


@lru_cache(maxsize=32)  # for materials and contestants in turn
def _chart(wo: tuple[float, ...], alpha: float, eta: float, through: bool, rule: int) -> _Chart:
    t, phi, weights = _nodes(rule)
    h, measure = _normals(t, phi, alpha)
    wi, spread = _directions(np.array(wo), h, eta, through)
    there = (spread > 0.0) & ((wi[:, 2] < 0.0) == through)
    wi = np.ascontiguousarray(wi[there])
    return _Chart(there, np.tile(wo, (len(wi), 1)), wi, (spread * measure)[there], weights)


def _cells(
    function: Density, wo: FloatArray, alpha: float, eta: float, through: bool, rule: int
) -> FloatArray:
    """The integral of a function of directions, of one side, in each cell: (CELLS²,)."""
    chart = _chart(tuple(wo.tolist()), alpha, eta, through, rule)
    values = np.zeros(len(chart.there))
    if len(chart.wi):
        values[chart.there] = function(chart.wo, chart.wi) * chart.measure
    return np.asarray(values.reshape(CELLS**2, -1) @ chart.weights)


def integral(bsdf: Bsdf, wo: FloatArray, alpha: float, eta: float) -> tuple[float, float]:
    """Share of a white sky that is scattered, in power and in the brightest channel, by f cos
    alone, and how far two rules differ."""
    total, doubt = 0.0, 0.0
    for through in (False, True) if eta != 1.0 else (False,):
        scale = eta * eta if through else 1.0

        def power(o: FloatArray, i: FloatArray, scale: float = scale) -> FloatArray:
            return np.asarray(bsdf.evaluate(o, i).max(axis=1) * scale)

        fine, coarse = (_cells(power, wo, alpha, eta, through, rule) for rule in RULES)
        total += float(fine.sum())
        doubt += float(np.abs(fine - coarse).sum())
    return total, doubt


def fit(bsdf: Bsdf, wo: FloatArray, alpha: float, eta: float, u: FloatArray) -> Fit:
    """Of samples for one direction wo (3,) above, with numbers u (n, 3)."""
    n = len(u)
    drawn = bsdf.sample(np.tile(wo, (n, 1)), u)
    # Mitsuba leaves the density of what it refuses; the weight is 0.
    kept = (drawn.pdf > 0.0) & (drawn.weight.max(axis=1) > 0.0) & ~drawn.is_delta
    fine, coarse, count = [], [], []
    for through in (False, True) if eta != 1.0 else (False,):
        fine.append(_cells(bsdf.pdf, wo, alpha, eta, through, RULES[0]))
        coarse.append(_cells(bsdf.pdf, wo, alpha, eta, through, RULES[1]))
        mine = kept & ((drawn.wi[:, 2] < 0.0) == through)
        index = _cell_of(wo, drawn.wi[mine], alpha, eta if through else 1.0)
        count.append(np.bincount(index, minlength=CELLS**2))
    expected, other = np.concatenate(fine), np.concatenate(coarse)
    if not np.isfinite(expected).all():
        return Fit(0.0, math.inf, math.inf)
    p_value = _p_value(n * expected, n * other, np.concatenate(count), n)
    return Fit(p_value, float(expected.sum()), float(np.abs(expected - other).sum()))


def _p_value(expected: FloatArray, other: FloatArray, observed: IntArray, n: int) -> float:
    """Pearson's test.  One cell holds the samples that failed and those of cells that expect fewer
    than 20, or that the rules differ in by a tenth of the noise: where the horizon or the critical
    angle cuts them."""
    large = (expected >= 20.0) & (np.abs(expected - other) <= 0.1 * np.sqrt(expected))
    if not large.any():
        return 1.0
    e = np.append(expected[large], n - expected[large].sum())
    o = np.append(observed[large], n - observed[large].sum())
    if e[-1] < 20.0:
        e, o = np.append(e[:-2], e[-2] + max(e[-1], 0.0)), np.append(o[:-2], o[-2] + o[-1])
    statistic = float(((o - e) ** 2 / e).sum())
    return float(stats.chi2.sf(statistic, len(e) - 1))
