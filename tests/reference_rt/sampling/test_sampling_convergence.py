"""How the error falls with the number n of samples: as 1/sqrt(n) for independent ones, faster for
Sobol' points where what is sampled is smooth."""

import math

import numpy as np
import pytest
from worlds import RADIANCE, RHO

import reference_rt as rt
from reference_rt.core import transform

COUNTS = (16, 64, 256, 1024, 4096)

MATERIALS = {
    "floor": rt.Diffuse(reflectance=tuple(RHO)),
    "lamp": rt.Emissive(radiance=tuple(RADIANCE)),
    "off": rt.Emissive(radiance=(0, 0, 0)),
}
FLOOR = rt.Rectangle(
    material="floor",
    transform=(
        transform.Scale(scale=(30.0, 30.0, 30.0)),
        transform.Rotate(rotate=transform.Turn(axis=(1, 0, 0), degrees=-90)),
    ),
)
LAMP = rt.Sphere(center=(0.5, 2.0, -1.0), radius=0.8, material="lamp")
LAMP_IRRADIANCE = math.pi * 0.64 / 5.25 * 2 / math.sqrt(5.25)
"""pi (r/d)² cos."""
ORIGIN = rt.Perspective(eye=(0, 1e-3, 0), target=(0, 0, 0), up=(0, 0, -1), fov=1e-6)
"""Every pixel sees the same point."""
OFF = rt.Sphere(center=(0, -9, 0), radius=0.1, material="off")

# (shapes, radiance of the environment, radiance of the floor)
SCENES = {
    "sky": ((FLOOR, OFF), 1.0, RHO),
    "lamp": ((FLOOR, LAMP), 0.0, RHO / math.pi * RADIANCE * LAMP_IRRADIANCE),
}


def scene_of(name, sampling, **parts):
    shapes, sky, _ = SCENES[name]
    given = {"camera": ORIGIN, "film": rt.Film(width=16, height=16)} | parts
    return rt.Scene(
        integrator=rt.Path(max_depth=2, sampling=sampling),
        materials=MATERIALS,
        shapes=shapes,
        lights=(rt.Constant(radiance=sky),),
        **given,
    )


def slope(errors):
    """Of the straight line through (log n, log error)."""
    return np.polyfit(np.log(COUNTS[: len(errors)]), np.log(errors), 1)[0]


def errors_of(scene, sampler, expected):
    """The relative root mean square error of one pixel, for each number of samples; every pixel
    is a replicate."""
    found = []
    for spp in COUNTS:
        colour = rt.render(scene.changed(sampler=sampler(spp=spp, seed=7))).colour
        found.append(math.sqrt(np.mean((colour / expected - 1) ** 2)))
    return found


BOUNDS = {
    ("sky", "both"): -1.0,
    ("sky", "lights"): -1.0,
    ("lamp", "lights"): -1.2,
    ("lamp", "both"): -0.7,
    ("lamp", "bsdf"): -0.7,
}
"""Of the slope of Sobol' points.  For scrambled nets it is -3/2 for smooth integrands (Owen 1997,
"Scrambled net variance for integrals of smooth functions"): the lamp, each of whose points is as
likely; -3/4 in two dimensions for those with a jump along a curve (He & Wang 2015): rays that meet
the lamp or miss it; kinks, as at the horizon of the sky, lie between."""


@pytest.mark.cases(2)
@pytest.mark.parametrize("case", BOUNDS)
def test_sobol_falls_faster(case):
    """All pixels see the same point, so that nothing but the direction of the light is random."""
    name, sampling = case
    errors = errors_of(scene_of(name, sampling), rt.Sobol, SCENES[name][2])
    assert slope(errors) < BOUNDS[case]


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", SCENES)
def test_independent_samples_fall_as_the_root(name):
    """256 pixels: the logarithm of an error is known to 0.044, the slope to 0.01; five times."""
    errors = errors_of(scene_of(name, "both"), rt.Independent, SCENES[name][2])
    assert slope(errors) == pytest.approx(-0.5, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_pixels_of_a_picture(name):
    """Of a view of the floor, over eight seeds.  What depends on the place in the pixel and on the
    light at once is sampled by two independent pairs, and falls as the root in the end: with the
    lamp, near which it matters, the error is smaller by a factor rather than by a power."""
    camera = rt.Perspective(eye=(0, 3, 3), target=(0, 0, 0), fov=30)
    scene = scene_of(name, "both", camera=camera)

    def noise(sampler, spp):
        pictures = np.array(
            [
                rt.render(scene.changed(sampler=sampler(spp=spp, seed=50 + r))).colour
                for r in range(8)
            ]
        )
        return math.sqrt((pictures.var(axis=0, ddof=1) / pictures.mean(axis=0) ** 2).mean())

    errors = [noise(rt.Sobol, spp) for spp in COUNTS[:4]]
    # Known to some 0.02 (256 pixels, 7 degrees of freedom each).
    assert slope(errors) < (-1.0 if name == "sky" else -0.55)
    assert errors[-1] < noise(rt.Independent, COUNTS[3]) / 6
