"""What is written as glTF, read by trimesh, and rendered here from the file alone."""

import io
import json
import math
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from builders import SCENES
from command_line import invoke
from PIL import Image

import reference_rt as rt
from comparisons.gltf import write_gltf
from comparisons.gltf.surfaces import Surfaces
from reference_rt.core.transform import Matrix, Rotate, Scale, Translate
from reference_rt.rendering import query
from reference_rt.textures.image_file import linear

FLAT = Rotate.model_validate({"rotate": {"axis": (1, 0, 0), "degrees": -90}})


def at(x: float, y: float, z: float) -> Translate:
    return Translate(translate=(x, y, z))


SHEAR = Matrix(matrix=((0.5, 0.3, 0, 2.2), (0, 0.6, 0, 0.5), (0.1, 0, 0.5, -1.0)))
MIRROR = Matrix(matrix=((-0.5, 0, 0, -2.3), (0, 0.7, 0, 0.6), (0, 0, 0.4, -1.0)))


@pytest.fixture
def scene(tmp_path: Path) -> rt.Scene:
    """One of everything whose picture by `direct` is known from the file, without shadows."""
    rng = np.random.default_rng(4)
    Image.fromarray(rng.integers(0, 256, (5, 7, 3), np.uint8)).save(tmp_path / "colours.png")
    tilted = np.concatenate([rng.integers(90, 166, (4, 4, 2)), np.full((4, 4, 1), 240)], axis=2)
    Image.fromarray(tilted.astype(np.uint8)).save(tmp_path / "normals.png")
    turned = {"scale": (3.0, 2.0), "rotate": 20.0, "offset": (0.1, 0.3)}
    bitmap = {"type": "bitmap", "uv": turned}
    corners = np.array([[-1.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [-1, 1, 0.4]])
    mesh = rt.Mesh(
        vertices=corners + np.array([0.0, 0.1, -2.0]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        colours=rng.uniform(0.0, 1.0, (4, 3)),
        material="painted",
    )
    data = {
        "camera": {"type": "perspective", "eye": [0.3, 2, 5], "target": [0, 0.3, 0], "fov": 50},
        "film": {"width": 32, "height": 20},
        "integrator": {"type": "direct"},
        "sampler": {"type": "grid"},
        "textures": {
            "squares": {"type": "checker", "first": 1, "second": [0, 1, 0], "uv": turned},
            "smooth": {**bitmap, "file": "colours.png", "wrap": "mirror"},
            "nearest": {**bitmap, "file": "colours.png", "filter": "nearest", "scale": 0.5},
            "tilted": {"type": "bitmap", "file": "normals.png", "encoding": "raw"},
            "vertices": {"type": "vertex_colours", "scale": 0.5},
        },
        "materials": {
            "floor": {"type": "diffuse", "reflectance": "squares"},
            "smooth": {"type": "diffuse", "reflectance": "smooth"},
            "nearest": {"type": "diffuse", "reflectance": "nearest"},
            "rough": {"type": "normal_map", "base": "white", "normals": "tilted"},
            "white": {"type": "diffuse", "reflectance": [0.9, 0.8, 0.7]},
            "painted": {"type": "diffuse", "reflectance": "vertices"},
        },
        "lights": [
            {"type": "point", "position": [1, 4, 3], "intensity": [20, 30, 10]},
            {"type": "directional", "direction": [-0.2, -1, -0.7], "irradiance": [1, 2, 3]},
        ],
    }
    (tmp_path / "scene.json").write_text(json.dumps(data))
    found = rt.Scene.load(tmp_path / "scene.json")
    group = rt.Rectangle(material="rough"), rt.Box(material="smooth", transform=(at(0, 0, -1.5),))
    return found.changed(
        groups={"pair": group},
        shapes=(
            rt.Rectangle(material="floor", transform=(Scale(scale=(4, 4, 4)), FLAT)),
            rt.Rectangle(material="nearest", transform=(Scale(scale=(0.5,) * 3), at(-1, 0.5, 1))),
            rt.Rectangle(material="rough", transform=(Scale(scale=(0.5,) * 3), at(0.6, 0.6, 1))),
            mesh,
            rt.Instance(group="pair", transform=(SHEAR,)),
            rt.Instance(group="pair", transform=(MIRROR,)),
        ),
    )


class File:
    """A .glb file: its JSON, its arrays, and the triangles of its nodes in the world."""

    def __init__(self, content: bytes) -> None:
        size = struct.unpack_from("<I", content, 12)[0]
        self.json = json.loads(content[20 : 20 + size])
        self.data = content[28 + size :]

    def view(self, number: int) -> bytes:
        view = self.json["bufferViews"][number]
        return self.data[view["byteOffset"] :][: view["byteLength"]]

    def array(self, number: int) -> np.ndarray:
        accessor = self.json["accessors"][number]
        kind = {5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        found = np.frombuffer(self.view(accessor["bufferView"]), kind)
        assert accessor["type"] == "SCALAR" or found.size % accessor["count"] == 0
        return found.reshape(accessor["count"], -1).astype(np.float64)

    def matrix(self, node: dict[str, Any]) -> np.ndarray:
        return np.array(node.get("matrix", np.eye(4).ravel())).reshape(4, 4).T

    def primitives(self) -> list[SimpleNamespace]:
        found = []
        for node in self.json["nodes"]:
            for part in self.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ():
                m = self.matrix(node)
                faces = self.array(part["indices"]).astype(int).reshape(-1, 3)
                faces = faces[:, ::-1] if np.linalg.det(m[:3, :3]) < 0.0 else faces
                of = {key: self.array(k) for key, k in part["attributes"].items()}
                p = of["POSITION"] @ m[:3, :3].T + m[:3, 3]
                material = self.json["materials"][part["material"]]
                found.append(SimpleNamespace(p=p, faces=faces, of=of, m=m[:3, :3], look=material))
        return found

    def lookup(self, which: dict[str, int], uv: np.ndarray, srgb: bool) -> np.ndarray:
        """A texture at (u, v) as the specification says: v runs down."""
        texture = self.json["textures"][which["index"]]
        sampler = self.json["samplers"][texture["sampler"]]
        source = self.json["images"][texture["source"]]
        texels = np.asarray(Image.open(io.BytesIO(self.view(source["bufferView"])))) / 255.0
        texels = linear(texels) if srgb else texels
        height, width = texels.shape[:2]

        def texel(x: int, y: int) -> np.ndarray:
            place = []
            for i, n, key in ((y, height, "wrapT"), (x, width, "wrapS")):
                mirrored = min(i % (2 * n), 2 * n - 1 - i % (2 * n))
                wraps = {10497: i % n, 33071: min(max(i, 0), n - 1), 33648: mirrored}
                place.append(wraps[sampler[key]])
            return texels[tuple(place)]

        x, y = uv[0] * width, uv[1] * height
        if sampler["magFilter"] == 9728:
            return texel(math.floor(x), math.floor(y))
        x, y = x - 0.5, y - 0.5
        i, j = math.floor(x), math.floor(y)
        rows = [texel(i, k) * (i + 1 - x) + texel(i + 1, k) * (x - i) for k in (j, j + 1)]
        return rows[0] * (j + 1 - y) + rows[1] * (y - j)

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """The eye, and the directions (height, width, 3) through the centres of pixels."""
        node = next(node for node in self.json["nodes"] if "camera" in node)
        camera, m = self.json["cameras"][node["camera"]], self.matrix(node)
        size = camera["extras"]
        tall = math.tan(0.5 * camera["perspective"]["yfov"])
        y, x = np.mgrid[: size["height"], : size["width"]] + 0.5
        x = (2.0 * x / size["width"] - 1.0) * tall * camera["perspective"]["aspectRatio"]
        y = (1.0 - 2.0 * y / size["height"]) * tall
        return m[:3, 3], np.stack([x, y, -np.ones_like(x)], axis=-1) @ m[:3, :3].T

    def radiance(self, eye: np.ndarray, d: np.ndarray, parts: list[SimpleNamespace]) -> np.ndarray:
        """Lambert's law at the first hit, under the file's lights."""
        best = closest(eye, d, parts)
        if best is None:
            return np.zeros(3)
        t, part, k, weights = best
        at = {key: weights @ values[part.faces[k]] for key, values in part.of.items()}
        a, b, c = part.p[part.faces[k]]
        n = np.cross(b - a, c - a)
        if "NORMAL" in at:
            n = np.linalg.solve(part.m.T, at["NORMAL"])
        n /= np.linalg.norm(n)
        pbr = part.look["pbrMetallicRoughness"]
        assert part.look["extensions"] == {"KHR_materials_specular": {"specularFactor": 0.0}}
        colour = np.array(pbr["baseColorFactor"][:3]) * at.get("COLOR_0", 1.0)
        for key, which in (("base", pbr.get("baseColorTexture")), ("n", look_of(part))):
            if which is None:
                continue
            found = self.lookup(which, at[f"TEXCOORD_{which['texCoord']}"], key == "base")
            if key == "base":
                colour = colour * found[:3]
                continue
            s = part.m @ at["TANGENT"][:3]
            s = s - n * (n @ s)
            s /= np.linalg.norm(s)
            x, y, z = (2.0 * found - 1.0) * [which["scale"], which["scale"], 1.0]
            n = x * s + y * np.cross(n, s) * at["TANGENT"][3] + z * n
            n /= np.linalg.norm(n)
        point, total = eye + t * d, np.zeros(3)
        for node in self.json["nodes"]:
            if (held := node.get("extensions")) is None:
                continue
            light = self.json["extensions"]["KHR_lights_punctual"]["lights"][
                held["KHR_lights_punctual"]["light"]
            ]
            m = self.matrix(node)
            w, falloff, distance = m[:3, 2], 1.0, math.inf
            if light["type"] == "point":
                w = m[:3, 3] - point
                distance = np.linalg.norm(w)
                w, falloff = w / distance, 1.0 / distance**2
            between = closest(point + 1e-6 * w, w, parts)
            if between is not None and between[0] < distance:
                continue
            power = light["intensity"] * np.array(light["color"])
            total += power * falloff * max(0.0, float(n @ w))
        return np.asarray(colour * total / math.pi)


def closest(o: np.ndarray, d: np.ndarray, parts: list[SimpleNamespace]) -> tuple[Any, ...] | None:
    """The distance, primitive, triangle and barycentric coordinates of the first hit."""
    best: tuple[Any, ...] | None = None
    for part in parts:
        a, b, c = (part.p[part.faces[:, k]] for k in range(3))
        e, f, away = b - a, c - a, o - a
        across = np.cross(d, f)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / np.sum(e * across, axis=1)
            u = np.sum(away * across, axis=1) * scale
            v = (np.cross(away, e) @ d) * scale
            t = np.sum(np.cross(away, e) * f, axis=1) * scale
            t = np.where((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0), t, math.inf)
        k = int(np.argmin(t))
        if t[k] < (math.inf if best is None else best[0]):
            best = t[k], part, k, np.array([1.0 - u[k] - v[k], u[k], v[k]])
    return best


def look_of(part: SimpleNamespace) -> dict[str, int] | None:
    return part.look.get("normalTexture")  # type: ignore[no-any-return]


@pytest.mark.parametrize("follow_v", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_picture_of_the_file_is_ours(scene: rt.Scene, tmp_path: Path, follow_v: bool) -> None:
    """Camera, triangles, instances (mirrored, sheared), textures and their maps, vertex colours,
    normal maps, lights."""
    if follow_v:
        scene = following_v(scene)
    write_gltf(scene, tmp_path / "out.glb")
    file = File((tmp_path / "out.glb").read_bytes())
    for node in file.json["nodes"]:  # as the specification demands: no shear
        gram = file.matrix(node)[:3, :3].T @ file.matrix(node)[:3, :3]
        assert np.allclose(gram, np.diag(np.diag(gram)), atol=1e-12)
    eye, directions = file.rays()
    parts = file.primitives()
    found = np.array([[file.radiance(eye, d, parts) for d in row] for row in directions])
    expected = rt.render(scene).colour
    assert expected.any(axis=2).mean() > 0.5
    # Vertices, normals and coordinates are float32: relative errors of 6e-8, a dozen in a product.
    wrong = np.abs(found - expected).max(axis=2) > 2e-6 * expected.max()
    assert not wrong.any()


def following_v(scene: rt.Scene) -> rt.Scene:
    rough = scene.materials["rough"].model_copy(update={"follow_v": True, "scale": 0.7})
    return scene.changed(materials=dict(scene.materials) | {"rough": rough})


def test_the_file_is_read_as_our_scene(scene: rt.Scene, tmp_path: Path) -> None:
    scene = following_v(scene)
    write_gltf(scene, tmp_path / "out.glb")
    read = rt.Scene.load(tmp_path / "out.glb")
    film = {"film": scene.film, "integrator": scene.integrator, "sampler": scene.sampler}
    expected = rt.render(scene).colour
    error = np.abs(rt.render(read.changed(**film)).colour - expected).max()
    assert error <= 2e-6 * expected.max()  # as above


def test_its_own_material_is_read_as_it_was(tmp_path: Path) -> None:
    """Colours with a factor, a mask with a cutoff, and numbers from two channels of one image."""
    rng = np.random.default_rng(1)
    Image.fromarray(rng.integers(0, 256, (8, 8, 4), np.uint8)).save(tmp_path / "a.png")
    uv = {"uv": {"scale": 1.7, "offset": -0.3}, "wrap": ["clamp", "mirror"]}
    image = {"type": "bitmap", "file": "a.png", **uv}
    numbers = {"base_color": "product", "roughness": "green", "metallic": "blue"}
    data = {
        "film": {"width": 24, "height": 16},
        "camera": {"type": "perspective", "eye": [0, 0, 4], "target": [0, 0, 0]},
        "textures": {
            "colours": image,
            "alpha": {**image, "channel": "alpha", "cutoff": 0.6},
            "green": {**image, "channel": "green", "encoding": "raw"},
            "blue": {**image, "channel": "blue", "encoding": "raw"},
            "product": {"type": "product", "of": ["colours"], "factor": [0.5, 1, 0.25]},
        },
        "materials": {
            "b": {"type": "gltf_pbr", **numbers},
            "t": {"type": "two_sided", "base": "b"},
            "m": {"type": "mask", "base": "t", "opacity": "alpha"},
        },
        "shapes": [
            {"type": "rectangle", "material": "m"},
            {"type": "rectangle", "material": "b", "transform": [{"translate": [0.2, 0.1, -1]}]},
        ],
        "lights": [{"type": "point", "position": [1, 2, 3], "intensity": [20, 30, 40]}],
    }
    (tmp_path / "scene.json").write_text(json.dumps(data))
    scene = rt.Scene.load(tmp_path / "scene.json")
    write_gltf(scene, tmp_path / "out.glb")
    read = rt.Scene.load(tmp_path / "out.glb")
    fixed = {"film": scene.film, "integrator": rt.Direct(), "sampler": rt.Grid()}
    found, expected = (rt.render(one.changed(**fixed)).colour for one in (read, scene))
    assert expected.any(axis=2).mean() > 0.1
    assert np.abs(found - expected).max() <= 2e-6 * expected.max()  # as above


def test_trimesh_reads_the_same_triangles(scene: rt.Scene, tmp_path: Path) -> None:
    """From both kinds of files, the second one written over itself."""
    areas = []
    for name in ("out.glb", "out.gltf", "out.gltf"):
        count, _ = write_gltf(scene, tmp_path / name)
        assert count == (name != "out.glb")
        loaded = trimesh.load_scene(tmp_path / name).to_mesh()
        assert len(loaded.faces) == 4 * 2 + 2 * (2 + 12)
        areas.append(np.sort(loaded.area_faces))
    parts = File((tmp_path / "out.glb").read_bytes()).primitives()
    corners = np.concatenate([part.p[part.faces] for part in parts])
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for found in areas:
        assert np.allclose(found, np.sort(0.5 * np.linalg.norm(own, axis=1)), rtol=1e-5)


MATERIALS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "mirror": ({"reflectance": 0.5}, {"baseColorFactor": [0.5] * 3 + [1], "roughnessFactor": 0.0}),
    "rough_conductor": (
        {"eta": 1, "k": 2, "alpha": 0.09},  # k² / (4 + k²)
        {"baseColorFactor": [0.5] * 3 + [1], "roughnessFactor": 0.3, "metallicFactor": 1.0},
    ),
    "rough_dielectric": (
        {"interior_ior": 1.3, "alpha": 0.25},
        {
            "roughnessFactor": 0.5,
            "metallicFactor": 0.0,
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_ior": {"ior": 1.3},
        },
    ),
    "plastic": ({"reflectance": 0.2}, {"baseColorFactor": [0.2] * 3 + [1], "metallicFactor": 0.0}),
    "principled": (
        {"base_colour": 0.3, "metallic": 0.2, "roughness": 0.7, "eta": 0.5},
        {"metallicFactor": 0.2, "roughnessFactor": 0.7, "KHR_materials_ior": {"ior": 2.0}},
    ),
    "phong": ({"diffuse": 0.1, "specular": 0.2}, {"baseColorFactor": [math.pi / 10] * 3 + [1]}),
    "emissive": (
        {"radiance": [4, 2, 0]},
        {
            "baseColorFactor": [0, 0, 0, 1],
            "emissiveFactor": [1.0, 0.5, 0.0],
            "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
        },
    ),
    "mask": (
        {"base": "b", "opacity": 0.3},
        {"alphaMode": "BLEND", "baseColorFactor": [1] * 3 + [0.3]},
    ),
    "two_sided": ({"base": "b"}, {"doubleSided": True, "metallicFactor": 0.0}),
}


@pytest.mark.parametrize("kind", MATERIALS)
def test_materials(kind: str, tmp_path: Path) -> None:
    fields, expected = MATERIALS[kind]
    data = {"b": {"type": "diffuse", "reflectance": 1}, "m": {"type": kind, **fields}}
    shape = {"type": "rectangle", "material": "m"}
    text = json.dumps({"materials": data, "shapes": [shape]})
    write_gltf(rt.Scene.parse(text), tmp_path / "m.glb")
    file = File((tmp_path / "m.glb").read_bytes())
    (look,) = file.json["materials"]
    extensions = look.get("extensions", {})
    assert file.json.get("extensionsUsed", []) == sorted(extensions)
    found = look | look["pbrMetallicRoughness"] | extensions
    for key, value in expected.items():
        assert found[key] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-15))


def test_gltf_pbr_is_written_as_it_is(tmp_path: Path) -> None:
    """Its textures of numbers share an image."""
    values = {"base_color": "product", "metallic": "grey", "roughness": 0.25, "ior": 1.4}
    values |= {"specular": 0.5, "specular_color": (1.0, 0.5, 1.0)}
    material = rt.GltfPbr(**values)
    product = rt.Product(of=("vertices",), factor=(0.1, 0.2, 0.3))
    textures = {"grey": rt.Checker(first=(0.2,) * 3, second=(1.0,) * 3), "product": product}
    textures["vertices"] = rt.VertexColours()
    surfaces = Surfaces(SimpleNamespace(materials={"m": material}, textures=textures))
    assert surfaces.surface("m").colours == rt.VertexColours()
    (look,) = surfaces.lists["materials"]
    pbr = look["pbrMetallicRoughness"]
    assert pbr["baseColorFactor"] == [0.1, 0.2, 0.3, 1.0]
    assert (pbr["metallicFactor"], pbr["roughnessFactor"]) == (1.0, 0.25)
    strength = {"specularFactor": 0.5, "specularColorFactor": [1.0, 0.5, 1.0]}
    more = {"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_specular": strength}
    assert look["extensions"] == more
    (image,) = surfaces.lists["images"]
    view = surfaces.lists["bufferViews"][image["bufferView"]]
    content = bytes(surfaces.data)[view["byteOffset"] :][: view["byteLength"]]
    codes = np.asarray(Image.open(io.BytesIO(content)))
    assert codes[..., 2].tolist() == [[255, 51], [51, 255]]
    assert (codes[..., 1] == 255).all()
    assert not surfaces.reasons


def test_cameras(tmp_path: Path) -> None:
    """A pinhole's picture is upside down; an orthographic view may be off its axis."""
    film = rt.Film(width=8, height=4)
    cameras = rt.Pinhole(eye=(1, 2, 3)), rt.Orthographic(eye=(1, 2, 3), view=(0.0, 4.0, -1.0, 1.0))
    for camera in cameras:
        scene = rt.Scene(camera=camera, film=film, shapes=(rt.Rectangle(),))
        write_gltf(scene, tmp_path / "c.glb")
        file = File((tmp_path / "c.glb").read_bytes())
        node = next(node for node in file.json["nodes"] if "camera" in node)
        m, seen = file.matrix(node)[:3], file.json["cameras"][0]
        o, d, *_ = query.camera_rays(scene, (0, 0), (-0.5, -0.5))
        if seen["type"] == "perspective":
            tall = math.tan(0.5 * seen["perspective"]["yfov"])
            corner = m[:, :3] @ [-tall * seen["perspective"]["aspectRatio"], tall, -1.0]
            assert np.allclose(corner / np.linalg.norm(corner), d, atol=1e-12)
        else:
            size = seen["orthographic"]
            corner = m @ [-size["xmag"], size["ymag"], 0.0, 1.0]
            assert np.allclose(corner, o, atol=1e-12)
            assert np.allclose(-m[:, 2], d, atol=1e-12)


def test_what_gltf_cannot_say(tmp_path: Path) -> None:
    """All reasons, and no file; what is left out is noted."""
    path = tmp_path / "out.glb"
    ball = rt.Sphere()
    scene = rt.Scene(
        camera=rt.Perspective(view=(0.0, 1.0, -1.0, 1.0)),
        shapes=(rt.Union(of=(ball, ball)), rt.Plane(), rt.Rectangle()),
        lights=(rt.Projector(origin=(0, 3, 1), target=(0, 0, 0), irradiance=(1, 1, 1)),),
    )
    with pytest.raises(rt.SceneError) as caught:
        write_gltf(scene, path)
    said = [str(error) for error in (caught.value, *caught.value.others)]
    for part in ("a solid (CSG)", "an infinite plane", "a view off the axis", "light 'projector'"):
        assert sum(part in line for line in said) == 1, said
    assert not path.exists()
    sky = rt.Constant(radiance=(1, 1, 1))
    _, notes = write_gltf(rt.Scene(shapes=(rt.Rectangle(),), lights=(sky,)), path)
    for part in ("environment", "from behind", "near clipping plane", "float32", "8 bits"):
        assert sum(part in note for note in notes) == (part not in ("float32", "8 bits")), notes


@pytest.mark.parametrize(
    "arguments", [["-o", "s.glb"], ["--to", "json", "--float32", "-o", "s.json"]]
)
def test_command(arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = invoke("convert", SCENES / "cornell_box.yaml", *arguments)
    assert result.exit_code == 0, result.output
    if "--float32" in arguments:
        document = json.loads(Path("s.json").read_text())
        content = Path(document["meshes"][0]["file"]).read_bytes()
        assert b"property float x" in content
        assert b"double" not in content
        assert len(trimesh.load(document["meshes"][0]["file"]).faces) == 2
    else:
        assert "note: numbers are float32" in result.output
        assert File(Path("s.glb").read_bytes()).json["asset"]["version"] == "2.0"


def test_float32_is_of_json(tmp_path: Path) -> None:
    output = tmp_path / "s.glb"
    result = invoke("convert", SCENES / "cornell_box.yaml", "--float32", "-o", output)
    assert result.exit_code == 2
    assert "--float32: is of --to json" in result.output
    assert not output.exists()
