"""Every public type, translated to Mitsuba: rays show that conventions agree."""

import re
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.counterpart import trace
from comparisons.mitsuba.scene import render
from comparisons.translator import UntranslatableError, load, to_mitsuba
from reference_rt.cameras.camera import Camera
from reference_rt.cameras.film import Film
from reference_rt.core.model import Description
from reference_rt.lights import Constant, Point
from reference_rt.materials import Emissive, Mirror
from reference_rt.materials.material import Material
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Sphere
from reference_rt.shapes.shape import Shape
from reference_rt.util.errors import SceneError


def test_shapes_keep_their_index_beyond_ten() -> None:
    balls = tuple(Sphere(center=(3.0 * i, 0.0, 0.0)) for i in range(12))
    o = np.array([[3.0 * i, 0.0, 5.0] for i in range(12)])
    hits = trace(load(Scene(shapes=balls)), o, np.tile([0.0, 0.0, -1.0], (12, 1)))
    assert hits.shape.tolist() == list(range(12))
    np.testing.assert_allclose(hits.t, 4.0, rtol=1e-6)
    np.testing.assert_allclose(hits.n, np.tile([0.0, 0.0, 1.0], (12, 1)), atol=1e-6)


def test_a_miss_has_no_shape() -> None:
    hits = trace(load(Scene(shapes=(Sphere(),))), np.array([[5.0, 0, 5]]), np.array([[0.0, 0, -1]]))
    assert (hits.t[0], hits.shape[0], hits.primitive[0]) == (np.inf, -1, -1)
    assert not hits.p.any()


def test_replicates_differ_by_seed_alone() -> None:
    scene = Scene(
        film=Film(width=8, height=8), shapes=(Sphere(),), lights=(Constant(radiance=(1.0,) * 3),)
    )
    mi_scene = load(scene).mi_scene
    first, again = render(mi_scene, 2, 2, seed=5), render(mi_scene, 2, 2, seed=5)
    np.testing.assert_array_equal(first.pictures, again.pictures)
    assert np.any(first.pictures[0] != first.pictures[1])
    assert first.pictures.dtype == np.float64
    assert (first.seconds > 0.0).all()


def test_emitters() -> None:
    scene = Scene(
        materials={
            "lamp": Emissive(radiance=(1.0, 2.0, 3.0), base="m"),
            "dark": Emissive(radiance=(4.0, 5.0, 6.0)),
            "m": Mirror(reflectance=(0.1, 0.2, 0.3)),
        },
        shapes=(Sphere(material="lamp"), Sphere(material="dark", center=(5.0, 0.0, 0.0))),
        lights=(Point(position=(1.0, 2.0, 3.0), intensity=(7.0, 8.0, 9.0)),),
    )
    translated = to_mitsuba(scene)
    assert translated["shape_0"]["emitter"]["radiance"]["value"] == [1.0, 2.0, 3.0]
    assert translated["shape_0"]["bsdf"]["specular_reflectance"]["value"] == [0.1, 0.2, 0.3]
    assert translated["shape_1"]["bsdf"]["reflectance"]["value"] == [0.0, 0.0, 0.0]
    assert translated["light_0"]["intensity"]["value"] == [7.0, 8.0, 9.0]
    assert {e.id() for e in load(scene).mi_scene.emitters()} >= {"light_0"}


class Teapot(Shape):
    type: str = "teapot"


class Velvet(Material):
    type: str = "velvet"


class Fisheye(Camera):
    type: str = "fisheye"


class Sun(Description):
    deterministic: ClassVar[bool] = True
    type: str = "sun"


class Lanczos(Description):
    type: str = "lanczos"


@pytest.mark.parametrize(
    ("part", "changes"),
    [
        (Teapot(), {"shapes": (Teapot(),)}),
        (Velvet(), {"materials": {"v": Velvet()}, "shapes": (Sphere(material="v"),)}),
        (Fisheye(), {"camera": Fisheye()}),
        (Sun(), {"lights": (Sun(),)}),
        (Lanczos(), {"film": Film().model_copy(update={"filter": Lanczos()})}),
        (Sun(), {"integrator": Sun()}),
        (Sun(), {"sampler": Sun()}),
    ],
)
def test_a_type_without_translation_is_named(part: Description, changes: dict[str, object]) -> None:
    scene = Scene.model_construct(**(dict(Scene()) | changes))
    scene._folder, scene._source = Path(), None
    with pytest.raises(UntranslatableError, match=type(part).__name__) as caught:
        to_mitsuba(scene)
    assert caught.value.exit_code == 4


def test_a_missing_mesh_is_an_error_of_the_scene() -> None:
    with pytest.raises(SceneError, match=r"shapes\[0\].*nowhere.obj"):
        to_mitsuba(Scene(shapes=(Mesh(file="nowhere.obj"),)))


def test_the_plugin_is_registered() -> None:
    assert mitsuba().load_dict({"type": "whitted", "max_depth": 3}).max_depth == 3


def test_a_number_in_place_of_absent_vertex_colours_is_their_luminance() -> None:
    scene = Scene.parse(
        """
        textures: {c: {type: vertex_colours, without: [0.9, 0.4, 0.1]}}
        materials: {m: {type: mask, opacity: c, base: g}, g: {type: diffuse, reflectance: c}}
        shapes: [{type: sphere, material: m}]
        """
    )
    translated = str(to_mitsuba(scene))
    # Rec. 709's weights.
    number = 0.2126 * 0.9 + 0.7152 * 0.4 + 0.0722 * 0.1
    found = [float(x) for x in re.findall(r"'opacity': .*?'value': ([0-9.e-]+)", translated)]
    assert found == [pytest.approx(number, abs=1e-4)]
