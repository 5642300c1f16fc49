"""Wrong derivatives are seen, and their causes named; right ones pass.

The wrong ones are made of our own differences of other scenes, of other random numbers: so no part
of Mitsuba's, and no part of `likeliest`, makes them.
"""

from functools import cache, partial

import numpy as np
import pytest

from comparisons.compare.derivative import judged, margins
from comparisons.compare.derivative_causes import Ours, likeliest
from comparisons.statistics.cells import Margins
from reference_rt import Scene, render

ROOM = """
film: {width: 12, height: 12}
camera: {type: perspective, eye: [0.3, 2.4, 2], target: [0, 0, 0.2], up: [0, 0, 1], fov: 60}
integrator: {type: path, max_depth: 4}
sampler: {type: sobol, spp: 64}
materials:
  floor: {type: diffuse, reflectance: 0.7}
  ball: {type: diffuse, reflectance: [0.8, 0.5, 0.3]}
  lamp: {type: emissive, radiance: 6}
shapes:
  - {type: rectangle, material: floor, transform: [{scale: 3}]}
  - {type: sphere, material: ball, radius: 0.5, center: [0, 0, 0.5]}
  - type: rectangle
    material: lamp
    transform: [{scale: 0.4}, {rotate: {axis: [1, 0, 0], degrees: 180}}, {translate: [1, 0.4, 2]}]
lights:
  - {type: constant, radiance: [0.2, 0.3, 0.5]}
"""

ALBEDO, RADIUS = "materials.floor.reflectance", "shapes[1].radius"

COUNT = 16


def scene(text: str = ROOM) -> Scene:
    return Scene.parse(text)


@cache
def others(path: str, text: str = ROOM, **options) -> np.ndarray:
    """Replicates with random numbers that no other ones here have."""
    return Ours(scene(text), path).of(scene(text), COUNT, seed=1000, **options)


@cache
def right_of(path: str) -> tuple[Ours, np.ndarray]:
    """Ours, and its replicates."""
    ours = Ours(scene(), path)
    return ours, ours.replicates(COUNT)


def told(path: str, wrong: np.ndarray) -> str:
    """The cause of a difference; "" without a difference, "?" without a cause."""
    ours, right = right_of(path)
    found = judged(wrong, right, 0.05, Margins())
    if found.status != "differ":
        return ""
    cause = likeliest(ours, right, wrong, Margins(), None)
    return "?" if cause is None else cause.name


FAULTS = {
    "a factor of 1.05": ("a constant factor", ALBEDO, lambda x: 1.05 * x),
    "the sign": ("the sign", ALBEDO, lambda x: -x),
    "degrees": ("another unit of the parameter", ALBEDO, lambda x: np.radians(x)),
    "half of it": ("another unit of the parameter", ALBEDO, lambda x: 0.5 * x),
    "upside down": ("the picture is upside down", ALBEDO, lambda x: x[:, ::-1]),
    "mirrored": ("the picture is mirrored", ALBEDO, lambda x: x[:, :, ::-1]),
    "the size": ("the size in place of the value", RADIUS, np.abs),
    "nothing": ("it is 0", ALBEDO, np.zeros_like),
    "next to nothing": ("it is 0", ALBEDO, lambda x: 1e-9 * x[:, ::-1]),
    "nothing below 0": ("negative values are cut off", RADIUS, lambda x: np.maximum(x, 0.0)),
    "channels exchanged": ("?", ALBEDO, lambda x: x[..., ::-1]),
    "a corner is lost": ("?", ALBEDO, lambda x: np.where(np.arange(12)[:, None] < 5, 0.0, x)),
}
"""What is made of the right derivative: the cause, the parameter, how."""


@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_derivative_is_seen_and_its_cause_is_right_or_unsaid(name):
    cause, path, change = FAULTS[name]
    assert told(path, change(others(path))) == cause


def test_a_right_derivative_passes():
    assert told(ALBEDO, others(ALBEDO)) == told(RADIUS, others(RADIUS)) == ""


def test_edges_that_are_left_out():
    """By the radius of a ball: its silhouette, and the edge of its shadow."""
    assert told(RADIUS, others(RADIUS, step=2.0**-31)) == "edges that move are left out"


@pytest.mark.parametrize(
    ("cause", "old", "new"),
    [
        ("the share of the material 'lamp' is missing", "radiance: 6", "radiance: 0"),
        ("the share of lights[0] (constant) is missing", "[0.2, 0.3, 0.5]", "0"),
        ("direct light alone", "max_depth: 4", "max_depth: 2"),
        ("the length of paths", "max_depth: 4", "max_depth: 3"),
    ],
)
def test_what_is_missing(cause, old, new):
    assert old in ROOM
    assert told(ALBEDO, others(ALBEDO, ROOM.replace(old, new))) == cause


LAMP = "shapes[2].transform[0].scale"


def test_a_density_that_is_held():
    """As where the lamp's points are sampled by its area, and the area is held: by two pictures
    whose lamp has its power kept, which is another thing than its radiance only where it is
    sampled.  The camera does not see the lamp's front."""
    step, size = 2.0**-6, 0.4
    sides = []
    for sign in (1, -1):
        moved = size + sign * step
        text = ROOM.replace("radiance: 6", f"radiance: {6.0 * (size / moved) ** 2}")
        one = scene(text.replace("scale: 0.4", f"scale: {moved}"))
        sides.append([render(one, seed=7000 + k).colour for k in range(COUNT)])
    wrong = np.subtract(*sides) / (2.0 * step)
    ours, right = right_of(LAMP)
    assert judged(wrong, right, 0.05, Margins()).status == "differ"
    cause = likeliest(ours, right, wrong, Margins(), None)
    assert cause is not None
    assert cause.name == "detached sampling"
    share, _, error = cause.evidence.split(" times")[0].split()
    assert abs(float(share) - 2.0 / size) < 4.0 * float(error)  # of the logarithm of an area
    assert "the material 'lamp'" in cause.evidence


@pytest.mark.parametrize(("down", "across"), [(1, 0), (0, -1), (1, 1)])
def test_half_a_pixel(down, across):
    """Pixels half as large, moved by one of them: but the rim, as a camera that is moved makes
    it."""
    fine = others(ALBEDO, ROOM.replace("width: 12, height: 12", "width: 24, height: 24"))
    moved = np.roll(fine, (down, across), axis=(1, 2))
    wrong = moved.reshape(COUNT, 12, 2, 12, 2, 3).mean(axis=(2, 4))
    assert told(ALBEDO, wrong) == "half a pixel"


def test_a_factor_that_grows_with_the_number_of_pixels():
    """A quarter of the pixels, a quarter of the factor."""
    ours, right = right_of(ALBEDO)
    wrong = 0.01 * others(ALBEDO)
    found = likeliest(ours, right, wrong, Margins(), lambda: (right, 0.25 * wrong))
    assert found is not None
    assert found.name == "a factor that grows with the number of pixels"
    noise = np.random.default_rng(3).normal(size=right.shape)
    for small in (wrong, noise, np.zeros_like(wrong)):  # which do not show that it grows
        same = likeliest(ours, right, wrong, Margins(), lambda small=small: (right, small))
        assert same is not None
        assert same.name == "a constant factor"


def test_what_few_samples_do_not_show_has_no_cause():
    """A small slope, seen with little noise: each hypothesis would seem to explain it."""
    ours, rng = Ours(scene(), ALBEDO), np.random.default_rng(1)
    ours.times = 64  # of `right`, below, whose noise is that of many samples
    mean = right_of(ALBEDO)[1].mean(axis=0)
    sloped = np.linspace(0.997, 1.003, 12)[:, None] * mean
    right, wrong = (x * rng.normal(1.0, 3e-4, (COUNT, *mean.shape)) for x in (mean, sloped))
    assert judged(wrong, right, 0.05, Margins()).status == "differ"
    assert likeliest(ours, right, wrong, Margins(), None) is None


HEAVY = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "edges": lambda rng, shape: 8.0 * rng.choice([-1.0, 0.0, 1.0], shape, p=[0.05, 0.9, 0.05]),
    "rare edges of one sign": lambda rng, shape: (
        50.0 * (rng.random(shape) < 0.02) + rng.normal(-1.0, 0.2, shape)
    ),
    "Student's t of 3": lambda rng, shape: rng.standard_t(3, shape),
    "lognormal, both signs": lambda rng, shape: (
        rng.choice([-1, 1], shape) * np.exp(1.5 * rng.normal(size=shape))
    ),
}


@pytest.mark.parametrize("pairs", [20, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("one", HEAVY)
@pytest.mark.parametrize("two", HEAVY)
def test_right_derivatives_are_not_called_wrong(one, two, pairs):
    """The stated level is one in a thousand: of 500 pairs with one mean 4 differ with a chance of
    0.002, and of 20 one does with 0.02.  Both sides' noise is of its own law, as that of
    differences and of AD is; the mean changes its sign over the picture, so that its mean is near
    0."""
    rng = np.random.default_rng(5)
    mean = np.linspace(-1.0, 1.2, 16)[:, None, None] * np.ones((16, 16, 3))
    alarms = 0
    for _ in range(pairs):
        a, b = (mean + 0.3 * HEAVY[law](rng, (COUNT, 16, 16, 3)) for law in (one, two))
        alarms += judged(a, b, 0.05, Margins()).status == "differ"
    assert alarms <= (0 if pairs < 100 else 3)


def test_a_bias_is_relative_to_the_size_and_not_to_the_mean():
    """A derivative whose mean is 0: 5 % of its size everywhere are seen, 0.05 % are not."""
    rng = np.random.default_rng(6)
    mean = np.where(np.arange(16)[:, None, None] < 8, -1.0, 1.0) * np.ones((16, 16, 3))
    noisy = partial(rng.normal, scale=0.02, size=(COUNT, 16, 16, 3))
    right = mean + noisy()
    seen = judged(mean + 0.05 + noisy(), right, 0.01, Margins())
    assert seen.status == "differ"
    assert seen.numbers["relative_bias"]["R"] == pytest.approx(0.05, rel=0.05)
    assert judged(mean + 0.0005 + noisy(), right, 0.01, Margins()).status == "agree"


def test_what_a_step_adds_is_permitted_and_said():
    rng = np.random.default_rng(7)
    right = 1.0 + rng.normal(scale=0.01, size=(COUNT, 8, 8, 3))
    wrong = 1.02 + rng.normal(scale=0.01, size=(COUNT, 8, 8, 3))
    step = margins(np.full((8, 8, 3), 0.024), np.ones((8, 8, 3)))
    found = judged(wrong, right, 0.005, step)
    assert found.status == "inconclusive"
    assert "what the step adds is not known better than to 5.00%" in found.reason
    assert judged(wrong, right, 0.005, Margins()).status == "differ"
