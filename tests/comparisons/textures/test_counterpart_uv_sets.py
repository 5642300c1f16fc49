"""Several sets of texture coordinates: in Mitsuba, by second readers, and as other formats."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_scenes import GltfScene, png
from PIL import Image

from comparisons.cycles.translate import write as write_cycles
from comparisons.gltf import write_gltf
from comparisons.mitsuba.context import UntranslatableError
from comparisons.mitsuba.files import write_scene
from comparisons.pbrt import write_pbrt
from comparisons.renderers import NoCounterpartError
from comparisons.rungs import direct, layers
from comparisons.rungs.files import files
from comparisons.rungs.layers import seen
from comparisons.shapes import site
from comparisons.textures import translate
from comparisons.translator import load
from comparisons.translator.writing import write_xml
from reference_rt.gltf import surfaces
from reference_rt.gltf.document import TextureInfo
from reference_rt.integrators import RayCast
from reference_rt.materials import Diffuse
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.shapes.meshes.files import gltf, ply
from reference_rt.util.errors import SceneError

Patch = pytest.MonkeyPatch

RNG = np.random.default_rng(31)
CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]]
SETS = RNG.uniform(0.0, 2.0, (3, 4, 2))
MESH = {
    "type": "mesh",
    "material": "m",
    "vertices": CORNERS,
    "faces": [[0, 1, 2], [0, 2, 3]],
    "uv": SETS[0].tolist(),
    "more_uv": np.hstack(SETS[1:]).tolist(),
}
SCENE: dict[str, Any] = {
    "film": {"width": 16, "height": 16},
    "camera": {"type": "perspective", "eye": [0.5, -1.2, 1.6], "target": [0.5, 0.5, 0], "fov": 50},
    "textures": {
        "a": {"type": "checker", "first": 0.9, "second": 0.25},
        "b": {"type": "bitmap", "file": "t.png", "uv_set": 1, "uv": {"scale": 2, "rotate": 20}},
        "c": {"type": "bitmap", "file": "t.png", "uv_set": 2, "channel": "red"},
        "p": {"type": "product", "of": ["a", "b"], "factor": 0.9},
    },
    "materials": {
        "m": {"type": "gltf_pbr", "base_color": "p", "metallic": 0.25, "roughness": "c"},
        "l": {"type": "emissive", "radiance": "b", "base": "m"},
    },
    "shapes": [
        MESH,
        {**MESH, "transform": [{"scale": [1, -1, 1]}, {"translate": [0.4, 0.2, -0.6]}]},
        {**MESH, "material": "l", "transform": [{"scale": 0.5}, {"translate": [0.2, 0.3, 0.9]}]},
    ],
    "lights": [{"type": "point", "position": [0, -1, 2], "intensity": 8}],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    texels = np.random.default_rng(1).integers(20, 256, (6, 5, 3), dtype=np.uint8)
    Image.fromarray(texels).save(tmp_path / "t.png")
    return tmp_path


@pytest.fixture
def scene(folder: Path) -> Scene:
    return Scene.parse(json.dumps(SCENE), folder=folder)


def test_mitsuba_sees_the_same(scene: Scene, monkeypatch: Patch) -> None:
    """Lit surfaces and a lamp by textures of all sets; and not if it takes another one."""
    tables = build_tables(scene)
    right = direct(scene, tables, load(scene))
    assert right.status == "agree", right.reason
    monkeypatch.setattr(translate, "uv_attribute", lambda uv_set: f"vertex_uv_{3 - uv_set}")
    assert direct(scene, tables, load(scene)).status == "differ"


def test_the_albedo_of_each_set(scene: Scene, monkeypatch: Patch) -> None:
    """The colours that the layers are held against."""
    cast = scene.changed(
        integrator=RayCast(show="colour"),
        materials=scene.materials | {"m": Diffuse(reflectance="b"), "l": Diffuse(reflectance="c")},
        sampler=None,
    )
    tables, counterpart, films = build_tables(cast), load(cast), (cast.film, cast.film)
    right = layers(cast, tables, counterpart, films)
    assert right.status == "agree", right.reason
    monkeypatch.setattr(seen, "_coordinates", lambda looked, uv_set: looked.uv)
    assert layers(cast, tables, counterpart, films).status == "differ"


@pytest.mark.parametrize("attribute", ["more_uv", "colours"])
def test_many_copies_of_attributes_are_refused(
    attribute: str, folder: Path, monkeypatch: Patch
) -> None:
    """They would be instances, of which Mitsuba interpolates attributes at the wrong place."""
    mesh = {key: MESH[key] for key in ("type", "vertices", "faces", "uv", "material")}
    mesh[attribute] = [[0.1, 0.2, 0.3, 0.4], [0.5] * 4, [0.6] * 4, [0.7] * 4]
    if attribute == "colours":
        mesh["colours"] = [row[:3] for row in mesh["colours"]]
    places: list[Any] = [[{"translate": [k, 0, 0]}] for k in range(2)]
    copies = [{"type": "instance", "group": "g", "transform": place} for place in places]
    if attribute == "colours":
        mesh["material"] = None
    many = Scene.parse(
        json.dumps({**SCENE, "shapes": copies, "groups": {"g": [mesh]}}), folder=folder
    )
    load(many)
    monkeypatch.setattr(site, "MOST_TRIANGLES", 3)
    with pytest.raises(UntranslatableError, match="in a group with 2 copies"):
        load(many)


# ---- second readers ------------------------------------------------------------------------------


def model(path: Path) -> Scene:
    """A file whose material has textures by four sets, one of them by a transform's number."""
    file = GltfScene(name="paint", emissiveFactor=[1, 1, 1])
    index = file.texture({"bufferView": file.view(png()), "mimeType": "image/png"})
    for n in range(3):
        rows = RNG.uniform(-1, 2, (4, 2)).astype("<f4")
        file.primitive["attributes"][f"TEXCOORD_{n}"] = file.add(rows)
    fourth = RNG.integers(0, 65535, (4, 2), dtype="u2", endpoint=True)
    file.primitive["attributes"]["TEXCOORD_3"] = file.add(fourth, normalized=True)
    moved = {"KHR_texture_transform": {"scale": [2, 3], "texCoord": 2}}
    file.material["pbrMetallicRoughness"] = {
        "baseColorTexture": {"index": index, "texCoord": 3},
        "metallicRoughnessTexture": {"index": index, "texCoord": 1, "extensions": moved},
    }
    file.material |= {"normalTexture": {"index": index, "texCoord": 1}}
    file.material |= {"emissiveTexture": {"index": index}}
    path.write_bytes(file.glb() if path.suffix == ".glb" else file.gltf())
    return Scene.load(path)


def _override_ignored(patch: Patch) -> None:
    patch.setattr(TextureInfo, "uv_set", property(lambda self: self.tex_coord))


def _always_the_first(patch: Patch) -> None:
    right = surfaces.Surfaces.bitmap

    def bitmap(self: Any, info: Any, **fields: Any) -> Any:
        return right(self, info, **{**fields, "uv_set": 0})

    patch.setattr(surfaces.Surfaces, "bitmap", bitmap)


def _upside_down(patch: Patch) -> None:
    patch.setattr(gltf, "_from_below", lambda uv: np.asarray(uv, np.float64))


def _exchanged(patch: Patch) -> None:
    right = gltf.GltfFile.primitive

    def primitive(self: Any, part: Any, uv_sets: Any = (0,)) -> Any:
        return right(self, part, (*uv_sets[:-2], uv_sets[-1], *uv_sets[-2:-1]))

    patch.setattr(gltf.GltfFile, "primitive", primitive)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("form", ["glb", "gltf"])
@pytest.mark.parametrize(
    "fault", [_override_ignored, _always_the_first, _upside_down, _exchanged, None]
)
def test_the_files_rung_reads_sets_of_gltf_itself(
    fault: Callable[[Patch], None] | None, form: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    if fault is not None:
        fault(monkeypatch)
    found = files(model(tmp_path / f"model.{form}"))
    assert found.status == ("agree" if fault is None else "differ"), found.reason
    if fault is not None:
        assert "coordinates" in found.reason
        assert "'paint'" in found.reason


@pytest.mark.parametrize("fault", [False, True])
def test_the_files_rung_reads_sets_of_ply(
    fault: bool, scene: Scene, tmp_path: Path, monkeypatch: Patch
) -> None:
    write_scene(scene, tmp_path / "out.yaml")
    if fault:
        monkeypatch.setattr(ply, "_further_uv", lambda table: ("v1", "u1", "u2", "v2"))
    found = files(Scene.load(tmp_path / "out.yaml"))
    assert found.status == ("differ" if fault else "agree"), found.reason
    if fault:
        assert "has the uv of further sets" in found.reason


# ---- other formats -------------------------------------------------------------------------------


def test_our_own_files_keep_every_bit(scene: Scene, tmp_path: Path) -> None:
    for name in ("one.yaml", "other.json"):
        write_scene(scene, tmp_path / name)
        written = Scene.load(tmp_path / name)
        assert all(shape.file is not None for shape in written.shapes)
        again, right = build_tables(written).textures, build_tables(scene).textures
        assert np.array_equal(again.sets.corners, right.sets.corners)
        assert np.array_equal(again.sets.number, right.sets.number)


@pytest.mark.filterwarnings("ignore")
def test_as_gltf_and_back(scene: Scene, tmp_path: Path) -> None:
    """The coordinates of each image are those of its set under its map."""
    simple = scene.changed(
        materials={"m": scene.materials["m"].model_copy(update={"base_color": "b"})},
        shapes=scene.shapes[:1],
    )
    write_gltf(simple, tmp_path / "out.glb")
    again = Scene.load(tmp_path / "out.glb")
    (mesh,), material = again.shapes, again.materials["m"]
    m = simple.textures["b"].uv.coefficients().reshape(2, 3)
    expected = {"base_color": SETS[1] @ m[:, :2].T + m[:, 2], "roughness": SETS[2]}
    for field, uv in expected.items():
        texture = again.textures[getattr(material, field)]
        k = texture.uv_set
        found = mesh.uv if k == 0 else mesh.more_uv[:, 2 * k - 2 : 2 * k]
        corners = np.ravel(MESH["faces"])
        in_order = np.asarray(found)[np.ravel(mesh.faces)]
        # glTF has float32, and v from the other side.
        assert np.allclose(in_order, uv[corners], rtol=0.0, atol=8.0 * 2.0**-23)
    assert {texture.uv_set for texture in again.textures.values()} == {0, 1}


def test_formats_without_sets_say_so(scene: Scene, tmp_path: Path) -> None:
    said = "uv_set: 1"
    simple = scene.changed(
        textures={"b": scene.textures["b"]},
        materials={"m": Diffuse(reflectance="b")},
        shapes=scene.shapes[:1],
    )
    for write, name in ((write_xml, "out.xml"), (write_pbrt, "out.pbrt")):
        with pytest.raises(SceneError, match=said):
            write(simple, tmp_path / name)
        assert not (tmp_path / name).exists()
    with pytest.raises(NoCounterpartError, match=said):
        write_cycles(simple, tmp_path / "cycles")
