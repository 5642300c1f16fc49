"""Surfaces that mirror next to nothing, since the indices on their sides are nearly equal: float32
has few digits of a Fresnel factor there, and of the half vector of what refracts."""

import pytest

from comparisons.rungs.direct import direct
from comparisons.rungs.whitted import whitted
from comparisons.translator import load
from reference_rt.core.model import types_of
from reference_rt.materials import AnyMaterial, Material
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {{type: perspective, eye: [6, 1, 3], target: [0, 0, 0], fov: 25}}
film: {{width: 24, height: 16}}
materials: {{m: {{type: {kind}, {index}{more}}}}}
shapes: [{{type: sphere, material: m}}]
lights: [{{type: point, position: [4, 5, 6], intensity: 20}}, {{type: constant, radiance: 1}}]
"""


def _field_of_index(material: type) -> str | None:
    fields = getattr(material, "model_fields", {})
    names = ("interior_ior", "ior", *(["eta"] if "k" not in fields else []))
    return next((name for name in names if name in fields), None)


HAVE_INDEX = {of: name for of in types_of(AnyMaterial) if (name := _field_of_index(of)) is not None}
VARIANTS = [
    (of, ", spec_trans: 1" if passes else "")
    for of in HAVE_INDEX
    for passes in ((False, True) if "spec_trans" in of.model_fields else (False,))
]


def test_every_material_with_an_index_is_tried() -> None:
    assert len(HAVE_INDEX) >= 8


def _scene(of: type[Material], more: str, index: float) -> Scene:
    kind = of.model_fields["type"].default
    return Scene.parse(SCENE.format(kind=kind, index=f"{HAVE_INDEX[of]}: {index}", more=more))


@pytest.mark.parametrize(
    ("of", "more"), VARIANTS, ids=[f"{of.__name__}{more}" for of, more in VARIANTS]
)
@pytest.mark.parametrize("index", [1.0001, 0.9999, 1.000001])
def test_light_of_nearly_equal_indices_agrees(of: type[Material], more: str, index: float) -> None:
    scene = _scene(of, more, index)
    counterpart = load(scene)
    for found in (
        *([direct(scene, scene.tables, counterpart, 100)] if of.smooth else []),
        whitted(scene, scene.tables, counterpart),
    ):
        assert found.status == "agree", f"{found.name}: {found.reason}"


@pytest.mark.parametrize(
    ("of", "more"), [v for v in VARIANTS if v[0].__name__ == "RoughDielectric" or v[1]]
)
def test_a_wrong_index_is_seen(of: type[Material], more: str) -> None:
    """An index that is 10 % further from 1: 21 % more light is mirrored."""
    scene, other = (_scene(of, more, index) for index in (1.0001, 1.00011))
    assert direct(scene, scene.tables, load(other), 100).status == "differ"
