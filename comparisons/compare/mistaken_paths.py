"""Hypotheses about paths that are traced wrongly: no shadow rays, light counted twice, a density
that is not that of the directions, a factor that was forgotten.

A small path tracer of ours takes the scene's own answers (hits, values of materials, samples of
lights) and keeps apart what each kind of light adds at each edge. A mistake is another sum of these
parts, and its change of the picture is what the candidate should show. All sums are of the same
paths, so that the change has little noise.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields

import numpy as np

from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST
from comparisons.results.case import FloatArray
from reference_rt.core.arrays import IntArray
from reference_rt.integrators import Path
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

UNIFORM = "directions are uniform, and weighted as if they had the cosine's density"


def mistaken_paths(
    scene: Scene, reference: FloatArray, threads: int | None = None
) -> Iterator[Hypothesis]:
    """Hypotheses about a scene; none unless it is rendered by path tracing, and each of its shapes
    has one material."""
    own = scene.integrator
    if not isinstance(own, Path) or not all(hasattr(shape, "material") for shape in scene.shapes):
        return
    edges = LONGEST if own.max_depth is None else min(own.max_depth, LONGEST)
    right, uniform = (_traced(scene, edges, wrong, threads) for wrong in (False, True))
    changes = {name: [change(parts) for parts in right] for name, change in CHANGES.items()}
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


def _traced(scene: Scene, edges: int, uniform: bool, threads: int | None) -> list[_Parts]:
    """BATCHES of paths, of which each picture is the mean.  uniform: with the mistake UNIFORM."""
    height, width = scene.film.height, scene.film.width
    spp = max(1, SAMPLES // BATCHES // (height * width))
    tracer = _Tracer(scene, edges, uniform, threads)
    found = []
    for seed in range(BATCHES):
        sums = tracer.traced(spp, seed)
        pictures = {name: x.reshape(height, width, 3) / spp for name, x in sums.items()}
        found.append(_Parts(**pictures))
    return found


class _Tracer:
    """sums (pixels, 3): of the radiance of the paths of a batch, by the names of `_Parts`."""

    def __init__(self, scene: Scene, edges: int, uniform: bool, threads: int | None) -> None:
        self._scene, self._edges, self._uniform, self._threads = scene, edges, uniform, threads
        names = sorted({shape.material or "" for shape in scene.shapes})
        self._bsdfs = [scene.bsdf(name or None) for name in names]
        self._number = np.array([names.index(shape.material or "") for shape in scene.shapes])
        self._pixels = scene.film.height * scene.film.width
        self._is_lit = scene.light_sources().probability.any()

    def _add(self, name: str, pixel: IntArray, light: FloatArray) -> None:
        for k in range(3):
            self.sums[name][:, k] += np.bincount(pixel, light[:, k], self._pixels)

    def traced(self, spp: int, seed: int) -> dict[str, FloatArray]:
        """`sums` of so many paths of each pixel."""
        self.sums = {field.name: np.zeros((self._pixels, 3)) for field in fields(_Parts)}
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
        for edge in range(self._edges):
            # What is seen, in mirrors too, does not change.
            met = np.flatnonzero(~is_seen)
            if len(met):
                emitted = scene.radiance(
                    o[met], d[met], 1, integrator=Path(max_depth=1), threads=self._threads
                ).mean
                self._add("met", pixel[met], weight[met] * emitted)
            hits = scene.intersect(o, d, threads=self._threads)
            alive = np.flatnonzero(hits.hit)
            if edge + 1 == self._edges or not len(alive):
                return
            pixel, weight = pixel[alive], weight[alive]
            at = _Surface(hits.p[alive], hits.ns[alive], hits.uv[alive], -d[alive])
            number = self._number[hits.shape[alive]]
            if self._is_lit:
                self._add_direct(at, number, pixel, weight, "first" if edge == 0 else "later")
            wi, factor, is_seen = self._scattered(at, number)
            o, d, weight = at.p + _beginning(at.p)[:, None] * wi, wi, weight * factor
            goes_on = np.flatnonzero((weight > 0.0).any(axis=1))
            o, d, weight = o[goes_on], d[goes_on], weight[goes_on]
            pixel, is_seen = pixel[goes_on], is_seen[goes_on]

    def _add_direct(
        self, at: "_Surface", number: IntArray, pixel: IntArray, weight: FloatArray, where: str
    ) -> None:
        """Light of one sample of a light at each point."""
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
        self._add("points_without_cosine", pixel[of], (shown / cosine)[of])
        distance = np.where(light.distance < FAR, light.distance, 1.0)[lit, None]
        self._add("points_times_distance", pixel[of], (shown * distance)[of])

    def _scattered(
        self, at: "_Surface", number: IntArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Directions in the world, the weights of the paths that follow them, and whether they are
        mirrored or refracted, so that no sample of a light finds what they meet."""
        u = self._rng.random((len(at.p), 3))
        wi, factor = np.zeros_like(at.p), np.zeros_like(at.p)
        is_delta = np.zeros(len(at.p), dtype=bool)
        for k, bsdf in enumerate(self._bsdfs):
            one = np.flatnonzero(number == k)
            if not len(one):
                continue
            found = bsdf.sample(at.wo[one], u[one], at.uv[one], threads=self._threads)
            wi[one], is_delta[one] = found.wi, found.is_delta
            factor[one] = np.where(found.pdf[:, None] > 0.0, found.weight, 0.0)
            if self._uniform:
                of = one[~found.is_delta]
                z, angle = u[of, 1], 2.0 * math.pi * u[of, 2]
                side = np.sqrt(1.0 - z * z)
                up = np.sign(at.wo[of, 2]) * z
                wi[of] = np.stack([side * np.cos(angle), side * np.sin(angle), up], axis=1)
                value = bsdf.evaluate(at.wo[of], wi[of], at.uv[of], threads=self._threads)
                factor[of] = math.pi * value / np.maximum(z, 1e-12)[:, None]
        return at.world(wi), factor, is_delta


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
