"""Shapes, cameras and lights of glTF against its specification, by formulas of its own, and against
trimesh."""

import math

import numpy as np
import pytest
import trimesh
from gltf_scenes import GltfScene, full_scene, load, refused

import reference_rt as rt
from reference_rt.cameras import orthographic, perspective
from reference_rt.core import transform

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


@pytest.mark.parametrize(("strength", "lights"), [(1.0, ["constant"]), (1.5, [])])
def test_bright_lamps_are_lights(tmp_path, strength, lights):
    """Of models that are meant to be lit from outside, some parts emit, too."""
    extensions = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    file = GltfScene(emissiveFactor=[1, 0, 0], extensions=extensions)
    assert [light.type for light in load(tmp_path, file)[0].lights] == lights


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
