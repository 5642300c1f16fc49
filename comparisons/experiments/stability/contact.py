"""F13: surfaces that are close to each other.

Law.  What lies between two surfaces is not skipped: rays that go straight on from surface to
surface meet them in their order, light gets into the gap and no further than it should, and glass
after glass lets through what Fresnel says, as long as the gap is more than

    4 B,  B = 17 sqrt(3) u (2 |c| + 6 s),  u = 2^-53,

c being the middle of the scene (largest coordinate) and s its half width: a ray begins up to B off
what it leaves (F2), on either side of the gap, and its target is seen no more precisely.

Range.  Gaps from 1e-1 to 1e-14 of the scale, about the origin and 1000 scales away.

Counts.  20,000 rays in each point of the full run.

Passes.  No failure up to the last decade of gaps above 4 B: 1e-13 at the origin, 1e-10 far away.
Answers are known in closed form; points of a contact shadow within 4 B of its edge are undecidable.

Mitsuba begins rays (1 + max |p|) RayEpsilon off, RayEpsilon = 8.9e-5 in its float32: gaps below
that are predicted to be skipped, from x = 1.1e4 on at the latest, and far away from x = 11."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

import reference_rt as rt
from comparisons import translator
from comparisons.experiments.stability.harness.core import (
    MITSUBA,
    OURS,
    Draw,
    Family,
    Outcome,
    Series,
    Shot,
    Sweep,
    U,
    decades,
    outcome,
    together,
)
from comparisons.experiments.stability.harness.steps import (
    CONTACT,
    PIXELS,
    bound,
    light_picture,
    lit,
    matrix,
)
from comparisons.geometry import frame
from comparisons.geometry.exact.dyadic import BoolArray
from comparisons.mitsuba.backend import scalar
from reference_rt.accel.geometry import Geometry, closest_hit, owner, surface
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.ray import Ray, ray_from
from reference_rt.core.vec3 import row
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.jit.kernel import entry_kernel
from reference_rt.rendering.query import radiance_without_noise
from reference_rt.rendering.query.links import link_to_geometry

# ---- stacks of surfaces that are close to each other, and the order in which rays meet them ------


COUNT = 8
"""Surfaces in a stack."""

FAR = 1000.0
"""Scales between the origin and the scenes that are far away."""

STACKS = 4
"""Drawn at each sweep point."""

THEIRS = 40
"""Rays of a stack that Mitsuba traces, in its scalar variant."""


@entry_kernel
def _follow(geometry: Geometry, o: FloatArray, d: FloatArray, out: IntArray) -> None:
    """Into out (n, steps): the shapes that a ray meets, one after another; -1 after the last."""
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        for k in range(out.shape[1]):
            hit = closest_hit(geometry, ray)
            if hit.kind < 0:
                break
            out[i, k] = owner(geometry, hit).shape
            ray = ray_from(surface(geometry, ray, hit), ray.d)


class Stack(NamedTuple):
    """A scene, rays (n, 3) and the shapes that each meets, in order (n, steps)."""

    scene: rt.Scene
    o: FloatArray
    d: FloatArray
    expected: IntArray


def follow(scene: rt.Scene, o: FloatArray, d: FloatArray, steps: int) -> IntArray:
    """The shapes that rays meet on their way straight through, -1 after the last."""
    out = np.full((len(o), steps), -1)
    found = link_to_geometry(rt.build_tables(scene), "closest_hit", "surface", "owner")
    _follow(found.tables, o, d, out)
    return out


def follow_in_mitsuba(scene: rt.Scene, o: FloatArray, d: FloatArray, steps: int) -> IntArray:
    """The same in Mitsuba, by `si.spawn_ray`."""
    out = np.full((len(o), steps), -1)
    with scalar() as mi:
        counterpart = translator.load(scene, frame.OURS)
        for i in range(len(o)):
            ray = mi.Ray3f(mi.Point3f(o[i].tolist()), mi.Vector3f(d[i].tolist()))
            for k in range(steps):
                si = counterpart.mi_scene.ray_intersect(ray)
                if not si.is_valid():
                    break
                out[i, k] = counterpart.mi_shapes[si.shape.id()].shape
                ray = si.spawn_ray(mi.Vector3f(d[i].tolist()))
    return out


def _axes(rng: np.random.Generator) -> FloatArray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def rays_down(
    rng: np.random.Generator, n: int, steepest: float = 0.4
) -> tuple[FloatArray, FloatArray]:
    """(o, d) from above through the middle of the square [-1, 1]², at up to this tangent."""
    middle = np.column_stack([rng.uniform(-0.2, 0.2, (n, 2)), np.zeros(n)])
    d = np.column_stack([rng.uniform(-steepest, steepest, (n, 2)), -np.ones(n)])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return middle - 1.5 * d, d


def plates(rng: np.random.Generator, n: int, gap: float, distance: float = 0.0) -> Stack:
    """Parallel squares, tilted."""
    axes, center = _axes(rng), _axes(rng)[0] * distance
    squares = tuple(
        rt.Rectangle(transform=matrix(axes, center - axes[:, 2] * (k * gap))) for k in range(COUNT)
    )
    o, d = rays_down(rng, n, 0.3)
    o, d = o @ axes.T + center, d @ axes.T
    return Stack(rt.Scene(shapes=squares), o, d, np.tile(np.arange(COUNT), (n, 1)))


def shells(rng: np.random.Generator, n: int, gap: float, distance: float = 0.0) -> Stack:
    """Spheres in spheres; rays pass near enough to the middle to meet all, twice."""
    center = _axes(rng)[0] * distance
    balls = tuple(
        rt.Sphere(center=tuple(center.tolist()), radius=1.0 - k * gap) for k in range(COUNT)
    )
    o, d = rays_down(rng, n)
    numbers = np.arange(COUNT)
    expected = np.tile(np.concatenate([numbers, numbers[::-1]]), (n, 1))
    return Stack(rt.Scene(shapes=balls), o + center, d, expected)


def slots(rng: np.random.Generator, n: int, gap: float, distance: float = 0.0) -> Stack:
    """A cube cut in two by a slot, and a square in the middle of that: in, out, the square, in,
    out."""
    axes, center = _axes(rng), _axes(rng)[0] * distance
    cut = rt.Box(transform=matrix(np.diag([4.0, 4.0, gap]), np.zeros(3)))
    cube = rt.Difference(of=(rt.Box(), cut), transform=matrix(axes, center))
    square = rt.Rectangle(transform=matrix(axes, center))
    o, d = rays_down(rng, n)
    o, d = (o - 1.5 * d) @ axes.T + center, d @ axes.T
    expected = np.tile([0, 0, 1, 0, 0], (n, 1))
    return Stack(rt.Scene(shapes=(cube, square)), o, d, expected)


def differing(expected: IntArray, found: IntArray) -> BoolArray:
    """Which rows (n,) are not the same."""
    return np.asarray((expected != found).any(axis=1))


def ordered(
    make: Callable[..., Stack], distance: float = 0.0, theirs: bool = True
) -> Callable[[Draw, float], Mapping[str, Outcome]]:
    """Rays straight through a stack with gaps of 1 / x."""

    def measure(draw: Draw, x: float) -> Mapping[str, Outcome]:
        stacks = (make(draw.rng, draw.cases // STACKS, 1.0 / x, distance) for _ in range(STACKS))
        return together(_judged(stack, x, draw.mitsuba and theirs) for stack in stacks)

    return measure


def _judged(stack: Stack, x: float, mitsuba: bool) -> dict[str, Outcome]:
    scene, o, d, expected = stack
    found = {OURS: follow(scene, o, d, expected.shape[1])}
    if mitsuba:
        found[MITSUBA] = follow_in_mitsuba(scene, o[:THEIRS], d[:THEIRS], expected.shape[1])
    shown = {"gap": (1.0 / x).hex(), "o": o, "d": d, "expected": expected}
    return {
        name: outcome(differing(expected[: len(met)], met), shown | {"found": met})
        for name, met in found.items()
    }


# ---- light in gaps: the contact shadow under a cube, and the transmittance of slabs of glass -----


def shadow_scene(gap: float) -> rt.Scene:
    """A cube over a floor z = 0, from x = -1 to 1 and from z = gap on."""
    floor = rt.Rectangle(transform=matrix(np.diag([4.0, 4.0, 1.0]), np.zeros(3)))
    cube = rt.Box(transform=matrix(np.eye(3), np.array([0.0, 0.0, 1.0 + gap])))
    return rt.Scene(shapes=(floor, cube))


def shadow(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """Points under the cube, `deep` from its edge x = 1, towards a sun at 45°: in the light where
    that comes in under the edge, deep < gap.  The floor is seen from below."""
    gap, n, rng = 1.0 / x, draw.cases, draw.rng
    deep = gap * 2.0 ** rng.uniform(-4.0, 4.0, n)
    slope = np.sqrt(0.5)
    at = np.column_stack([1.0 - deep, rng.uniform(-0.5, 0.5, n), np.zeros(n)])
    d = np.tile([0.0, 0.0, 1.0], (n, 1))
    o, w = at - d, np.tile([slope, 0.0, slope], (n, 1))
    dark = (1.0 - at[:, 0] > gap).astype(np.int64)
    # Near the edge of the shadow either answer is right.
    sure = (np.abs(deep - gap) > CONTACT * bound(0.0, 1.0)) & (deep < 1.5)
    scene = shadow_scene(gap)
    answers = {OURS: lit(OURS, scene, o, d, w)}
    if draw.mitsuba:
        answers[MITSUBA] = lit(MITSUBA, scene, *(a[: 4 * THEIRS] for a in (o, d, w)))
    outcomes = {}
    for name, answer in answers.items():
        met, few = (1.0 - answer[:, 0]).astype(np.int64), slice(len(answer))
        shown = {"gap": gap.hex(), "point": at, "expected": dark, "found": met}
        outcomes[name] = outcome(dark[few] != met, shown, ~sure[few])
    return outcomes


GLASS = 1.5
"""Index of refraction."""

TRANSMITTED = 64.0 * COUNT * U
"""Of the relative error: each of Fresnel's equations, some thirty operations whose result changes
by less than twice what the cosine does, below 30°."""


def panes(gap: float) -> SceneTables:
    """Slabs of glass, `gap` thick and as much apart, before a lamp of radiance 1."""
    slabs = tuple(
        rt.Box(
            material="glass",
            transform=matrix(np.diag([2.0, 2.0, gap / 2.0]), np.array([0.0, 0.0, -2.0 * k * gap])),
        )
        for k in range(COUNT // 2)
    )
    lamp = rt.Rectangle(
        material="lamp", transform=matrix(np.diag([9.0, 9.0, 1.0]), np.array([0.0, 0.0, -3.0]))
    )
    materials: dict[str, Any] = {
        "glass": rt.Dielectric(interior_ior=GLASS),
        "lamp": rt.Emissive(radiance=(1.0, 1.0, 1.0)),
    }
    return rt.build_tables(rt.Scene(shapes=(*slabs, lamp), materials=materials))


def fresnel(cosine: FloatArray) -> FloatArray:
    """Transmitted by one surface, of unpolarised light (both ways the same)."""
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / GLASS**2)
    across = (cosine - GLASS * inner) / (cosine + GLASS * inner)
    along = (GLASS * cosine - inner) / (GLASS * cosine + inner)
    return np.asarray(1.0 - 0.5 * (across**2 + along**2))


def transmitted(draw: Draw, x: float) -> Mapping[str, Outcome]:
    """As many surfaces as Whitted may follow: what is mirrored to and fro needs more, so that the
    lamp is seen through all of them alone: (1 - F)^COUNT."""
    o, d = rays_down(draw.rng, draw.cases)
    setup = rt.Whitted(max_depth=COUNT, min_contribution=0.0).setup()
    found = radiance_without_noise(panes(1.0 / x), setup, o + np.array([0.0, 0.0, 0.5]), d)[:, 0]
    expected = fresnel(-d[:, 2]) ** COUNT
    error = np.abs(found - expected) / expected
    shown = {"o": o, "d": d, "expected": expected, "found": found}
    return {OURS: outcome(~(error <= TRANSMITTED), shown, worst=float(error.max() / (COUNT * U)))}


def shoot(contestant: str, x: float) -> Shot:
    """The strip of the floor beside and under the edge, twelve gaps wide."""
    gap = 1.0 / x
    ticks = (np.arange(PIXELS) + 0.5) / PIXELS * 12.0 - 6.0
    across, along = np.meshgrid(ticks, np.linspace(-0.5, 0.5, PIXELS))
    at = np.column_stack([1.0 + across.ravel() * gap, along.ravel(), np.zeros(across.size)])
    d = np.tile([0.0, 0.0, 1.0], (len(at), 1))
    w = np.tile([math.sqrt(0.5), 0.0, math.sqrt(0.5)], (len(at), 1))
    found = lit(contestant, shadow_scene(gap), at - d, d, w)
    share = float((found[:, 0] > 0.0).mean())
    caption = (
        f"{contestant}: the floor at a cube's edge (in the middle), {gap:.0e} under it; "
        f"light comes in by one gap in twelve: 58 % are lit, here {100.0 * share:.0f} %"
    )
    return Shot(light_picture(found), caption)


# ---- the series ----------------------------------------------------------------------------------


CASES = 400, 20_000
NEAR_LAW = "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u · 6 s = 7.8e-14 s"
FAR_LAW = (
    "a gap is kept apart where it is more than 4 B = 4 · 17 sqrt(3) u (2 |c| + 6 s) = 2.6e-11 s"
)


def _series(name: str, about: str, make: Callable[..., Stack], far: bool, theirs: bool) -> Series:
    values = decades(1, 12) if far else decades(1, 14)
    return Series(
        f"{name}, far away" if far else name,
        Sweep("scale / gap", values, (1e1, 1e5, 1e10) if far else (1e1, 1e5, 1e13), *CASES),
        about + (", a thousand scales from the origin." if far else "."),
        ordered(make, FAR if far else 0.0, theirs),
        holds_to=1e10 if far else 1e13,
        law=FAR_LAW if far else NEAR_LAW,
    )


_KINDS: tuple[tuple[str, str, Callable[..., Stack], bool], ...] = (
    ("plates", f"Rays straight through {COUNT} parallel squares meet them in order", plates, True),
    ("shells", f"Rays through {COUNT} spheres in each other meet them in and out", shells, True),
    ("slots", "Rays through a cube with a slot, and a square in that", slots, False),
)

FAMILY = Family(
    id="F13",
    name="contact gaps",
    law="What lies in a gap is not skipped: order, shadows and light are those of closed forms.",
    anchors="lost contact shadows are reported of Mitsuba (mitsuba3#1871, #219); none is tested.",
    series=(
        *(
            _series(name, about, make, far, theirs)
            for far in (False, True)
            for name, about, make, theirs in _KINDS
        ),
        Series(
            "shadow",
            Sweep("scale / gap", decades(1, 14), (1e1, 1e5, 1e12), *CASES),
            "A cube hovers over a floor: light at 45° comes in under its edge by one gap.",
            shadow,
            holds_to=1e13,
            law=NEAR_LAW,
            shoot=shoot,
        ),
        Series(
            "glass",
            Sweep("scale / thickness", decades(1, 14), (1e1, 1e6, 1e13), 200, 2000),
            f"A lamp through {COUNT // 2} slabs of glass, as thick as they are apart: "
            f"(1 - F)^{COUNT}, F by Fresnel.",
            transmitted,
            unit=f"u · {COUNT}, relative",
            holds_to=1e13,
            law=NEAR_LAW,
        ),
    ),
)
