"""What the BSDFs of a scene return, material by material, against Mitsuba's counterparts."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counterparts import every_material

from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF, round32
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.scene import for_rays
from comparisons.rungs.rays import arbiter
from comparisons.translator.accuracy import accuracy
from reference_rt import Scene
from reference_rt.core.arrays import FloatArray
from reference_rt.core.model import types_of
from reference_rt.materials import AnyMaterial, NoSurface
from reference_rt.rendering.query import Bsdf

PAIRS = 200

SMOOTH = ("silver", "gold", "glass", "pane")
"""Perfectly smooth: there is nothing to evaluate."""

MATERIALS = (
    "grey", "floor", "brushed", "cast", "frosted", "coat", "dull", "car", "petal", "toy", "wax",
    "leaf", "mix", "sheet", "dents", "tiles", "lamp",
)  # fmt: skip

SAME_DENSITY = ("grey", "floor", "brushed", "frosted", "leaf", "lamp", "dents", "tiles")
"""Those that draw directions as Mitsuba does.  The others choose their lobes, or blend, by other
shares, and Mitsuba's Beckmann normals here are not drawn from the visible ones: see
`translate.materials`."""


@pytest.fixture(scope="module")
def scene(image_folder: Path) -> Scene:
    return every_material(image_folder)


def test_every_material_is_compared(scene: Scene) -> None:
    assert {*SMOOTH, *MATERIALS} == set(scene.materials)
    kinds = {type(material) for material in scene.materials.values()}
    assert kinds == set(types_of(AnyMaterial)) - {NoSurface}  # which scatters nothing


class TheirBsdf:
    """Mitsuba's BSDF of a material, at a point whose shading frame is the world's."""

    def __init__(self, scene: Scene, name: str) -> None:
        around = TranslationContext.of(scene)
        self.bsdf = mitsuba().load_dict(translate_material(scene.materials[name], around))

    def place(self, wo: Any, u: Any, v: Any) -> Any:
        mi = mitsuba()
        import drjit as dr  # after the choice of its LLVM

        si = dr.zeros(mi.SurfaceInteraction3f)
        si.t, si.wi, si.uv = 1.0, wo, mi.Point2f(u, v)
        si.n, si.dp_du, si.dp_dv = mi.Normal3f(0, 0, 1), mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
        si.sh_frame = mi.Frame3f(mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1))
        return si

    def values(self, wo: FloatArray, wi: FloatArray, uv: FloatArray) -> tuple[Any, ...]:
        context = mitsuba().BSDFContext()

        def ask(o: Any, i: Any, u: Any, v: Any) -> tuple[Any, ...]:
            si = self.place(o, u, v)
            return self.bsdf.eval(context, si, i), self.bsdf.pdf(context, si, i)

        return for_rays(ask, wo, wi, uv[:, 0], uv[:, 1])

    def samples(self, wo: FloatArray, u: FloatArray, uv: FloatArray) -> tuple[Any, ...]:
        mi = mitsuba()

        def ask(o: Any, u0: Any, u1: Any, u2: Any, s: Any, t: Any) -> tuple[Any, ...]:
            drawn, weight = self.bsdf.sample(
                mi.BSDFContext(), self.place(o, s, t), u0, mi.Point2f(u1, u2)
            )
            return drawn.wo, weight, drawn.pdf

        return for_rays(ask, wo, *u.T, *uv.T)


def pairs(both: bool, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """wo, wi, half of them near the mirrored direction, and uv, all of which float32 can hold."""
    rng = np.random.default_rng(seed)
    wo, wi = rng.normal(size=(2, PAIRS, 3))
    wo[:, 2] = wo[:, 2] if both else np.abs(wo[:, 2]) + 0.02
    wi[::2] = (wo * [-1.0, -1.0, 1.0] + 0.1 * wi)[::2]
    wo, wi = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (wo, wi))
    return round32(wo), round32(wi), round32(rng.uniform(size=(PAIRS, 2)))


def float32_bounds(
    bsdf: Bsdf, wo: FloatArray, wi: FloatArray, uv: FloatArray, off: float
) -> tuple[FloatArray, FloatArray]:
    """Of value and density: products' roundings, tables' errors, and how far the roundings of
    directions and texture coordinates move ours."""
    value, pdf = bsdf.evaluate(wo, wi, uv), bsdf.pdf(wo, wi, uv)
    bounds = [
        (128.0 * UNIT_ROUNDOFF + off) * np.abs(value).max(axis=1) + 1e-18,
        128.0 * UNIT_ROUNDOFF * pdf + 1e-18,
    ]
    for k, move in enumerate(arbiter.directions(6)):
        step = ROUNDINGS * UNIT_ROUNDOFF * move
        # Texture coordinates are scaled by up to 6 before they are rounded again.
        other = uv + 6.0 * ROUNDINGS * UNIT_ROUNDOFF * np.array([(-1.0) ** k, (-1.0) ** (k // 2)])
        at = wo + step, wi - step, other
        bounds[0] += np.abs(bsdf.evaluate(*at) - value).max(axis=1)
        bounds[1] += np.abs(bsdf.pdf(*at) - pdf)
    return bounds[0], bounds[1]


@pytest.mark.parametrize("name", MATERIALS)
def test_bsdfs_have_the_same_values(scene: Scene, name: str) -> None:
    bsdf, theirs = scene.bsdf(name), TheirBsdf(scene, name)
    wo, wi, uv = pairs(name in ("frosted", "car", "leaf", "sheet"), seed=5)
    value, density = theirs.values(wo, wi, uv)
    bound, pdf_bound = float32_bounds(bsdf, wo, wi, uv, accuracy(scene, name))
    ours = bsdf.evaluate(wo, wi, uv)
    assert (ours.max(axis=1) > 0.0).sum() > PAIRS // 4
    assert (np.abs(ours - value).max(axis=1) <= bound).all()
    if name in SAME_DENSITY:
        assert (np.abs(bsdf.pdf(wo, wi, uv) - density) <= pdf_bound).all()


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", [*SMOOTH, *MATERIALS])
def test_samples_of_bsdfs_have_the_same_mean(scene: Scene, name: str) -> None:
    """Of weight times the direction's first two moments: by other shares of lobes, the same law."""
    n = 20_000
    rng = np.random.default_rng(6)
    uv = round32(np.tile(rng.uniform(size=(1, 2)), (n, 1)))
    for tilt in (0.3, 0.9):
        wo = round32(np.tile([np.sin(tilt), 0.0, np.cos(tilt)], (n, 1)))
        ours = scene.bsdf(name).sample(wo, rng.uniform(size=(n, 3)), uv)
        wi, weight, pdf = TheirBsdf(scene, name).samples(wo, rng.uniform(size=(n, 3)), uv)
        found = []
        for direction, own in ((ours.wi, ours.weight), (wi, weight * (pdf > 0.0)[:, None])):
            kept = np.where(own.max(axis=1, keepdims=True) > 0.0, direction, 0.0)
            moments = np.concatenate([own, own * kept[:, :1], own * kept[:, 2:]], axis=1)
            found.append((moments.mean(axis=0), moments.var(axis=0) / n))
        (a, a_error), (b, b_error) = found
        # Weights of one lobe are all alike but for roundings; tables are off by their accuracy.
        slack = (256.0 * UNIT_ROUNDOFF + accuracy(scene, name)) * np.abs(a).max()
        assert (np.abs(a - b) <= 5.0 * np.sqrt(a_error + b_error) + slack).all()
        assert a.max() > 0.01
