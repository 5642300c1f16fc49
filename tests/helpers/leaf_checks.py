"""What every material that scatters by a law of its own must pass: samples against densities and
integrals, weights against values, compiled code against plain Python."""

import math

import numpy as np
from builders import U

from comparisons.statistics.chi_square import chi_square, integrate
from reference_rt.core.vec3 import Vec3
from reference_rt.jit.kernel import ByClass, entry_kernel
from reference_rt.materials.bsdfs.tables import TABLES
from reference_rt.textures import NO_TEXTURES, At

NOWHERE = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))

MIXTURE = np.array([0.5, 0.3, 0.2])
"""Of the three channels: what is wrong with one is wrong with it."""

_eval_pdf, _sample = ByClass("eval_pdf"), ByClass("sample")
for *_, _table, _module in TABLES:
    if hasattr(_module, "eval_pdf"):
        _eval_pdf.register(_table, _module.eval_pdf)
        _sample.register(_table, _module.sample)
_eval_pdf_one, _sample_one = _eval_pdf.function, _sample.function


def _evaluate_rows(table, wo, wi, values, densities):
    at = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    for i in range(len(wo)):
        a, b = Vec3(wo[i, 0], wo[i, 1], wo[i, 2]), Vec3(wi[i, 0], wi[i, 1], wi[i, 2])
        # One by one: a slice would compile Numba's messages about shapes, 0.3 s in every kernel.
        value, densities[i] = _eval_pdf_one(table, 0, at, a, b)
        values[i, 0], values[i, 1], values[i, 2] = value


def _sample_rows(table, wo, u, wi, weights, others):
    at = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    for i in range(len(u)):
        v = Vec3(wo[i, 0], wo[i, 1], wo[i, 2])
        found = _sample_one(table, 0, at, v, u[i, 0], u[i, 1], u[i, 2])
        wi[i, 0], wi[i, 1], wi[i, 2] = found.wi
        weights[i, 0], weights[i, 1], weights[i, 2] = found.weight
        others[i, 0], others[i, 1] = found.pdf, found.eta
        others[i, 2] = 1.0 if found.is_delta else 0.0


_compiled = entry_kernel(_evaluate_rows), entry_kernel(_sample_rows)
PLAIN = _evaluate_rows, _sample_rows
"""The same functions without the compiler."""


def rows(v, n):
    return np.ascontiguousarray(np.broadcast_to(np.asarray(v, float), (n, 3)))


def evaluate(table, wo, wi, functions=_compiled):
    """(n, 3) f |cos wi| and (n,) densities; wo and wi: a direction, or n of them."""
    n = max(np.size(wo), np.size(wi)) // 3
    values, densities = np.empty((n, 3)), np.empty(n)
    functions[0](table, rows(wo, n), rows(wi, n), values, densities)
    return values, densities


def sample(table, wo, u, functions=_compiled):
    """(n, 3) directions, (n, 3) weights, (n,) densities, (n,) eta, (n,) whether discrete."""
    n = len(u)
    wi, weights, others = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    functions[1](table, rows(wo, n), u, wi, weights, others)
    return wi, weights, others[:, 0], others[:, 1], others[:, 2] != 0


def towards(cosine, phi):
    sine = math.sqrt((1 - cosine) * (1 + cosine))
    return np.array([sine * math.cos(phi), sine * math.sin(phi), cosine])


def vec_towards(cosine, phi):
    return Vec3(*towards(cosine, phi).tolist())


def random_direction(rng, k, front=True):
    """A third of them grazing, a quarter from behind unless `front`."""
    cosine = 10.0 ** rng.uniform(-4, -1) if k % 3 == 0 else rng.uniform(0.05, 1)
    if not front and k % 4 == 3:
        cosine = -cosine
    return towards(cosine, rng.uniform(0, 2 * math.pi))


def p_values(material, wo, rng, n=30_000, most=1e-3, off=0.0):
    """Chi-square of the directions drawn; and whether E[weight] is the integral of f cos, by the
    central limit.  Of those that are not discrete, which the first numbers choose, for a share p.
    most, off: by how much the quadrature of densities and, relatively, of f cos may be too large.
    """
    table = material.tabulate(NO_TEXTURES)
    u = rng.uniform(0, 1, (n, 3))
    first = sample(table, wo, u * (0, 1, 1))
    p = float(first[2][0]) if first[4][0] else 0.0
    u[:, 0] = p + (1 - p) * u[:, 0]
    wi, weights, densities, _, is_delta = sample(table, wo, u)
    assert not is_delta.any(), material
    failed = densities == 0
    wi[failed] = math.nan
    weights[failed] = 0
    fit = chi_square(lambda d: evaluate(table, wo, d)[1] / (1 - p), wi)
    # The quadrature is 2e-4 off at worst, where refraction of grazing light starts in a step:
    # product rules in finer panels, and counts of samples, give 1 there.
    assert fit.integral < 1 + most, material
    total = integrate(lambda d: evaluate(table, wo, d)[0] @ MIXTURE, wi[~failed])
    mixed = weights @ MIXTURE * (1 - p)
    # 1e-5 is the quadrature's: some hundred boxes, each right to a fraction of 1e-6.
    allowed = max(1e-5, off * total)
    z = max(0.0, abs(mixed.mean() - total) - allowed) / max(mixed.std() / math.sqrt(n), 1e-12)
    return fit.p_value, math.erfc(z / math.sqrt(2))


def check_weights(material, wo, rng, condition, bends=True):
    """weight times density is the value, density is `pdf`, of every smooth sample;  condition: how
    much a rounding of the direction shows in them;  bends: whether what passes is refracted."""
    table = material.tabulate(NO_TEXTURES)
    wi, weights, densities, eta, is_delta = sample(table, wo, rng.uniform(0, 1, (2000, 3)))
    kept = (densities > 0) & ~is_delta
    wi, weights, densities, eta = wi[kept], weights[kept], densities[kept], eta[kept]
    values, found = evaluate(table, wo, wi)
    assert ((eta == 1) == ((wi[:, 2] * wo[2] > 0) | (not bends))).all()
    assert np.abs(np.linalg.norm(wi, axis=1) - 1).max(initial=0) < 64 * U * condition
    assert (np.abs(found - densities) <= 64 * U * condition * densities).all()
    product = weights * densities[:, None]
    assert (np.abs(values - product) <= 64 * U * condition * product).all()


def check_same_bits(materials, rng):
    """Compiled kernels and the same text as plain Python; and nothing is NaN or infinite, grazing
    directions and the equator included."""
    wo, wi, u = rng.normal(size=(80, 3)), rng.normal(size=(80, 3)), rng.uniform(0, 1, (80, 3))
    wo[::7, 2] *= 1e-9
    wi[::5, 2] *= 1e-12
    wo[::31, 2] = 0
    wi[3::37, 2] = 0
    for v in (wo, wi):
        v /= np.linalg.norm(v, axis=1)[:, None]
    wi[1::9] = wo[1::9] * (-1, -1, 1)
    wi[2::9] = -wo[2::9]
    wo[4], wi[4], wo[13] = (0, 0, 1), (0, 0, 1), (0, 0, 1)
    u[::11] = 0
    u[5::11] = 1 - U
    for material in materials:
        table = material.tabulate(NO_TEXTURES)
        for one, other in (
            (evaluate(table, wo, wi), evaluate(table, wo, wi, PLAIN)),
            (sample(table, wo, u), sample(table, wo, u, PLAIN)),
        ):
            for a, b in zip(one, other, strict=True):
                assert np.isfinite(a).all(), material
                assert np.array_equal(a, b), material


def albedo(table, wo, rng, n=20_000):
    """The fraction of power that leaves, a channel each, by sampling (unbiased) with its standard
    error; what refracts counts with eta², the factor by which radiance there is denser."""
    _, weights, densities, eta, _ = sample(table, wo, rng.uniform(0, 1, (n, 3)))
    power = weights * (eta * eta * (densities > 0))[:, None]
    return power.mean(axis=0), power.std(axis=0) / math.sqrt(n)
