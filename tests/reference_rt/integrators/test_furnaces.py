"""Furnaces: where everything shines equally, every radiance is known.

F10 and F12 of the stability suites have closed furnaces with roulette, and rough bodies; scenes of
comparisons/truth have those of every material."""

import numpy as np
import pytest
from worlds import MATERIALS, assert_mean, at, facing, world

import reference_rt as rt
from reference_rt.core.exr import write_exr

# The front of each wall of the cube [-1, 1]³ points at the middle.
WALLS = tuple(
    rt.Rectangle(material="wall", transform=(*at(0, 0, -1), *facing(axis, degrees)))
    for axis, degrees in (
        ((1, 0, 0), 0), ((1, 0, 0), 90), ((1, 0, 0), 180),
        ((1, 0, 0), 270), ((0, 1, 0), 90), ((0, 1, 0), 270),
    )
)  # fmt: skip
INSIDE = rt.Orthographic(eye=(0.1, 0.2, 0.3), target=(-1, -0.9, -0.8), width=1e-12)


def closed(albedo, **parts):
    """Walls that emit 1 and reflect `albedo`, seen from within."""
    materials = {
        "scattering": rt.Diffuse(reflectance=albedo),
        "wall": rt.Emissive(radiance=(1, 1, 1), base="scattering"),
    }
    return world(*WALLS, materials=materials, camera=INSIDE, **parts)


@pytest.mark.cases(3)
@pytest.mark.parametrize("depth", range(7))
def test_max_depth_counts_edges(depth):
    """By scattered rays alone every path brings the same, and `max_depth` is the number of
    terms: no noise."""
    albedo = np.array([0.2, 0.5, 0.9])
    for rr_depth in (4096, depth + 1):
        path = rt.Path(max_depth=depth, rr_depth=rr_depth, sampling="bsdf")
        scene = closed(tuple(albedo), integrator=path, pixels=4, spp=4)
        expected = (1 - albedo**depth) / (1 - albedo)
        assert np.allclose(rt.render(scene).colour, expected, rtol=1e-14, atol=0)
    assert_mean(
        closed(tuple(albedo), integrator=rt.Path(max_depth=depth), spp=64), expected, power=5e-3
    )


# ---- lossless bodies in a sky of one radiance ----------------------------------------------------

SKY = np.array([1.0, 2.0, 3.0])


@pytest.fixture(scope="module")
def sky(tmp_path_factory):
    """An environment of the radiance SKY, as a map: see `worlds.DARK`."""
    path = tmp_path_factory.mktemp("sky") / "sky.exr"
    write_exr(path, {name: np.full((3, 4), x) for name, x in zip("RGB", SKY, strict=True)}, {})
    return rt.EnvironmentMap(file=str(path))


# A mirror's back is black, and what passes a mask around solid glass is not refracted: only mirrors
# with two sides and thin glass may be mixed without loss.
LOSSLESS = {
    "mirror": rt.Mirror(),
    "conductor": rt.Conductor(eta=(1e-9,) * 3, k=(1.0, 2.0, 3.0)),
    "glass": rt.Dielectric(),
    "bubble": rt.Dielectric(interior_ior=1.0, exterior_ior=1.5),
    "diamond": rt.Dielectric(interior_ior=2.42),
    "thin glass": rt.ThinDielectric(),
    "mirror on both sides": rt.TwoSided(base="silver"),
    "masked mirror": rt.Mask(base="mirrors", opacity=0.3),
    "chequered mask": rt.Mask(base="mirrors", opacity="white and black"),
    "masked thin glass": rt.Mask(base="thin glass", opacity=0.5),
    "half silvered": rt.Blend(first="mirrors", second="thin glass", weight=0.25),
    "all of them": rt.Blend(first="mirrors", second="masked", weight="white and black"),
    "nothing": rt.Mask(base="silver", opacity=0.0),
}


def body(material, environment, seed=4, spp=64, **path):
    """A ball in the sky, from edge to edge."""
    return world(
        rt.Sphere(material="body"),
        materials={
            **MATERIALS,
            "mirrors": rt.TwoSided(base="silver"),
            "masked": rt.Mask(base="thin glass", opacity=0.5),
            "body": material,
        },
        environment=environment,
        camera=rt.Orthographic(eye=(0, 0, 3), width=2.1),
        film=rt.Film(width=32, height=32),
        sampler=rt.Sobol(spp=spp, seed=seed),
        integrator=rt.Path(**path),
    )


@pytest.mark.cases(5)
@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_bodies_vanish(name, sky):
    """Without roulette path by path; a conductor with eta = 1e-9 absorbs 4 eta / (eta² + k² + 1) of
    what it mirrors at most (the Fresnel equations at normal incidence, k >= 1)."""
    scene = body(LOSSLESS[name], sky, rr_depth=4096, max_depth=10**5)
    # A few roundings at each of some ten surfaces.
    loss = 4e-9 if name == "conductor" else 1e-12
    assert np.allclose(rt.render(scene).colour, SKY, rtol=loss, atol=0)
