"""Material by material: the BSDFs of our kernels are those of their counterparts in Mitsuba."""

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reference_rt as rt
from comparisons.geometry.frame import ROUNDINGS, UNIT_ROUNDOFF
from comparisons.materials.both_sides import both_sides, directions
from comparisons.materials.material import MOST
from comparisons.materials.principled import clearcoat_error
from comparisons.materials.rough_plastic import MARGIN, table_error
from comparisons.materials.translate import translate_material
from comparisons.mitsuba.backend import SCALAR, mitsuba, variant
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.plugins.exact_coat import approximate_g1, exact_g1, smooth_reflectance
from comparisons.rungs.rays import arbiter
from reference_rt.core.arrays import FloatArray
from reference_rt.core.vec3 import Vec3, luminance
from reference_rt.materials import AnyMaterial, Material
from reference_rt.scene.examples import examples
from reference_rt.textures import texture_names

PAIRS = 60

GOLD: dict[str, Any] = {
    "eta": (0.2, 0.9, 1.1),
    "k": (3.0, 2.0, 2.5),
    "reflectance": (0.9, 0.8, 0.7),
}
COLOURS: dict[str, Any] = {"reflectance": (0.9, 0.5, 0.1), "specular": (0.9, 1.0, 0.8)}
SPECULAR: dict[str, Any] = {"specular": 0.7, "specular_color": (1.0, 0.6, 0.2)}
PHONG: dict[str, Any] = {"diffuse": (0.2, 0.1, 0.05), "specular": (0.3, 1.2, 0.1)}

MATERIALS: tuple[Material, ...] = (
    *(
        material
        for material in examples(AnyMaterial)
        if material.smooth and not material.transmits and not texture_names(material)
        if not isinstance(material, rt.Emissive)
    ),
    *(
        rt.RoughConductor(**GOLD, alpha=(alpha, alpha), distribution=distribution)
        for alpha in (0.02, 1.3)
        for distribution in ("ggx", "beckmann")
    ),
    *(
        rt.RoughDielectric(
            interior_ior=inside,
            exterior_ior=outside,
            alpha=(alpha, alpha),
            distribution=distribution,
            reflectance=(0.9, 0.8, 1.0),
            transmittance=(1.0, 0.5, 0.7),
        )
        for inside, outside, alpha in ((1.5, 1.0, 0.1), (1.1, 1.4, 0.5))
        for distribution in ("ggx", "beckmann")
    ),
    *(rt.Plastic(**COLOURS, interior_ior=index, nonlinear=True) for index in (1.2, 2.4)),
    rt.RoughPlastic(**COLOURS, alpha=0.4, distribution="beckmann", nonlinear=True),
    rt.RoughPlastic(**COLOURS, interior_ior=1.33, exterior_ior=1.33),  # Mitsuba refuses it
    rt.Plastic(**COLOURS, interior_ior=1.33, exterior_ior=1.33),
    rt.Principled(base_colour=(0.8, 0.5, 0.2), spec_trans=0.7, roughness=0.4, metallic=0.1),
    rt.Principled(base_colour=(0.8, 0.5, 0.2), spec_trans=1.0, roughness=0.2, eta=1.6),
    rt.Principled(base_colour=(0.8, 0.5, 0.2), spec_trans=1.0, sheen=0.8, eta=1.6),
    rt.PrincipledThin(base_colour=(0.8, 0.5, 0.2), sheen=0.8, sheen_tint=0.5, flatness=0.6),
    rt.PrincipledThin(base_colour=(0.8, 0.5, 0.2), diff_trans=1.2, spec_trans=0.3, spec_tint=0.5),
    rt.PrincipledThin(spec_trans=1.0, eta=1.7, roughness=0.6, anisotropic=0.6),
    rt.PrincipledThin(base_colour=(0.8, 0.5, 0.2), spec_trans=1.0, eta=0.6, spec_tint=1.0),
)
"""The examples of all types that reflect into a continuum, what lets light pass, and what is
extreme."""


MITSUBA_LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
"""Mitsuba's weights (include/mitsuba/core/spectrum.h)."""


def counterpart(material: Material) -> dict[str, Any]:
    return translate_material(material, TranslationContext({}, {}, Path()))


def pairs(material: Material) -> tuple[FloatArray, FloatArray]:
    """Half of them anywhere, half near the mirrored one; behind, too, where light passes."""
    wo, wi = directions(PAIRS, seed=4, both=material.transmits)
    rng = np.random.default_rng(5)
    near = wo * [-1.0, -1.0, 1.0] + 0.1 * rng.normal(size=wo.shape)
    wi[::2] = near[::2]
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    return wo, wi.astype(np.float32).astype(np.float64)


def float32_bound(material: Material, wo: FloatArray, wi: FloatArray, ours: FloatArray) -> Any:
    """(n,): the products' roundings, and how far those of the directions move our value."""
    found = 128.0 * UNIT_ROUNDOFF * np.abs(ours).max(axis=1)
    for move in arbiter.directions(6):
        step = ROUNDINGS * UNIT_ROUNDOFF * move
        moved = both_sides(material, wo + step, wi - step, None)[0]
        found += np.abs(moved - ours).max(axis=1)
    if isinstance(material, rt.Principled) and material.clearcoat != 0.0:
        found += clearcoat_error(material) * np.abs(ours).max(axis=1)
    tint = max(getattr(material, "spec_tint", 0.0), getattr(material, "sheen_tint", 0.0))
    if tint > 0.0:
        # A tint is the colour over its luminance, whose weights have other digits in Mitsuba.
        base = np.array(material.base_colour)
        off = base @ MITSUBA_LUMINANCE / luminance(Vec3(*base)) - 1.0
        found += abs(off) * tint * np.abs(ours).max(axis=1)
    # Mitsuba's microfacets end where fewer than 1e-20 face a direction.
    return found + 1e-18


@pytest.mark.cases(62)
@pytest.mark.parametrize("backend", ["the chosen one", SCALAR])
@pytest.mark.parametrize("material", MATERIALS, ids=lambda m: m.type)
def test_the_same_is_scattered(material: Material, backend: str) -> None:
    """By Mitsuba's wide variants and by its scalar ones, whose code branches otherwise."""
    wo, wi = pairs(material)
    with variant(backend) if backend == SCALAR else contextlib.nullcontext():
        ours, theirs = both_sides(material, wo, wi, counterpart(material))
    bound = float32_bound(material, wo, wi, ours)
    if isinstance(material, rt.RoughPlastic):
        white = {"reflectance": (1.0, 1.0, 1.0), "specular": (0.0, 0.0, 0.0)}
        bound += 1.5 * table_error(material.model_copy(update=white)) * ours.max(axis=1)
    assert (ours.max(axis=1) > 0.0).sum() > PAIRS // 4
    assert (np.abs(ours - theirs).max(axis=1) <= bound).all()


@pytest.mark.parametrize(
    ("material", "wrong"),
    [
        (rt.RoughConductor(**GOLD, alpha=(0.1, 0.3)), {"alpha": (0.3, 0.1)}),
        (rt.RoughConductor(**GOLD, alpha=(0.3, 0.3)), {"alpha": (0.3001, 0.3001)}),
        (rt.RoughConductor(**GOLD), {"k": (3.0, 2.0, 2.501)}),
        (rt.RoughDielectric(alpha=(0.3, 0.3)), {"interior_ior": 1.501}),
        (rt.Plastic(**COLOURS), {"nonlinear": True}),
        (rt.Plastic(**COLOURS), {"interior_ior": 1.501}),
        (rt.Principled(sheen=0.5), {"sheen": 0.501}),
        (rt.Principled(clearcoat=0.5), {"clearcoat_gloss": 0.01}),
        (rt.PrincipledThin(diff_trans=1.0), {"diff_trans": 1.001}),
        (rt.PrincipledThin(spec_trans=1.0), {"eta": 1.501}),
        (rt.GltfPbr(metallic=0.5), {"roughness": 0.999}),
        (rt.GltfPbr(metallic=0.5, roughness=0.5), {"metallic": 0.501}),
        (rt.GltfPbr(metallic=0.0, roughness=0.5), {"ior": 1.501}),
        (rt.GltfPbr(metallic=0.0, roughness=0.5), {"specular": 0.999}),
        (rt.Phong(**PHONG), {"exponent": 32.01}),
    ],
    ids=lambda x: x.type if isinstance(x, Material) else "",
)
def test_a_slightly_different_material_is_distinguished(
    material: Material, wrong: dict[str, Any]
) -> None:
    wo, wi = pairs(material)
    ours, _ = both_sides(material, wo, wi, None)
    other = material.model_copy(update=wrong)
    _, theirs = both_sides(other, wo, wi, counterpart(other))
    bound = float32_bound(material, wo, wi, ours)
    assert (np.abs(ours - theirs).max(axis=1) > bound).any()


@pytest.mark.slow
def test_tables_of_rough_plastic_are_off_by_little() -> None:
    """The bound that comparisons allow for is far from what they call wrong."""
    worst = max(
        table_error(
            rt.RoughPlastic(
                reflectance=(1.0, 1.0, 1.0), specular=(0.0, 0.0, 0.0), alpha=a, interior_ior=n
            )
        )
        for a, n in ((0.05, 2.0), (0.2, 1.5), (0.6, 1.3))
    )
    assert 0.0 < MARGIN * worst < 0.5 * MOST


def test_how_far_mitsubas_masking_is_off() -> None:
    a = np.linspace(0.01, 4.0, 2000)
    off = np.abs(approximate_g1(a) / exact_g1(a) - 1.0).max()
    assert off == pytest.approx(0.0031, abs=0.0003)


@pytest.mark.parametrize(("eta", "off"), [(1.3, 1e-3), (1.5, 1e-3), (2.0, 7e-3)])
def test_how_far_mitsubas_fit_of_the_coat_is_off(eta: float, off: float) -> None:
    """And that the integral in its place is one: against half a million midpoints."""
    mi = mitsuba()
    n = 500_000
    cos = (np.arange(n) + 0.5) / n
    sin_t2 = (1.0 - cos * cos) * eta * eta
    cos_t = np.sqrt(np.maximum(1.0 - sin_t2, 0.0))
    s = (eta * cos - cos_t) / (eta * cos + cos_t)
    p = (cos - eta * cos_t) / (cos + eta * cos_t)
    f = np.where(sin_t2 < 1.0, 0.5 * (s * s + p * p), 1.0)
    exact = float((2.0 * f * cos).mean())
    # Near the critical angle f has a root's slope: a step's share of it is missed at most.
    assert smooth_reflectance(eta) == pytest.approx(exact, abs=1e-6)
    fit = float(np.array(mi.fresnel_diffuse_reflectance(1.0 / eta)).item())
    assert 0.0 < abs(fit / exact - 1.0) < off


SAMPLED: tuple[Material, ...] = (
    rt.RoughConductor(**GOLD, alpha=(0.4, 0.4), distribution="beckmann"),
    rt.RoughDielectric(alpha=(0.4, 0.4), distribution="beckmann"),
    rt.Plastic(**COLOURS),
    rt.RoughPlastic(**COLOURS, alpha=0.3),
    rt.RoughPlastic(**COLOURS, alpha=0.3, distribution="beckmann"),
    rt.GltfPbr(base_color=(0.8, 0.5, 0.2), metallic=0.3, roughness=0.6, **SPECULAR),
    rt.Phong(**PHONG, exponent=20.0, mirror=(0.1, 0.2, 0.3)),
    rt.Phong(**PHONG, exponent=20.0, half_vector=True),
)


@pytest.mark.cases(3)
@pytest.mark.parametrize("material", SAMPLED, ids=lambda m: m.type)
def test_counterparts_draw_what_they_say(material: Material) -> None:
    """The mean of the weights of those that are written here is the integral of what they give."""
    mi = mitsuba()
    import drjit as dr  # after the choice of its LLVM

    if mi.variant().startswith("scalar"):
        pytest.skip("a million samples, one at a time")
    bsdf = mi.load_dict(counterpart(material))
    n = 1_000_000
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    sampler.seed(7, n)
    si = dr.zeros(mi.SurfaceInteraction3f, n)
    si.t, si.wi = 1.0, dr.normalize(mi.Vector3f(0.5, 0.2, 0.8))
    drawn, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    perfect = np.array(mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta))
    weights = np.array(weight).T * ~perfect[:, None]
    d = mi.warp.square_to_uniform_sphere(sampler.next_2d())
    values = np.array(bsdf.eval(mi.BSDFContext(), si, d)).T * 4.0 * np.pi
    error = np.sqrt((weights.var(axis=0) + values.var(axis=0)) / n)
    assert (np.abs(weights.mean(axis=0) - values.mean(axis=0)) < 5.0 * error).all()
    pdf, told = np.array(bsdf.pdf(mi.BSDFContext(), si, drawn.wo)), np.array(drawn.pdf)
    counts = weights.max(axis=1) > 0.0
    np.testing.assert_allclose(pdf[counts], told[counts], rtol=2e-3, atol=1e-6)
