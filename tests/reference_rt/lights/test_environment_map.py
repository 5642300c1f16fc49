"""Environment maps: where texels are, and samples whose density is exactly theirs."""

import math

import numpy as np
import pytest
from builders import random_turn
from PIL import Image

from comparisons.statistics.chi_square import chi_square, integrate, sidak
from reference_rt.core import transform
from reference_rt.core.ray import (
    BLOCK,
    HIT_FLOATS,
    HIT_INTEGERS,
    RAY_FLOATS,
    HitBlock,
    Ray,
    RayBlock,
    put_ray,
)
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import entry_kernel, local_floats, local_integers
from reference_rt.lights import (
    LIGHT_FLOATS,
    LIGHT_INTEGERS,
    LightBlock,
    background_in,
    light_of,
)
from reference_rt.lights.emitters import environment_map
from reference_rt.lights.emitters.environment_map import EnvironmentMap, tabulate
from reference_rt.sampling import distribution
from reference_rt.util import memory

U = 2.0**-53
SIZES = [(2, 1), (2, 3), (3, 2), (5, 8), (16, 32)]


@entry_kernel
def _sample(table, u, out):
    for k in range(len(u)):
        s = environment_map.sample(table, u[k, 0], u[k, 1])
        out[k, 0], out[k, 1], out[k, 2] = s.wi
        out[k, 3], out[k, 4], out[k, 5] = s.radiance
        out[k, 6] = s.pdf


@entry_kernel
def _pdf(table, d, out):
    for k in range(len(d)):
        out[k] = environment_map.pdf(table, row(d, k))


@entry_kernel
def _of_block(table, u, d, sampled, seen):
    """Paths of one block: those of `d` escape, those of `u` want a sample."""
    rays = RayBlock(local_floats(RAY_FLOATS))
    hits = HitBlock(local_floats(HIT_FLOATS), local_integers(HIT_INTEGERS))
    lit = LightBlock(local_floats(LIGHT_FLOATS), local_integers(LIGHT_INTEGERS))
    for j in range(len(d)):
        hits.codes[j] = -1 if j % 3 != 1 else 0
        put_ray(rays, j, Ray(Vec3(0.0, 0.0, 0.0), row(d, j), math.inf))
    environment_map.backgrounds(table, rays, hits, len(d), lit)
    for j in range(len(d)):
        found = background_in(lit, j)
        seen[j, 0], seen[j, 1], seen[j, 2] = found.radiance
        seen[j, 3] = found.density
    for j in range(len(u)):
        lit.codes[j] = 5 if j % 4 != 2 else -1
        lit.numbers[12 * BLOCK + j], lit.numbers[13 * BLOCK + j] = u[j, 0], u[j, 1]
    environment_map.samples(table, 5, lit, len(u))
    for j in range(len(u)):
        s = light_of(lit, j)
        sampled[j, 0], sampled[j, 1], sampled[j, 2] = s.wi
        sampled[j, 3], sampled[j, 4], sampled[j, 5] = s.radiance
        sampled[j, 6] = s.pdf


def samples(table, u):
    out = np.empty((len(u), 7))
    _sample(table, u, out)
    return out[:, :3], out[:, 3:6], out[:, 6]


def pdf(table):
    def density(d):
        out = np.empty(len(d))
        _pdf(table, np.ascontiguousarray(d), out)
        return out

    return density


def random_map(rng, height, width, dark=0.3):
    """Texels of very different brightness, some black, turned at random."""
    texels = rng.random((height, width, 3)) ** 4 * (rng.random((height, width, 1)) > dark)
    texels[-1, -1] = 1.0
    turn = random_turn(rng)
    return tabulate(texels, turn)


def toward(u, v):
    """The direction of image coordinates, u across and v down from the top, each 0 to 1."""
    phi, theta = 2 * math.pi * u, math.pi * v
    return Vec3(math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))


def test_where_texels_stand():
    """u = atan2(x, -z) / 2 pi, texels in the middles of their columns; v from the top, the first
    and the last row the poles; bilinear between."""
    rng = np.random.default_rng(421)
    texels = rng.random((5, 8, 3))
    table = tabulate(texels, np.eye(3))
    for y in range(5):
        for x in range(8):
            d = toward((x + 0.5) / 8, y / 4)
            if 0 < y < 4:  # at a pole every column is
                expected = texels[y, x]
                assert environment_map.radiance(table, d) == pytest.approx(expected, rel=1e-13)
            if y < 4:
                d = toward((x + 0.75) / 8, (y + 0.5) / 4)
                side = 0.75 * texels[:, x] + 0.25 * texels[:, (x + 1) % 8]
                expected = 0.5 * side[y] + 0.5 * side[y + 1]
                assert environment_map.radiance(table, d) == pytest.approx(expected, rel=1e-13)
    assert environment_map.radiance(table, Vec3(0, 0, -1)) == pytest.approx(
        0.5 * texels[2, 0] + 0.5 * texels[2, 7], rel=1e-13
    )
    assert environment_map.radiance(table, Vec3(9, 0, 0)) == pytest.approx(
        0.5 * texels[2, 1] + 0.5 * texels[2, 2], rel=1e-13
    )


@pytest.mark.slow
def test_density_is_that_of_the_samples():
    """Chi-square; the density integrates to 1, and is that of the direction."""
    rng = np.random.default_rng(422)
    p_values = []
    for height, width in SIZES:
        table = random_map(rng, height, width)
        wi, _, density = samples(table, rng.random((60_000, 2)))
        # The direction is rounded; near a pole that moves it across columns, and its height is
        # measured in the lowest cell's, at least 2 / (height - 1)².
        out = np.hypot(*(wi @ table.to_map.reshape(3, 3).T)[:, [0, 2]].T)
        moved = 16 * U * (height**2 + width / out) * table.texels.max() / table.total[0]
        assert (np.abs(density - pdf(table)(wi)) <= moved).all()
        assert (density > 0).all()
        assert np.abs(np.linalg.norm(wi, axis=1) - 1).max() < 16 * U
        fit = chi_square(pdf(table), wi, tolerance=1e-5)
        assert fit.integral == pytest.approx(1.0, abs=2e-3)
        p_values.append(fit.p_value)
    assert min(p_values) > sidak(len(p_values))


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_total_is_the_integral_of_the_luminance(height, width):
    """By 16 x 16 Gauss points for each cell, where the luminance is smooth."""
    table = random_map(np.random.default_rng(423), height, width)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    v = (np.arange(height - 1)[:, None] + 0.5 * (nodes + 1)).ravel() / (height - 1)
    u = (np.arange(width)[:, None] + 0.5 * (nodes + 1) + 0.5).ravel() / width
    in_map = np.array([toward(a, b) for b in v for a in u])
    d = in_map @ table.to_map.reshape(3, 3)
    across, down = np.tile(weights, width) / 2 / width, np.tile(weights, height - 1) / 2
    solid_angle = np.outer(np.sin(math.pi * v) * down / (height - 1), across) * 2 * math.pi**2
    found = np.sum(pdf(table)(d) * solid_angle.ravel())
    # Rounding of the azimuth, at columns' edges, times its slope.
    assert found == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_samples_carry_the_radiance_of_their_directions(height, width):
    table = random_map(np.random.default_rng(428), height, width)
    wi, radiance, _ = samples(table, np.random.default_rng(429).random((300, 2)))
    out = np.hypot(*(wi @ table.to_map.reshape(3, 3).T)[:, [0, 2]].T)
    seen = np.array([environment_map.radiance(table, Vec3(*w)) for w in wi])
    # As for the density; the polar angle is that of a rounded height, whose slope is 1 / out.
    moved = 16 * U * (height + width) / out * table.texels.max()
    assert (np.abs(radiance - seen).max(axis=1) <= moved).all()


def test_the_luminance_of_a_fine_map_is_its_density():
    """Samples see cells by height in place of angle.  In a cell of polar angles from y step on the
    two differ by at most cot(y step) step / 8 of the way, at the poles by 1/4, and the luminance of
    this map by at most sin((y + 1) step) step: together by step² / 4 at most, in the second row."""
    v, u = np.meshgrid(np.linspace(0, math.pi, 129), np.arange(64) / 64, indexing="ij")
    texels = np.repeat((2 + np.cos(v) * np.sin(2 * math.pi * u))[..., None], 3, axis=2)
    table = tabulate(texels, np.eye(3))
    _, radiance, density = samples(table, np.random.default_rng(430).random((2000, 2)))
    assert density * table.total[0] == pytest.approx(radiance[:, 0], abs=(math.pi / 128) ** 2 / 4)


@pytest.mark.parametrize(("height", "width"), SIZES)
@pytest.mark.parametrize("count", [1, 8, 13, BLOCK])
def test_light_of_a_block_has_the_same_bits(height, width, count):
    rng = np.random.default_rng(431)
    table = random_map(rng, height, width)
    u, d = rng.random((count, 2)), rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-9, 9)
    found, seen = np.empty((count, 7)), np.empty((count, 4))
    _of_block(table, u, d, found, seen)
    lit, escaped = np.arange(count) % 4 != 2, np.arange(count) % 3 != 1
    assert found[lit].tobytes() == np.column_stack(samples(table, u))[lit].tobytes()
    assert seen[escaped, 3].tobytes() == pdf(table)(d)[escaped].tobytes()
    expected = np.array([environment_map.radiance(table, Vec3(*row)) for row in d])
    assert seen[escaped, :3].tobytes() == expected[escaped].tobytes()


def test_a_uniform_map_is_the_constant_environment():
    texels = np.broadcast_to([1.0, 2.0, 3.0], (4, 6, 3))
    table = tabulate(texels, np.eye(3))
    mean = 0.2126 * 1 + 0.7152 * 2 + 0.0722 * 3
    assert table.total[0] == pytest.approx(4 * math.pi * mean, rel=1e-14)
    _, radiance, density = samples(table, np.random.default_rng(424).random((1000, 2)))
    assert density == pytest.approx(0.25 / math.pi, rel=1e-14)
    assert radiance == pytest.approx(np.broadcast_to([1.0, 2.0, 3.0], (1000, 3)), rel=1e-14)
    assert environment_map.power(table, 2.0) == pytest.approx(16 * math.pi**2 * mean, rel=1e-14)


def test_one_bright_texel():
    """All samples come from the cells around it, the corners of the unit square too."""
    texels = np.zeros((9, 16, 3))
    texels[3, 15] = 1e6
    table = tabulate(texels, np.eye(3))
    ticks = np.append(np.linspace(0, 1 - 2.0**-33, 30), 2.0**-33)
    u = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    wi, radiance, density = samples(table, u)
    inside = density > 0  # on the rim it is 0
    assert inside.mean() > 0.7
    assert np.isfinite(wi).all()
    assert np.isfinite(radiance).all()
    v = np.arccos(wi[inside, 1]) / math.pi * 8
    a = np.arctan2(wi[inside, 0], -wi[inside, 2]) / (2 * math.pi) * 16 - 0.5
    assert np.abs(v - 3).max() <= 1.0
    assert np.abs((a - 15 + 8) % 16 - 8).max() <= 1.0


@pytest.mark.parametrize(("a", "b"), [(0, 1), (1, 0), (1, 1), (0.3, 2), (1e300, 1e-300), (0, 0)])
def test_linear_inverts_its_integral(a, b):
    for u in (0.0, 2.0**-33, 0.25, 0.7, 1.0 - 2.0**-33, 1.0):
        t = distribution.linear(u, float(a), float(b))
        assert 0.0 <= t <= 1.0
        if a + b > 0:
            most = max(a, b)
            x, y = a / most, b / most
            # Where the density starts at 0, u's root is what an error in t is of.
            assert x * t + 0.5 * (y - x) * t * t == pytest.approx(u * 0.5 * (x + y), abs=8 * U)


def test_cells_without_width_are_never_found():
    sums = distribution.running_sums(np.array([0.0, 2.0, 0.0, 0.0, 1.0, 0.0]))
    assert sums.tolist() == [0, 0, 2, 2, 2, 3, 3]
    assert [distribution.cell_of(sums, x) for x in (0.0, 1.999, 2.0, 2.999)] == [1, 1, 4, 4]


@pytest.mark.parametrize("width", [1, 2, 3, 7, 64, 1000])
def test_a_guide_finds_the_cell_that_a_search_of_the_whole_row_finds(width):
    """Rows of very different brightness, with cells of no width, black rows and a row of one
    cell."""
    rng = np.random.default_rng(425)
    rows = rng.random((9, width)) ** 8 * (rng.random((9, width)) > 0.4)
    rows[3] = 0.0
    rows[6] = np.arange(width) == width // 2
    sums = distribution.running_sums(rows)
    guides = distribution.guide(sums)
    assert guides.shape == (9, width + 1)
    for k in range(9):
        for u in (0.0, 2.0**-33, *rng.random(40), 1 - 2.0**-33):
            found = distribution.guided_cell_of(sums[k], guides[k], u)
            assert found == distribution.cell_of(sums[k], u * sums[k, -1])


def test_turned_and_mirrored(tmp_path):
    """A transform takes the map with it."""
    rng = np.random.default_rng(425)
    Image.fromarray(rng.integers(0, 256, (6, 9, 3), np.uint8)).save(tmp_path / "sky.png")
    plain = EnvironmentMap(file="sky.png").tabulate(tmp_path)
    turn = transform.Rotate(rotate=transform.Turn(axis=(1, 2, 3), degrees=77))
    mirror = transform.Scale(scale=(1, 1, -1))
    for steps in ((turn,), (mirror,), (mirror, turn)):
        moved = EnvironmentMap(file="sky.png", scale=2.0, transform=steps).tabulate(tmp_path)
        m = transform.affine(steps)[:, :3]
        for d in rng.normal(size=(20, 3)):
            expected = environment_map.radiance(plain, Vec3(*d)) * 2.0
            found = environment_map.radiance(moved, Vec3(*(m @ d)))
            assert found == pytest.approx(expected, abs=1e-13)


@pytest.mark.slow
def test_the_mean_of_a_map_lights_a_wall():
    """Irradiance from the upper half by samples: within 6 standard errors of quadrature."""
    table = random_map(np.random.default_rng(426), 7, 12)
    n = np.array([1.0, 2.0, 2.0]) / 3
    wi, radiance, density = samples(table, np.random.default_rng(427).random((100_000, 2)))
    values = radiance[:, 1] / density * np.maximum(0.0, wi @ n)

    def green(d):
        d = np.ascontiguousarray(d)
        found = np.array([environment_map.radiance(table, Vec3(*w)).y for w in d])
        return found * np.maximum(0.0, d @ n)

    expected = integrate(green, wi[:10], tolerance=1e-3)
    error = values.std() / math.sqrt(len(values))
    assert abs(values.mean() - expected) < 6 * error + 1e-3 * expected


def bad_file(folder, name, pixels):
    Image.fromarray(pixels).save(folder / name)


def test_bad_maps(tmp_path):
    def message(**fields):
        with pytest.raises(ValueError, match="expected") as caught:
            EnvironmentMap(**fields).tabulate(tmp_path)
        return str(caught.value)

    assert "missing.png" in message(file="missing.png")
    bad_file(tmp_path, "black.png", np.zeros((4, 8, 3), np.uint8))
    assert "no power" in message(file="black.png")
    bad_file(tmp_path, "row.png", np.full((1, 8, 3), 9, np.uint8))
    assert "one row" in message(file="row.png")
    bad_file(tmp_path, "nan.tiff", np.array([[1, 2], [3, np.nan]], np.float32))
    assert "column 1, row 1" in message(file="nan.tiff")
    bad_file(tmp_path, "sky.png", np.full((4, 8, 3), 200, np.uint8))
    assert "overflows" in message(file="sky.png", scale=1e308)
    steps = {
        "moved": transform.Translate(translate=(0, 1, 0)),
        "scaled": transform.Scale(scale=2.0),
        "sheared": transform.Matrix(matrix=((1, 1, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0))),
    }
    for step in steps.values():
        assert "rotations and reflections" in message(file="sky.png", transform=(step,))


def test_what_does_not_fit_into_memory_is_refused_by_all_that_is_stored(tmp_path, monkeypatch):
    """Sums and guides, too, and not the radiance alone."""
    Image.new("RGB", (300, 200), (90, 90, 90)).save(tmp_path / "sky.png")
    sky = EnvironmentMap(file="sky.png")
    stored = sum(column.nbytes for column in sky.tabulate(tmp_path))
    monkeypatch.setattr(memory, "machine_memory", lambda: stored)
    sky.tabulate(tmp_path)
    # Rows and columns have a few bytes more.
    monkeypatch.setattr(memory, "machine_memory", lambda: 0.98 * stored)
    with pytest.raises(ValueError, match=r"300 x 200 pixels, which take .* of memory"):
        sky.tabulate(tmp_path)
