"""The formulas of media against each other, identities, published numbers and PythonicDISORT."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expn

from comparisons.truth import scattering
from comparisons.truth.areas.atmospheres import RADIANCES, SLABS, Slab
from comparisons.truth.scattering import (
    ball_in_sky,
    blend,
    chandrasekhar_h,
    half_space,
    half_space_in_sky,
    henyey_greenstein,
    isotropic,
    let_through,
    rayleigh,
    seen_ball,
    sent_back,
)

ALBEDOS = (0.1, 0.5, 0.9, 0.99, 0.999)


def cubed(n):
    """Gauss's rule of [0, 1] whose nodes crowd at 0, where H is not smooth."""
    x, weight = np.polynomial.legendre.leggauss(n)
    x, weight = (x + 1.0) / 2.0, weight / 2.0
    return x**3, weight * 3.0 * x**2


@pytest.mark.parametrize("albedo", ALBEDOS)
def test_h_obeys_its_integral_equations_and_has_its_moment(albedo):
    """The closed form against Chandrasekhar's equations: (1960) V 3 and 14, and the mean of H."""
    x, weight = cubed(200)
    mu = np.array([0.0, 0.01, 0.1, 0.5, 1.0])
    h, at = chandrasekhar_h(mu, albedo), chandrasekhar_h(x, albedo)
    below = mu[:, None] + x
    inverse = np.sqrt(1.0 - albedo) + albedo / 2.0 * ((x * at / below) @ weight)
    assert np.abs(1.0 / h - inverse).max() < 1e-12
    assert np.abs(h - 1.0 - albedo / 2.0 * mu * h * ((at / below) @ weight)).max() < 1e-10
    assert at @ weight == pytest.approx(2.0 / albedo * (1.0 - np.sqrt(1.0 - albedo)), rel=1e-12)


def test_h_has_the_values_of_the_table():
    """Chandrasekhar 1960, table XI, without absorption: H(0.5) = 2.0128, H(1) = 2.9078.  What is
    lacking to 1 changes H by sqrt(3 (1 - a)) mu, 2e-5 at most."""
    found = chandrasekhar_h(np.array([0.0, 0.5, 1.0]), 1.0 - 1e-11)
    assert np.abs(found - [1.0, 2.0128, 2.9078]).max() < 1e-4


@pytest.mark.parametrize("albedo", ALBEDOS)
def test_a_half_space_in_a_sky_is_one_in_all_suns(albedo):
    """A sun's irradiance is the sky's radiance times the solid angle 2 pi d(mu0)."""
    x, weight = cubed(60)
    mu = np.array([0.1, 0.5, 1.0])
    suns = half_space(mu[:, None], [albedo], x[:, None], [2.0 * np.pi])[..., 0]
    assert suns @ weight == pytest.approx(half_space_in_sky(mu, [albedo])[:, 0], rel=1e-9)


@pytest.mark.parametrize(
    ("phase", "mean"),
    [(isotropic, 0.0), (rayleigh, 0.0), (henyey_greenstein(0.9), 0.9),
     (henyey_greenstein(-0.5), -0.5),
     (blend(henyey_greenstein(0.8), henyey_greenstein(-0.4), 0.3), 0.44)],
)  # fmt: skip
def test_phase_functions_have_the_integral_1_and_their_mean_cosine(phase, mean):
    x, weight = np.polynomial.legendre.leggauss(400)
    assert 2.0 * np.pi * (phase(x) @ weight) == pytest.approx(1.0, rel=1e-11)
    assert 2.0 * np.pi * ((phase(x) * x) @ weight) == pytest.approx(mean, abs=1e-11)


def test_moments_of_slabs_are_those_of_their_phase_functions():
    x, weight = np.polynomial.legendre.leggauss(400)
    lobes = ((0.7, 0.75), (0.3, -0.4))
    shapes = {
        "rayleigh": rayleigh(x), 0.75: henyey_greenstein(0.75)(x), -0.5: henyey_greenstein(-0.5)(x),
        lobes: blend(henyey_greenstein(0.75), henyey_greenstein(-0.4), 0.3)(x),
    }  # fmt: skip
    legendre = np.polynomial.legendre.legvander(x, 11)
    for phase, values in shapes.items():
        slab = Slab((1.0,) * 3, (1.0,) * 3, phase, True, 0.5)
        assert np.allclose(slab.moments(12), 2.0 * np.pi * (legendre.T @ (values * weight)))


def test_a_layer_scatters_once_what_its_integral_says():
    """The integral along the ray, and the limit where both cosines are the same."""
    for mu, mu0, depth in ((0.6, 0.8, 1.5), (0.3, 0.3, 4.0), (0.9, 0.2, 0.01)):
        back = quad(lambda x: np.exp(-x / mu0 - x / mu) / mu, 0.0, depth)[0]  # noqa: B023
        on = quad(lambda x: np.exp(-x / mu0 - (depth - x) / mu) / mu, 0.0, depth)[0]  # noqa: B023
        assert sent_back(np.array([mu]), mu0, [depth])[0, 0] == pytest.approx(back, rel=1e-9)
        assert let_through(np.array([mu]), mu0, [depth])[0, 0] == pytest.approx(on, rel=1e-9)


def test_a_floor_under_smoke_gets_what_the_integral_over_its_sky_says():
    for depth in (0.1, 1.0, 4.0):
        direct = 2.0 * quad(lambda mu: mu * np.exp(-depth / mu), 0.0, 1.0)[0]  # noqa: B023
        assert 2.0 * expn(3, depth) == pytest.approx(direct, rel=1e-9)


# ---- balls --------------------------------------------------------------------------------------


def taken(radius, albedo):
    """The share of the sky's light that a ball absorbs: the mean over its disk."""
    x, weight = np.polynomial.legendre.leggauss(64)
    mu, weight = (x + 1.0) / 2.0, weight / 2.0
    return (1.0 - seen_ball(radius * np.sqrt(1.0 - mu**2), radius, albedo)) * 2.0 * mu @ weight


@pytest.mark.parametrize("radius", [0.3, 1.0, 4.0])
def test_the_mean_way_through_a_ball_is_4_r_over_3_however_it_scatters(radius):
    """4 V / S (Blanco & Fournier 2003): with the absorption e to first order, whose second one is
    less than 20 radii² e; two absorptions take it away."""
    ways = [taken(radius, 1.0 - e) / (e * radius) for e in (2e-5, 1e-5)]
    assert 2.0 * ways[1] - ways[0] == pytest.approx(4.0 / 3.0, rel=2e-6)


def test_a_black_ball_takes_what_its_chords_say():
    for radius in (0.1, 1.0, 3.0):
        left = (1.0 - (1.0 + 2.0 * radius) * np.exp(-2.0 * radius)) / (2.0 * radius**2)
        assert taken(radius, 0.0) == pytest.approx(1.0 - left, rel=1e-12)


@pytest.mark.parametrize(("radius", "albedo"), [(0.5, 0.4), (4.0, 0.95), (10.0, 0.999)])
def test_the_equation_of_a_ball_is_solved_to_a_millionth(radius, albedo, monkeypatch):
    """Twice as many nodes; and J by a direct integral over all directions, at some places."""
    across = radius * np.array([0.0, 0.5, 0.9])
    first, lack = seen_ball(across, radius, albedo), ball_in_sky(radius, albedo)
    monkeypatch.setattr(scattering, "BALL_NODES", 256)
    assert np.abs(seen_ball(across, radius, albedo) - first).max() < 1e-6
    x, weight = np.polynomial.legendre.leggauss(400)
    for r in radius * np.array([0.2, 0.7]):
        end = -r * x + np.sqrt(radius**2 - r**2 * (1.0 - x**2))
        t = end[:, None] * (1.0 + x) / 2.0
        at = np.sqrt(r**2 + t**2 + 2.0 * r * t * x[:, None])
        along = ((1.0 - albedo + albedo * lack(at)) * np.exp(-t)) @ weight * end / 2.0
        assert lack(np.array(r)) == pytest.approx(along @ weight / 2.0, rel=2e-5)


# ---- slabs --------------------------------------------------------------------------------------


def test_slabs_are_numbers_of_layers_and_their_errors_are_small():
    assert set(RADIANCES) == set(SLABS)
    assert 3 * len(SLABS) >= 40
    for values, error in RADIANCES.values():
        assert len(values) == 3
        assert min(values) > 0.0
        assert error < 1e-4


def remade(name):
    pytest.importorskip("PythonicDISORT")
    from comparisons.truth.disort import radiances

    values, _ = RADIANCES[name]
    assert np.abs(radiances(SLABS[name], SLABS[name].streams) / values - 1.0).max() < 1e-8


@pytest.mark.parametrize("name", ["slab_sky_1", "slab_sky_4"])
def test_discrete_ordinates_make_the_table_of_slabs(name):
    """Its digits are nine."""
    remade(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLABS)
def test_discrete_ordinates_make_the_whole_table_of_slabs(name):
    remade(name)


def test_discrete_ordinates_of_a_thick_layer_are_those_of_a_half_space():
    """Of two solutions that share nothing.  The error of 64 streams falls as their square, since
    radiance is not smooth at the horizon."""
    pytest.importorskip("PythonicDISORT")
    from comparisons.truth.disort import radiance

    for albedo, mu, mu0 in ((0.5, 0.3, 0.8), (0.9, 0.7, 0.5)):
        slab = Slab((40.0,) * 3, (albedo,) * 3, 0.0, True, mu, mu0, 70.0)
        truth = half_space(np.array([mu]), [albedo], mu0, [1.0])[0, 0]
        assert radiance(slab, 0, 64) == pytest.approx(truth, rel=2e-4)
        in_sky = Slab((40.0,) * 3, (albedo,) * 3, 0.0, True, mu)
        sky = half_space_in_sky(np.array([mu]), [albedo])[0, 0]
        assert radiance(in_sky, 0, 64) == pytest.approx(sky, rel=2e-4)


def test_discrete_ordinates_of_a_dark_layer_are_light_scattered_once():
    """The rest is the albedo's next power: some 1e-6.  This tells the side of g and the azimuth."""
    pytest.importorskip("PythonicDISORT")
    from comparisons.truth.disort import radiance

    for g, azimuth in ((0.6, 40.0), (-0.5, 130.0)):
        for is_back, share in ((True, sent_back), (False, let_through)):
            slab = Slab((1.0,) * 3, (1e-6,) * 3, g, is_back, 0.6, 0.8, azimuth)
            sines = np.sqrt((1.0 - 0.6**2) * (1.0 - 0.8**2))
            turn = sines * np.cos(np.radians(azimuth)) + (-1.0 if is_back else 1.0) * 0.6 * 0.8
            once = 1e-6 * henyey_greenstein(g)(turn) * share(np.array([0.6]), 0.8, [1.0])[0, 0]
            assert radiance(slab, 0, 64) == pytest.approx(once, rel=1e-4)
