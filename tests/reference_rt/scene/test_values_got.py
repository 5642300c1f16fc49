"""An error about a value repeats the value, shortened if it is long."""

import numpy as np
import pytest

import reference_rt as rt

PERSPECTIVE = "camera: {type: perspective, %s}"
MATERIAL = "materials: {a: {type: %s}}"
SHAPE = "shapes: [{type: %s}]"


@pytest.mark.parametrize(
    ("text", "got"),
    [
        (PERSPECTIVE % "eye: [1, 2]", "[1, 2]"),
        (PERSPECTIVE % "up: [0, 0, 0]", "[0, 0, 0]"),
        (PERSPECTIVE % "fov: 180", "180"),
        (PERSPECTIVE % "view: [1, 2, 3]", "[1, 2, 3]"),
        ("film: {width: 1.5}", "1.5"),
        ("film: 3", "3"),
        ("film: {layers: [albedo, albedo]}", "['albedo', 'albedo']"),
        ("film: {layers: [beauty]}", "'beauty'"),
        ("integrator: path", "'path'"),
        ("sampler: {type: grid, spp: 3}", "3"),
        (MATERIAL % "diffuse, reflectance: -1", "-1"),
        (MATERIAL % "diffuse, reflectance: 2", "2"),
        (MATERIAL % "diffuse, reflectance: [1, 2]", "[1, 2]"),
        (MATERIAL % "rough_conductor, eta: 1, k: 0, alpha: 99", "99"),
        (MATERIAL % "conductor, eta: 0, k: 0", "0"),
        (MATERIAL % "mask, base: x, opacity: 3", "3"),
        (SHAPE % "sphere, radius: big", "'big'"),
        (SHAPE % "sphere, transform: 5", "5"),
        (SHAPE % "sphere, transform: [{scale: [1, 2]}]", "[1, 2]"),
        (SHAPE % "sphere, transform: [{scales: 2}]", "['scales']"),
        (SHAPE % "sphere, transform: [{matrix: [1, 2]}]", "[1, 2]"),
        (SHAPE % "union, of: []", "0"),
        (SHAPE % "cylinder, z_min: 2, z_max: 1", "2 and 1"),
        (
            SHAPE % "quadric, coefficients: [1, 2], lower: [0, 0, 0], upper: [1, 1, 1]",
            "[1, 2]",
        ),
        ("shapes: 3", "3"),
        ("hierarchy: octree", "'octree'"),
        ("lights: [{type: point, position: [0, 0, 0], intensity: bright}]", "'bright'"),
        (
            "lights: [{type: spot, origin: [1, 0, 0], target: [1, 0, 0], intensity: 1}]",
            "[1.0, 0.0, 0.0] and [1.0, 0.0, 0.0]",
        ),
    ],
)
def test_what_was_got(text, got):
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.parse(text, "x.yaml")
    assert caught.value.message.endswith(f"got {got}")
    assert caught.value.message.count("got ") == 1
    assert caught.value.message.isprintable()


@pytest.mark.parametrize(
    "value",
    ["x" * 10**6, list(range(10**5)), {"a" * 1000: 1}, 10**4000, [[1] * 9] * 10**4, np.zeros(9)],
    ids=["text", "list", "keys", "number", "lists", "array"],
)
def test_long_values_are_shortened(value):
    with pytest.raises(rt.SceneError) as caught:
        rt.Sphere(center=value)
    assert len(str(caught.value)) < 200


def test_what_is_missing_or_unknown_has_no_value():
    with pytest.raises(rt.SceneError) as caught:
        rt.Point(position=(0, 0, 0))
    assert "got" not in caught.value.message
    with pytest.raises(rt.SceneError) as caught:
        rt.Sphere(centre=(0, 0, 0))
    assert caught.value.message.endswith("did you mean 'center'?")
