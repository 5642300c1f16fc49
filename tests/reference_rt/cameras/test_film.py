"""Reconstruction filters: formulas, unbiased samples of them, an edge seen through each."""

import math

import numpy as np
import pytest
from scipy.stats import qmc

import reference_rt as rt
from reference_rt.cameras.film import film_offset, stratum_of
from reference_rt.core import transform

EVERY = [
    rt.BoxFilter(),
    rt.TentFilter(),
    rt.TentFilter(radius=2.5),
    rt.GaussianFilter(),
    rt.GaussianFilter(stddev=1.5),
    rt.MitchellFilter(),
    rt.MitchellFilter(b=1.0, c=0.0),
    rt.MitchellFilter(b=0.0, c=0.0),
    rt.CatmullRomFilter(),
    rt.LanczosFilter(),
    rt.LanczosFilter(lobes=1),
    rt.LanczosFilter(lobes=6),
]


def radius(description):
    """The end of the filter's support, in pixels."""
    match description:
        case rt.BoxFilter():
            return 0.5
        case rt.TentFilter():
            return description.radius
        case rt.GaussianFilter():
            return 4.0 * description.stddev
        case rt.LanczosFilter():
            return float(description.lobes)
    return 2.0


def pieces(description):
    """Edges between which the filter is smooth."""
    r = radius(description)
    return np.unique([-r, *np.arange(math.ceil(-r), math.floor(r) + 1), r])


def quadrature(edges, points):
    """Gauss' nodes and weights between each two edges, one row for each."""
    x, w = np.polynomial.legendre.leggauss(points)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    return middle[:, None] + half[:, None] * x, half[:, None] * w


def integral(description, g, to=None):
    """The filter's integral of g up to `to`."""
    edges = pieces(description)
    if to is not None:
        edges = np.unique(np.minimum(edges, to))
        if len(edges) < 2:
            return 0.0
    x, w = quadrature(edges, 40)
    values = np.array([description.value(float(at)) for at in x.flat]).reshape(x.shape)
    return float(np.sum(w * values * g(x)))


def cubic(b, c):
    """Mitchell's and Netravali's equation 8, as printed."""

    def value(x):
        x = abs(x)
        if x < 1:
            return ((12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + 6 - 2 * b) / 6
        if x < 2:
            far = (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2
            return (far + (-12 * b - 48 * c) * x + 8 * b + 24 * c) / 6
        return 0.0

    return value


@pytest.mark.parametrize(
    ("description", "formula"),
    [
        (rt.BoxFilter(), lambda x: float(-0.5 <= x < 0.5)),
        (rt.TentFilter(radius=2.5), lambda x: max(0.0, 2.5 - abs(x)) / 2.5**2),
        (rt.MitchellFilter(), cubic(1 / 3, 1 / 3)),
        (rt.MitchellFilter(b=1.0, c=0.0), cubic(1, 0)),
        (rt.MitchellFilter(b=0.25, c=0.75), cubic(0.25, 0.75)),
        (rt.CatmullRomFilter(), cubic(0, 0.5)),
    ],
    ids=["box", "tent", "mitchell", "b-spline", "mitchell-quarter", "catmull-rom"],
)
def test_values_are_the_formulas(description, formula):
    """These have an integral of 1 as they stand."""
    for x in np.linspace(-2.6, 2.6, 521).tolist():
        # Cubics have terms up to 45, which cancel.
        assert description.value(x) == pytest.approx(formula(x), rel=0, abs=3e-14)


@pytest.mark.parametrize("description", EVERY, ids=str)
def test_integral_is_one(description):
    # Rounding of some thousand terms, and the quadrature, whose error is far below.
    assert integral(description, np.ones_like) == pytest.approx(1.0, rel=0, abs=1e-12)


def test_ratios_of_gaussian_and_lanczos():
    """Their formulas, up to the integral."""
    gaussian, s = rt.GaussianFilter(stddev=0.7), 0.7
    lanczos = rt.LanczosFilter(lobes=3)
    for x in np.linspace(-2.7, 2.7, 101):
        expected = (np.exp(-(x**2) / (2 * s * s)) - np.exp(-8)) / (1 - np.exp(-8))
        # Rounding beside 1.
        assert gaussian.value(x) / gaussian.value(0.0) == pytest.approx(expected, rel=0, abs=1e-15)
        expected = np.sinc(x) * np.sinc(x / 3)
        assert lanczos.value(x) / lanczos.value(0.0) == pytest.approx(expected, rel=0, abs=1e-15)
    for n in (1, 2):
        assert lanczos.value(float(n)) == pytest.approx(0.0, abs=1e-16)
    assert gaussian.value(2.8) == lanczos.value(3.0) == lanczos.value(-7.0) == 0.0


@pytest.mark.parametrize("description", EVERY, ids=str)
def test_even(description):
    for x in (0.2, 0.49, 0.9, 1.3, 1.7, 2.4):
        assert description.value(x) == description.value(-x)


@pytest.mark.parametrize(
    "description",
    [rt.BoxFilter(), rt.TentFilter(), rt.TentFilter(radius=2.0), rt.MitchellFilter(),
     rt.CatmullRomFilter(), rt.MitchellFilter(b=0.9, c=0.3)],
    ids=str,
)  # fmt: skip
def test_partition_of_unity(description):
    """Filters of whole pixels add up to 1 everywhere: an even picture stays even."""
    for x in np.linspace(-0.5, 0.499, 41):
        total = sum(description.value(float(x + k)) for k in range(-4, 5))
        assert total == pytest.approx(1.0, rel=0, abs=1e-14)


@pytest.mark.parametrize("description", EVERY, ids=str)
def test_weights_are_unbiased(description):
    """E[weight x^k], over u, is the filter's moment."""
    setup = description.setup()
    limits = getattr(setup, "cumulative", np.array([0.0, 0.5, 1.0]))  # where offset or weight jump
    limits = np.unique(limits)
    cells = len(limits) - 1
    # Inside a cell offset and weight are smooth, but for the tent, whose slope is infinite at
    # u = 0 and 1 (error of Gauss' rule for sqrt: of order 1 / points³).
    u, share = quadrature(limits, 8 if cells > 2 else 500)
    drawn = np.array([film_offset(setup, float(at)) for at in u.flat])
    for power in range(5):
        expected = integral(description, lambda x, k=power: x**k)
        found = np.sum(share.ravel() * drawn[:, 1] * drawn[:, 0] ** power)
        tolerance = 1e-12 if cells > 2 else 1e-8
        assert found == pytest.approx(expected, abs=tolerance * radius(description) ** power)


ZERO = 1e-9
"""Where a filter is 0 its weights are polynomials' rounding errors, 1e-14 of its maximum over the
density of its smallest cells, which is 1e-5 of the largest, of either sign."""


@pytest.mark.parametrize("description", EVERY, ids=str)
def test_offsets_stay_inside_and_rise(description):
    setup = description.setup()
    u = np.array([0.0, 2.0**-33, *np.linspace(0.001, 0.999, 999), 1 - 2.0**-33, 1 - 2.0**-53])
    drawn = np.array([film_offset(setup, float(x)) for x in u])
    for part in (drawn[drawn[:, 1] < -ZERO], drawn[drawn[:, 1] > ZERO]):  # negative ones come first
        assert (np.diff(part[:, 0]) >= 0).all()
        assert (np.diff(part[1:-1, 0]) > 0).all()
    assert np.abs(drawn[:, 0]).max() <= radius(description)
    assert np.isfinite(drawn).all()


@pytest.mark.parametrize("description", EVERY, ids=str)
def test_weights_are_even_on_either_side_of_zero(description):
    """Drawn from |f|: weights are near a number where f is positive, and near another where it is
    negative, away from where f is 0."""
    setup = description.setup()
    if not hasattr(setup, "cumulative"):
        return
    x, w = quadrature(np.linspace(-radius(description), radius(description), 20_001), 1)
    f = np.array([description.value(float(at)) for at in x.flat])
    drawn = np.array([film_offset(setup, float(u)) for u in np.linspace(0.001, 0.999, 999)])
    values = np.array([description.value(float(at)) for at in drawn[:, 0]])
    clear = np.abs(drawn[:, 1]) > ZERO
    assert np.array_equal(np.sign(drawn[clear, 1]), np.sign(values[clear]))
    share = 0.0
    if (f < 0).any():
        share = setup.cumulative[sum(description.value(float(at)) < 0 for at in setup.cells[:, 0])]
        assert math.log2(share) == round(math.log2(share))
    for sign, points in ((1, 1.0 - share), (-1, share)):
        size = np.sum(w.ravel() * np.maximum(sign * f, 0.0))
        large = sign * values > 0.2 * np.abs(f).max()
        # Half a cell, a 128th of a pixel or a 64th of a Gaussian's s, changes f by at most that
        # times its slope, which is below 2 of its maximum: 0.016 of it, of at least 0.2.
        assert np.allclose(sign * drawn[large, 1], size / max(points, 1e-9), rtol=0.08)


@pytest.mark.parametrize("description", EVERY, ids=str)
def test_as_many_of_sobol_points_are_negative(description):
    """In each pixel of 256 samples, so that an even picture has no noise."""
    setup = description.setup()
    counts = set()
    for seed in range(20):
        u = qmc.Sobol(2, rng=np.random.default_rng(seed)).random(256)
        weights = [film_offset(setup, x)[1] * film_offset(setup, y)[1] for x, y in u.tolist()]
        counts.add(sum(weight < 0 for weight in weights))
    assert len(counts) == 1


@pytest.mark.parametrize(
    "description", [rt.MitchellFilter(), rt.CatmullRomFilter(), rt.LanczosFilter()], ids=str
)
def test_strata_share_out_all_samples(description):
    """Of 128 samples each stratum has the first numbers of its sequence, each once; its weight
    makes up for how many they are; and every sample is in each stratum as often."""
    setup = description.setup()
    for pixel in (0, 7):
        strata = {}
        for k in range(128):
            with np.errstate(over="ignore"):  # of hashes
                own = stratum_of(setup, 3, pixel, k)
            strata.setdefault((own.pixel, *own[2:]), []).append(own.number)
        parts = parts_of(setup.share)
        assert {(x, y) for _, x, y, _ in strata} == {(x, y) for x in parts for y in parts}
        assert len(strata) == 4
        for (_, x, y, weight), numbers in strata.items():
            assert sorted(numbers) == list(range(len(numbers)))
            assert weight * len(numbers) / 128 == pytest.approx(x[1] * y[1], rel=1e-14)
    of, size = setup.strata.of, setup.strata.size
    for k in range(4):
        often = (of == k).reshape(16, 4, 16).sum(axis=(0, 1))
        assert (often == 16 * size[k] // 16).all()


def parts_of(share):
    """The parts of [0, 1) in which a filter is negative, and positive."""
    return (0.0, share), (share, 1.0 - share)


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    ("sampler", "rows"),
    [(rt.Independent(spp=4096, seed=6), 32), (rt.Sobol(spp=24, seed=6), 1024)],
    ids=["independent", "sobol"],
)
@pytest.mark.parametrize(
    "description",
    [EVERY[0], EVERY[1], EVERY[3], rt.MitchellFilter(), rt.CatmullRomFilter(), rt.LanczosFilter()],
    ids=str,
)
def test_a_step(description, sampler, rows):
    """The emissive half-plane x < 0.3 pixels right of the picture's middle, under each pixel.  Of
    24 samples a pixel has a part of the strata only."""
    edge, width = 0.3, 12
    half = transform.Translate(translate=(-100 + edge * 2 / width, 0, 0))
    scene = rt.Scene(
        camera=rt.Orthographic(eye=(0, 0, 1), width=2),
        film=rt.Film(width=width, height=rows, filter=description),
        sampler=sampler,
        integrator=rt.Whitted(),
        materials={"lamp": rt.Emissive(radiance=(1, 1, 1))},
        shapes=(
            rt.Rectangle(material="lamp", transform=(transform.Scale(scale=(100,) * 3), half)),
        ),
    )
    columns = rt.render(scene).colour[..., 0]
    mean, error = columns.mean(axis=0), columns.std(axis=0, ddof=1) / math.sqrt(rows)
    for i in range(width):
        to = edge + width / 2 - (i + 0.5)  # the edge, counted from this pixel's centre
        # 4 standard errors, and rounding.
        assert abs(mean[i] - integral(description, np.ones_like, to)) <= 4 * error[i] + 1e-12
    assert mean[0] == pytest.approx(1.0, abs=0.02)
    assert 0.2 < mean[width // 2] < 0.9


@pytest.mark.parametrize(
    ("cls", "fields"),
    [
        (rt.TentFilter, {"radius": 0.0}),
        (rt.TentFilter, {"radius": -1.0}),
        (rt.GaussianFilter, {"stddev": 0.0}),
        (rt.GaussianFilter, {"stddev": math.nan}),
        (rt.MitchellFilter, {"b": -0.1}),
        (rt.MitchellFilter, {"c": 1.1}),
        (rt.MitchellFilter, {"radius": 2.0}),
        (rt.CatmullRomFilter, {"b": 0.5}),
        (rt.LanczosFilter, {"lobes": 0}),
        (rt.LanczosFilter, {"lobes": 2.5}),
        (rt.LanczosFilter, {"lobes": 65}),
        (rt.Film, {"layers": ("colour",)}),
        (rt.Film, {"layers": ("id", "id")}),
        (rt.Film, {"layers": "albedo"}),
    ],
    ids=str,
)
def test_bad_input(cls, fields):
    with pytest.raises(rt.SceneError, match="expected"):
        cls(**fields)
