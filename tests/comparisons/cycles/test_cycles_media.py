"""Media as volumes of Cycles: their coefficients, and which scenes have an equal.

What Cycles makes of them is in `test_cycles_votes`."""

import json
from pathlib import Path

import numpy as np
import pytest

import reference_rt as rt
from comparisons.cycles.media import _apart, volume_of
from comparisons.cycles.translate import obstacles, write
from comparisons.renderers import NoCounterpartError
from reference_rt.core.transform import Scale, Translate

SCENES = Path(__file__).parents[3] / "scenes"

FOG = rt.Homogeneous(sigma_t=(1.0, 2.0, 4.0), albedo=(0.5, 0.75, 1.0), scale=3.0)
EDGE, GLASS = rt.NoSurface(), rt.Dielectric(interior_ior=1.5)
BALL = rt.Sphere(material="edge", interior="fog")


def scene_of(*shapes, camera=None, **parts):
    return rt.Scene(
        media={"fog": FOG, "ink": rt.Homogeneous(sigma_t=(1.0, 1.0, 1.0), albedo=(0.0, 0.0, 0.0))},
        materials={"edge": EDGE, "glass": GLASS, "matte": rt.Diffuse(), **parts.pop("more", {})},
        shapes=shapes,
        camera=camera or rt.Perspective(eye=(0, 0, 5), target=(0, 0, 0)),
        integrator=rt.Path(),
        film=rt.Film(filter=rt.BoxFilter()),
        lights=(rt.Constant(radiance=(1.0, 1.0, 1.0)),),
        **parts,
    )


def moved(shape, x, **changes):
    return shape.model_copy(update={"transform": (Translate(translate=(x, 0, 0)),), **changes})


def test_coefficients_are_those_of_the_medium() -> None:
    (part,) = volume_of(FOG)
    assert part["scatter"] == [1.5, 4.5, 12.0]
    assert part["absorption"] == [1.5, 1.5, 0.0]
    assert (part["phase"], part["g"]) == ("HENYEY_GREENSTEIN", 0.0)


def test_a_blend_is_two_volumes_that_add_up() -> None:
    phase = rt.BlendPhase(first=rt.HenyeyGreenstein(g=0.7), second=rt.Rayleigh(), weight=0.25)
    first, second = volume_of(FOG.model_copy(update={"phase": phase}))
    assert (first["phase"], first["g"]) == ("HENYEY_GREENSTEIN", 0.7)
    assert (second["phase"], second["g"]) == ("RAYLEIGH", None)
    scattered = np.array([first["scatter"], second["scatter"]])
    assert np.allclose(scattered.sum(axis=0), [1.5, 4.5, 12.0], rtol=1e-15)
    assert np.allclose(scattered[1] / scattered[0], 1.0 / 3.0, rtol=1e-15)
    assert first["absorption"] == [1.5, 1.5, 0.0]
    assert second["absorption"] == [0.0] * 3


@pytest.mark.parametrize("g", [0.995, -0.995])
def test_narrow_phase_functions_have_no_equal(g: float) -> None:
    with pytest.raises(NoCounterpartError, match=r"\|g\| above 0.99"):
        volume_of(FOG.model_copy(update={"phase": rt.HenyeyGreenstein(g=g)}))


def written(scene, folder):
    write(scene, folder)
    return json.loads((folder / "scene.json").read_text("utf-8"))


def test_optical_depths_do_not_depend_on_the_frame(tmp_path: Path) -> None:
    """Scenes are written in coordinates that suit float32: the coefficients follow."""
    depths = []
    for size in (1.0, 1e6):
        folder = tmp_path / f"{size:g}"
        folder.mkdir()
        ball = BALL.model_copy(update={"transform": (Scale(scale=(size,) * 3),)})
        medium = FOG.model_copy(update={"scale": FOG.scale / size})
        camera = rt.Perspective(eye=(0, 0, 5 * size), target=(0, 0, 0))
        scene = scene_of(ball, camera=camera)
        found = written(scene.changed(media={**scene.media, "fog": medium}), folder)
        (mesh,) = found["meshes"]
        height = np.ptp(np.load(folder / mesh["file"])["vertices"][:, 2])
        (part,) = found["materials"][mesh["material"]]["volume"]
        depths.append(height * np.array(part["scatter"]))
    assert np.allclose(depths[0], depths[1], rtol=1e-6)
    assert np.allclose(depths[0], 2.0 * np.array([1.5, 4.5, 12.0]), rtol=1e-3)


def test_one_material_around_two_media(tmp_path: Path) -> None:
    shapes = (moved(BALL, -2.0), moved(BALL, 2.0, interior="ink"), moved(BALL, 6.0, interior=None))
    found = written(scene_of(*shapes), tmp_path)
    volumes = [found["materials"][mesh["material"]]["volume"] for mesh in found["meshes"]]
    assert [v and v[0]["scatter"] for v in volumes] == [[1.5, 4.5, 12.0], [0.0] * 3, None]
    assert {found["materials"][m["material"]]["shader"]["type"] for m in found["meshes"]} == {
        "clear"
    }


def test_no_light_gets_into_what_is_opaque(tmp_path: Path) -> None:
    """Cycles would show the volume in place of the surface."""
    found = written(scene_of(BALL.model_copy(update={"material": "matte"})), tmp_path)
    assert [m["volume"] for m in found["materials"].values()] == [None]


def test_the_cameras_medium_is_the_worlds(tmp_path: Path) -> None:
    camera = rt.Perspective(eye=(0, 0, 5), target=(0, 0, 0), medium="fog")
    found = written(scene_of(rt.Sphere(material="matte"), camera=camera), tmp_path)
    assert found["volume"][0]["scatter"] == [1.5, 4.5, 12.0]


INSIDE = rt.Perspective(eye=(0, 0, 5), target=(0, 0, 0), medium="fog")
SHINING = {"lamp": rt.Emissive(radiance=(1.0, 1.0, 1.0), base="matte")}


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (scene_of(BALL, moved(BALL, 1.0)), "not apart"),
        (scene_of(BALL, moved(rt.Box(material="edge", interior="ink"), 2.0)), "not apart"),
        (scene_of(BALL, camera=INSIDE), "around a camera in a medium"),
        (scene_of(BALL.model_copy(update={"exterior": "ink"})), "outside of a surface"),
        (scene_of(rt.Rectangle(material="edge", interior="fog")), "may not be closed"),
        (
            scene_of(BALL, camera=rt.Perspective(eye=(0, 0, 0.5), target=(0, 0, 0))),
            "a camera in the hull",
        ),
        (
            scene_of(BALL, rt.Rectangle(material="lamp"), more=SHINING),
            "lamps that reflect",
        ),
    ],
)
def test_what_cycles_computes_otherwise_does_not_vote(scene: rt.Scene, reason: str) -> None:
    (told,) = obstacles(scene)
    assert reason in told


@pytest.mark.parametrize(
    "scene",
    [
        scene_of(moved(BALL, -1.01), moved(BALL, 1.01)),
        scene_of(BALL, rt.Rectangle(material="lamp"), more=SHINING).changed(
            media={"fog": FOG.model_copy(update={"albedo": (0.0, 0.0, 0.0)})}
        ),
        scene_of(BALL.model_copy(update={"material": "glass"})),
    ],
)
def test_the_like_vote(scene: rt.Scene) -> None:
    assert obstacles(scene) == []


def test_scenes_that_vote() -> None:
    names = ("fog", "milk_glass", "coloured_fog", "nested_media", "absorbing_glass", "csg_smoke")
    voters = [name for name in names if not obstacles(rt.Scene.load(SCENES / f"{name}.yaml"))]
    assert voters == ["fog", "milk_glass", "coloured_fog"]


def test_balls_are_apart_where_their_boxes_are_not() -> None:
    rng = np.random.default_rng(3)
    ball = rng.normal(size=(400, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    assert _apart(ball, ball + np.array([1.3, 1.3, 1.3]))  # 2.25 away; boxes overlap by 0.7
    assert not _apart(ball, ball + np.array([1.0, 1.0, 1.0]))
