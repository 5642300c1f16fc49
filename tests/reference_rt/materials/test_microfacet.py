"""Microfacets: densities against quadrature, Smith's masking against its definition, samples
against their density, the same bits with and without the compiler."""

import math

import numpy as np
import pytest
from builders import U
from flint import arb, ctx
from leaf_checks import vec_towards as towards
from pydantic import TypeAdapter, ValidationError

from comparisons.statistics.chi_square import chi_square, sidak
from reference_rt.core.vec3 import Vec3, dot
from reference_rt.jit.kernel import entry_kernel
from reference_rt.materials.bsdfs.rough_conductor import Rough
from reference_rt.materials.microfacet import ggx_and_smith
from reference_rt.materials.microfacet.ggx_and_smith import (
    BECKMANN,
    GGX,
    MIN_ALPHA,
    AlphaParameter,
    Microfacets,
    _slope_seen,
    density,
    g1,
    g1_over_cos,
    half_vector,
    microfacets_at,
    roughnesses,
    sample_visible,
    visible_density,
)
from reference_rt.textures import NO_TEXTURES, At, Palette

KINDS = (GGX, BECKMANN)


@entry_kernel
def _draw(kind, alpha, v, u, out):
    m = Microfacets(kind, alpha[0], alpha[1])
    for i in range(len(u)):
        n = sample_visible(m, Vec3(v[0], v[1], v[2]), u[i, 0], u[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = n


@entry_kernel
def _densities(kind, alpha, v, h, out):
    m = Microfacets(kind, alpha[0], alpha[1])
    towards = Vec3(v[0], v[1], v[2])
    for i in range(len(h)):
        normal = Vec3(h[i, 0], h[i, 1], h[i, 2])
        out[i, 0], out[i, 1] = density(m, normal), visible_density(m, towards, normal)


def draw(m, v, u):
    out = np.empty((len(u), 3))
    _draw(m.kind, np.array(m[1:]), np.array(v), u, out)
    return out


def densities(m, v, h):
    """(n, 2): of normals, and of those that v sees."""
    out = np.empty((len(h), 2))
    _densities(m.kind, np.array(m[1:]), np.array(v), np.ascontiguousarray(h), out)
    return out


def random_cases(n, seed):
    """Distributions of both kinds, alpha from 0.01 to 1, a third isotropic; directions, a third
    of them grazing."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        alpha = 10.0 ** rng.uniform(-2, 0, 2)
        if k % 3 == 0:
            alpha[1] = alpha[0]
        cosine = rng.uniform(0, 1) if k % 3 != 1 else 10.0 ** rng.uniform(-4, -1)
        yield (
            Microfacets(KINDS[k % 2], float(alpha[0]), float(alpha[1])),
            towards(float(cosine), float(rng.uniform(0, 2 * math.pi))),
        )


@pytest.mark.parametrize("cases", [24, pytest.param(400, marks=pytest.mark.slow)])
def test_visible_normals_have_their_density(cases):
    """Chi-square; and that the density integrates to 1, which is what defines Smith's G1."""
    rng = np.random.default_rng(11)
    p_values = []
    for m, v in random_cases(cases, 12):
        samples = draw(m, v, rng.uniform(0, 1, (40_000, 2)))
        fit = chi_square(lambda h, m=m, v=v: densities(m, v, h)[:, 1], samples)
        # The quadrature may overlook the share of a few samples: 20 of the 40 000 here.
        assert fit.integral == pytest.approx(1.0, abs=5e-4), (m, v)
        p_values.append(fit.p_value)
    assert min(p_values) > sidak(len(p_values))


def test_masking_of_a_direction_and_its_opposite():
    for m, v in random_cases(20, 14):
        assert g1(m, v) == g1(m, -v)
        assert 0.0 <= g1(m, v) <= 1.0
        assert g1(m, v) == pytest.approx(v.z * g1_over_cos(m, v), rel=2 * U)
        assert g1(m, Vec3(0.0, 0.0, 1.0)) == 1.0
        assert g1(m, Vec3(1.0, 0.0, 0.0)) == 0.0


def test_beckmanns_slopes_are_inverted_to_the_last_digits():
    """Against 40 digits: the fraction below the slope found is u again."""
    ctx.dps = 40
    rng = np.random.default_rng(15)
    angles = np.concatenate(
        [rng.uniform(0, math.pi / 2, 200), math.pi / 2 - 10.0 ** rng.uniform(-12, -1, 50)]
    )

    def seen(c, s, x):
        x = arb(x)
        return arb(c) * arb.pi().sqrt() * (-x).erfc() + arb(s) * (-x * x).exp()

    for angle in angles.tolist():
        c, s = math.cos(angle), math.sin(angle)
        most = min(c / s, 6.5)
        for u in (*rng.uniform(0, 1, 4).tolist(), 2.0**-33, 1 - 2.0**-33):
            found = seen(c, s, _slope_seen(c, s, u)) / seen(c, s, most)
            # erfc and exp are right to 2 u, and the sums and Newton's last step add some.
            assert abs(float(found - arb(u))) < 16 * U


@pytest.mark.parametrize("edge", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_beckmanns_slopes_end_where_their_density_does(edge):
    """Near the largest slope that is seen, where the density falls to 0, in few steps too."""
    for angle in np.linspace(0.01, 0.5 * math.pi - 0.01, 20).tolist():
        c, s = math.cos(angle), math.sin(angle)
        slopes = [_slope_seen(c, s, u) for u in (1.0 - 2 * edge, 1.0 - edge, 1.0 - 2.0**-53)]
        assert slopes[0] <= slopes[1] <= slopes[2] <= min(c / s, 6.5)
        most = min(c / s, 6.5)
        for u, x in zip((1.0 - 2 * edge, 1.0 - edge), slopes, strict=False):
            assert abs(ggx_and_smith.seen(c, s, x) / ggx_and_smith.seen(c, s, most) - u) < 16 * U


def edges():
    """Directions at the ends of what there is."""
    tiny = (0.0, 1e-300, 1e-150, 1e-16, 1e-8, 1e-4)
    return [towards(z, phi) for z in tiny for phi in (0.0, 1.0, math.pi / 2)] + [
        Vec3(0.0, 0.0, 1.0),
        Vec3(1e-9, 0.0, 1.0),
        Vec3(-1e-300, 1e-300, 1.0),
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("alpha", [(1e-4, 1e-4), (1e-4, 10.0), (0.3, 0.1), (10.0, 10.0)])
def test_everything_is_finite(kind, alpha):
    m = Microfacets(kind, *alpha)
    u = np.array([(a, b) for a in (0, 2.0**-53, 0.5, 1 - 2.0**-53) for b in (0, 0.5, 1 - 2.0**-53)])
    for v in edges():
        assert math.isfinite(g1_over_cos(m, v))
        for h in draw(m, v, u).tolist():
            h = Vec3(*h)
            assert dot(h, h) == pytest.approx(1.0, rel=16 * U)
            assert h.z > 0.0
            assert math.isfinite(visible_density(m, v, h))
        for h in edges():
            assert 0.0 <= density(m, h) < math.inf
            assert math.isfinite(visible_density(m, v, h))
    assert half_vector(Vec3(1.0, 0.0, 0.0), Vec3(-1.0, 0.0, 0.0)).h == (0.0, 0.0, 0.0)
    assert density(m, Vec3(0.0, 0.0, 0.0)) == density(m, Vec3(0.0, 0.0, -1.0)) == 0.0


def test_alpha_of_a_description():
    alpha = TypeAdapter(AlphaParameter).validate_python
    assert alpha(0.1) == (0.1, 0.1)
    assert alpha([0.1, 1]) == (0.1, 1.0)
    assert alpha("worn") == "worn"
    assert alpha([0.1, "worn"]) == (0.1, "worn")
    assert Rough(alpha=(0.1, 0.2)).oriented
    assert not Rough(alpha=(0.1, 0.1)).oriented
    assert not Rough(alpha="worn").oriented


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        (0, "above 0 and at most 10, got 0"),
        (-0.1, "above 0 and at most 10, got -0.1"),
        (math.nan, "above 0 and at most 10, got nan"),
        (math.inf, "above 0 and at most 10, got inf"),
        ([0.1, 0], "above 0 and at most 10, got 0"),
        ([0.1], "a number, two of them"),
        ([0.1, 0.1, 0.1], "a number, two of them"),
        (True, "a number, two of them"),
        (None, "a number, two of them"),
    ],
)
def test_no_such_alpha(value, problem):
    with pytest.raises(ValidationError, match=problem):
        TypeAdapter(AlphaParameter).validate_python(value)


def test_rows_of_the_table():
    nowhere = At(None, 0.0, 0.0, Vec3(-1.0, -1.0, -1.0))
    table = roughnesses("beckmann", (1e-9, 0.2), NO_TEXTURES)
    assert microfacets_at(table, 0, nowhere) == (BECKMANN, MIN_ALPHA, 0.2)
    textured = roughnesses("ggx", "worn", Palette({"worn": 3}, (0, 0, 0, 1.0)))
    assert textured.alpha_x.texture == textured.alpha_y.texture == [3]
    with pytest.raises(ValueError, match="'worn' has values up to 11; expected at most 10"):
        roughnesses("ggx", "worn", Palette({"worn": 0}, (11.0,)))
