"""Textures of glTF by any of a mesh's sets of texture coordinates: each texel that a surface shows
against the specification's formulas, on numbers of NumPy that no reader of ours has seen."""

import math

import numpy as np
import pytest
from gltf_scenes import GltfScene, load, png, refused

from reference_rt.accel.geometry import tangents
from reference_rt.core.ray import Hit, Ray
from reference_rt.core.vec3 import Vec3
from reference_rt.integrators.shading import texture_place
from reference_rt.shapes import TRIANGLE
from reference_rt.textures.lookup import lookup

RNG = np.random.default_rng(12)
TEXELS = RNG.integers(1, 256, (7, 5, 4), dtype=np.uint8)
HEIGHT, WIDTH = TEXELS.shape[:2]
CODES = TEXELS / 255.0
LINEAR = np.where(CODES <= 0.04045, CODES / 12.92, ((CODES + 0.055) / 1.055) ** 2.4)
POINTS = RNG.normal(size=(9, 3)).astype("<f4")
FACES = np.array([[0, 1, 2], [3, 2, 1], [6, 4, 8], [5, 7, 0]])
SETS = RNG.uniform(-1.0, 2.0, (4, 9, 2)).astype("<f4")
"""TEXCOORD_0 to 3, which have nothing to do with each other."""
TURNED = {"offset": [0.25, 0.5], "rotation": 0.3, "scale": [2.0, -3.0]}

SLOTS = {
    "base": "baseColorTexture",
    "rough": "metallicRoughnessTexture",
    "specular": "specularTexture",
    "tint": "specularColorTexture",
    "emission": "emissiveTexture",
    "normal": "normalTexture",
}
"""The textures of a material that we read."""


def scene_of(infos, coordinates=SETS, indexed=True, faces=FACES, **material):
    """A file whose material has textures by these numbers of sets; `infos`, by the names of SLOTS:
    a set, or fields of glTF's."""
    file = GltfScene(name="paint", emissiveFactor=[1, 1, 1], **material)
    index = file.texture({"bufferView": file.view(png(TEXELS)), "mimeType": "image/png"})
    base, specular, attributes = {}, {}, {}
    for name, info in infos.items():
        fields = {"index": index, **({"texCoord": info} if isinstance(info, int) else info)}
        part = {"base": base, "rough": base, "specular": specular, "tint": specular}
        part.get(name, file.material)[SLOTS[name]] = fields
    file.material["pbrMetallicRoughness"] = base
    file.material.setdefault("extensions", {})["KHR_materials_specular"] = specular
    order = np.arange(9) if indexed else faces.ravel()
    attributes["POSITION"] = file.add(POINTS[order])
    for n, rows in enumerate(coordinates):
        if rows is not None:
            more = {} if rows.dtype.kind == "f" else {"normalized": True}
            attributes[f"TEXCOORD_{n}"] = file.add(rows[order], **more)
    file.primitive["attributes"] = attributes
    file.primitive.pop("indices")
    if indexed:
        file.primitive["indices"] = file.add(faces.astype("<u2").reshape(-1, 1))
    return file


def hits(scene):
    """Each triangle at some points: its number, the barycentrics and what a kernel is given."""
    geometry = scene.tables.geometry
    for row in range(len(geometry.shapes.triangles.corners)):
        face = int(geometry.shapes.triangles.face[row])
        for b, c in RNG.dirichlet((1.0, 1.0, 1.0), 4)[:, :2].tolist():
            yield face, np.array([1.0 - b - c, b, c]), Hit(1.0, TRIANGLE, row, b, c, -1)


RAY = Ray(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.0), math.inf)


def shown(scene, name, hit):
    """What a texture shows at a hit."""
    at = texture_place(scene.tables.textures, scene.tables.geometry, RAY, hit)
    return np.array(lookup([*scene.textures].index(name), at))


def texel(image, rows, face, weights, transform=None):
    """The texel that the specification means: v counts from the top of the image."""
    u, v = weights @ np.asarray(rows, np.float64)[FACES[face]]
    if transform is not None:
        (a, b), (du, dv), turn = (transform[key] for key in ("scale", "offset", "rotation"))
        c, s = math.cos(turn), math.sin(turn)
        u, v = c * a * u + s * b * v + du, c * b * v - s * a * u + dv
    return image[math.floor(v * HEIGHT) % HEIGHT, math.floor(u * WIDTH) % WIDTH]


def parts_of(scene):
    """By the names of SLOTS: our texture's name, and the image of which it shows texels."""
    layers, name = {}, "paint"
    while name is not None:
        layers[scene.materials[name].type] = scene.materials[name]
        name = getattr(scene.materials[name], "base", None)
    leaf = layers["gltf_pbr"]
    found = {"base": (leaf.base_color, LINEAR), "rough": (leaf.roughness, CODES[..., 1:2])}
    found |= {"specular": (leaf.specular, CODES[..., 3:]), "tint": (leaf.specular_color, LINEAR)}
    found["emission"] = layers["emissive"].radiance, LINEAR
    if "normal_map" in layers:
        found["normal"] = layers["normal_map"].normals, CODES
    return found


def check(scene, sets, coordinates=SETS, transforms=None, slots=SLOTS):
    """Whether each texture shows what the coordinates of its set say; sets: by the slots' names."""
    parts = parts_of(scene)
    for face, weights, hit in hits(scene):
        for slot in slots:
            if slot in sets:
                name, image = parts[slot]
                moved = (transforms or {}).get(slot)
                expected = texel(image, coordinates[sets[slot]], face, weights, moved)[:3]
                found = shown(scene, name, hit)
                assert np.allclose(found, expected, rtol=1e-14, atol=0.0), (slot, face)


@pytest.mark.parametrize("slot", SLOTS)
@pytest.mark.parametrize("uv_set", range(4))
@pytest.mark.parametrize("way", ["plain", "moved", "overridden"])
def test_every_slot_by_every_set(tmp_path, slot, uv_set, way):
    """The others have set 1; `KHR_texture_transform` may name another set than the texture does."""
    sets = dict.fromkeys(SLOTS, 1) | {slot: uv_set}
    infos = dict(sets)
    if way != "plain":
        moved = {"extensions": {"KHR_texture_transform": dict(TURNED)}, "texCoord": uv_set}
        if way == "overridden":
            moved["extensions"]["KHR_texture_transform"]["texCoord"] = uv_set
            moved["texCoord"] = 3 - uv_set
        infos[slot] = moved
    scene, said = load(tmp_path, scene_of(infos))
    assert "one point" not in said
    assert len(scene.shapes) == 1
    check(scene, sets, transforms={slot: TURNED} if way != "plain" else None)


@pytest.mark.parametrize("seed", range(12))
def test_any_sets_together(tmp_path, seed):
    """Indexed or not, of any mixture of sets, of which a file may have some only."""
    rng = np.random.default_rng(seed)
    sets = {slot: int(rng.integers(4)) for slot in SLOTS if rng.random() < 0.8}
    file = scene_of(sets, indexed=bool(seed % 2), alphaMode="MASK", alphaCutoff=0.5)
    scene, _ = load(tmp_path, file, form="glb" if seed % 3 else "gltf")
    masked = "base" in sets  # and so is emission
    check(scene, sets, slots=[slot for slot in SLOTS if not (masked and slot == "emission")])
    used = [*dict.fromkeys(sets.values())]
    more = scene.shapes[0].more_uv
    assert (0 if more is None else more.shape[1] // 2) == max(0, len(used) - 1)
    if {"base", "emission"} <= sets.keys():
        (mask,) = (m for m in scene.materials.values() if m.type == "mask")
        for face, weights, hit in hits(scene):
            alpha = texel(CODES, SETS[sets["base"]], face, weights)[3]
            assert np.all(shown(scene, mask.opacity, hit) == float(alpha >= 0.5))
            radiance = texel(LINEAR, SETS[sets["emission"]], face, weights)[:3] * (alpha >= 0.5)
            radiant = next(m for m in scene.materials.values() if m.type == "emissive").radiance
            assert np.allclose(shown(scene, radiant, hit), radiance, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("kind", ["u1", "u2", "i1", "i2"])
@pytest.mark.parametrize("quantised", ["normalised", "whole"])
def test_quantised_coordinates(tmp_path, kind, quantised):
    """Fractions of the largest integer; by KHR_mesh_quantization they may be whole numbers."""
    most = np.iinfo(kind).max
    second = RNG.integers(0, most, (9, 2), dtype=kind, endpoint=True)
    sets = {"base": 0, "emission": 1}
    file = scene_of(sets, (SETS[0], second))
    file.root["extensionsUsed"] = ["KHR_mesh_quantization"]
    values = second / most
    if quantised == "whole":
        number = file.primitive["attributes"]["TEXCOORD_1"]
        del file.accessors[number]["normalized"]
        values = second / 1.0
    scene, _ = load(tmp_path, file)
    mesh = scene.shapes[0]
    assert np.array_equal(mesh.uv, SETS[0].astype(float) * [1, -1] + [0, 1])
    assert np.array_equal(mesh.more_uv, values * [1, -1] + [0, 1])


def test_tangents_are_those_of_the_normal_maps_set(tmp_path):
    scene, _ = load(tmp_path, scene_of({"base": 0, "normal": 2, "emission": 1}))
    for face, _, hit in hits(scene):
        p, (u, v) = POINTS[FACES[face]].astype(float), SETS[2][FACES[face]].astype(float).T
        v = 1.0 - v
        edges = np.array([[u[1] - u[0], v[1] - v[0]], [u[2] - u[0], v[2] - v[0]]])
        along = np.linalg.solve(edges, np.array([p[1] - p[0], p[2] - p[0]]))
        found = tangents(scene.tables.geometry, RAY, hit)
        assert np.allclose([tuple(found.dpdu), tuple(found.dpdv)], along, rtol=1e-9)


def test_sets_that_a_primitive_lacks(tmp_path):
    """Its other textures are right."""
    scene, said = load(tmp_path, scene_of({"base": 1, "emission": 2}, (None, SETS[1])))
    assert "meshes[0].primitives[0] has no TEXCOORD_2: its textures show one point" in said
    check(scene, {"base": 1}, (None, SETS[1]))
    assert not scene.shapes[0].more_uv.any()
    scene, said = load(tmp_path, scene_of({"base": 1, "emission": 2}, (None, None, SETS[2])))
    assert "has no TEXCOORD_1" in said
    check(scene, {"emission": 2}, SETS)
    assert not scene.shapes[0].uv.any()


def test_one_material_on_primitives_with_other_sets(tmp_path):
    """Each has its own coordinates for the same textures."""
    file = scene_of({"base": 2, "emission": 0})
    other = dict(file.primitive["attributes"])
    other["TEXCOORD_0"], other["TEXCOORD_2"] = other["TEXCOORD_1"], other["TEXCOORD_3"]
    file.root["meshes"][0]["primitives"].append({**file.primitive, "attributes": other})
    scene, _ = load(tmp_path, file)
    first, second = scene.shapes
    assert first.material == second.material
    for shape, (base, emission) in ((first, (2, 0)), (second, (3, 1))):
        for found, n in ((shape.uv, base), (shape.more_uv, emission)):
            assert np.array_equal(found, SETS[n].astype(float) * [1, -1] + [0, 1])


def test_other_lengths_are_errors(tmp_path):
    file = scene_of({"base": 0, "emission": 1}, (SETS[0], SETS[1]))
    file.accessors[file.primitive["attributes"]["TEXCOORD_1"]]["count"] = 8
    (line,) = refused(tmp_path, file)
    assert "the attributes of a primitive have different lengths" in line


def test_an_occlusion_texture_needs_no_set(tmp_path):
    """Shapes occlude; its coordinates are no more than a lightmap's."""
    file = scene_of({"base": 0}, occlusionTexture={"index": 0, "texCoord": 1})
    scene, said = load(tmp_path, file)
    assert "occlusion textures are ignored" in said
    assert scene.shapes[0].more_uv is None


def test_by_trimesh(tmp_path):
    """The coordinates of set 0 as another reader has them."""
    trimesh = pytest.importorskip("trimesh")
    scene, _ = load(tmp_path, scene_of({"base": 1, "emission": 0}))
    theirs = trimesh.load(tmp_path / "model.glb", process=False, force="mesh")
    # It takes v from 1 in float32.
    assert np.allclose(scene.shapes[0].more_uv, theirs.visual.uv, rtol=0.0, atol=2.0**-23)
