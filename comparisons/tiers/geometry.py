"""The first rung: the same rays hit the same places."""

from typing import Any

import numpy as np

from comparisons.mitsuba_scene import trace
from comparisons.results import Tier
from comparisons.tiers import arbiter
from comparisons.tiers.bounds import ShapeSizes, delta, shape_sizes, slide
from comparisons.tiers.camera import compare_camera
from comparisons.tiers.rays import Rays, mixed_rays
from reference_rt import query
from reference_rt.query import Intersections
from reference_rt.scene import Scene
from reference_rt.shapes import Box, Mesh, Sphere, Triangle
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables, build_tables
from reference_rt.transform import Translate

KINDS = ("hit", "shape", "face", "t", "normal", "shading_normal", "uv")

PIXELS = 128 * 128
"""Camera rays that are compared at most, evenly strided; as many others join them."""


def geometry(
    scene: Scene, tables: SceneTables, mi_scene: Any, pixels: int = PIXELS, seed: int = 0
) -> Tier:
    """Compare camera rays, and what camera, random and secondary rays hit.

    `pixels` bounds the number of camera rays; there are as many random rays through the scene's
    bounds, drawn with `seed`, and as many from the camera rays' hits.  Both tracers get the same
    float32 numbers.  Agreement needs every ray's hit, shape, face, t, normals and uv to be within
    float32's bound, or the arbiter to say that float32 cannot resolve the ray.
    """
    camera = compare_camera(scene, mi_scene, pixels)
    sizes = shape_sizes(tables, len(scene.shapes))
    rays = mixed_rays(scene, tables, sizes, pixels, seed)
    ours, theirs = query.intersect(tables, rays.o, rays.d), trace(mi_scene, rays.o, rays.d)
    comparer = Comparer(scene, sizes)
    ratios = comparer.ratios(rays, ours, theirs)
    wrong = np.flatnonzero((ratios > 1.0).any(axis=1))
    reach = np.maximum(sizes.reach_of(ours.shape), sizes.reach_of(theirs.shape))
    radius = delta(rays.o, np.where(ours.shape[:, None] >= 0, ours.p, theirs.p), reach)

    def like_theirs(numbers: IntArray, offsets: FloatArray) -> arbiter.BoolArray:
        moved = Rays(rays.o[numbers] + offsets, rays.d[numbers])
        again = query.intersect(tables, moved.o, moved.d)
        ratios = comparer.ratios(moved, again, _rows(theirs, numbers))
        # The move itself shifts t and uv by as much as the bound: twice is allowed.
        return np.asarray((ratios <= 2.0).all(axis=1))

    settled = arbiter.explained(wrong, radius[wrong], like_theirs)
    left = wrong[~settled]
    coincident = _coincident(scene, comparer, rays, left, (ours, theirs))
    mismatches = left[~coincident]
    right = ratios[(ratios <= 1.0).all(axis=1)]
    numbers: dict[str, Any] = {
        "rays": len(rays.o),
        "hits": int(np.count_nonzero(ours.shape >= 0)),
        "mismatches": len(mismatches),
        "explained": len(wrong) - len(mismatches),
        "coincident": int(np.count_nonzero(coincident)),
        **{
            f"max_{kind}_error_over_bound": float(right[:, k].max(initial=0.0))
            for k, kind in enumerate(KINDS)
            if k > 2
        },
        "mismatches_by_kind": {
            kind: int(np.count_nonzero(ratios[mismatches, k] > 1.0)) for k, kind in enumerate(KINDS)
        },
        **camera.numbers,
    }
    if camera.problem:
        return Tier("geometry", "differ", camera.problem, numbers)
    if len(mismatches):
        where = _describe(rays, ours, theirs, ratios, int(mismatches[0]))
        reason = f"{len(mismatches)} of {len(rays.o)} rays differ; the first: {where}"
        return Tier("geometry", "differ", reason, numbers)
    unresolved = (
        f"{numbers['explained']} of {len(rays.o)} rays meet edges, or surfaces that coincide, "
        "which float32 cannot resolve"
    )
    if numbers["explained"] > arbiter.LIMIT * len(rays.o):
        return Tier("geometry", "reference-limited", unresolved, numbers)
    worst = right.max(initial=0.0)
    reason = f"{len(rays.o)} rays agree to {worst:.2g} of float32's bound; {unresolved}"
    return Tier("geometry", "agree", reason, numbers)


# ---- one answer against the other ---------------------------------------------------------------


class Comparer:
    """Errors of Mitsuba's answers over their bounds."""

    def __init__(self, scene: Scene, sizes: ShapeSizes) -> None:
        self.sizes = sizes
        shapes = [*scene.shapes, None]
        # A hit without a shape has index -1: the last of these.
        self.has_faces = np.array([isinstance(s, Mesh | Triangle) for s in shapes])
        self.is_sphere = np.array([isinstance(s, Sphere) for s in shapes])
        self.is_box = np.array([isinstance(s, Box) for s in shapes])

    def ratios(self, rays: Rays, ours: Intersections, theirs: Intersections) -> FloatArray:
        """(n, len(KINDS)): error over bound, infinite for another hit, shape or face.

        With e = delta / cos, how far the point may slide along the surface: |t| may be off by e,
        uv and normals by e over the smallest length on which they change, shading normals, which
        turn by up to two unit vectors on that length, by twice that.
        """
        hit = (ours.shape >= 0) & (theirs.shape >= 0)
        same = hit & (ours.shape == theirs.shape)
        other_face = self.has_faces[ours.shape] & (ours.face != theirs.face)
        length = np.linalg.norm(rays.d, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            e = slide(self.sizes, rays.o, rays.d, ours.p, ours.n, ours.shape)
            turn = e / self.sizes.feature_of(ours.shape, ours.face)
            error_t = np.abs(theirs.t - ours.t) * length / e
            error_n = np.linalg.norm(theirs.n - ours.n, axis=1) / turn
            error_ns = np.linalg.norm(theirs.ns - ours.ns, axis=1) / (2.0 * turn)
            error_uv = np.linalg.norm(self._place(theirs) - self._place(ours), axis=1) / turn
        # A box's faces are counted and parametrised differently: its normals tell them apart.
        error_uv[self.is_box[ours.shape]] = 0.0
        different = np.column_stack(
            [(ours.shape >= 0) != (theirs.shape >= 0), hit & ~same, same & other_face]
        )
        errors = np.column_stack([error_t, error_n, error_ns, error_uv])
        errors[~same | other_face] = 0.0  # of another surface they mean nothing
        # A NaN is never within a bound.
        return np.hstack([np.where(different, np.inf, 0.0), np.nan_to_num(errors, nan=np.inf)])

    def _place(self, hits: Intersections) -> FloatArray:
        """uv as coordinates without seam or pole: a sphere's as a unit vector."""
        phi, theta = 2.0 * np.pi * hits.uv[:, 0], np.pi * hits.uv[:, 1]
        r = np.sin(theta)
        on_sphere = np.column_stack([r * np.cos(phi), r * np.sin(phi), np.cos(theta)])
        flat = np.column_stack([hits.uv, np.zeros(len(phi))])
        return np.where(self.is_sphere[hits.shape][:, None], on_sphere, flat)


COINCIDENCES = 8
"""Shapes that are looked behind: each costs building the tables again."""


def _coincident(
    scene: Scene,
    comparer: Comparer,
    rays: Rays,
    numbers: IntArray,
    answers: tuple[Intersections, Intersections],
) -> arbiter.BoolArray:
    """Which rays (m,) meet two shapes in one place, of which ours found one, Mitsuba the other.

    So it is where ours gives Mitsuba's answer once its own shape is far away, at the same t.
    """
    ours, theirs = (_rows(hits, numbers) for hits in answers)
    found = np.zeros(len(numbers), bool)
    for shape in np.unique(ours.shape[ours.shape >= 0])[:COINCIDENCES].tolist():
        mine = np.flatnonzero(ours.shape == shape)
        some = Rays(rays.o[numbers[mine]], rays.d[numbers[mine]])
        rest = build_tables(_without(scene, shape, comparer.sizes))
        behind = query.intersect(rest, some.o, some.d)
        agrees = (comparer.ratios(some, behind, _rows(theirs, mine)) <= 1.0).all(axis=1)
        e = slide(comparer.sizes, some.o, some.d, behind.p, behind.n, behind.shape)
        with np.errstate(invalid="ignore"):
            found[mine] = agrees & (np.abs(behind.t - ours.t[mine]) <= e)
    return found


def _without(scene: Scene, index: int, sizes: ShapeSizes) -> Scene:
    """The scene with one shape far away.  Left out, it would make kernels compile again."""
    far = 1e6 * float(sizes.reach.max())
    shapes = list(scene.shapes)
    steps = (*shapes[index].transform, Translate(translate=(far, far, far)))
    shapes[index] = shapes[index].model_copy(update={"transform": steps})
    return scene.changed(shapes=tuple(shapes))


def _rows(hits: Intersections, rows: IntArray) -> Intersections:
    return Intersections(**{name: array[rows] for name, array in vars(hits).items()})


def _describe(
    rays: Rays, ours: Intersections, theirs: Intersections, ratios: FloatArray, k: int
) -> str:
    kind = KINDS[int(np.argmax(ratios[k]))]
    sides = [
        f"{who} shape {hits.shape[k]} face {hits.face[k]} at t = {hits.t[k]:.9g}, n = {hits.n[k]}"
        for who, hits in (("ours", ours), ("Mitsuba's", theirs))
    ]
    return f"{kind}, from {rays.o[k].tolist()} along {rays.d[k].tolist()}: {'; '.join(sides)}"
