"""Which medium is where: the length of the way of a ray through each medium.

Every surface becomes none, and every medium one that only absorbs, in a colour of its own, under a
white sky.  Then a ray goes straight through the scene, and what it sees is exp(-length) in each of
these colours: so the lengths are read off our own pictures.  Mitsuba's side steps from hit to hit,
and asks at each the shape that it met for the medium behind it.
"""

from typing import Any, NamedTuple

import numpy as np

from comparisons.geometry.frame import RAY_EPSILON
from comparisons.media import translate_medium
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.plugins.base import is_wide
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.coincidence import together_along
from comparisons.rungs.rays.rays import Rays, joined, pixel_rays, random_rays
from comparisons.translator import load
from comparisons.translator.moved import moved
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Path
from reference_rt.lights import Constant
from reference_rt.materials import NoSurface
from reference_rt.media import Homogeneous
from reference_rt.rendering import query
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Shape
from reference_rt.shapes.csg import Solid
from reference_rt.shapes.instances import Instance

RAYS = 1024
"""Of the camera, and as many through the scene's bounds."""

THICK = 8.0
"""The optical thickness of the scene's diagonal in a medium: as exp(-8), and that of some such
ways, is far from 0, lengths have nearly all the digits of a picture."""

DEEPEST = 60.0
"""Thicknesses beyond this are alike, as those of endless ways are."""

MOST_HITS = 256
"""Of a ray in Mitsuba."""

MOVED = 16
"""Rays beside one whose lengths differ: those of float32 may pass an edge on its other side."""

FEW = 2e-3
"""Largest fraction of rays that differ from all beside them.  More means another medium."""


class Media(NamedTuple):
    """rays, media: how many were compared;  wrong: of rays whose lengths differ;  lost: of others
    that differ, in which Mitsuba steps over a surface (see `_steps_over`);  first: one that is
    wrong, in words."""

    rays: int
    media: int
    wrong: int
    lost: int
    first: str

    @property
    def too_many(self) -> bool:
        return arbiter.too_many(self.wrong, self.rays, FEW)

    @property
    def is_limited(self) -> bool:
        return arbiter.too_many(self.lost, self.rays)


def media_along(
    scene: Scene, counterpart: Counterpart, sizes: ShapeSizes, most: int = RAYS, seed: int = 3
) -> Media:
    """Compare the lengths of the ways of rays through each medium.  Raises UntranslatableError."""
    names = [*scene.media]
    rng = np.random.default_rng(seed)
    rays = pixel_rays(scene, sizes.frame, most)
    diagonal = 1.0
    if np.isfinite(sizes.lower).all():
        rays = joined(rays, random_rays(sizes, most, rng))
        diagonal = float(np.linalg.norm(sizes.upper - sizes.lower)) or 1.0
    wrong, lost = np.zeros((2, len(rays.o)), bool)
    first = ""
    for three in (names[k : k + 3] for k in range(0, len(names), 3)):
        clear = absorbing(scene, three, THICK / diagonal)
        ours = thickness(clear, rays)
        theirs = thickness_in_mitsuba(clear, counterpart, rays)
        allowed = THICK / diagonal * _slack(sizes, counterpart, rays, diagonal)
        off = _differ(ours, theirs, allowed)
        asked = np.flatnonzero(off)
        off[asked[_meet_two(scene, sizes, rays.rows(asked))]] = False
        over = asked[_steps_over(scene, sizes, rays.rows(asked))]
        lost[over] |= off[over]
        off[over] = False
        for k in np.flatnonzero(off):
            near = thickness(clear, _beside(sizes, rays, int(k), rng))
            lowest, highest = near.min(axis=0), near.max(axis=0)
            inside = np.clip(theirs[k], lowest, highest)
            off[k] = _differ(inside[None], theirs[k][None], 2.0 * allowed[[k]])[0]
            if off[k] and not first:
                first = _described(three, rays, int(k), ours[k], theirs[k], THICK / diagonal)
        wrong |= off
    of_wrong, of_lost = int(np.count_nonzero(wrong)), int(np.count_nonzero(lost))
    return Media(len(rays.o), len(names), of_wrong, of_lost, first)


def _differ(a: FloatArray, b: FloatArray, allowed: FloatArray) -> Any:
    """(n,): whether thicknesses (n, 3) differ by more than is allowed (n,)."""
    a, b = np.minimum(a, DEEPEST), np.minimum(b, DEEPEST)
    return (np.abs(a - b) > allowed[:, None] * (1.0 + a)).any(axis=1)


def _slack(sizes: ShapeSizes, counterpart: Counterpart, rays: Rays, diagonal: float) -> FloatArray:
    """(n,): how far Mitsuba may be off in the length of a way: by its ray epsilon where a ray goes
    on behind each of some surfaces that it meets at a slant, and by meshes that stand in."""
    reach = np.abs(rays.o - np.array(sizes.frame.center)).max(axis=1) + diagonal
    sag = max(counterpart.sags().values(), default=0.0)
    return np.asarray(SLANTED * (RAY_EPSILON * (1.0 / sizes.frame.scale + reach) + sag))


SLANTED = 16.0
"""How often a slant and the number of surfaces multiply the offset of one that is met head-on."""


def _beside(sizes: ShapeSizes, rays: Rays, k: int, rng: np.random.Generator) -> Rays:
    """Rays that are moved by up to Mitsuba's ray epsilon."""
    o, d = np.tile(rays.o[k], (MOVED, 1)), np.tile(rays.d[k], (MOVED, 1))
    size = float(sizes.frame.epsilon(rays.o[[k]])[0])
    return Rays(o + size * rng.uniform(-4.0, 4.0, o.shape), d)


def _meet_two(scene: Scene, sizes: ShapeSizes, rays: Rays) -> Any:
    """(n,): whether a ray meets two shapes in one place that bound different media: which of them
    decides is nobody's fault."""
    if not len(rays.o):
        return np.zeros(0, bool)
    ray, shapes = together_along(sizes, scene.tables, rays)
    media = [(one.interior, one.exterior) for one in scene.shapes]
    differ = np.array([a == b or media[a] != media[b] for a, b in shapes], bool)
    return np.bincount(ray[differ], minlength=len(rays.o)) > 0


def _steps_over(scene: Scene, sizes: ShapeSizes, rays: Rays) -> Any:
    """(n,): whether a ray crosses a surface behind which another one lies within Mitsuba's ray
    epsilon, along the normal: Mitsuba goes on from beyond both, and loses its way."""
    if not len(rays.o):
        return np.zeros(0, bool)
    crossed = query.crossings(scene.tables, rays.o, rays.d)
    onwards = np.sign(np.sum(rays.d[crossed.ray] * crossed.n, axis=1))[:, None] * crossed.n
    behind = query.crossings(scene.tables, crossed.p, onwards)
    epsilon = sizes.frame.epsilon(crossed.p)[behind.ray]
    # The surface itself is at 0, but for the rounding of float64.
    near = (behind.t > OWN * epsilon) & (behind.t <= epsilon)
    return np.bincount(crossed.ray[behind.ray[near]], minlength=len(rays.o)) > 0


OWN = 2.0**-20
"""Of Mitsuba's ray epsilon, which is 2^-13 of a point's coordinates: float64's errors are 2^-50 of
them."""


def _described(
    names: list[str], rays: Rays, k: int, ours: FloatArray, theirs: FloatArray, sigma: float
) -> str:
    parts = [
        f"{name}: ours {a / sigma:.6g}, Mitsuba's {b / sigma:.6g}"
        for name, a, b in zip(names, ours, theirs, strict=False)
    ]
    return (
        f"the length of the way in each medium of the ray from {rays.o[k].tolist()} along "
        f"{rays.d[k].tolist()}: {'; '.join(parts)}"
    )


# ---- the scene in which all is seen through ------------------------------------------------------


def absorbing(scene: Scene, names: list[str], sigma: float) -> Scene:
    """The scene with surfaces that are none, under a white sky, in which up to three media absorb a
    colour each, by sigma per length, and the others nothing."""
    media = {}
    for name in scene.media:
        red, green, blue = (sigma if names[k : k + 1] == [name] else 0.0 for k in range(3))
        media[name] = Homogeneous(sigma_t=(red, green, blue), albedo=(0.0, 0.0, 0.0))
    return scene.changed(
        media=media,
        materials={"none": NoSurface()},
        textures={},
        shapes=tuple(map(_clear, scene.shapes)),
        groups={name: tuple(map(_clear, shapes)) for name, shapes in scene.groups.items()},
        lights=(Constant(radiance=(1.0, 1.0, 1.0)),),
        integrator=Path(max_depth=1),
        sampler=None,
    )


def _clear(shape: Shape) -> Shape:
    if isinstance(shape, Instance):
        return shape
    if isinstance(shape, Solid):
        of = tuple(map(_bare, shape.of))
        return shape.model_copy(update={"material": "none", "of": of})
    return shape.model_copy(update={"material": "none"})


def _bare(operand: Shape) -> Shape:
    """An operand with the material of its solid."""
    more = {"of": tuple(map(_bare, operand.of))} if isinstance(operand, Solid) else {}
    return operand.model_copy(update={"material": None, **more})


def thickness(clear: Scene, rays: Rays) -> FloatArray:
    """(n, 3): by our renderer."""
    seen = clear.radiance(rays.o, rays.d, spp=1).mean
    with np.errstate(divide="ignore"):
        return np.asarray(-np.log(seen))


def thickness_in_mitsuba(clear: Scene, counterpart: Counterpart, rays: Rays) -> FloatArray:
    """(n, 3): by the hits of Mitsuba, and the media of its shapes."""
    other = load(clear, counterpart.frame)
    o, name, begin = counterpart.frame.into(rays.o), clear.camera.medium, None
    if name is not None:
        begin = translate_medium(moved(clear, counterpart.frame).media[name])
        begin = mitsuba().load_dict(begin)
    if is_wide(mitsuba()):
        return _together(other, o, rays.d, begin)
    return np.array([_one(other, *ray, begin) for ray in zip(o, rays.d, strict=True)])


def _together(counterpart: Counterpart, o: FloatArray, d: FloatArray, inside: Any) -> FloatArray:
    mi = mitsuba()
    import drjit as dr  # after the choice of its LLVM

    n = len(o)
    ray = mi.Ray3f(mi.Point3f(o.T), mi.Vector3f(d.T))
    medium = dr.zeros(mi.MediumPtr, n) if inside is None else dr.opaque(mi.MediumPtr, inside, n)
    total, active = mi.Color3f(0.0), dr.full(mi.Mask, True, n)
    before = mi.Float(0.0)
    begin, along = mi.Point3f(ray.o), mi.Vector3f(ray.d)
    for _ in range(MOST_HITS):
        si, _ = counterpart.lit.trace(ray, active)
        met = active & si.is_valid()
        t = dr.select(met, dr.dot(si.p - begin, along), dr.inf)
        mei = dr.zeros(mi.MediumInteraction3f, n)
        within = active & (medium != dr.zeros(mi.MediumPtr))
        sigma = medium.get_scattering_coefficients(mei, within)[2]
        more = dr.select(within & (sigma > 0.0), sigma * dr.maximum(t - before, 0.0), 0.0)
        total += more
        before = dr.select(met, t, before)
        changes = met & si.is_medium_transition()
        medium = dr.select(changes, si.target_medium(ray.d), medium)
        ray = dr.select(met, si.spawn_ray(along), ray)
        active = met
        dr.eval(ray, total, before, medium, active)
        if not dr.any(active):
            break
    return np.broadcast_to(np.array(total, np.float64), (3, n)).T.copy()


def _one(counterpart: Counterpart, o: FloatArray, d: FloatArray, medium: Any) -> FloatArray:
    """The same of one ray in a scalar variant."""
    mi = mitsuba()
    ray = mi.Ray3f(mi.Point3f(o.tolist()), mi.Vector3f(d.tolist()))
    total, before = np.zeros(3), 0.0
    for _ in range(MOST_HITS):
        si, _ = counterpart.lit.trace(ray, True)
        t = float(np.dot(np.array(si.p) - o, d)) if si.is_valid() else np.inf
        if medium is not None:
            mei = mi.MediumInteraction3f()
            sigma = np.array(medium.get_scattering_coefficients(mei, True)[2], np.float64)
            with np.errstate(invalid="ignore"):
                total += np.where(sigma > 0.0, sigma * max(t - before, 0.0), 0.0)
        if not si.is_valid():
            break
        before = t
        if si.is_medium_transition():
            medium = si.target_medium(ray.d)
        ray = si.spawn_ray(mi.Vector3f(d.tolist()))
    return total
