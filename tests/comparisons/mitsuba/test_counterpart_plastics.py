"""Plastics with colours of vertices, of which Mitsuba lacks the mean that its own plastics need."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mitsuba_dicts import theirs_along

from comparisons.mitsuba.backend import backend
from comparisons.mitsuba.notes import notes_of
from comparisons.mitsuba.reading import read_file
from comparisons.mitsuba.reading.reference import changes_to, own_scene
from comparisons.mitsuba.translate import UntranslatableError, load, to_mitsuba
from comparisons.rungs import direct
from reference_rt.rendering.scene import Scene

SCENE = """
camera: {type: perspective, eye: [0.4, 1.5, 3], target: [0, 0, 0], fov: 45}
film: {width: 24, height: 18}
integrator: {type: path, max_depth: 3}
textures:
  c: {type: vertex_colours, scale: 0.9}
  im: {type: bitmap, file: colours.png}
  h: {type: bitmap, file: heights.png, encoding: raw}
  n: {type: bitmap, file: normals.png, encoding: raw}
materials:
  grey: {type: diffuse, reflectance: 0.5}
  coat: COAT
  m: WRAPPER
shapes:
  - type: mesh
    vertices: [[-1, 0, -1], [1, 0, -1], [1, 0.1, 1], [-1, 0, 1]]
    faces: [[0, 2, 1], [0, 3, 2]]
    uv: [[0, 0], [1, 0], [1, 1], [0, 1]]
    colours: [[0.9, 0.1, 0], [0, 0.8, 0.2], [0.1, 0, 1], [0.7, 0.7, 0.1]]
    material: m
lights: LIGHTS
"""

LAMPS = "[{type: point, position: [1, 2, -1], intensity: 9}, {type: constant, radiance: 0.7}]"
SKY = "[{type: constant, radiance: [0.7, 0.6, 0.5]}]"

COATS = {
    "base": "{type: plastic, reflectance: c}",
    "nonlinear base": "{type: plastic, reflectance: c, nonlinear: true, interior_ior: 1.9}",
    "coat": "{type: plastic, reflectance: im, specular: c}",
    "both": "{type: plastic, reflectance: c, specular: c}",
    "rough base": "{type: rough_plastic, reflectance: c, alpha: 0.2}",
    "rough coat": "{type: rough_plastic, specular: c, alpha: 0.3, distribution: beckmann}",
    "rough both": "{type: rough_plastic, reflectance: c, specular: c, alpha: 0.4, nonlinear: true}",
    "no coat": "{type: rough_plastic, reflectance: c, specular: c, interior_ior: 1}",
}
WRAPPERS = {
    "two-sided": "{type: two_sided, base: coat}",
    "mask": "{type: mask, base: coat, opacity: 0.6}",
    "blend": "{type: blend, first: coat, second: grey, weight: 0.3}",
    "bump": "{type: bump, base: coat, height: h, scale: 0.05}",
    "normal map": "{type: normal_map, base: coat, normals: n}",
}

PRECISE = 5e-3
"""Largest standard error of a mean: a tenth of a lobe of 5 % or more of the light would be seen."""

FAST = pytest.mark.skipif(
    backend().variant.startswith("scalar"), reason="needs a fast variant of Mitsuba"
)


def scene_of(folder: Path, coat: str, wrapper: str = "two-sided", lights: str = LAMPS) -> Scene:
    text = SCENE.replace("COAT", COATS[coat]).replace("WRAPPER", WRAPPERS[wrapper])
    return Scene.parse(text.replace("LIGHTS", lights), folder=folder)


CASES = [
    *((coat, "two-sided") for coat in COATS),
    *((coat, wrapper) for coat in ("both", "rough both") for wrapper in WRAPPERS),
]


@pytest.mark.parametrize(("coat", "wrapper"), CASES)
def test_direct_light_agrees(coat: str, wrapper: str, image_folder: Path) -> None:
    scene = scene_of(image_folder, coat, wrapper)
    rung = direct(scene, scene.tables, load(scene), 200)
    assert rung.status == "agree", rung.reason
    assert rung.numbers["rays"] > 200
    assert "refuses colours of vertices" in " ".join(notes_of(scene))


@pytest.mark.parametrize("coat", ["base", "rough coat"])
def test_another_scale_of_the_colours_is_seen(coat: str, image_folder: Path) -> None:
    scene = scene_of(image_folder, coat)
    other = SCENE.replace("scale: 0.9", "scale: 0.91").replace("COAT", COATS[coat])
    other = other.replace("WRAPPER", WRAPPERS["two-sided"]).replace("LIGHTS", LAMPS)
    faulty = load(Scene.parse(other, folder=image_folder))
    assert direct(scene, scene.tables, faulty, 200).status == "differ"


def difference(ours: Scene, theirs: Any, coordinates: Any) -> tuple[float, float]:
    """The relative difference of the mean radiance on a grid of rays, and its standard error, in
    the channel where it is largest over that."""
    x, z = (g.ravel() for g in np.meshgrid(*2 * [np.linspace(-0.9, 0.9, 8)]))
    target = coordinates(x, z)
    o = np.tile([0.3, 2.0, 3.0], (len(x), 1))
    d = target - o
    d /= np.linalg.norm(d, axis=1)[:, None]
    found, (mean, error) = ours.radiance(o, d, spp=2048), theirs_along(theirs, o, d, 2048)
    off = found.mean.mean(axis=0) - mean.mean(axis=0)
    errors = np.sqrt((found.standard_error**2 + error**2).mean(axis=0) / len(x))
    worst = int(np.argmax(np.abs(off / errors)))
    return float((off / mean.mean(axis=0))[worst]), float((errors / mean.mean(axis=0))[worst])


@FAST
@pytest.mark.parametrize("coat", COATS)
def test_samples_have_the_density_that_they_state(coat: str, image_folder: Path) -> None:
    """Light of the sky, which a path finds by samples of the material and by samples of the sky,
    weighted by both densities: a wrong probability of a lobe would show."""
    scene = scene_of(image_folder, coat, lights=SKY)
    off, error = difference(
        scene, load(scene).mi_scene, lambda x, z: np.column_stack([x, 0 * x, z])
    )
    assert error < PRECISE
    # The largest of 3 channels of 8 materials: 4 standard errors, or 1e-4 for float32, which
    # rounds some hundreds of times on a path.
    assert abs(off) < 4.0 * error + 1e-4


@pytest.mark.parametrize("coat", COATS)
def test_mitsubas_own_are_refused(coat: str, image_folder: Path) -> None:
    scene = scene_of(image_folder, coat)
    with pytest.raises(UntranslatableError, match="vertex colours"):
        to_mitsuba(scene, native=True)


FILE = """<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="3"/></integrator>
  <sensor type="perspective"><transform name="to_world">
    <lookat origin="0, 3, 3" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
  <shape type="ply"><string name="filename" value="square.ply"/>
    <bsdf type="twosided">BSDF</bsdf></shape>
  <emitter type="constant"/>
</scene>
"""
ATTRIBUTE = (
    '<texture type="mesh_attribute" name="{}"><string name="name" value="vertex_color"/></texture>'
)
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float r
property float g
property float b
element face 2
property list uchar int vertex_indices
end_header
-1 0 1 0.9 0.1 0
1 0 1 0 0.8 0.2
1 0 -1 0.1 0 1
-1 0 -1 0.7 0.7 0.1
3 0 1 2
3 0 2 3
"""


@FAST
@pytest.mark.parametrize("plugin", ["plastic", "roughplastic"])
@pytest.mark.parametrize(
    "names",
    [
        ("diffuse_reflectance",),
        ("specular_reflectance",),
        ("diffuse_reflectance", "specular_reflectance"),
    ],
)
def test_in_a_users_file(plugin: str, names: tuple[str, ...], tmp_path: Path) -> None:
    """Mitsuba refuses the file as it stands; with our plugin in its place, light is ours."""
    attributes = "".join(ATTRIBUTE.format(name) for name in names)
    (tmp_path / "square.ply").write_text(PLY)
    (tmp_path / "own.xml").write_text(
        FILE.replace("BSDF", f'<bsdf type="{plugin}">{attributes}</bsdf>')
    )
    scene = read_file(tmp_path / "own.xml", Scene)
    assert "refuses colours of vertices" in " ".join(changes_to(scene))
    off, error = difference(scene, own_scene(scene), lambda x, z: np.column_stack([x, 0 * x, z]))
    assert error < PRECISE
    assert abs(off) < 4.0 * error + 1e-4  # as above
