"""Hypotheses about paths that are traced wrongly: no shadow rays, light counted twice, a density
that is not that of the directions, a factor that was forgotten, or that each bounce has too much.

A small path tracer of ours takes the scene's own answers (hits, values of materials, samples of
lights) and keeps apart what each kind of light adds at each edge. A mistake is another sum of these
parts, and its change of the picture is what the candidate should show. All sums are of the same
paths, so that the change has little noise.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST
from comparisons.results.case import FloatArray
from reference_rt.core.arrays import IntArray
from reference_rt.integrators import AnyIntegrator, Direct, Path, Whitted
from reference_rt.integrators.path import ROULETTE_CAP as CAP
from reference_rt.materials import Dielectric, Diffuse, Phong, ThinDielectric
from reference_rt.rendering.query.hits import BoolArray
from reference_rt.rendering.scene import Scene

SAMPLES = 1 << 18
"""Paths of a picture, some seconds: the change is known to some percent of itself."""

BATCHES = 8
"""Parts of these, whose spread is the noise of a change."""

LONGEST = 8
"""Edges of paths in scenes without a limit: what longer ones add is a small part of a change."""

AHEAD = 1e-6
"""Where rays that leave a surface begin, in units of 1 plus the largest coordinate there, and how
far from a light shadow rays end, as a fraction of the distance."""

FAR = 1e12
"""The length of shadow rays to what is infinitely far."""


@dataclass
class _Parts:
    """Pictures (height, width, 3): `points` of lights without extent, `lamps` of others by samples
    of these, `met` of others by directions of materials.  At the first surface, and at later ones;
    as if nothing cast a shadow (`open_`), or multiplied by what was forgotten."""

    points_first: FloatArray
    points_later: FloatArray
    lamps_first: FloatArray
    lamps_later: FloatArray
    met: FloatArray
    open_points_first: FloatArray
    open_points_later: FloatArray
    open_lamps_first: FloatArray
    open_lamps_later: FloatArray
    points_without_cosine: FloatArray
    points_times_distance: FloatArray
    bounces: dict[str, FloatArray]
    """By the name of a mistake of BOUNCES: how it changes the picture."""

    @property
    def points(self) -> FloatArray:
        return self.points_first + self.points_later

    @property
    def lamps(self) -> FloatArray:
        return self.lamps_first + self.lamps_later

    @property
    def open_points(self) -> FloatArray:
        return self.open_points_first + self.open_points_later

    @property
    def open_lamps(self) -> FloatArray:
        return self.open_lamps_first + self.open_lamps_later


Change = Callable[[_Parts], FloatArray]

CHANGES: dict[str, Change] = {
    "without shadows": lambda p: p.open_points - p.points + p.open_lamps - p.lamps,
    "without shadows of lights without extent": lambda p: p.open_points - p.points,
    "without shadows at the first surface": lambda p: (
        p.open_points_first - p.points_first + p.open_lamps_first - p.lamps_first
    ),
    "without shadows at later surfaces": lambda p: (
        p.open_points_later - p.points_later + p.open_lamps_later - p.lamps_later
    ),
    "light is counted twice: by samples of lights, and where paths meet them": lambda p: p.met,
    "direct light is not divided by pi": lambda p: (math.pi - 1.0) * (p.points + p.lamps),
    "direct light of lights without extent is not divided by pi": lambda p: (
        (math.pi - 1.0) * p.points
    ),
    "direct light of lights without extent lacks the cosine": lambda p: (
        p.points_without_cosine - p.points
    ),
    "light of points falls with the distance, not with its square": lambda p: (
        p.points_times_distance - p.points
    ),
}
"""By the name of a mistake: how it changes the picture."""


class _Bounce(NamedTuple):
    """What n paths do at a surface.  cosine (n,): of the direction that they take;  is_delta,
    passes (n,): whether it is mirrored or refracted, and whether it leads to the other side;
    chance (n,): of that, where a dielectric chose, else 1;  survival (n,): the chance that Russian
    roulette lets them go on, by what they carry;  edge: edges before it."""

    cosine: FloatArray
    is_delta: BoolArray
    passes: BoolArray
    chance: FloatArray
    survival: FloatArray
    edge: int


def _without_fresnel(mirrored: float) -> Callable[[_Bounce], FloatArray]:
    """Dielectrics that mirror this share of the light at all angles, but where all is mirrored."""

    def factor(at: _Bounce) -> FloatArray:
        share = np.where(at.passes, 1.0 - mirrored, mirrored)
        return np.where(at.chance < 1.0, share / at.chance, 1.0)

    return factor


def _each(factor: float) -> Callable[[_Bounce], FloatArray]:
    return lambda at: np.full_like(at.cosine, factor)


def _roulette(first: int) -> Callable[[_Bounce], FloatArray]:
    return lambda at: at.survival if at.edge + 1 >= first else np.ones_like(at.survival)


FACTORS = {"1/2": 0.5, "0.8": 0.8, "0.9": 0.9, "2": 2.0, "pi": math.pi, "1/pi": 1.0 / math.pi}

TWICE = "the cosine is multiplied twice"

BOUNCES: dict[str, Callable[[_Bounce], FloatArray]] = {
    TWICE: lambda at: np.where(at.is_delta, 1.0, at.cosine),
    **{f"each bounce is multiplied by {name}": _each(of) for name, of in FACTORS.items()},
    **{
        f"Russian roulette from bounce {first} on does not compensate for the paths that it ends": (
            _roulette(first)
        )
        for first in (1, 2, 3, 5)
    },
    "dielectrics mirror nothing, without Fresnel's formulas": _without_fresnel(0.0),
    "dielectrics mirror half of the light, without Fresnel's formulas": _without_fresnel(0.5),
}
"""By the name of a mistake: by what it multiplies what paths carry on from a surface."""

UNIFORM = "directions are uniform, and weighted as if they had the cosine's density"


def mistaken_paths(
    scene: Scene, reference: FloatArray, threads: int | None = None
) -> Iterator[Hypothesis]:
    """Hypotheses about a scene; none unless its paths are traced, by path tracing, for direct light
    or, along mirrored and refracted rays, by Whitted's ray tracing, and each of its shapes has one
    material."""
    edges = _edges(scene.integrator)
    if edges is None or not all(hasattr(shape, "material") for shape in scene.shapes):
        return
    right, uniform = (_traced(scene, edges, wrong, threads) for wrong in (False, True))
    changes = {name: [change(parts) for parts in right] for name, change in CHANGES.items()}
    changes |= {name: [parts.bounces[name] for parts in right] for name in BOUNCES}
    changes[UNIFORM] = [
        b.points + b.met - a.points - a.met for a, b in zip(right, uniform, strict=True)
    ]
    evidence = "so does our picture change if its paths are traced so"
    for name, each in changes.items():
        found = np.stack(each)
        if found.shape[1:] == reference.shape and found.any():
            picture = reference + found.mean(axis=0)
            noise = found.var(axis=0, ddof=1) / len(found)
            yield Hypothesis("mistaken paths", name, evidence, picture, 0, REST, None, noise)


def _edges(own: AnyIntegrator) -> int | None:
    """The most edges of the paths of an integrator; None where it has no such paths."""
    if isinstance(own, Path):
        return LONGEST if own.max_depth is None else min(own.max_depth, LONGEST)
    if isinstance(own, Direct):
        return 2 if own.shadows else None
    return min(own.max_depth + 2, LONGEST) if isinstance(own, Whitted) else None


def _traced(scene: Scene, edges: int, uniform: bool, threads: int | None) -> list[_Parts]:
    """BATCHES of paths, of which each picture is the mean.  uniform: with the mistake UNIFORM."""
    height, width = scene.film.height, scene.film.width
    spp = max(1, SAMPLES // BATCHES // (height * width))
    tracer = _Tracer(scene, edges, uniform, threads)
    found = []
    for seed in range(BATCHES):
        sums = tracer.traced(spp, seed)
        pictures = {name: x.reshape(height, width, 3) / spp for name, x in sums.items()}
        bounces = {name: pictures.pop(name) for name in BOUNCES}
        found.append(_Parts(**pictures, bounces=bounces))
    return found


class _Tracer:
    """sums (pixels, 3): of the radiance of the paths of a batch, by the names of `_Parts`."""

    def __init__(self, scene: Scene, edges: int, uniform: bool, threads: int | None) -> None:
        self._scene, self._edges, self._uniform, self._threads = scene, edges, uniform, threads
        names = sorted({shape.material or "" for shape in scene.shapes})
        self._bsdfs = [scene.bsdf(name or None) for name in names]
        self._number = np.array([names.index(shape.material or "") for shape in scene.shapes])
        self._pixels = scene.film.height * scene.film.width
        self._splits = np.array(
            [isinstance(scene.materials.get(n), Dielectric | ThinDielectric) for n in names]
        )
        self._is_lit = scene.light_sources().probability.any()
        # Path tracing refuses Phong materials that create energy; what shines is the same without.
        plain = {k: Diffuse() if isinstance(m, Phong) else m for k, m in scene.materials.items()}
        self._shining = scene.changed(materials=plain, integrator=Path(max_depth=1), sampler=None)
        # Whitted's rays end where light is scattered, and skies light nothing.
        self._scatters = not isinstance(scene.integrator, Whitted)

    def _add(self, name: str, pixel: IntArray, light: FloatArray) -> None:
        for k in range(3):
            self.sums[name][:, k] += np.bincount(pixel, light[:, k], self._pixels)

    def traced(self, spp: int, seed: int) -> dict[str, FloatArray]:
        """`sums` of so many paths of each pixel."""
        names = [*(field.name for field in fields(_Parts) if field.name != "bounces"), *BOUNCES]
        self.sums = {name: np.zeros((self._pixels, 3)) for name in names}
        self._rng = np.random.default_rng(seed)
        self._trace(spp)
        return self.sums

    def _trace(self, spp: int) -> None:
        scene, rng = self._scene, self._rng
        shape = (spp, scene.film.height, scene.film.width, 2)
        rays = scene.camera_rays(offsets=rng.random(shape) - 0.5, lens=rng.random(shape))
        o, d = (x.reshape(-1, 3) for x in rays)
        pixel = np.tile(np.arange(self._pixels), spp)
        weight, is_seen = np.ones_like(o), np.ones(len(o), dtype=bool)
        # What paths of each mistake carry, over what they should, and the square of the index.
        wrong, eta2 = dict.fromkeys(BOUNCES, np.ones(len(o))), np.ones(len(o))
        for edge in range(self._edges):
            if edge > 0:
                light = weight * self._emitted(o, d)
                # What is seen, in mirrors too, does not change but by bounces.
                self._add("met", pixel[~is_seen], light[~is_seen])
                for name, factor in wrong.items():
                    self._add(name, pixel, (factor - 1.0)[:, None] * light)
            hits = scene.intersect(o, d, threads=self._threads)
            alive = np.flatnonzero(hits.hit)
            if edge + 1 == self._edges or not len(alive):
                return
            pixel, weight, eta2 = pixel[alive], weight[alive], eta2[alive]
            wrong = {name: factor[alive] for name, factor in wrong.items()}
            at = _Surface(hits.p[alive], hits.ns[alive], hits.uv[alive], -d[alive])
            number = self._number[hits.shape[alive]]
            if self._is_lit:
                where = "first" if edge == 0 else "later"
                self._add_direct(at, number, pixel, weight, where, wrong)
            wi, factor, is_seen, chance, eta = self._scattered(at, number)
            weight, eta2 = weight * factor, eta2 * eta * eta
            if not self._scatters:
                weight[~is_seen] = 0.0
            survival = np.minimum(weight.max(axis=1) * eta2, CAP)
            cosine = at.local(wi)[:, 2]
            passes = cosine * at.wo[:, 2] < 0.0
            bounce = _Bounce(np.abs(cosine), is_seen, passes, chance, survival, edge)
            wrong = {name: factor * BOUNCES[name](bounce) for name, factor in wrong.items()}
            o, d = at.p + _beginning(at.p)[:, None] * wi, wi
            goes_on = np.flatnonzero((weight > 0.0).any(axis=1))
            o, d, weight = o[goes_on], d[goes_on], weight[goes_on]
            pixel, is_seen, eta2 = pixel[goes_on], is_seen[goes_on], eta2[goes_on]
            wrong = {name: factor[goes_on] for name, factor in wrong.items()}

    def _emitted(self, o: FloatArray, d: FloatArray) -> FloatArray:
        """The light (n, 3) that comes from what rays meet first."""
        return self._shining.radiance(o, d, 1, threads=self._threads).mean

    def _add_direct(
        self,
        at: "_Surface",
        number: IntArray,
        pixel: IntArray,
        weight: FloatArray,
        where: str,
        wrong: dict[str, FloatArray],
    ) -> None:
        """Light of one sample of a light at each point.  wrong: see `_trace`."""
        light = self._scene.sample_lights(
            at.p, self._rng.random((len(at.p), 3)), threads=self._threads
        )
        value = np.zeros_like(at.p)
        wi = at.local(light.wi)
        for k, bsdf in enumerate(self._bsdfs):
            one = number == k
            if one.any():
                value[one] = bsdf.evaluate(at.wo[one], wi[one], at.uv[one], threads=self._threads)
        pdf = np.where(light.pdf > 0.0, light.pdf, np.inf)[:, None]
        arriving = weight * value * light.radiance / pdf
        if not self._scatters:
            arriving[~light.is_delta & np.isinf(light.distance)] = 0.0
        lit = np.flatnonzero((arriving > 0.0).any(axis=1))
        arriving, pixel = arriving[lit], pixel[lit]
        far = np.minimum(light.distance[lit], FAR)
        hidden = self._scene.occluded(
            at.p[lit], light.wi[lit], far * (1.0 - AHEAD), _beginning(at.p[lit]), self._threads
        )
        shown = np.where(hidden[:, None], 0.0, arriving)
        for kind, of in (("points", light.is_delta[lit]), ("lamps", ~light.is_delta[lit])):
            self._add(f"{kind}_{where}", pixel[of], shown[of])
            self._add(f"open_{kind}_{where}", pixel[of], arriving[of])
        of = light.is_delta[lit]
        cosine = np.maximum(np.abs(wi[lit, 2]), 1e-6)[:, None]
        # Lamps and skies count where paths meet them.
        for name, factor in wrong.items():
            times = factor[lit][:, None] * (cosine if name == TWICE else 1.0)
            self._add(name, pixel[of], ((times - 1.0) * shown)[of])
        self._add("points_without_cosine", pixel[of], (shown / cosine)[of])
        distance = np.where(light.distance < FAR, light.distance, 1.0)[lit, None]
        self._add("points_times_distance", pixel[of], (shown * distance)[of])

    def _scattered(
        self, at: "_Surface", number: IntArray
    ) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray, FloatArray]:
        """Directions in the world, the weights of the paths that follow them, whether they are
        mirrored or refracted, so that no sample of a light finds what they meet, the chance of
        that where a dielectric chose, else 1, and the index behind over that before."""
        u = self._rng.random((len(at.p), 3))
        wi, factor = np.zeros_like(at.p), np.zeros_like(at.p)
        is_delta = np.zeros(len(at.p), dtype=bool)
        chance, eta = np.ones((2, len(at.p)))
        for k, bsdf in enumerate(self._bsdfs):
            one = np.flatnonzero(number == k)
            if not len(one):
                continue
            found = bsdf.sample(at.wo[one], u[one], at.uv[one], threads=self._threads)
            wi[one], is_delta[one], eta[one] = found.wi, found.is_delta, found.eta
            if self._splits[k]:
                chance[one] = np.where(found.pdf > 0.0, found.pdf, 1.0)
            factor[one] = np.where(found.pdf[:, None] > 0.0, found.weight, 0.0)
            if self._uniform:
                of = one[~found.is_delta]
                z, angle = u[of, 1], 2.0 * math.pi * u[of, 2]
                side = np.sqrt(1.0 - z * z)
                up = np.sign(at.wo[of, 2]) * z
                wi[of] = np.stack([side * np.cos(angle), side * np.sin(angle), up], axis=1)
                value = bsdf.evaluate(at.wo[of], wi[of], at.uv[of], threads=self._threads)
                factor[of] = math.pi * value / np.maximum(z, 1e-12)[:, None]
        return at.world(wi), factor, is_delta, chance, eta


def _beginning(p: FloatArray) -> FloatArray:
    return np.asarray(AHEAD * (1.0 + np.abs(p).max(axis=1)))


class _Surface:
    """Points of surfaces.  p, uv: where;  wo: towards the viewer, in the shading frame."""

    def __init__(self, p: FloatArray, n: FloatArray, uv: FloatArray, back: FloatArray) -> None:
        self.p, self.uv = p, uv
        aside = np.where(np.abs(n[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
        x = np.cross(aside, n)
        x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        self._axes = np.stack([x, np.cross(n, x), n], axis=1)
        self.wo = self.local(back)

    def local(self, d: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("kij,kj->ki", self._axes, d))

    def world(self, d: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("kij,ki->kj", self._axes, d))
