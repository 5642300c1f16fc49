"""Lamps of every shape, alone in a scene, under integrators that may draw none of their light."""

from typing import Any

import numpy as np
import pytest

import reference_rt as rt
from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.scene import picture
from comparisons.shapes.stand_ins import coarser
from comparisons.translator import load
from reference_rt.core.model import name_of, types_of
from reference_rt.scene.examples import examples
from reference_rt.shapes import Plane, Primitive
from reference_rt.shapes.csg import Difference

SPP = 256
LAMPS = [
    *(examples(of)[0] for of in types_of(Primitive) if of is not Plane),
    rt.Sphere(transform=({"scale": (1, 0.4, 1)},)),
    Difference(of=(rt.Box(), rt.Sphere(radius=1.2))),
]


@pytest.mark.parametrize("radiance", [(0.5, 0.4, 0.3), "checks"], ids=["plain", "textured"])
@pytest.mark.parametrize("lamp", LAMPS, ids=lambda lamp: name_of(type(lamp)))
def test_a_lamp_of_which_no_light_is_drawn(lamp: Any, radiance: Any) -> None:
    """Mitsuba refuses a scene with no light that it may draw; what shines is seen all the same."""
    scene = rt.Scene(
        camera=rt.Perspective(eye=(3, 2, 5), target=(0, 0, 0), fov=40),
        film=rt.Film(width=8, height=6),
        integrator=rt.Direct(bsdf_samples=0),
        sampler=rt.Independent(spp=4),
        textures={"checks": rt.Checker(first=(0.9, 0.8, 0.7), second=(0.6, 0.5, 0.4))},
        materials={"lamp": rt.Emissive(radiance=radiance)},
        shapes=(lamp.model_copy(update={"material": "lamp"}),),
    )
    with scalar(), coarser(0.35):
        counterpart = load(scene)
        if counterpart.solids:
            return  # no emitter of Mitsuba's scene, which loads
        seen = picture(counterpart.mi_scene, SPP, 1)
    ours = rt.render(scene.changed(sampler=rt.Independent(spp=SPP))).colour
    assert seen.any() == ours.any()  # a polygon may show its back
    # Samples are 0, or at most the brightest: their deviation is half of it at most.
    error = 0.5 * ours.max() * (2.0 / (48 * SPP)) ** 0.5
    assert np.abs(seen.mean(axis=(0, 1)) - ours.mean(axis=(0, 1))).max() <= 5.0 * error
