"""Microfacets and coats without the approximations of Mitsuba.

Beckmann microfacets with the exact masking function: `{"type": "exact_beckmann"}`.

Mitsuba uses Walter et al.'s rational approximation of Smith's G1 for Beckmann's distribution, which
is up to 0.31 % off (`approximate_g1` over `exact_g1`); the BSDF contains G1 of both directions, and
is up to 0.63 % off.  This plugin wraps Mitsuba's rough conductor or dielectric, and multiplies its
BSDF by exact over approximate G1 for both directions; everything else is Mitsuba's.

The nested material must sample visible normals ("sample_visible" true, its default).  Mitsuba draws
them exactly, but their density contains G1 of wi: it is multiplied by the same ratio, which is then
missing in the weight, BSDF over density.  The other way to sample is wrong for dielectrics: normals
are drawn from a rougher distribution, of which the weight knows nothing (src/bsdfs/
roughdielectric.cpp).  At alpha = 0.4 as much light passes a surface as should at normal incidence,
and 3 to 4 % more at 75 degrees (`tests/comparisons/mitsuba/test_documented_limits.py`).

Plastic and rough plastic without Mitsuba's tables: `{"type": "exact_coat"}`.

The diffuse base under a coat is rho / (1 - c R) T(wi) T(wo) / (eta² pi), with R the coat's internal
reflectance and T its transmittance.  Mitsuba takes R of smooth plastic from a fit made for indices
up to 2; of rough plastic as the mean over 64 cosines from 0 to 1, both ends included, which is
about R / 64 below the integral; and T by linear interpolation between these 64 cosines.  Here both
are integrals in float64: `comparisons.materials.coat` measures the error of Mitsuba's base.
The specular reflection is Mitsuba's, with the exact masking of the former.

Mitsuba's plastics choose between coat and base by the means of their colours.  Colours of vertices
have no mean in Mitsuba (3.9.1 raises an error), so the nested material has SUBSTITUTE in their
place, and this plugin evaluates those of the vertices.  Only the probability of the choice depends
on the substitute, and it is the same in `sample` and `pdf`.
"""

import functools
import math
from typing import Any

import numpy as np
from scipy import special

from comparisons.mitsuba.plugins import base
from comparisons.mitsuba.plugins.base import base_class
from reference_rt.core.arrays import FloatArray


def approximate_g1(a: FloatArray) -> FloatArray:
    """Mitsuba's G1, for a = 1 / (alpha tan theta) (include/mitsuba/render/microfacet.h)."""
    rational = (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
    return np.where(a >= 1.6, 1.0, rational)


def exact_g1(a: FloatArray) -> FloatArray:
    """Smith's G1: 2 / (1 + erf a + exp(-a²) / (a sqrt pi)) (Walter et al. 2007, section 5.2)."""
    return np.asarray(2.0 / (1.0 + special.erf(a) + np.exp(-a * a) / (a * math.sqrt(math.pi))))


def correction(mi: Any, alpha_u: Any, alpha_v: Any, v: Any) -> Any:
    """Exact over approximate G1(v)."""
    import drjit as dr

    x, y = alpha_u * v.x, alpha_v * v.y
    slope = dr.sqrt(x * x + y * y)
    # Beyond 10 both are 1; at grazing angles the ratio of the two tends to a constant.
    a = dr.clip(dr.abs(v.z) / dr.maximum(slope, 1e-20), 1e-6, 10.0)
    # Both divided by a.
    rational = (3.535 + 2.181 * a) / (1.0 + 2.276 * a + 2.577 * a * a)
    approximate = dr.select(a >= 1.6, 1.0 / a, rational)
    exact = 2.0 / (a * (1.0 + dr.erf(a)) + dr.exp(-a * a) / math.sqrt(math.pi))
    return exact / approximate


def _register_beckmann(mi: Any) -> None:
    import drjit as dr

    class ExactBeckmann(base_class(mi)):  # type: ignore[misc]
        """Parameters: nested; alpha_u and alpha_v, its own."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.wrap(properties["nested"])
            self.alphas = [base.number(mi, properties[f"alpha_{c}"]) for c in "uv"]

        def correction(self, si: Any, v: Any, active: Any) -> Any:
            alpha_u, alpha_v = (dr.maximum(alpha(si, active), 1e-4) for alpha in self.alphas)
            return correction(mi, alpha_u, alpha_v, v)

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            drawn, value = self.nested.sample(context, si, sample1, sample2, active)
            drawn.pdf = drawn.pdf * self.correction(si, si.wi, active)
            return drawn, value * self.correction(si, drawn.wo, active)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            factor = self.correction(si, si.wi, active) * self.correction(si, wo, active)
            return self.nested.eval(context, si, wo, active) * factor

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            density = self.nested.pdf(context, si, wo, active)
            return density * self.correction(si, si.wi, active)

    mi.register_bsdf("exact_beckmann", ExactBeckmann)


CELLS = 512
"""Cells of T's table, evenly spaced in the square root of the cosine: for an index above 1 linear
interpolation is exact to 5e-6 (measured)."""

NODES, NEAR_TOTAL = (64, 32), (192, 64)
"""Of the quadrature over visible normals.  Where reflection may be total, F behaves like a square
root: T for an index below 1 is off by up to 0.3 % at single cosines, by 2 % with NODES (against 900
nodes)."""

COLOURS = ("diffuse_reflectance", "specular_reflectance")
"""Mitsuba's names of a plastic's colours."""

SUBSTITUTE = 0.5
"""The colours of a nested material in the place of those of vertices: any number above 0 will do,
and at most 1, as Mitsuba takes it for a reflectance."""


_legendre = functools.cache(special.roots_legendre)
"""SciPy's: numpy's dense eigenvalues take a second with several threads on a busy machine."""


def _rule(n: int, low: float = 0.0, high: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights for an interval."""
    nodes, weights = _legendre(n)
    return low + 0.5 * (high - low) * (nodes + 1.0), 0.5 * (high - low) * weights


def fresnel(cosine: FloatArray, eta: float) -> FloatArray:
    """Unpolarised reflectance from outside a medium of index eta, in float64."""
    cosine_t = np.sqrt(np.maximum(1.0 - (1.0 - cosine * cosine) / (eta * eta), 0.0))
    s = (cosine - eta * cosine_t) / (cosine + eta * cosine_t)
    p = (eta * cosine - cosine_t) / (eta * cosine + cosine_t)
    return np.asarray(np.where(cosine_t > 0.0, 0.5 * (s * s + p * p), 1.0))


def smooth_reflectance(eta: float) -> float:
    """R: the integral of 2 F cos over the cosines, inside a medium of index eta.

    By quadrature over the square root of the cosine.  For eta > 1 the integral is taken outside: by
    reciprocity the transmittance from inside is 1 / eta² of that from outside.
    """
    if eta < 1.0:
        x, weight = _rule(400)
        return float(np.sum(weight * 4.0 * x**3 * fresnel(x * x, 1.0 / eta)))
    x, weight = _rule(400)
    outside = float(np.sum(weight * 4.0 * x**3 * fresnel(x * x, eta)))
    return 1.0 - (1.0 - outside) / (eta * eta)


def accepted(eta: float) -> float:
    """The index, or one next to 1, which Mitsuba's rough plastic refuses: a coat of index 1
    reflects none of the light, one of this index 2.5e-11."""
    return 1.00001 if eta == 1.0 else eta


class RoughCoat:
    """T at CELLS + 1 cosines, and R, of a rough coat with index `eta`, by quadrature in float64."""

    def __init__(self, distribution: str, alpha: float, eta: float) -> None:
        self.is_beckmann, self.alpha = distribution == "beckmann", alpha
        self.nodes = NODES if eta > 1.0 else NEAR_TOTAL
        self.transmittance = self.scattered(np.linspace(0.0, 1.0, CELLS + 1) ** 2, eta, True)
        critical = math.sqrt(1.0 - 1.0 / (eta * eta)) if eta > 1.0 else 0.5
        parts = (_rule(64, 0.0, critical), _rule(64, critical, 1.0))
        nodes, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
        self.nodes = NEAR_TOTAL
        within = self.scattered(nodes, 1.0 / eta, False)
        self.reflectance = float(np.sum(2.0 * nodes * weights * within))

    def scattered(self, cosines: FloatArray, eta: float, through: bool) -> FloatArray:
        """The fraction of light that microfacets transmit (`through`) or reflect, at each cosine
        (n,): the mean over visible normals."""
        return np.array([self._scattered(max(float(c), 1e-6), eta, through) for c in cosines])

    def _scattered(self, cosine: float, eta: float, through: bool) -> float:
        sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
        x, z, weight = self._seen(cosine, sine)
        of_normal = np.minimum(sine * x + cosine * z, 1.0)  # the cosine of light and normal
        share = fresnel(of_normal, eta)
        if through:
            share = 1.0 - share
            cosine_t = np.sqrt(np.maximum(1.0 - (1.0 - of_normal**2) / (eta * eta), 0.0))
            turned = of_normal / eta - cosine_t
            wo_z = -(turned * z - cosine / eta)
        else:
            wo_z = 2.0 * of_normal * z - cosine
        up = wo_z > 0.0
        slope = np.sqrt(np.maximum(1.0 - wo_z * wo_z, 1e-30)) * self.alpha
        a = np.where(up, wo_z, 1.0) / slope
        g1 = exact_g1(np.minimum(a, 26.0)) if self.is_beckmann else _ggx_g1(a)
        return float(np.sum(weight * np.where(up, share * g1, 0.0)))

    def _seen(self, cosine: float, sine: float) -> tuple[FloatArray, ...]:
        """Unit normals visible from (sine, 0, cosine): x, z, and weights that sum to 1.

        Beckmann: slopes over alpha, a and b, have the density (cosine - alpha sine a)
        exp(-a² - b²).  GGX: with roughness 1 they reflect the stretched direction uniformly into a
        spherical cap (Dupuy & Benyoub 2023).
        """
        if self.is_beckmann:
            last = min(6.0, cosine / max(self.alpha * sine, 1e-12))
            (a, of_a), (b, of_b) = _rule(self.nodes[0], -6.0, last), _rule(self.nodes[1], 0.0, 6.0)
            a, b = (g.ravel() for g in np.meshgrid(a, b, indexing="ij"))
            weight = np.outer(of_a, of_b).ravel() * np.exp(-a * a - b * b)
            weight *= cosine - self.alpha * sine * a
            normal = np.stack([-self.alpha * a, self.alpha * b, np.ones_like(a)])
        else:
            stretched = np.array([self.alpha * sine, 0.0, cosine])
            stretched /= np.linalg.norm(stretched)
            # v is squared, as the integrand behaves like a square root at the cap's rim.
            (v, of_v), (phi, of_phi) = _rule(self.nodes[0]), _rule(self.nodes[1], 0.0, math.pi)
            weight = np.outer(2.0 * of_v * v, of_phi).ravel()
            v, phi = (g.ravel() for g in np.meshgrid(v, phi, indexing="ij"))
            down = v * v * (1.0 + stretched[2])
            r = np.sqrt(np.maximum(down * (2.0 - down), 0.0))
            cap = np.stack([r * np.cos(phi), r * np.sin(phi), 1.0 - down])
            normal = (cap + stretched[:, None]) * np.array([[self.alpha], [self.alpha], [1.0]])
        x, _, z = normal / np.linalg.norm(normal, axis=0)
        return x, z, weight / weight.sum()


rough_coat = functools.cache(RoughCoat)


def _ggx_g1(a: FloatArray) -> FloatArray:
    """Smith's G1 for GGX, with a = 1 / (alpha tan theta) (Walter et al. 2007, eq. 34)."""
    return np.asarray(2.0 / (1.0 + np.sqrt(1.0 + 1.0 / (a * a))))


def _register_coat(mi: Any) -> None:
    import drjit as dr

    everything = 0xFFFFFFFF
    diffuse = int(mi.BSDFFlags.DiffuseReflection)

    class ExactCoat(base_class(mi)):  # type: ignore[misc]
        """Parameters: nested, Mitsuba's own material; its reflectance, nonlinear, eta; distribution
        and alpha if it is rough; specular, if that of the nested material is SUBSTITUTE."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.wrap(properties["nested"])
            self.base = base.colour(mi, properties.get_texture("reflectance", 0.5))
            self.specular: base.Parameter | None = None
            if "specular" in properties:
                self.specular = base.colour(mi, properties.get_texture("specular", 1.0))
            self.nonlinear = properties["nonlinear"]
            self.eta = float(properties["eta"])
            self.distribution = properties.get("distribution", "")
            self.alpha = max(float(properties.get("alpha", 0.0)), 1e-4)
            if self.distribution:
                coat = rough_coat(self.distribution, self.alpha, self.eta)
                self.r, values = coat.reflectance, coat.transmittance
                self.table = mi.Float(values.astype(np.float32)) if base.is_wide(mi) else values
            else:
                self.r = smooth_reflectance(self.eta)

        def coloured(self, value: Any, si: Any, active: Any) -> Any:
            """Light that the nested material's coat reflects, with the coat's own colour."""
            if self.specular is None:
                return value
            return value * self.specular(si, active) / SUBSTITUTE

        def passing(self, cosine: Any) -> Any:
            """T at a cosine above 0."""
            if not self.distribution:
                return 1.0 - mi.fresnel(cosine, self.eta)[0]
            x = dr.sqrt(dr.clip(cosine, 0.0, 1.0)) * CELLS
            if not base.is_wide(mi):
                k = min(int(x), CELLS - 1)
                low, high = float(self.table[k]), float(self.table[k + 1])
            else:
                k = dr.minimum(mi.UInt32(x), CELLS - 1)
                low, high = (dr.gather(mi.Float, self.table, i) for i in (k, k + 1))
            return low + (x - mi.Float(k)) * (high - low)

        def scattered(self, si: Any, wo: Any, active: Any) -> Any:
            """BSDF times cosine of the base."""
            rho = self.base(si, active)
            value = rho / (1.0 - (rho if self.nonlinear else mi.Color3f(1.0)) * self.r)
            passing = self.passing(si.wi.z) * self.passing(wo.z)
            value *= passing * wo.z / (math.pi * self.eta * self.eta)
            lit = dr.select(si.wi.z > 0.0, wo.z > 0.0, False)
            return dr.select(lit, value, mi.Color3f(0.0))

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            drawn, value = self.nested.sample(context, si, sample1, sample2, active)
            perfect = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
            smooth = self.eval(context, si, drawn.wo, active) / dr.maximum(drawn.pdf, 1e-30)
            smooth = dr.select(drawn.pdf > 0.0, smooth, mi.Color3f(0.0))
            return drawn, dr.select(perfect, self.coloured(value, si, active), smooth)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            total = mi.Color3f(0.0)
            if self.distribution and context.component in (everything, 0):
                glossy = mi.BSDFContext(context.mode)
                glossy.type_mask = context.type_mask
                glossy.component = 0
                total += self.coloured(self.nested.eval(glossy, si, wo, active), si, active)
                if self.distribution == "beckmann":
                    for v in (si.wi, wo):
                        total *= correction(mi, self.alpha, self.alpha, v)
            if context.component in (everything, 1) and context.type_mask & diffuse == diffuse:
                total += self.scattered(si, wo, active)
            return total

    mi.register_bsdf("exact_coat", ExactCoat)


def register(mi: Any) -> None:
    """Define both materials for the current variant, and register them."""
    _register_beckmann(mi)
    _register_coat(mi)
