"""Parameters by their paths: all real numbers of all types, from the descriptions alone."""

import json
from typing import Any

import numpy as np
import pytest

from reference_rt import Mesh, Scene, SceneError, Sphere, UsageError
from reference_rt.cameras import AnyCamera
from reference_rt.core.model import name_of, types_of
from reference_rt.lights import AnyLight
from reference_rt.materials import AnyMaterial
from reference_rt.scene.examples import NAMED, examples
from reference_rt.scene.parameters import PARTS, moved, parameter, parameters
from reference_rt.shapes.csg import AnyShape
from reference_rt.textures import AnyTexture

KINDS: dict[str, Any] = {
    "camera": AnyCamera,
    "textures": AnyTexture,
    "materials": AnyMaterial,
    "shapes": AnyShape,
    "lights": AnyLight,
}


def scenes_of(part: str, kind: type) -> list[Scene]:
    """Scenes with one example of a type each."""
    found = []
    for example in examples(kind):
        fields = dict(NAMED)
        one: Any = example
        if part in ("textures", "materials"):
            one = fields.get(part, {}) | {"it": example}
        elif part != "camera":
            one = (example,)
        found.append(Scene(**fields | {part: one}))
    return found


def floats(value: Any) -> int:
    """The numbers of JSON that are written as real ones."""
    if isinstance(value, dict | list):
        return sum(map(floats, value.values() if isinstance(value, dict) else value))
    return int(isinstance(value, float))


def read(scene: Scene, path: str) -> Any:
    return np.asarray(parameter(scene, path).value)


ALL = [
    pytest.param(part, kind, id=f"{part}-{name_of(kind)}")
    for part, union in KINDS.items()
    for kind in types_of(union)
]


@pytest.mark.parametrize(("part", "kind"), ALL)
def test_every_real_number_of_every_type_moves(part: str, kind: type) -> None:
    """As many as the JSON of the scene has, each up or down; a path leads back to its value."""
    for scene in scenes_of(part, kind):
        known = list(parameters(scene))
        data = {name: json.loads(scene.to_json()).get(name) for name in PARTS}
        assert sum(isinstance(one.value, float) for one in known) == floats(data)
        for one in known:
            if one.keys[0] != part:
                continue
            assert parameter(scene, one.path) == one
            assert one.scale > 0.0
            h, there = one.scale / 1024.0, []
            for step in (h, -h):
                try:
                    there.append((step, moved(scene, one, step)))
                except SceneError:
                    continue
            # Which has a matrix in their place; whose ends name a symmetry.
            assert there or one.keys[2] in ("uv", "horizontal_angles"), one
            for step, other in there:
                found = read(other, one.path) - np.asarray(one.value)
                np.testing.assert_allclose(found, step, rtol=1e-9)
                assert type(other) is Scene
                changed = [p.path for p, q in zip(known, parameters(other), strict=True) if p != q]
                assert one.path in changed


def test_a_colour_moves_as_a_whole_and_by_its_numbers_and_a_vector_by_its_numbers() -> None:
    scene = Scene.parse(
        "materials: {red: {type: mirror}, red.hot: {type: diffuse, reflectance: 0.25}}\n"
        "shapes: [{type: sphere, material: red.hot, transform: [{scale: 2}]}]\n"
    )
    assert parameter(scene, "materials.red.hot.reflectance").value == (0.25,) * 3
    assert read(moved(scene, "shapes[0].transform[0].scale", 0.5), "shapes[0].transform[0].scale"
                ).tolist() == [2.5] * 3  # fmt: skip
    one = moved(scene, "materials.red.hot.reflectance[1]", 0.5)
    assert parameter(one, "materials.red.hot.reflectance").value == (0.25, 0.75, 0.25)
    with pytest.raises(UsageError, match=r"several values; expected such as shapes\[0\].center\[2"):
        parameter(scene, "shapes[0].center")


def test_vertices_in_memory_and_what_was_loaded_stay_what_they_are() -> None:
    mesh = Mesh(vertices=np.eye(3), faces=[[0, 1, 2]])
    scene = Scene(shapes=(mesh,))
    other = moved(scene, "shapes[0].vertices[1][2]", 0.125)
    assert read(other, "shapes[0].vertices[1][2]") == 0.125
    assert np.array_equal(mesh.vertices, np.eye(3))
    assert not [p for p in parameters(scene) if "faces" in p.path]


def test_a_ball_far_away_moves_by_parts_of_its_radius() -> None:
    scene = Scene(shapes=(Sphere(center=(1e4, 0, 0), radius=0.01),))
    assert parameter(scene, "shapes[0].center[0]").scale == 0.01
    assert parameter(scene, "shapes[0].radius").scale == 0.01
    assert parameter(scene, "camera.target[0]").scale == 1.0  # the eye's distance


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("materials.red.color", "'materials.red' has no 'color'; .*; did you mean 'reflectance'"),
        ("shapes[1].radius", r"'shapes' has the numbers 0 to 0, got '\[1\].radius'"),
        ("shapes[0].radius[0]", "'shapes.0..radius' is a number"),
        ("shapes[0].material", "is 'red', a name"),
        ("camera.far", "is not set"),
        ("materials.red", "holds several values"),
        ("integrator.max_depth", "the scene has no 'integrator'"),
        ("film.width", "the scene has no 'film'"),
        ("textures.marble.uv", "'textures' holds several values"),
        ("", "the scene has no ''"),
    ],
)
def test_what_is_no_parameter_is_one_line_that_names_some(path: str, said: str) -> None:
    scene = Scene.parse(
        "materials: {red: {type: diffuse, reflectance: 0.5}}\n"
        "shapes: [{type: sphere, material: red}]\n"
    )
    with pytest.raises(UsageError, match=said) as raised:
        parameter(scene, path)
    text = str(raised.value)
    assert "\n" not in text
    named = text.split("expected such as ")[1].split("; did")[0].split(", ")
    assert {*named} <= {one.path for one in parameters(scene)}


def test_whole_numbers_are_none() -> None:
    quad = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
    scene = Scene(shapes=(Mesh(**quad),))
    with pytest.raises(UsageError, match="holds several values"):
        parameter(scene, "shapes[0].faces")
    wave = Scene.parse("textures: {t: {type: checker, uv_set: 0}}")
    with pytest.raises(UsageError, match=r"uv_set: is 0, which is no real number"):
        parameter(wave, "textures.t.uv_set")
