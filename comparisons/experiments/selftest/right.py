"""Right renderers of many kinds.

A case draws the pictures of both sides anew for each run. Rendered cases draw from pools of
replicates (`Pools`); synthetic ones draw their noise with NumPy, where it has a simple law or no
renderer of ours makes it: noise that pixels share, and stored half floats.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from comparisons.compare.budget import Budget
from comparisons.experiments.selftest.pools import POOL, Pools, of_mitsuba, of_ours, of_scene
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene

Draw = Callable[[np.random.Generator], tuple[FloatArray, FloatArray]]
"""Makes the replicates of the candidate and of the reference, (replicates, height, width, 3)."""

REPLICATES = 16


@dataclass(frozen=True)
class RightCase:
    """kind: of right renderers;  name: of the case;  rendered: whether its pictures are;  prepare:
    from the folder of scenes makes what draws the pictures;  looks: the numbers of replicates at
    which they are looked at until the question is decided; none for one look at all."""

    kind: str
    name: str
    rendered: bool
    prepare: Callable[[Path], Draw]
    looks: tuple[int, ...] = ()


CASES: list[RightCase] = []

Law = Callable[[np.random.Generator, int], FloatArray]
"""Makes so many replicates."""

SAME = REPLICATES, REPLICATES


def _rendered(kind: str, name: str, counts: tuple[int, int] = SAME) -> Callable[..., None]:
    """Register what makes the pools of a case from the folder of scenes."""

    def register(pools: Callable[[Path], Pools]) -> None:
        def prepare(scenes: Path) -> Draw:
            both = pools(scenes)
            return lambda rng: both.draw(rng, counts)

        CASES.append(RightCase(kind, name, True, prepare))

    return register


def _drawn(kind: str, name: str, looks: tuple[int, ...] = ()) -> Callable[[Draw], Draw]:
    """Register what draws both sides."""

    def register(draw: Draw) -> Draw:
        CASES.append(RightCase(kind, name, False, lambda scenes: draw, looks))
        return draw

    return register


def _by_law(kind: str, name: str, counts: tuple[int, int] = SAME) -> Callable[[Law], Law]:
    """Register the law of the replicates of both sides."""

    def register(law: Law) -> Law:
        _drawn(kind, name)(lambda rng: (law(rng, counts[0]), law(rng, counts[1])))
        return law

    return register


def _against_means(name: str) -> Callable[[Law], Law]:
    """The same as at a gate: 32 pictures against 16 that have 16 times as many samples each."""

    def register(law: Law) -> Law:
        @_drawn("unequal samples", f"{name}, 32 to 16 means of 16")
        def draw(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
            means = [law(rng, 16).mean(axis=0) for _ in range(REPLICATES)]
            return law(rng, 2 * REPLICATES), np.stack(means)

        return law

    return register


SIDE = 48


def shaded() -> FloatArray:
    """(48, 48, 3): a black background, a lamp that is seen directly, and surfaces."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    shade = 0.4 + 0.2 * np.sin(5.0 * x) * np.cos(7.0 * y)
    picture = shade[..., None] * np.array([1.0, 0.8, 0.3])
    picture[(x - 0.6) ** 2 + (y - 0.65) ** 2 < 0.05] *= 2.0
    picture[:6] = 0.0
    picture[8:14, 12:36] = 5.0
    return np.asarray(picture)


def _gamma(rng: np.random.Generator, count: int, noise: float = 0.2) -> FloatArray:
    """Replicates of `shaded` without noise in background and lamp."""
    noisy = rng.gamma(noise**-2, noise**2, (count, SIDE, SIDE, 3))
    noisy[:, :6] = noisy[:, 8:14, 12:36] = 1.0
    return shaded() * noisy


FLOOR_AND_BALL = """
camera: {{type: perspective, eye: [0, 1.6, 4.5], target: [0, 0.7, 0], fov: 42}}
film: {{width: 48, height: 48}}
sampler: {{type: independent, spp: 32}}
integrator: {{type: path, max_depth: 4, sampling: {sampling}}}
materials:
  floor: {{type: diffuse, reflectance: [0.6, 0.57, 0.5]}}
  ball: {{type: diffuse, reflectance: [0.7, 0.25, 0.15]}}
  lamp: {{type: emissive, radiance: {radiance}}}
shapes:
  - type: rectangle
    material: floor
    transform: [{{scale: 4}}, {{rotate: {{axis: [1, 0, 0], degrees: -90}}}}]
  - {{type: sphere, material: ball, center: [0.4, 0.5, 0], radius: 0.5}}
  - {lamp}
lights:
  - {{type: constant, radiance: 0.1}}
"""


def _with_lamp(radius: float, sampling: str) -> Scene:
    """A spherical lamp of a power that does not depend on its radius."""
    lamp = f"{{type: sphere, material: lamp, center: [-0.6, 1.6, 0.3], radius: {radius}}}"
    radiance = [0.5 / radius**2] * 3
    return Scene.parse(FLOOR_AND_BALL.format(sampling=sampling, radiance=radiance, lamp=lamp))


def _with_torus() -> Scene:
    place = "transform: [{translate: [-0.6, 1.6, 0.3]}]"
    lamp = f"{{type: torus, major_radius: 0.1, minor_radius: 0.02, material: lamp, {place}}}"
    return Scene.parse(FLOOR_AND_BALL.format(sampling="both", radiance=[83.0] * 3, lamp=lamp))


def _scattered(radius: float) -> None:
    count = POOL * REPLICATES

    @_rendered("rare light", f"lamp of radius {radius:g}, scattered rays alone")
    def pools(scenes: Path) -> Pools:
        bsdf, both = (_with_lamp(radius, sampling) for sampling in ("bsdf", "both"))
        return Pools(of_ours(bsdf, count), of_ours(both, count, count))


def _unmet(radius: float) -> None:
    count = POOL * REPLICATES

    @_rendered(
        "light that no picture met",
        f"lamp of radius {radius:g}, scattered rays alone on both sides",
    )
    def pools(scenes: Path) -> Pools:
        scene = _with_lamp(radius, "bsdf")
        return Pools(of_ours(scene, count), of_ours(scene, count, count))


def _scene(kind: str, name: str, budget: Budget, counts: tuple[int, int] = SAME) -> None:
    """Ours against Mitsuba's pictures of a scene."""
    samples = f"{budget.spp}" + (f" to {budget.reference_spp}" if budget.reference_spp else "")
    text = f"{name}, {counts[0]} to {counts[1]} replicates of {samples} samples"

    @_rendered(kind, text, counts)
    def pools(scenes: Path) -> Pools:
        return of_scene(scenes / f"{name}.yaml", budget, counts)


# In the order of their kinds.

for _radius in (0.3, 0.1, 0.03, 0.01):
    _scattered(_radius)


@_rendered("rare light", "small torus that shines, against Mitsuba")
def torus(scenes: Path) -> Pools:
    scene, count = _with_torus(), POOL * REPLICATES
    return Pools(of_ours(scene, count), of_mitsuba(scene, count))


for _radius in (0.01, 0.002):
    _unmet(_radius)


@_by_law("noise shared between pixels", "one random sequence for all pixels", (8, 8))
def one_sequence(rng: np.random.Generator, count: int) -> FloatArray:
    """One random sequence for all pixels: the error is a smooth function of the place."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    wave = [np.sin(np.pi * (k * x + j * y)) for k in range(3) for j in range(3)]
    errors = np.tensordot(rng.standard_normal((count, 9, 3)), np.stack(wave), axes=(1, 0))
    return np.asarray(shaded() * (1.0 + 0.03 * np.moveaxis(errors, 1, -1)))


@_by_law("noise shared between pixels", "photon map", (8, 8))
def photons(rng: np.random.Generator, count: int) -> FloatArray:
    """A photon map: each photon lights a disk of some 80 pixels."""
    met = rng.poisson(0.05, (count, SIDE, SIDE, 1)) * np.ones(3) / 0.05
    return np.asarray(shaded() * ndimage.gaussian_filter(met, (0, 3.0, 3.0, 0), mode="wrap"))


@_by_law("noise shared between pixels", "denoised")
def denoised(rng: np.random.Generator, count: int) -> FloatArray:
    """Noise that a denoiser has smoothed, by a linear filter of the noise alone."""
    noise = rng.standard_normal((count, SIDE, SIDE, 3))
    smooth = ndimage.gaussian_filter(noise, (0, 2.0, 2.0, 0), mode="wrap")
    return np.asarray(shaded() * (1.0 + smooth))


def _sky(rng: np.random.Generator, count: int, noise: float) -> FloatArray:
    """A smooth sky of texels, which a renderer shows with hardly any noise."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    texels = (0.3 + y + 0.2 * np.sin(3.0 * x))[..., None] * np.array([0.7, 0.9, 1.3])
    return np.asarray(texels * (1.0 + noise * rng.standard_normal((count, SIDE, SIDE, 3))))


@_by_law("almost no noise", "smooth sky, noise of 1e-5")
def smooth_sky(rng: np.random.Generator, count: int) -> FloatArray:
    return _sky(rng, count, 1e-5)


def _as_halves(pictures: FloatArray) -> FloatArray:
    return pictures.astype(np.float16).astype(np.float64)


@_drawn("almost no noise", "half-float texels")
def half_texels(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """The candidate holds the sky's texels as half floats; both have a little noise."""
    texels = _sky(rng, 1, 0.0)
    noise = 1.0 + 1e-5 * rng.standard_normal((2, REPLICATES, SIDE, SIDE, 3))
    return _as_halves(texels) * noise[0], texels.astype(np.float32) * noise[1]


@_drawn("almost no noise", "half-float files")
def half_files(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """The candidate's files are of half floats; the lamp and the background have no noise."""
    candidate = _gamma(rng, REPLICATES)
    candidate[:, 8:14, 12:36] *= 0.2347
    reference = _gamma(rng, REPLICATES)
    reference[:, 8:14, 12:36] *= 0.2347
    return _as_halves(candidate), reference


@_drawn("the baseline's own pictures", "bit-identical pictures")
def own_pictures(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    pictures = _gamma(rng, REPLICATES)
    return pictures, pictures


_scene("wide filters", "filter_gaussian", Budget(size=(48, 36), spp=16))


@_by_law("wide filters", "gaussian filter over skewed noise")
def filtered(rng: np.random.Generator, count: int) -> FloatArray:
    """A Gaussian filter of half a pixel's standard deviation, which reaches two pixels."""
    noise = rng.gamma(0.5, 2.0, (count, SIDE, SIDE, 1)) * np.ones(3)
    return np.asarray(shaded() * ndimage.gaussian_filter(noise, (0, 0.5, 0.5, 0), mode="wrap"))


_SMALL = Budget(size=(32, 32), spp=16)

_by_law("a single picture", "against sixteen", (1, REPLICATES))(_gamma)
_scene("a single picture", "cornell_box", _SMALL, (1, REPLICATES))


@_drawn("looks at a growing number of replicates", "fireflies at 4, 8, 16 and 32", (4, 8, 16, 32))
def fireflies(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """One sample in 1e4 has half of the energy."""

    def side() -> FloatArray:
        smooth = 0.5 * rng.gamma(4.0, 0.25, (32, SIDE, SIDE, 3))
        return np.asarray(smooth + (rng.random((32, SIDE, SIDE, 1)) < 1e-4) * 5000.0)

    return side(), side()


_scene("heavy-tailed caustics", "caustic_glass", Budget(size=(32, 24), spp=64))
_scene("unequal samples", "cornell_box", Budget(size=(32, 32), spp=8, reference_spp=64))


@_against_means("caustic of infinite variance")
@_by_law("heavy-tailed caustics", "caustic of infinite variance")
def pareto(rng: np.random.Generator, count: int) -> FloatArray:
    """A caustic without a variance, in a ninth of the picture; the tail's exponent is 1.5."""
    pictures = 0.5 + 0.05 * rng.standard_normal((count, SIDE, SIDE, 3))
    bright = (rng.random((count, 16, 16, 1)) < 0.02) * rng.pareto(1.5, (count, 16, 16, 1))
    pictures[:, 16:32, 16:32] += 10.0 * bright
    return np.asarray(pictures)


@_against_means("pixels of two values")
def two_values(rng: np.random.Generator, count: int) -> FloatArray:
    """Pixels that are lit or not, some seldom, beside others that are up to 1e4 times as bright."""
    fixed = np.random.default_rng(5)
    chance = fixed.random((SIDE, SIDE, 3)) ** 6
    bright = 10.0 ** fixed.uniform(-2.0, 2.0, (SIDE, SIDE, 1))
    return np.asarray(bright * (rng.random((count, SIDE, SIDE, 3)) < chance))


_scene("unequal replicates", "cornell_box", _SMALL, (4, 24))
_scene("unequal replicates", "colour_bleeding", _SMALL, (20, 6))
_scene("deterministic parts", "environment", Budget(size=(40, 25), spp=16))
_by_law("deterministic parts", "background and lamp without noise")(_gamma)

KINDS = tuple(dict.fromkeys(case.kind for case in CASES))
