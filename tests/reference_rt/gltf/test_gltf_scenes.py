"""Scenes of glTF against its specification, by formulas of its own, and against trimesh."""

import base64
import json
import math
import warnings
from contextlib import suppress

import numpy as np
import pytest
import trimesh
from gltf_scenes import TEXELS, GltfScene, full_scene, png
from mesh_writers import written
from PIL import Image

import reference_rt as rt
from reference_rt.cameras import orthographic, perspective
from reference_rt.core import transform
from reference_rt.core.vec3 import Vec3
from reference_rt.textures import At
from reference_rt.textures.lookup import lookup

HEIGHT, WIDTH = TEXELS.shape[:2]
LINEAR = np.where(
    TEXELS / 255 <= 0.04045, TEXELS / 255 / 12.92, ((TEXELS / 255 + 0.055) / 1.055) ** 2.4
)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path / "cache"))


def load(folder, file, form="glb", **options):
    """The scene, and what was said about it."""
    path = written(folder, getattr(file, form)(), f"model.{form}")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene = rt.Scene.load(path, **options)
    return scene, "\n".join(str(one.message) for one in said)


def refused(folder, file, **options):
    """The lines of the error."""
    with pytest.raises(rt.SceneError) as error:
        load(folder, file, **options)
    return [str(one) for one in (error.value, *error.value.others)]


# ---- shapes --------------------------------------------------------------------------------------


def placed(scene):
    """Every mesh of a scene with its map to the world, those of instances too."""
    for shape in scene.shapes:
        m = transform.affine(shape.transform)
        for mesh in scene.groups[shape.group] if shape.type == "instance" else (shape,):
            yield mesh, m


def by_us(scene):
    """(n, 3, 8): corners, unit normals and uv of all triangles, in the world."""
    found = []
    for mesh, m in placed(scene):
        normals = transform.apply_normals(m, mesh.normals)
        table = np.hstack([transform.apply_points(m, mesh.vertices), normals, mesh.uv])
        found.append(table[mesh.faces])
    return np.concatenate(found)


def by_trimesh(path):
    scene = trimesh.load(path, process=False, force="scene")
    found = []
    for name in scene.graph.nodes_geometry:
        m, geometry = scene.graph[name]
        mesh = scene.geometry[geometry]
        normals = mesh.vertex_normals @ np.linalg.inv(m[:3, :3])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        points = trimesh.transform_points(mesh.vertices, m)
        found.append(np.hstack([points, normals, mesh.visual.uv])[mesh.faces])
    return np.concatenate(found)


def test_shapes_against_trimesh(tmp_path):
    """Nested nodes, matrices, a mirrored one, and one mesh in several nodes, of two primitives."""
    rng = np.random.default_rng(3)
    file = GltfScene()
    file.material["pbrMetallicRoughness"] = {"baseColorTexture": {"index": file.texture()}}
    attributes = file.primitive["attributes"]
    attributes["NORMAL"] = file.add(np.float32(rng.normal(size=(4, 3))))
    other = {
        "POSITION": file.add(np.float32(rng.normal(size=(3, 3)))),
        "NORMAL": file.add(np.float32(rng.normal(size=(3, 3)))),
        "TEXCOORD_0": file.add(np.float32([[0, 0], [1, 0.2], [0, 0.8]])),
    }
    file.root["meshes"][0]["primitives"].append({"attributes": other, "material": 0})
    file.root["meshes"].append({"primitives": [{"attributes": other, "material": 0}]})
    turn = [0.5, 0.5, -0.5, 0.5]
    matrix = [*[2, 0, 0, 0], *[0.5, 1, 0, 0], *[0, 0, 3, 0], *[5, 6, 7, 1]]
    file.root["nodes"] = [
        {"translation": [1, 2, 3], "rotation": turn, "children": [1, 2]},
        {"mesh": 0, "scale": [-1, 2, 0.5], "children": [3]},
        {"mesh": 0, "matrix": matrix},
        {"mesh": 1, "translation": [0, 0, 4]},
    ]
    scene, _ = load(tmp_path, file)
    assert [shape.type for shape in scene.shapes] == ["instance", "mesh", "instance"]
    ours, theirs = by_us(scene), by_trimesh(tmp_path / "model.glb")
    apart = np.abs(ours[:, None] - theirs[None]).max(axis=(2, 3))
    assert sorted(apart.argmin(axis=1)) == [*range(len(theirs))]
    # trimesh keeps positions, of up to 20, and normals in float32.
    assert apart.min(axis=1).max() < 32 * 2.0**-24


def test_instancing(tmp_path):
    """Each copy's translation, rotation and scale, then the node's."""
    file = GltfScene()
    half = 0.5**0.5
    columns = {
        "TRANSLATION": file.add(np.float32([[1, 2, 3], [4, 5, 6]])),
        "ROTATION": file.add(np.float32([[0, 0, half, half], [0, 0, 0, 1]])),
        "SCALE": file.add(np.float32([[2, 1, 1], [1, 1, 1]])),
    }
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": columns}}
    file.root["nodes"][0] |= {"translation": [10, 0, 0], "extensions": extensions}
    scene, _ = load(tmp_path, file)
    maps = [m for _, m in placed(scene)]
    # The quarter turn, by float32 numbers, takes x to y and y to -x.
    first = [[0, -1, 0, 11], [2, 0, 0, 2], [0, 0, 1, 3]]
    assert np.allclose(maps[0], first, rtol=0, atol=4 * 2.0**-24)
    assert np.array_equal(maps[1], [[1, 0, 0, 14], [0, 1, 0, 5], [0, 0, 1, 6]])


def test_flat_nodes_and_what_is_no_surface(tmp_path):
    file = GltfScene()
    file.root["nodes"][0]["scale"] = [0, 1, 1]
    scene, said = load(tmp_path, file)
    assert scene.shapes == ()
    assert "nodes[0] is flat, by a scale of 0, and is left out" in said
    file = GltfScene()
    file.primitive["mode"] = 1
    line = "meshes[0].primitives[0] are points or lines; expected triangles"
    assert line in refused(tmp_path, file)[0]
    scene, said = load(tmp_path, file, allow_missing=True)
    assert f"{line}; left out" in said


# ---- cameras and lights --------------------------------------------------------------------------


TURN = [math.sin(0.3), 0.0, 0.0, math.cos(0.3)]
"""A rotation by 0.6 about x."""


def world_of(direction):
    c, s = math.cos(0.6), math.sin(0.6)
    x, y, z = direction
    return np.array([x, c * y - s * z, s * y + c * z])


@pytest.mark.parametrize("aspect", [2.0, None])
def test_perspective_rays(tmp_path, aspect):
    """Through the points that the specification's projection takes to the corners of the view."""
    file = GltfScene()
    view = {"yfov": 0.8, "znear": 0.25, "zfar": 7.0, **({"aspectRatio": aspect} if aspect else {})}
    file.root["cameras"] = [{"type": "perspective", "perspective": view}]
    file.node(camera=0, translation=[1, 2, 3], rotation=TURN)
    scene, _ = load(tmp_path, file)
    film = scene.film
    assert (film.width, film.height) == ((512, 256) if aspect else (512, 512))
    setup = scene.camera.setup(film.width, film.height)
    for x, y in ((0.0, 0.0), (1.0, 0.0), (0.3, 0.8)):
        ray = perspective.camera_ray(setup, x, y, (0.5, 0.5))
        # P[0][0] = 1 / (a tan(yfov / 2)), P[1][1] = 1 / tan(yfov / 2): x / w of a point is P x / -z
        slope = math.tan(0.4)
        wanted = world_of(((2 * x - 1) * slope * (aspect or 1.0), (1 - 2 * y) * slope, -1.0))
        assert np.allclose(ray.d, wanted / np.linalg.norm(wanted), rtol=0, atol=1e-14)
        # It begins at the near plane and ends at the far one.
        assert np.allclose(ray.o, [1, 2, 3] + 0.25 * wanted, rtol=0, atol=1e-14)
        end = np.array(ray.o) + ray.t_max * np.array(ray.d)
        assert np.allclose(end, [1, 2, 3] + 7.0 * wanted, rtol=0, atol=1e-13)


def test_orthographic_rays(tmp_path):
    scene, said = load(tmp_path, full_scene(), defaults={"camera": "flat"})
    assert "cameras" not in said
    assert (scene.film.width, scene.film.height) == (512, 256)
    setup = scene.camera.setup(512, 256)
    for x, y in ((0.0, 0.0), (0.75, 0.5)):
        ray = orthographic.camera_ray(setup, x, y, (0.5, 0.5))
        assert np.array_equal(ray.d, (0.0, 0.0, -1.0))
        assert np.allclose(ray.o, (4.0 * x - 2.0, 1.0 - 2.0 * y, 0.0), rtol=0, atol=1e-15)


def test_which_camera(tmp_path):
    first, said = load(tmp_path, full_scene())
    assert "has 2 cameras: the first is taken" in said
    assert first.camera.type == "perspective"
    second, _ = load(tmp_path, full_scene(), defaults={"camera": "1"})
    assert second.camera.type == "orthographic"
    (line,) = refused(tmp_path, full_scene(), defaults={"camera": "2"})
    assert 'there is no camera "2"; expected a number from 0, or one of: "", "flat"' in line
    (line,) = refused(tmp_path, full_scene(), defaults={"spp": "2"})
    assert "has no default 'spp'; expected camera, environment or scene" in line


def test_a_view_where_there_is_no_camera(tmp_path):
    """It sees all corners of the mesh."""
    file = GltfScene()
    file.root["nodes"][0] |= {"translation": [30, -20, 5], "scale": [4, 1, 1]}
    scene, said = load(tmp_path, file)
    assert "has no camera: the view is from the front" in said
    for x, y in ((26, -21), (34, -21), (26, -19), (34, -19)):
        seen = scene.camera.basis @ (np.array([x, y, 5.0]) - scene.camera.eye)
        assert np.max(np.abs(seen[:2] / seen[2])) < math.tan(math.radians(22.5))


def test_lights(tmp_path):
    file = GltfScene()
    cone = {"innerConeAngle": 0.2, "outerConeAngle": 0.5}
    for fields in ({"type": "directional"}, {"type": "point"}, {"type": "spot", "spot": cone}):
        node = file.light(color=[1, 0.5, 0.25], intensity=8.0, **fields)
        file.root["nodes"][node] |= {"translation": [1, 2, 3], "rotation": TURN, "scale": [2, 2, 2]}
    scene, said = load(tmp_path, file)
    sun, point, spot = scene.lights
    forward = world_of((0.0, 0.0, -1.0))
    assert np.allclose(sun.direction, forward, rtol=0, atol=1e-15)
    assert sun.irradiance == point.intensity == spot.intensity == (8.0, 4.0, 2.0)
    assert point.position == spot.origin == (1.0, 2.0, 3.0)
    assert np.allclose(np.subtract(spot.target, spot.origin), forward, rtol=0, atol=1e-15)
    assert math.radians(spot.beam_width) == pytest.approx(0.2, rel=1e-15)
    assert math.radians(spot.cutoff_angle) == pytest.approx(0.5, rel=1e-15)
    assert "linearly with the angle" in said


def test_environments(tmp_path):
    file = GltfScene()
    scene, said = load(tmp_path, file)
    assert scene.lights == (rt.Constant(radiance=1.0),)
    assert "the environment is 1 everywhere" in said
    assert load(tmp_path, file, defaults={"environment": "0"})[0].lights == ()
    named = load(tmp_path, file, defaults={"environment": str(tmp_path / "sky.hdr")})[0]
    assert named.lights == (rt.EnvironmentMap(file=str(tmp_path / "sky.hdr")),)
    assert [light.type for light in load(tmp_path, full_scene())[0].lights] == [
        "point",
        "directional",
        "spot",
    ]


# ---- materials -----------------------------------------------------------------------------------


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
    assert (tilt.scale, tilt.follow_v) == (0.5, True)
    assert scene.materials[sides.base].type == "gltf_pbr"
    assert "it emits from its front only" in said


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


def test_the_second_set_of_texture_coordinates(tmp_path):
    file = GltfScene()
    index = file.texture()
    second = np.float32([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]])
    file.primitive["attributes"]["TEXCOORD_1"] = file.add(second)
    info = {"index": index, "texCoord": 1}
    file.material["pbrMetallicRoughness"] = {"baseColorTexture": info}
    scene, _ = load(tmp_path, file)
    assert np.array_equal(scene.shapes[0].uv, second.astype(float) * (1, -1) + (0, 1))
    file.material["emissiveTexture"] = {"index": index}
    (line,) = refused(tmp_path, file)
    assert "materials[0] has textures by TEXCOORD_1 and TEXCOORD_0; expected one set" in line
    del file.primitive["attributes"]["TEXCOORD_1"], file.material["emissiveTexture"]
    scene, said = load(tmp_path, file)
    assert "has no TEXCOORD_1: its textures show one point" in said
    assert not scene.shapes[0].uv.any()


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
    assert np.array_equal(np.array(Image.open(name)), TEXELS)


@pytest.mark.parametrize("uri", ["../out.png", "/etc/passwd", "a/../../out.png", "%2e%2e/out.png"])
def test_images_are_in_the_folder(tmp_path, uri):
    (tmp_path / "in").mkdir()
    (tmp_path / "out.png").write_bytes(png())
    file = GltfScene()
    file.material["emissiveTexture"] = {"index": file.texture({"uri": uri})}
    (line,) = refused(tmp_path / "in", file)
    assert f"images[0] is '{uri}'; expected a file in its folder" in line


# ---- what is missing, and what is wrong ----------------------------------------------------------


def test_every_missing_part_has_a_line(tmp_path):
    file = GltfScene(alphaMode="BLEND")
    file.material["extensions"] = {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}
    file.material["pbrMetallicRoughness"] = {"baseColorFactor": [1, 1, 1, 0.5]}
    file.material["occlusionTexture"] = {"index": file.texture()}
    file.primitive["attributes"]["COLOR_0"] = file.add(np.full((4, 4), 99, np.uint8))
    file.primitive["targets"] = [{}]
    file.root |= {"animations": [{}], "skins": [{}]}
    file.root["nodes"][0]["skin"] = 0
    lines = refused(tmp_path, file)
    for line, part in zip(lines, ("KHR_materials_clearcoat", "opacities of vertices"), strict=True):
        assert part in line
        assert line.startswith(f"{tmp_path / 'model.glb'}: ")
    assert "--allow-missing" in lines[0]
    scene, said = load(tmp_path, file, allow_missing=True)
    assert scene.allows_missing
    for part in ("clearcoat", "opacities", "animations", "skins", "morph", "occlusion"):
        assert part in said
    file.root["extensionsRequired"] = ["KHR_materials_clearcoat"]
    (line,) = refused(tmp_path, file, allow_missing=True)
    assert 'requires the extension "KHR_materials_clearcoat", which is unknown; expected' in line


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["asset", "version"], "1.0", "asset.version: expected version 2.0 of glTF"),
        (["materials", 0, "alphaMode"], "GLASS", "materials[0].alphaMode: expected 'OPAQUE', "),
        (["materials", 0, "emissiveFactor"], [1, 0], "materials[0].emissiveFactor: expected at"),
        (["meshes", 0, "primitives"], [], "meshes[0].primitives: expected at least 1 item"),
        (["nodes", 0, "mesh"], 7, "there is no meshes[7]; expected one of 1"),
        (["meshes", 0, "primitives", 0, "material"], 3, "there is no materials[3]; expected"),
        (["nodes", 0, "camera"], 0, "there is no cameras[0]; expected one of 0"),
        (["nodes", 0, "scale"], [1, 2], "is malformed: a node's 'scale' is not 3 finite numbers"),
        (["accessors", 2, "count"], 99, "is malformed: accessors[2] reaches beyond its view"),
        (["nodes", 0, "children"], [0], "is malformed: nodes[0] has two parents"),
    ],
)
def test_wrong_files(tmp_path, path, value, message):
    file = GltfScene()
    file.root["asset"] = {"version": "2.0"}
    part = file.root
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    (line, *_) = refused(tmp_path, file)
    assert line.startswith(f"{tmp_path / 'model.glb'}: {message}")


def read_or_refused(folder, content, form):
    path = written(folder, content, f"damaged.{form}")
    with suppress(rt.SceneError):
        rt.Scene.load(path, allow_missing=True)
    path.unlink()


WRONG = (None, True, -1, 0, 1e308, "", "a", [], {}, [[]], [None], {"index": 0}, 10**30)


def parts_of(value, path=()):
    yield path
    if not isinstance(value, dict | list):
        return
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        yield from parts_of(inner, (*path, key))


@pytest.mark.parametrize("seed", [0, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore")
def test_any_part_of_any_type(tmp_path, seed):
    """Every value of the JSON replaced by every other kind; unless slow, some of them."""
    whole = json.loads(full_scene().gltf())
    changes = [(path, wrong) for path in parts_of(whole) if path for wrong in WRONG]
    if seed is not None:
        rng = np.random.default_rng(seed)
        changes = [changes[k] for k in rng.choice(len(changes), 150, replace=False)]
    for (*path, last), wrong in changes:
        copy = json.loads(json.dumps(whole))
        part = copy
        for key in path:
            part = part[key]
        part[last] = wrong
        read_or_refused(tmp_path, json.dumps(copy).encode(), "gltf")


@pytest.mark.parametrize("step", [23, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore")
def test_damaged_files(tmp_path, step):
    """Cut anywhere, and with any bit flipped; unless slow, every so many."""
    for form in ("gltf", "glb"):
        content = getattr(full_scene(), form)()
        for length in range(0, len(content), 4 * step):
            read_or_refused(tmp_path, content[:length], form)
        for bit in range(0, 8 * len(content), 13 * step):
            data = bytearray(content)
            data[bit // 8] ^= 1 << bit % 8
            read_or_refused(tmp_path, bytes(data), form)
