"""A convex shape that shines and scatters sees nothing of itself: its radiance is what it emits."""

import numpy as np
import pytest

from reference_rt import (
    Box,
    Diffuse,
    Emissive,
    Film,
    Path,
    Perspective,
    Rectangle,
    Scene,
    Sobol,
    Sphere,
    Whitted,
    render,
)
from reference_rt.shapes import Shape


@pytest.mark.parametrize("integrator", [Path(max_depth=6), Whitted()], ids=["path", "whitted"])
@pytest.mark.parametrize(
    "shape",
    [Sphere(material="lamp"), Rectangle(material="lamp"), Box(material="lamp")],
    ids=["sphere", "rectangle", "box"],
)
def test_emits_what_it_says(shape: Shape, integrator: Path | Whitted) -> None:
    scene = Scene(
        camera=Perspective(eye=(1.0, 1.5, 4.0), fov=60.0),
        film=Film(width=24, height=24),
        sampler=Sobol(spp=16) if isinstance(integrator, Path) else None,
        integrator=integrator,
        materials={"white": Diffuse(reflectance=(0.9, 0.9, 0.9)), "lamp": LAMP},
        shapes=(shape,),
    )
    picture = render(scene)
    assert picture.nonfinite == 0
    lit = picture.colour[picture.colour[..., 2] > 0.0]
    assert len(lit) > 50
    # A pixel is the lamp or nothing, sample by sample: the hue is exact to the rounding of the
    # mean, and no pixel is brighter than the lamp by more.
    np.testing.assert_allclose(lit[:, 0] * 2.0, lit[:, 2], rtol=1e-14)
    assert lit.max(axis=0) == pytest.approx(LAMP.radiance, rel=1e-14)


LAMP = Emissive(radiance=(2.0, 3.0, 4.0), base="white")
