"""Glass of glTF files: KHR_materials_transmission and KHR_materials_volume."""

import numpy as np
import pytest
from gltf_scenes import GltfScene

import reference_rt as rt

pytestmark = pytest.mark.filterwarnings("ignore:.*has no camera")

CLEAR = {"KHR_materials_transmission": {"transmissionFactor": 1}}
BODY = {"thicknessFactor": 2}
SKY = {"environment": "1"}
SMOOTH = {"metallicFactor": 0, "roughnessFactor": 0}


def written(tmp_path, pbr=SMOOTH, volume=None, **more):
    extensions = {**CLEAR, **more.pop("extensions", {})}
    if volume is not None:
        extensions["KHR_materials_volume"] = volume
    file = GltfScene(name="glass", pbrMetallicRoughness=pbr, extensions=extensions, **more)
    path = tmp_path / "glass.glb"
    path.write_bytes(file.glb())
    return path


def read(tmp_path, **given):
    scene = rt.Scene.load(written(tmp_path, **given), SKY)
    (shape,) = scene.shapes
    return scene, scene.materials[shape.material], shape


def test_a_sheet_and_a_body(tmp_path):
    scene, glass, shape = read(tmp_path)
    assert glass == rt.ThinDielectric(interior_ior=1.5)
    assert (shape.interior, scene.media) == (None, {})
    ior = {"KHR_materials_ior": {"ior": 1.33}}
    scene, glass, shape = read(tmp_path, volume=BODY, extensions=ior, doubleSided=True)
    assert glass == rt.Dielectric(interior_ior=1.33, exterior_ior=1.0)
    assert (shape.interior, scene.media) == (None, {})
    _, glass, _ = read(tmp_path, pbr={"metallicFactor": 0, "roughnessFactor": 0.5}, volume=BODY)
    assert glass == rt.RoughDielectric(interior_ior=1.5, exterior_ior=1.0, alpha=0.25)


def test_what_it_absorbs(tmp_path):
    """After the distance the colour is left, of black nothing."""
    volume = {**BODY, "attenuationDistance": 0.5, "attenuationColor": [0.25, 1, 0]}
    scene, _, shape = read(tmp_path, volume=volume)
    medium = scene.media[shape.interior]
    left = np.exp(-0.5 * np.array(medium.sigma_t))
    np.testing.assert_allclose(left[:2], [0.25, 1.0], rtol=1e-15)
    assert 0.0 < left[2] < 1e-300
    assert medium.albedo == (0.0, 0.0, 0.0)
    assert isinstance(scene.integrator, rt.Path)
    # A thin sheet has no inside, whatever it says.
    thin = {"attenuationDistance": 0.5, "attenuationColor": [0.25, 1, 0]}
    assert read(tmp_path, volume=thin)[0].media == {}


def test_a_ball_of_green_glass_is_as_dark_as_it_says(tmp_path):
    """Through the middle of a body of index 1 + 1e-9, over a straight way of 2: the colour."""
    volume = {**BODY, "attenuationDistance": 2, "attenuationColor": [0.5, 0.9, 0.1]}
    extensions = {"KHR_materials_ior": {"ior": 1.0 + 1e-9}}
    scene, _, shape = read(tmp_path, volume=volume, extensions=extensions)
    ball = rt.Sphere(material=shape.material, interior=shape.interior)
    lit = scene.changed(shapes=(ball,), groups={})
    found = lit.radiance([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]], spp=4).mean[0]
    # Fresnel's reflection is 2.5e-19, and the index bends nothing on the axis.
    np.testing.assert_allclose(found, [0.5, 0.9, 0.1], rtol=1e-12)


REFUSED = {
    "less than all light": {
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}}
    },
    "tinted light": {"pbr": {**SMOOTH, "baseColorFactor": [1, 0.5, 0.5, 1]}},
    "light beside a metal": {"pbr": {"metallicFactor": 0.5, "roughnessFactor": 0}},
    "light that it emits": {"emissiveFactor": [1, 0, 0]},
    "light with opacity": {"alphaMode": "BLEND"},
    "light through a thin and rough sheet": {"pbr": {"metallicFactor": 0, "roughnessFactor": 0.5}},
    "light with an index of at most 1": {"extensions": {"KHR_materials_ior": {"ior": 1}}},
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_no_clear_glass_is_named(what, tmp_path):
    path = written(tmp_path, **REFUSED[what])
    with pytest.raises(rt.SceneError, match=f"transmits {what}; expected clear white glass"):
        rt.Scene.load(path, SKY)
    with pytest.warns(rt.SceneWarning, match=what):
        scene = rt.Scene.load(path, SKY, allow_missing=True)
    (shape,) = scene.shapes
    assert shape.interior is None
