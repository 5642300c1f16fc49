"""Materials and textures of glTF against its specification: texels by formulas of its own."""

import base64
import math
from pathlib import Path

import numpy as np
import pytest
from gltf_scenes import TEXELS, UV, GltfScene, full_scene, load, png, refused
from PIL import Image

import reference_rt as rt
from reference_rt.core.vec3 import Vec3
from reference_rt.textures import At
from reference_rt.textures.lookup import lookup

HEIGHT, WIDTH = TEXELS.shape[:2]
LINEAR = np.where(
    TEXELS / 255 <= 0.04045, TEXELS / 255 / 12.92, ((TEXELS / 255 + 0.055) / 1.055) ** 2.4
)


def looked(scene, name, u, v, colour=(-1.0, -1.0, -1.0)):
    """A texture at glTF's coordinates, whose v counts from the top."""
    k = [*scene.textures].index(name)
    return np.array(lookup(k, At(scene.tables.textures, u, 1.0 - v, Vec3(*colour))))


def texel(u, v, image=LINEAR):
    """The nearest texel, as the specification places them: (0, 0) is the upper left corner."""
    return image[math.floor(v * HEIGHT) % HEIGHT, math.floor(u * WIDTH) % WIDTH]


PLACES = np.random.default_rng(9).uniform(-2, 3, (40, 2)).tolist()


def test_the_default_material(tmp_path):
    file = GltfScene()
    del file.primitive["material"]
    scene, _ = load(tmp_path, file)
    assert scene.materials[scene.shapes[0].material] == rt.GltfPbr()


def test_factors_textures_and_vertex_colours(tmp_path):
    file = GltfScene(name="paint")
    index = file.texture()
    file.material["pbrMetallicRoughness"] = {
        "baseColorFactor": [0.9, 0.5, 0.25, 1.0],
        "baseColorTexture": {"index": index},
        "metallicFactor": 0.5,
        "roughnessFactor": 0.75,
        "metallicRoughnessTexture": {"index": index},
    }
    file.primitive["attributes"]["COLOR_0"] = file.add(np.float32(np.full((4, 3), 1.5)))
    scene, _ = load(tmp_path, file)
    paint = scene.materials["paint"]
    own = (0.3, 0.6, 0.9)
    for u, v in PLACES:
        base = texel(u, v)[:3] * (0.9, 0.5, 0.25)
        # A product of three and of four numbers.
        assert np.allclose(looked(scene, paint.base_color, u, v, own), base * own, rtol=1e-15)
        assert np.allclose(looked(scene, paint.base_color, u, v), base, rtol=1e-15)
        red_green_blue = texel(u, v, TEXELS / 255)
        assert np.allclose(looked(scene, paint.metallic, u, v), 0.5 * red_green_blue[2])
        assert np.allclose(looked(scene, paint.roughness, u, v), 0.75 * red_green_blue[1])
    assert np.all(scene.shapes[0].colours == 1.0)  # "MUST be clamped"


def test_texture_transforms(tmp_path):
    """Offset, and scale before rotation, counter-clockwise in the image's own coordinates."""
    file = GltfScene(name="paint")
    turned = {"offset": [0.1, 0.25], "rotation": 0.4, "scale": [2.0, -0.5]}
    info = {"index": file.texture(), "extensions": {"KHR_texture_transform": turned}}
    file.material["pbrMetallicRoughness"] = {"baseColorTexture": info}
    scene, _ = load(tmp_path, file)
    c, s = math.cos(0.4), math.sin(0.4)
    for u, v in PLACES:
        a, b = 2.0 * u, -0.5 * v
        expected = texel(c * a + s * b + 0.1, c * b - s * a + 0.25)[:3]
        found = looked(scene, scene.materials["paint"].base_color, u, v)
        assert np.array_equal(found, expected)


def test_samplers(tmp_path):
    file = GltfScene(name="paint")
    index = file.texture(wrapS=33071, wrapT=33648, magFilter=9729)
    file.material["pbrMetallicRoughness"] = {"baseColorTexture": {"index": index}}
    scene, _ = load(tmp_path, file)
    (one,) = scene.textures.values()
    assert (one.wrap, one.filter, one.encoding) == (("clamp", "mirror"), "bilinear", "srgb")
    file.root["textures"][0] = {"source": 0}
    (one,) = load(tmp_path, file)[0].textures.values()
    assert (one.wrap, one.filter) == ("repeat", "bilinear")


def test_alpha_modes(tmp_path):
    file = GltfScene(name="paint", alphaMode="MASK", alphaCutoff=0.25)
    info = {"index": file.texture()}
    base = {"baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": info}
    file.material["pbrMetallicRoughness"] = base
    masked = load(tmp_path, file)[0]
    file.material["alphaMode"] = "BLEND"
    blended = load(tmp_path, file)[0]
    for u, v in PLACES:
        alpha = 0.5 * texel(u, v, TEXELS / 255)[3]
        assert np.allclose(looked(blended, blended.materials["paint"].opacity, u, v), alpha)
        assert np.all(looked(masked, masked.materials["paint"].opacity, u, v) == (alpha >= 0.25))
    del base["baseColorTexture"]
    assert load(tmp_path, file)[0].materials["paint"].opacity == 0.5
    file.material["alphaMode"] = "OPAQUE"
    assert load(tmp_path, file)[0].materials["paint"].type == "gltf_pbr"
    for cutoff, opacity in ((0.6, 0.0), (0.5, None), (0.0, None)):
        file.material |= {"alphaMode": "MASK", "alphaCutoff": cutoff}
        found = load(tmp_path, file)[0].materials["paint"]
        assert getattr(found, "opacity", None) == opacity


def test_the_opacity_of_an_opaque_image_is_the_factor(tmp_path):
    file = GltfScene(name="paint", alphaMode="BLEND")
    Image.fromarray(TEXELS[..., :3]).save(tmp_path / "a b.png")
    info = {"index": file.texture({"uri": "a%20b.png"})}
    base = {"baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": info}
    file.material["pbrMetallicRoughness"] = base
    scene, _ = load(tmp_path, file, "gltf")
    assert scene.materials["paint"].opacity == 0.5
    assert [one.file for one in scene.textures.values()] == ["a b.png"]


def test_both_sides_normal_maps_and_masks_nest(tmp_path):
    """The tilted normal is turned to the viewer as a whole: so the map is outside."""
    scene, said = load(tmp_path, full_scene())
    lamp = scene.materials["paint"]
    mask = scene.materials[lamp.base]
    tilt = scene.materials[mask.base]
    sides = scene.materials[tilt.base]
    assert [m.type for m in (lamp, mask, tilt, sides)] == [
        "emissive",
        "mask",
        "normal_map",
        "two_sided",
    ]
    assert (tilt.scale, tilt.follow_v) == (0.5, False)
    assert scene.materials[sides.base].type == "gltf_pbr"
    assert "it emits from its front only" in said


@pytest.mark.parametrize("by", ["uv", "node"])
def test_normal_maps_follow_mirrored_coordinates(tmp_path, by):
    file = full_scene()
    if by == "uv":
        uv = UV * np.float32([-1, 1])
        file.primitive["attributes"]["TEXCOORD_0"] = file.add(uv)
    else:
        file.root["nodes"][0]["scale"] = [1, -1, 1]
    (tilt,) = (m for m in load(tmp_path, file)[0].materials.values() if m.type == "normal_map")
    assert tilt.follow_v


def test_emission_is_masked(tmp_path):
    scene, _ = load(tmp_path, full_scene())
    lamp = scene.materials["paint"]
    c, s = math.cos(0.3), math.sin(0.3)
    for u, v in np.random.default_rng(10).uniform(0, 1, (40, 2)).tolist():
        a, b = 2.0 * u, 3.0 * v
        x, y = c * a + s * b + 0.1, c * b - s * a + 0.2
        opaque = 0.6 * texel(min(max(x, 0.0), 0.999), y, TEXELS / 255)[3] >= 0.3
        expected = texel(u, v)[:3] * (5.0, 2.5, 0.0) * opaque
        assert np.allclose(looked(scene, lamp.radiance, u, v), expected, rtol=1e-15)


def test_unlit(tmp_path):
    file = GltfScene(name="paint", extensions={"KHR_materials_unlit": {}})
    file.material["pbrMetallicRoughness"] = {"baseColorFactor": [0.25, 0.5, 1.0, 1.0]}
    scene, said = load(tmp_path, file)
    paint = scene.materials["paint"]
    assert paint.radiance == (0.25, 0.5, 1.0)
    assert scene.materials[paint.base] == rt.Diffuse(reflectance=0.0)
    assert "materials[0] is unlit: it emits its colour" in said


def test_specular_and_index(tmp_path):
    file = GltfScene(name="paint")
    info = {"index": file.texture()}
    file.material["extensions"] = {
        "KHR_materials_ior": {"ior": 1.3},
        "KHR_materials_specular": {
            "specularFactor": 0.5,
            "specularTexture": info,
            "specularColorFactor": [0.1, 0.2, 0.3],
        },
    }
    scene, _ = load(tmp_path, file)
    paint = scene.materials["paint"]
    assert (paint.ior, paint.specular_color) == (1.3, (0.1, 0.2, 0.3))
    strength = scene.textures[paint.specular]
    assert (strength.channel, strength.scale) == ("alpha", 0.5)


# ---- images --------------------------------------------------------------------------------------


def test_images_in_views_and_uris_are_the_same(tmp_path):
    uri = "data:image/png;base64," + base64.b64encode(png()).decode()
    files = set()
    for image in (None, {"uri": uri}):
        file = GltfScene()
        file.material["emissiveFactor"] = [1, 1, 1]
        file.material["emissiveTexture"] = {"index": file.texture(image)}
        (one,) = load(tmp_path, file)[0].textures.values()
        files.add(one.file)
    (name,) = files
    assert name.startswith(str(tmp_path / "cache"))
    assert Path(name).read_bytes() == png()
    Path(name).write_bytes(b"another image")  # a cache is not trusted
    load(tmp_path, file)
    assert Path(name).read_bytes() == png()


@pytest.mark.parametrize("uri", ["../out.png", "/etc/passwd", "a/../../out.png", "%2e%2e/out.png"])
def test_images_are_in_the_folder(tmp_path, uri):
    (tmp_path / "in").mkdir()
    (tmp_path / "out.png").write_bytes(png())
    file = GltfScene()
    file.material["emissiveTexture"] = {"index": file.texture({"uri": uri})}
    (line,) = refused(tmp_path / "in", file)
    assert f"images[0] is '{uri}'; expected a file in its folder" in line
