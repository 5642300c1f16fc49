"""Bump maps on meshes that stand in for curved shapes, which have the surface's own tangents."""

from pathlib import Path

import numpy as np
import pytest

from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.plugins.exact_coordinates import (
    NUMPY,
    Coordinates,
    Round,
    derivatives_at,
    of_cone,
    of_quadric,
)
from comparisons.mitsuba.translate import UntranslatableError, load, to_mitsuba
from comparisons.mitsuba.translate.shapes import meshes, stand_ins
from comparisons.mitsuba.translate.shapes.stand_ins import coarser
from comparisons.rungs import direct, whitted
from reference_rt.core.arrays import FloatArray
from reference_rt.lights import Point
from reference_rt.materials import Bump
from reference_rt.rendering.scene import Scene

QUADRIC = "type: quadric, lower: [-1, -0.9, -0.8], upper: [0.9, 1, 0.7], coefficients: "
SHAPES = {
    "torus": "type: torus, major_radius: 1, minor_radius: 0.4",
    "thin torus": "type: torus, major_radius: 1.2, minor_radius: 0.1",
    "cone": "type: cone, radius: 1, height: 1.5",
    "frustum": "type: cone, radius: 0.5, top_radius: 1, height: 1.2, capped: false",
    "ball": f"{QUADRIC}[1, 1, 1, 0, 0, 0, 0, 0, 0, -0.9], capped: true",
    "paraboloid": f"{QUADRIC}[1, 2, 0, 0, 0, 0, 0, 0, -1, -0.5]",
    "hyperboloid": f"{QUADRIC}[1, 1.5, -1, 0, 0, 0, 0, 0, 0, -0.3]",
    "two sheets": f"{QUADRIC}[-1, -1.5, 1, 0, 0, 0, 0, 0, 0, -0.1], capped: true",
    "double cone": f"{QUADRIC}[1, 1.5, -1, 0, 0, 0, 0, 0, 0, 0]",
    "lying double cone": f"{QUADRIC}[1, -1.5, 1, 0, 0, 0, 0, 0, 0, 0]",
    "pipe": f"{QUADRIC}[1.7, 1.2, 0, 0, 0, 0, 0, 0, 0, -0.6], capped: true",
    "lying pipe": f"{QUADRIC}[0, 1.2, 1.4, 0, 0, 0, 0, 0, 0, -0.6]",
    "saddle": f"{QUADRIC}[1, -1, 0, 0, 0, 0, 0, 0, -1, 0]",
    "tilted": f"{QUADRIC}[1, 1, 2, 0.3, 0.5, 0.2, 0.1, 0, 0, -0.7], capped: true",
    "plane": f"{QUADRIC}[0, 0, 0, 0, 0, 0, 0.3, 0.2, 1, -0.1]",
}
MAPS = {
    "turned": "{rotate: {axis: [1, 2, 3], degrees: 70}}",
    "mirrored": "{scale: [1, -0.8, 1.2]}, {rotate: {axis: [1, 0, 1], degrees: 50}}",
    "sheared": "{matrix: [[0.9, 0.4, 0.1, 0], [0, 1, -0.3, -0.2], [0.3, 0.35, 0.8, 0]]}",
}
MATERIALS = {
    "metal": "{type: rough_conductor, eta: 1, k: 2, alpha: 0.4}",
    "brushed metal": "{type: rough_conductor, eta: 0.2, k: 3, alpha: [0.15, 0.5]}",
    "plaster": "{type: diffuse, reflectance: 0.6}",
    "plastic": "{type: rough_plastic, reflectance: im, alpha: 0.3}",
    "car": "{type: principled, anisotropic: 0.8, roughness: 0.4, metallic: 0.5}",
    "glass": "{type: rough_dielectric, interior_ior: 1.5, alpha: 0.4}",
}
AROUND = {
    "alone": "{type: two_sided, base: bump}",
    "mask": "{type: mask, base: bump, opacity: 0.7}",
    "blend": "{type: blend, first: bump, second: grey, weight: 0.4}",
    "lamp": "{type: emissive, base: bump, radiance: 0.1}",
    "two sides": "{type: two_sided, base: bump, back: grey}",
}
HEIGHTS = (
    "{type: bitmap, file: heights.png, encoding: raw, uv: {scale: 2}}",
    "{type: bitmap, file: wide.png, encoding: raw, uv: {scale: [3, 2], rotate: 30}}",
    "{type: checker}",
)

SCENE = """
camera: {type: perspective, eye: [1, 2, 4], target: [0, 0, 0], fov: 45}
film: {width: 24, height: 18}
integrator: INTEGRATOR
textures:
  h: HEIGHT
  im: {type: bitmap, file: colours.png}
materials:
  grey: {type: diffuse}
  m: MATERIAL
  bump: {type: bump, base: m, height: h, scale: 0.06, OPTIONS}
  outer: OUTER
shapes:
  - SHAPES
lights:
  - {type: point, position: [1, 2, 3], intensity: 5}
  - {type: directional, direction: [-1, -2, 0.3], irradiance: 2}
"""


def scene_of(
    folder: Path,
    shapes: str,
    material: str = "metal",
    outer: str = "alone",
    height: str = HEIGHTS[0],
    options: str = "",
    integrator: str = "{type: path}",
) -> Scene:
    text = SCENE.replace("SHAPES", shapes).replace("MATERIAL", MATERIALS[material])
    if material == "glass" and "two_sided" in AROUND[outer]:
        outer = "mask"  # two sides are for what is opaque
    text = text.replace("OUTER", AROUND[outer]).replace("HEIGHT", height)
    text = text.replace("OPTIONS", options).replace("INTEGRATOR", integrator)
    return Scene.parse(text, folder=folder)


def one(shape: str, placed: str = "turned") -> str:
    return f"{{{SHAPES[shape]}, material: outer, transform: [{MAPS[placed]}]}}"


def agrees(scene: Scene, fineness: float = 0.35, rays: int = 200) -> None:
    with scalar(), coarser(fineness):
        found = direct(scene, scene.tables, load(scene), rays)
    assert found.status == "agree", found.reason
    assert found.numbers["rays"] > 100


EVERY = [(shape, placed) for shape in SHAPES for placed in MAPS]


@pytest.mark.parametrize(("shape", "placed"), EVERY)
def test_direct_light_agrees(shape: str, placed: str, image_folder: Path) -> None:
    """Each shape under each map, with materials and heights in turn."""
    k = EVERY.index((shape, placed))
    materials, outers = list(MATERIALS), list(AROUND)
    options = "flip_invalid_normals: true, use_shadowing_function: true" if k % 4 == 3 else ""
    agrees(
        scene_of(
            image_folder,
            one(shape, placed),
            materials[k % len(materials)],
            outers[(k // 3) % len(outers)],
            HEIGHTS[k % 2],
            options,
        )
    )


@pytest.mark.parametrize("outer", AROUND)
@pytest.mark.parametrize("material", MATERIALS)
def test_every_material_under_a_bump(material: str, outer: str, image_folder: Path) -> None:
    agrees(scene_of(image_folder, one("frustum", "sheared"), material, outer, HEIGHTS[1]))


@pytest.mark.parametrize("name", ["cone", "frustum", "hyperboloid", "saddle"])
def test_mitsubas_own_tangents_differ(
    name: str, image_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stand_ins, "_with_coordinates", lambda bsdf, of, m: bsdf)
    """Also on meshes as fine as in a comparison, whose bound is the least."""
    scene = scene_of(image_folder, one(name))
    with scalar():
        assert direct(scene, scene.tables, load(scene), 200).status == "differ"


@pytest.mark.parametrize("step", ["{scale: 1e-3}", "{scale: 500}, {translate: [1e6, 3e5, -2e5]}"])
def test_in_a_moved_frame(step: str, image_folder: Path) -> None:
    """Tiny, and large and far away, seen and lit as in the other tests: the counterpart is moved
    and scaled."""
    for k, shape in enumerate(("torus", "cone", "hyperboloid", "saddle")):
        placed = one(shape).replace("degrees: 70}}]", f"degrees: 70}}}}, {step}]")
        scene = scene_of(image_folder, placed, list(MATERIALS)[k])
        scale = 1e-3 if "1e-3" in step else 500.0
        middle = np.zeros(3) if scale < 1.0 else np.array([1e6, 3e5, -2e5])
        camera = scene.camera.model_copy(
            update={
                "eye": tuple(scale * np.array(scene.camera.eye) + middle),
                "target": tuple(middle),
            }
        )
        point, sun = scene.lights
        assert isinstance(point, Point)
        lamp = point.model_copy(
            update={
                "position": tuple(scale * np.array(point.position) + middle),
                "intensity": tuple(scale**2 * np.array(point.intensity)),
            }
        )
        materials = {
            name: material.model_copy(update={"scale": scale * material.scale})
            if isinstance(material, Bump)
            else material
            for name, material in scene.materials.items()
        }
        scene = scene.changed(camera=camera, lights=(lamp, sun), materials=materials)
        with scalar(), coarser(0.35):
            assert not load(scene).frame.is_ours
        agrees(scene)


def copies_of(shape: str, count: int) -> str:
    places = [
        f"{{type: instance, group: g, transform: [{{scale: [0.4, -0.5, 0.6]}}, {{rotate: "
        f"{{axis: [1, {k}, 2], degrees: 50}}}}, {{translate: [{0.7 * k - 1.5}, 0, 0]}}]}}"
        for k in range(count)
    ]
    return "\n  - ".join(places) + f"\ngroups: {{g: [{one(shape)}]}}"


@pytest.mark.parametrize("placed", MAPS)
def test_an_ellipsoid_that_shines(placed: str, image_folder: Path) -> None:
    """Which is a mesh in Mitsuba, as its instances do not emit."""
    shape = (
        f"{{type: sphere, material: outer, transform: [{{scale: [1, 0.8, 0.6]}}, {MAPS[placed]}]}}"
    )
    agrees(scene_of(image_folder, shape, "brushed metal", "lamp"), fineness=0.7)


@pytest.mark.parametrize("name", ["plane", "lying pipe", "double cone"])
def test_textures_where_uv_are_not_linear_on_a_triangle(name: str, image_folder: Path) -> None:
    """Between the vertices of these large or long triangles Mitsuba's uv are up to half the shape's
    size off; the material sees the surface's own."""
    scene = scene_of(image_folder, one(name))
    im = scene.materials["grey"].model_copy(update={"reflectance": "im"})
    both = scene.materials["outer"].model_copy(update={"base": "im"})
    agrees(scene.changed(materials={**scene.materials, "im": im, "outer": both}))


@pytest.mark.parametrize("name", ["torus", "frustum", "saddle"])
def test_copies_of_a_group(name: str, image_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes, not instances, in which the place of a surface is not known: with fewer triangles
    each, so that there are as many in all."""
    monkeypatch.setattr(stand_ins, "MOST_TRIANGLES", 60_000)
    monkeypatch.setattr(meshes, "MOST_TRIANGLES", 60_000)
    scene = scene_of(image_folder, copies_of(name, 4))
    with scalar():
        counterpart = load(scene)
        found = direct(scene, scene.tables, counterpart, 300)
    assert all(mi_shape.plugin.group is None for mi_shape in counterpart.mi_shapes.values())
    triangles = [s.triangles for s in next(iter(counterpart.stand_ins().values()))]
    assert triangles[0] < 17_000
    assert found.status == "agree", found.reason


def test_very_many_copies_of_a_group(image_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (stand_ins, meshes):
        monkeypatch.setattr(module, "MOST_TRIANGLES", 60_000)
        monkeypatch.setattr(module, "MOST_INSTANCES", 3)
    with scalar(), pytest.raises(UntranslatableError, match="in a group with 4 copies"):
        load(scene_of(image_folder, copies_of("torus", 4)))


def test_mitsubas_own_bump_is_refused(image_folder: Path) -> None:
    with scalar(), coarser(0.35), pytest.raises(UntranslatableError, match="under a bump map"):
        to_mitsuba(scene_of(image_folder, one("torus")), native=True)


@pytest.mark.parametrize("operation", ["difference", "intersection", "union"])
def test_in_a_solid(operation: str, image_folder: Path) -> None:
    solid = (
        f"{{type: {operation}, material: outer, transform: [{MAPS['mirrored']}],"
        f" of: [{{{SHAPES['torus']}}}, {{{SHAPES['cone']}, transform: [{{scale: 0.8}}]}}]}}"
    )
    agrees(scene_of(image_folder, solid, "brushed metal"))


@pytest.mark.parametrize("name", ["torus", "cone", "saddle"])
def test_whitted_light_agrees(name: str, image_folder: Path) -> None:
    scene = scene_of(image_folder, one(name), integrator="{type: whitted, max_depth: 3}")
    with scalar(), coarser(0.35):
        found = whitted(scene, scene.tables, load(scene), 300)
    # In coarse meshes edges are wider.
    assert found.status in ("agree", "reference-limited"), found.reason
    assert found.numbers["unexplained"] == 0


SURFACES: tuple[tuple[Coordinates, FloatArray], ...] = (
    (Round((0.0, 0.0, 0.0), 1.0), np.array([[1.2, 0.4, 0.1], [-0.8, 0.3, -0.2]])),
    (Round((0.1, 0.2, 0.3), 0.0, is_sphere=True), np.array([[0.5, 0.4, 0.7], [-0.3, -0.2, 0.1]])),
    (of_cone(1.0, -0.4, 0.5, 2.0), np.array([[0.5, 0.6, 0.9], [-0.3, 0.2, 1.9]])),
    (
        of_quadric(
            np.array([[1.0, 0.2, 0.3], [0.2, -0.7, 0.1], [0.3, 0.1, 0.4]]),
            np.array([0.3, 0.1, -0.5]),
            np.array([-1.0, -0.9, -0.8]),
            np.array([0.9, 1.0, 0.7]),
        ),
        np.array([[0.5, 0.6, 0.2], [-0.3, 0.4, -0.1]]),
    ),
)


@pytest.mark.parametrize(("of", "p"), SURFACES)
def test_derivatives_are_those_of_uv(of: Coordinates, p: FloatArray) -> None:
    """Along dp/du, u changes by as much as the step, and v does not; and the other way round."""
    step = 1e-5

    def uv(p: FloatArray) -> FloatArray:
        return np.column_stack(of.uv(tuple((p - of.origin).T), NUMPY))

    for k, direction in enumerate(derivatives_at(of, p)):
        change = (uv(p + step * direction) - uv(p - step * direction)) / (2.0 * step)
        # Off by a sixth of the third derivative, some hundreds here, times the step squared.
        np.testing.assert_allclose(change, np.eye(2)[[k, k]], atol=1e3 * step**2)
