"""The rate of false alarms: verdicts about right renderers, over many seeds; and pools of rendered
replicates, from which runs draw some at random.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage, stats

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Say, budgeted
from comparisons.compare.looks import level_of
from comparisons.experiments.selftest.fault import CAUGHT
from comparisons.gate.digest import fingerprint
from comparisons.gate.gate import LIMIT, gate_pictures, look
from comparisons.gate.pictures_in import Picture
from comparisons.gate.reference import Reference
from comparisons.mitsuba import scene as mitsuba_scene
from comparisons.runs.elsewhere import run_elsewhere
from comparisons.translator import load
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.util.workers import Workers

POOL = 10
"""Replicates in a pool over those that a run draws. The noise of a pool's mean, which all runs have
in common, is a third of a run's; the mean of a run scatters by 5 % too little."""


@dataclass(frozen=True)
class Pools:
    """Replicates of either side, (count, height, width, 3)."""

    candidate: FloatArray
    reference: FloatArray

    def draw(
        self, rng: np.random.Generator, counts: tuple[int, int]
    ) -> tuple[FloatArray, FloatArray]:
        """So many of each side, without repetition."""
        sides = zip((self.candidate, self.reference), counts, strict=True)
        one, two = (side[rng.choice(len(side), count, replace=False)] for side, count in sides)
        return one, two

    def centred(self) -> "Pools":
        """The candidate times a factor a channel that makes both pools' image means equal: then a
        bias that is planted is the only one."""
        means = [side.mean(axis=(0, 1, 2)) for side in (self.reference, self.candidate)]
        return Pools(self.candidate * (means[0] / means[1]), self.reference)


def of_ours(scene: Scene, count: int, first: int = 0) -> FloatArray:
    """Our replicates (count, height, width, 3), with seeds from `first` on."""
    tables, sampler = build_tables(scene), scene.resolved_sampler
    seeded = (sampler.model_copy(update={"seed": first + k}) for k in range(count))
    return np.stack([render(scene.changed(sampler=s), tables=tables).colour for s in seeded])


def of_mitsuba(scene: Scene, count: int, spp: int | None = None) -> FloatArray:
    """Mitsuba's replicates (count, height, width, 3); spp: None for the scene's."""
    counterpart, samples = load(scene), spp or scene.resolved_sampler.spp
    return np.stack(
        [mitsuba_scene.picture(counterpart.mi_scene, samples, seed) for seed in range(count)]
    )


def of_scene(path: Path, budget: Budget, counts: tuple[int, int] | None = None) -> Pools:
    """Pools of our replicates and Mitsuba's for runs of so many; None: the budget's replicates."""
    scene = budgeted(Scene.load(path), budget)
    ours, theirs = counts or (budget.replicates, budget.replicates)
    return Pools(
        of_ours(scene, POOL * ours), of_mitsuba(scene, POOL * theirs, budget.reference_spp)
    )


# ---- right renderers of many kinds --------------------------------------------------------------
# A case draws the pictures of both sides anew for each run. Rendered cases draw from pools of
# replicates (`Pools`); synthetic ones draw their noise with NumPy, where it has a simple law or no
# renderer of ours makes it: noise that pixels share, and stored half floats.


Draw = Callable[[np.random.Generator], tuple[FloatArray, FloatArray]]
"""Makes the replicates of the candidate and of the reference, (replicates, height, width, 3)."""

REPLICATES = 16


@dataclass(frozen=True)
class RightCase:
    """kind: one of KINDS;  name: of the case;  rendered: whether its pictures are;  prepare: from
    the folder of scenes makes what draws the pictures;  looks: the numbers of replicates at which
    they are looked at until the question is decided; none for one look at all."""

    kind: str
    name: str
    rendered: bool
    prepare: Callable[[Path], Draw]
    looks: tuple[int, ...] = ()


KINDS = (
    "rare light",
    "light that no picture met",
    "noise shared between pixels",
    "almost no noise",
    "the baseline's own pictures",
    "wide filters",
    "a single picture",
    "looks at a growing number of replicates",
    "heavy-tailed caustics",
    "unequal samples",
    "unequal replicates",
    "deterministic parts",
)


# ---- rendered -----------------------------------------------------------------------------------

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


def _drawing(pools: Pools, counts: tuple[int, int] = (REPLICATES, REPLICATES)) -> Draw:
    return lambda rng: pools.draw(rng, counts)


def _by_scattered_rays(radius: float) -> RightCase:
    def prepare(scenes: Path) -> Draw:
        bsdf, both = (
            of_ours(_with_lamp(radius, sampling), POOL * REPLICATES, first)
            for sampling, first in (("bsdf", 0), ("both", POOL * REPLICATES))
        )
        return _drawing(Pools(bsdf, both))

    return RightCase(KINDS[0], f"lamp of radius {radius:g}, scattered rays alone", True, prepare)


def _torus(scenes: Path) -> Draw:
    scene, count = _with_torus(), POOL * REPLICATES
    return _drawing(Pools(of_ours(scene, count), of_mitsuba(scene, count)))


def _unmet(radius: float) -> RightCase:
    def prepare(scenes: Path) -> Draw:
        scene, count = _with_lamp(radius, "bsdf"), POOL * REPLICATES
        return _drawing(Pools(of_ours(scene, count), of_ours(scene, count, count)))

    name = f"lamp of radius {radius:g}, scattered rays alone on both sides"
    return RightCase(KINDS[1], name, True, prepare)


def _scene(
    kind: str,
    name: str,
    budget: Budget,
    counts: tuple[int, int] = (REPLICATES, REPLICATES),
) -> RightCase:
    """Ours against Mitsuba's pictures of a scene."""

    def prepare(scenes: Path) -> Draw:
        return _drawing(of_scene(scenes / f"{name}.yaml", budget, counts), counts)

    samples = f"{budget.spp}" + (f" to {budget.reference_spp}" if budget.reference_spp else "")
    text = f"{name}, {counts[0]} to {counts[1]} replicates of {samples} samples"
    return RightCase(kind, text, True, prepare)


# ---- synthetic ----------------------------------------------------------------------------------

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


def _one_sequence(rng: np.random.Generator, count: int) -> FloatArray:
    """One random sequence for all pixels: the error is a smooth function of the place."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    wave = [np.sin(np.pi * (k * x + j * y)) for k in range(3) for j in range(3)]
    errors = np.tensordot(rng.standard_normal((count, 9, 3)), np.stack(wave), axes=(1, 0))
    return np.asarray(shaded() * (1.0 + 0.03 * np.moveaxis(errors, 1, -1)))


def _photons(rng: np.random.Generator, count: int) -> FloatArray:
    """A photon map: each photon lights a disk of some 80 pixels."""
    met = rng.poisson(0.05, (count, SIDE, SIDE, 1)) * np.ones(3) / 0.05
    return np.asarray(shaded() * ndimage.gaussian_filter(met, (0, 3.0, 3.0, 0), mode="wrap"))


def _denoised(rng: np.random.Generator, count: int) -> FloatArray:
    """Noise that a denoiser has smoothed, by a linear filter of the noise alone."""
    noise = rng.standard_normal((count, SIDE, SIDE, 3))
    smooth = ndimage.gaussian_filter(noise, (0, 2.0, 2.0, 0), mode="wrap")
    return np.asarray(shaded() * (1.0 + smooth))


def _sky(noise: float) -> Callable[[np.random.Generator, int], FloatArray]:
    """A smooth sky of texels, which a renderer shows with hardly any noise."""

    def pictures(rng: np.random.Generator, count: int) -> FloatArray:
        y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
        sky = (0.3 + y + 0.2 * np.sin(3.0 * x))[..., None] * np.array([0.7, 0.9, 1.3])
        return np.asarray(sky * (1.0 + noise * rng.standard_normal((count, SIDE, SIDE, 3))))

    return pictures


def _as_halves(pictures: FloatArray) -> FloatArray:
    return pictures.astype(np.float16).astype(np.float64)


def _half_texels(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """The candidate holds the sky's texels as half floats; both have a little noise."""
    sky = _sky(0.0)(rng, 1)
    noise = 1.0 + 1e-5 * rng.standard_normal((2, REPLICATES, SIDE, SIDE, 3))
    return _as_halves(sky) * noise[0], sky.astype(np.float32) * noise[1]


def _half_files(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """The candidate's files are of half floats; the lamp and the background have no noise."""
    candidate = _gamma(rng, REPLICATES)
    candidate[:, 8:14, 12:36] *= 0.2347
    reference = _gamma(rng, REPLICATES)
    reference[:, 8:14, 12:36] *= 0.2347
    return _as_halves(candidate), reference


def _own_pictures(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    pictures = _gamma(rng, REPLICATES)
    return pictures, pictures


def _filtered(rng: np.random.Generator, count: int) -> FloatArray:
    """A Gaussian filter of half a pixel's standard deviation, which reaches two pixels."""
    noise = rng.gamma(0.5, 2.0, (count, SIDE, SIDE, 1)) * np.ones(3)
    return np.asarray(shaded() * ndimage.gaussian_filter(noise, (0, 0.5, 0.5, 0), mode="wrap"))


def _pareto(rng: np.random.Generator, count: int) -> FloatArray:
    """A caustic without a variance, in a ninth of the picture; the tail's exponent is 1.5."""
    pictures = 0.5 + 0.05 * rng.standard_normal((count, SIDE, SIDE, 3))
    bright = (rng.random((count, 16, 16, 1)) < 0.02) * rng.pareto(1.5, (count, 16, 16, 1))
    pictures[:, 16:32, 16:32] += 10.0 * bright
    return np.asarray(pictures)


def _two_values(rng: np.random.Generator, count: int) -> FloatArray:
    """Pixels that are lit or not, some seldom, beside others that are up to 1e4 times as bright."""
    fixed = np.random.default_rng(5)
    chance = fixed.random((SIDE, SIDE, 3)) ** 6
    bright = 10.0 ** fixed.uniform(-2.0, 2.0, (SIDE, SIDE, 1))
    return np.asarray(bright * (rng.random((count, SIDE, SIDE, 3)) < chance))


def _fireflies(scenes: Path) -> Draw:
    """One sample in 1e4 has half of the energy."""

    def side(rng: np.random.Generator) -> FloatArray:
        smooth = 0.5 * rng.gamma(4.0, 0.25, (32, SIDE, SIDE, 3))
        return np.asarray(smooth + (rng.random((32, SIDE, SIDE, 1)) < 1e-4) * 5000.0)

    return lambda rng: (side(rng), side(rng))


Law = Callable[[np.random.Generator, int], FloatArray]


def _synthetic(
    kind: str, name: str, law: Law, counts: tuple[int, int] = (REPLICATES, REPLICATES)
) -> RightCase:
    def draw(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        return law(rng, counts[0]), law(rng, counts[1])

    return RightCase(kind, name, False, lambda scenes: draw)


def _against_means(name: str, law: Law) -> RightCase:
    """As at a gate: 32 pictures against 16 that have 16 times as many samples each."""

    def draw(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        means = [law(rng, 16).mean(axis=0) for _ in range(REPLICATES)]
        return law(rng, 2 * REPLICATES), np.stack(means)

    return RightCase(KINDS[9], f"{name}, 32 to 16 means of 16", False, lambda scenes: draw)


def _drawn(kind: str, name: str, draw: Draw) -> RightCase:
    return RightCase(kind, name, False, lambda scenes: draw)


_SMALL = Budget(size=(32, 32), spp=16)

CASES: tuple[RightCase, ...] = (
    *(_by_scattered_rays(radius) for radius in (0.3, 0.1, 0.03, 0.01)),
    RightCase(KINDS[0], "small torus that shines, against Mitsuba", True, _torus),
    *(_unmet(radius) for radius in (0.01, 0.002)),
    _synthetic(KINDS[2], "one random sequence for all pixels", _one_sequence, (8, 8)),
    _synthetic(KINDS[2], "photon map", _photons, (8, 8)),
    _synthetic(KINDS[2], "denoised", _denoised),
    _synthetic(KINDS[3], "smooth sky, noise of 1e-5", _sky(1e-5)),
    _drawn(KINDS[3], "half-float texels", _half_texels),
    _drawn(KINDS[3], "half-float files", _half_files),
    _drawn(KINDS[4], "bit-identical pictures", _own_pictures),
    _scene(KINDS[5], "filter_gaussian", Budget(size=(48, 36), spp=16)),
    _synthetic(KINDS[5], "gaussian filter over skewed noise", _filtered),
    _synthetic(KINDS[6], "against sixteen", _gamma, (1, REPLICATES)),
    _scene(KINDS[6], "cornell_box", _SMALL, (1, REPLICATES)),
    RightCase(KINDS[7], "fireflies at 4, 8, 16 and 32", False, _fireflies, (4, 8, 16, 32)),
    _scene(KINDS[8], "caustic_glass", Budget(size=(32, 24), spp=64)),
    _synthetic(KINDS[8], "caustic of infinite variance", _pareto),
    _scene(KINDS[9], "cornell_box", Budget(size=(32, 32), spp=8, reference_spp=64)),
    _against_means("caustic of infinite variance", _pareto),
    _against_means("pixels of two values", _two_values),
    _scene(KINDS[10], "cornell_box", _SMALL, (4, 24)),
    _scene(KINDS[10], "colour_bleeding", _SMALL, (20, 6)),
    _scene(KINDS[11], "environment", Budget(size=(40, 25), spp=16)),
    _synthetic(KINDS[11], "background and lamp without noise", _gamma),
)

OF_KINDS: Mapping[str, tuple[RightCase, ...]] = {
    kind: tuple(case for case in CASES if case.kind == kind) for kind in KINDS
}


# ---- rates of false alarms ----------------------------------------------------------------------


ALLOWED = 1e-3
"""Allowed false alarms per case."""

LEVEL = 0.01
"""Of the test whether more false alarms were counted than ALLOWED explains: in a thousand runs one
is expected, and four or fewer are no evidence of more."""


@dataclass(frozen=True)
class Alarms:
    """kind, name, rendered: of the `RightCase`;  runs: verdicts about new pictures;  false_alarms:
    those that are `differ` or `invalid`;  reasons: their numbers by the first words;  verdicts: all
    by status;  upper: the upper 95 % confidence bound of the rate of false alarms (Clopper and
    Pearson 1934)."""

    kind: str
    name: str
    rendered: bool
    runs: int
    false_alarms: int
    reasons: dict[str, int]
    verdicts: dict[str, int]
    upper: float

    @property
    def holds(self) -> bool:
        """Whether the runs do not show a rate above ALLOWED."""
        return self.false_alarms <= float(stats.binom.isf(LEVEL, self.runs, ALLOWED))

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def specificity(runs: int, scenes: Path, say: Say, workers: Workers) -> list[Alarms]:
    """`runs` verdicts about each of CASES: most of the time is NumPy's, which uses one core."""
    tasks = ((number, runs, scenes.resolve()) for number in range(len(CASES)))
    found = []
    for one in run_elsewhere(workers, _of_case, tasks):
        found.append(one)
        say(f"{one.kind}, {one.name}: {one.false_alarms} false alarms in {runs} runs")
    return found


def _of_case(number: int, runs: int, scenes: Path) -> Alarms:
    """Of the case with this number: cases hold functions, which cannot be sent to a process."""
    return alarms_of(CASES[number], runs, scenes)


def alarms_of(case: RightCase, runs: int, scenes: Path) -> Alarms:
    """`runs` verdicts about the case, each with random numbers of its own."""
    draw = case.prepare(scenes)
    verdicts: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    for run in range(runs):
        status, reason = verdict(*draw(np.random.default_rng(run)), case.looks)
        verdicts[status] += 1
        if status in CAUGHT:
            reasons[": ".join(part.strip() for part in reason.split(":")[:2])] += 1
    alarms = sum(reasons.values())
    upper = float(stats.beta.ppf(0.95, alarms + 1, runs - alarms)) if alarms < runs else 1.0
    return Alarms(
        case.kind, case.name, case.rendered, runs, alarms, dict(reasons), dict(verdicts), upper
    )


def verdict(
    candidate: FloatArray, reference: FloatArray, looks: Sequence[int] = ()
) -> tuple[str, str]:
    """The gate's verdict on replicates (R, height, width, 3), and the reason; with looks that of
    the statistics, at the first that decides."""
    pictures = [Picture(picture) for picture in candidate]
    for number, count in enumerate(looks, start=1):
        rung = look(pictures[:count], Reference(reference[:count]), LIMIT, level_of(number))
        if rung.status != "inconclusive" or count == looks[-1]:
            return rung.status, f"{rung.name}: {rung.reason}"
    prints = tuple(fingerprint(picture) for picture in reference)
    case = gate_pictures(pictures, Reference(reference, fingerprints=prints))
    return case.verdict, case.reason
