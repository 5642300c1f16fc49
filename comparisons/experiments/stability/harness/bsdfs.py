"""Materials evaluated and sampled for arrays of directions: ours and Mitsuba's, by one interface.

Directions are local, unit, (n, 3); `wo` towards the viewer.  Mitsuba sees them rounded to float32.
"""

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from comparisons.experiments.stability.harness.outcomes import MITSUBA, OURS, FloatArray
from comparisons.experiments.stability.harness.series import Draw, Sweep
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
