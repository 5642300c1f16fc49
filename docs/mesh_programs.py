"""How programs write and read a mesh, and what of it is told: for measure_files.py."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def scalar_mitsuba() -> Any:
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    return mi


CORNERS = np.array([[0, 0, 0], [1.1, 0, 0], [1.2, 2.3, 0], [0.1, 2.4, 3.7]]) + 1.0 / 3.0
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
UV = np.array([[0.1, 0.2], [0.3, 0.4], [0.55, 0.65], [0.8, 0.95]])
COLOURS = np.array([[0.1, 0.2, 0.3], [0.9, 0.8, 0.7], [0.5, 0.05, 0.6], [1.0, 0.0, 0.35]])
NORMALS = np.array([[0.6, 0.8, 0.0], [0.0, 0.6, -0.8], [-0.8, 0.0, 0.6], [0.0, 0.0, 1.0]])

WITH_UV = "_uv"
"""End of the names of files that have texture coordinates in place of colours, where a writer has
one or the other."""

Mesh = dict[str, Any]
"""Of a mesh: positions, faces; normals, uv, colours (n, 3), from 0 to 1, where they are kept."""


def trimesh_write(path: Path) -> None:
    import trimesh

    mesh = trimesh.Trimesh(CORNERS, FACES, vertex_normals=NORMALS, process=False)
    if path.stem.endswith(WITH_UV):
        mesh.visual = trimesh.visual.TextureVisuals(UV)
        mesh.export(str(path))
        return
    mesh.visual.vertex_colors = np.round(255.0 * np.c_[COLOURS, np.ones(4)]).astype(np.uint8)
    mesh.export(str(path))


def trimesh_read(path: Path) -> Mesh:
    import trimesh

    mesh = trimesh.load(str(path), process=False, force="mesh")
    found: Mesh = {"positions": mesh.vertices, "faces": mesh.faces}
    if "vertex_normals" in mesh._cache.cache:
        found["normals"] = mesh.vertex_normals
    if mesh.visual.kind == "vertex":
        found["colours"] = np.asarray(mesh.visual.vertex_colors)[:, :3] / 255.0
    if mesh.visual.kind == "texture" and mesh.visual.uv is not None:
        found["uv"] = mesh.visual.uv
    return found


def meshio_write(path: Path) -> None:
    import meshio

    data = {"red": COLOURS[:, 0], "green": COLOURS[:, 1], "blue": COLOURS[:, 2]}
    if path.suffix == ".ply":
        bytes_ = {k: np.round(255 * v).astype(np.uint8) for k, v in data.items()}
        data = bytes_ | dict(zip(("nx", "ny", "nz"), NORMALS.T, strict=True))
        data |= dict(zip(("s", "t"), UV.T, strict=True))
    elif path.suffix == ".obj":
        data = {"obj:vn": NORMALS, "obj:vt": UV}
    meshio.Mesh(CORNERS, [("triangle", FACES)], point_data=data).write(str(path))


def meshio_read(path: Path) -> Mesh:
    import meshio

    mesh = meshio.read(str(path))
    data = mesh.point_data
    found: Mesh = {"positions": mesh.points, "faces": mesh.cells_dict["triangle"]}
    if "red" in data:
        found["colours"] = np.stack([data[k] for k in ("red", "green", "blue")], -1) / 255.0
    if "nx" in data:
        found["normals"] = np.stack([data[k] for k in ("nx", "ny", "nz")], -1)
    for u, v in (("s", "t"), ("u", "v")):
        if u in data:
            found["uv"] = np.stack([data[u], data[v]], -1)
    if "obj:vt" in data:
        found["uv"] = data["obj:vt"]
    if "obj:vn" in data:
        found["normals"] = data["obj:vn"]
    return found


def open3d_write(path: Path) -> None:
    import open3d

    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(CORNERS), open3d.utility.Vector3iVector(FACES)
    )
    mesh.vertex_normals = open3d.utility.Vector3dVector(NORMALS)
    mesh.vertex_colors = open3d.utility.Vector3dVector(COLOURS)
    if path.suffix == ".stl":
        mesh.compute_triangle_normals()
    if not open3d.io.write_triangle_mesh(str(path), mesh):
        raise OSError("refused")


def open3d_read(path: Path) -> Mesh:
    import open3d

    mesh = open3d.io.read_triangle_mesh(str(path))
    if not len(mesh.vertices):
        raise OSError("nothing")
    found: Mesh = {"positions": np.asarray(mesh.vertices), "faces": np.asarray(mesh.triangles)}
    if mesh.has_vertex_normals():
        found["normals"] = np.asarray(mesh.vertex_normals)
    if mesh.has_vertex_colors():
        found["colours"] = np.asarray(mesh.vertex_colors)
    if mesh.has_triangle_uvs():
        found["uv"] = np.asarray(mesh.triangle_uvs)
    return found


def lib3mf_write(path: Path) -> None:
    import lib3mf

    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    mesh = model.AddMeshObject()
    vertices, triangles = [], []
    for p in CORNERS:
        vertex = lib3mf.Position()
        for k in range(3):
            vertex.Coordinates[k] = p[k]
        vertices.append(vertex)
    for face in FACES:
        triangle = lib3mf.Triangle()
        for k in range(3):
            triangle.Indices[k] = int(face[k])
        triangles.append(triangle)
    mesh.SetGeometry(vertices, triangles)
    model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
    model.QueryWriter("3mf" if path.suffix == ".3mf" else "stl").WriteToFile(str(path))


def lib3mf_read(path: Path) -> Mesh:
    import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    model.QueryReader("3mf" if path.suffix == ".3mf" else "stl").ReadFromFile(str(path))
    objects = model.GetMeshObjects()
    objects.MoveNext()
    mesh = objects.GetCurrentMeshObject()
    positions = [[*p.Coordinates] for p in mesh.GetVertices()]
    faces = [[*t.Indices] for t in mesh.GetTriangleIndices()]
    return {"positions": np.array(positions), "faces": np.array(faces)}


def assimp_read(path: Path) -> Mesh:
    import assimp_py

    flags = assimp_py.Process_Triangulate
    scene = assimp_py.import_file(str(path), flags)  # which owns the memory of what follows
    (mesh,) = scene.meshes
    positions = np.array(mesh.vertices, float).reshape(-1, 3)
    found: Mesh = {"positions": positions, "faces": np.array(mesh.indices).reshape(-1, 3)}
    if mesh.normals:
        found["normals"] = np.array(mesh.normals, float).reshape(-1, 3)
    if mesh.texcoords:
        found["uv"] = np.array(mesh.texcoords[0], float).reshape(len(positions), -1)[:, :2]
    if mesh.colors:
        found["colours"] = np.array(mesh.colors[0], float).reshape(len(positions), -1)[:, :3]
    return found


def usd_write(path: Path) -> None:
    from pxr import Sdf, Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    mesh = UsdGeom.Mesh.Define(stage, "/mesh")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(CORNERS.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(FACES))
    mesh.CreateFaceVertexIndicesAttr(FACES.ravel().tolist())
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(NORMALS.astype(np.float32)))
    mesh.SetNormalsInterpolation("vertex")
    primvars = UsdGeom.PrimvarsAPI(mesh)
    types = Sdf.ValueTypeNames
    uv = primvars.CreatePrimvar("st", types.TexCoord2fArray, "vertex")
    uv.Set(Vt.Vec2fArray.FromNumpy(UV.astype(np.float32)))
    colours = primvars.CreatePrimvar("displayColor", types.Color3fArray, "vertex")
    colours.Set(Vt.Vec3fArray.FromNumpy(COLOURS.astype(np.float32)))
    stage.Save()


def usd_read(path: Path) -> Mesh:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    (mesh,) = (UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    found: Mesh = {
        "positions": np.array(mesh.GetPointsAttr().Get()),
        "faces": np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3),
    }
    if (normals := mesh.GetNormalsAttr().Get()) is not None:
        found["normals"] = np.array(normals)
    for name, key in (("st", "uv"), ("displayColor", "colours")):
        if values := UsdGeom.PrimvarsAPI(mesh).GetPrimvar(name).Get():
            found[key] = np.array(values)
    return found


def blender_mesh_read(path: Path) -> Mesh:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.suffix == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=False)
    else:
        bpy.ops.wm.usd_import(filepath=str(path))
    (thing,) = (one for one in bpy.context.scene.objects if one.type == "MESH")
    mesh = thing.data
    world = np.array(thing.matrix_world)
    positions = np.array([v.co[:] for v in mesh.vertices]) @ world[:3, :3].T + world[:3, 3]
    found: Mesh = {
        "positions": positions,
        "faces": np.array([p.vertices[:] for p in mesh.polygons]),
    }
    corners = [k for polygon in mesh.polygons for k in polygon.loop_indices]
    found["normals"] = np.array([mesh.corner_normals[k].vector[:] for k in corners])
    if mesh.uv_layers:
        found["uv"] = np.array([mesh.uv_layers[0].uv[k].vector[:] for k in corners])
    for layer in mesh.color_attributes[:1]:
        ends = (
            corners if layer.domain == "CORNER" else [mesh.loops[k].vertex_index for k in corners]
        )
        found["colours"] = np.array([layer.data[k].color[:3] for k in ends])
    return found


def mitsuba_mesh_read(path: Path) -> Mesh:
    mi = scalar_mitsuba()
    mesh = mi.load_dict({"type": path.suffix[1:], "filename": str(path)})
    values = mi.traverse(mesh)

    def column(name: str, width: int) -> Array:
        return np.array(values[name]).reshape(-1, width)

    found: Mesh = {"positions": column("vertex_positions", 3), "faces": column("faces", 3)}
    if mesh.has_vertex_normals():
        found["normals"] = column("vertex_normals", 3)
    if mesh.has_vertex_texcoords():
        found["uv"] = column("vertex_texcoords", 2)
    if "vertex_color" in values:
        found["colours"] = column("vertex_color", 3)
    return found


def ours_mesh_read(path: Path) -> Mesh:
    import reference_rt as rt

    data = rt.Mesh(file=str(path)).data(Path())
    named = {"positions": data.vertices, "faces": data.faces, "normals": data.normals}
    named |= {"uv": data.uv, "colours": data.colours}
    return {key: value for key, value in named.items() if value is not None}


MESH_PROGRAMS: dict[str, tuple[str, Callable[[Path], None] | None, Callable[[Path], Mesh]]] = {
    "ours": ("reference_rt", None, ours_mesh_read),
    "Mitsuba": ("mitsuba", None, mitsuba_mesh_read),
    "trimesh": ("trimesh", trimesh_write, trimesh_read),
    "meshio": ("meshio", meshio_write, meshio_read),
    "Open3D": ("open3d", open3d_write, open3d_read),
    "lib3mf": ("lib3mf", lib3mf_write, lib3mf_read),
    "assimp": ("assimp_py", None, assimp_read),
    "usd-core": ("pxr", usd_write, usd_read),
    "Blender": ("bpy", None, blender_mesh_read),
}
MESH_FORMATS = {
    ".ply": ".ply",
    ".obj": ".obj",
    ".stl": ".stl",
    ".glb": ".glb",
    ".glb with texture coordinates": ".glb",
    ".3mf": ".3mf",
    ".usda": ".usda",
}
"""Suffixes of tables."""


def told_of_mesh(read: Mesh) -> str:
    """What of each corner of each triangle is there, and its greatest error."""
    positions, faces = np.asarray(read["positions"], float), np.asarray(read["faces"])
    if faces.shape != FACES.shape:
        return f"{len(faces)} triangles"
    notes = [_error(positions[faces], CORNERS[FACES], "positions")]
    for name, known in (("normals", NORMALS), ("uv", UV), ("colours", COLOURS)):
        if name in read:
            found = np.asarray(read[name], float)
            of_corners = found.reshape(4, 3, -1) if len(found) == 12 else found[faces]
            notes.append(_error(of_corners, known[FACES], name))
    return "; ".join(notes)


def _error(found: Array, known: Array, name: str) -> str:
    error = float(np.abs(found - known).max())
    if error == 0.0:
        return f"{name} exact"
    if name in ("positions", "normals") and error > 1e-3:
        # Which axes are turned to where, and by what factor.
        by = np.linalg.lstsq(known.reshape(-1, 3), found.reshape(-1, 3), rcond=None)[0].T
        # Blender keeps normals with 4 digits.
        if np.abs(known @ by.T - found).max() < 3e-4:
            return f"{name} times {(np.round(by, 2) + 0.0).tolist()}"
    if error < 1.5e-7 * max(1.0, float(np.abs(known).max())):
        return f"{name} float32"
    if name == "colours":
        decoded = np.where(known > 0.04045, ((known + 0.055) / 1.055) ** 2.4, known / 12.92)
        for note, of in (("8 bits", known), ("8 bits, decoded from sRGB", decoded)):
            # Half a step, times the curve's steepest slope.
            if np.abs(found - of).max() <= (0.5 / 255.0 + 1e-6) * (2.3 if of is decoded else 1.0):
                return f"{name} {note}"
        if np.abs(found * 255.0 - known).max() < 0.5 or np.abs(found / 255.0 - known).max() < 0.01:
            return f"{name} in another unit: 255 is 1"
    if name == "uv" and np.abs(found - (known * [1, -1] + [0, 1])).max() < 1e-5:
        return "uv with v turned"
    return f"{name} {error:.1g}"
