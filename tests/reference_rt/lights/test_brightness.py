"""Every field that makes a light brighter does: twice the number, twice the picture."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.lights import AnyLight
from reference_rt.scene.examples import NAMED, examples, write_files

FIELDS = "intensity", "irradiance", "radiance", "scale"

CASES = [
    (light, field)
    for light in examples(AnyLight)
    for field in FIELDS
    if not isinstance(getattr(light, field, ""), str)
]


@pytest.mark.parametrize(("light", "field"), CASES, ids=lambda x: getattr(x, "type", x))
def test_twice_the_number_is_twice_the_picture(light: Any, field: str, tmp_path: Path) -> None:
    """To the last bit, since two is a power of two and the random numbers are the same."""
    write_files(tmp_path)
    value = getattr(light, field)
    twice = tuple(2.0 * x for x in value) if isinstance(value, tuple) else 2.0 * value
    pictures = []
    for one in (light, light.model_copy(update={field: twice})):
        scene = rt.Scene(
            camera=rt.Perspective(eye=(0, 2, 6), target=(0, 0, 0), fov=50),
            film=rt.Film(width=12, height=8),
            sampler=rt.Sobol(spp=4),
            integrator=rt.Whitted() if isinstance(light, rt.Ambient) else rt.Direct(),
            materials={"grey": rt.Phong(ambient=0.3, diffuse=0.5)},
            textures=NAMED["textures"],
            shapes=(
                rt.Sphere(radius=0.7, material="grey"),
                rt.Plane(
                    material="grey",
                    transform=(
                        {"rotate": {"axis": (1, 0, 0), "degrees": -90}},
                        {"translate": (0, -1, 0)},
                    ),
                ),
            ),
            lights=(one,),
        )
        pictures.append(rt.render(rt.Scene.parse(scene.to_json(), folder=tmp_path)).colour)
    assert pictures[0].max() > 0.0
    assert np.array_equal(2.0 * pictures[0], pictures[1])
