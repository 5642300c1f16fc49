"""The number of a triangle is the file's own, whatever the scene leaves out, and what is left out
is told."""

import numpy as np
import pytest
from builders import cube, write_obj
from command_line import invoke
from mesh_writers import FACES, FORMS, XYZ, Gltf, ascii_stl, binary_stl, ply

import reference_rt as rt
from reference_rt.cli.explain import explain

COUNT = 12
SIDE = 4


def grid(flat):
    """Vertices and faces of COUNT triangles side by side at z = 0, those in `flat` without area, of
    three kinds: a point, a line of two ends, a line of three points."""
    at = np.array([[k % SIDE, k // SIDE, 0.0] for k in range(COUNT)])
    corners = at[:, None] + np.array([[0.0, 0, 0], [0.5, 0, 0], [0, 0.5, 0]])
    for k in flat:
        corners[k] = at[k] + np.array([[[0, 0, 0]] * 3, [[0, 0, 0], [0.5, 0, 0], [0, 0, 0]],
                                       [[0, 0, 0], [0.25, 0, 0], [0.5, 0, 0]]][k % 3])  # fmt: skip
    return corners.reshape(-1, 3), np.arange(3 * COUNT).reshape(-1, 3)


PLACES = {
    "start": (0, 1, 2),
    "middle": (5, 6),
    "end": (COUNT - 1,),
    "everywhere": (0, 3, 4, 8, COUNT - 2, COUNT - 1),
    "none": (),
}


def _off(vertices, faces):
    lines = [f"OFF\n{len(vertices)} {len(faces)} 0"]
    lines += [" ".join(map(repr, v)) for v in vertices.tolist()]
    lines += ["3 " + " ".join(map(str, f)) for f in faces.tolist()]
    return "\n".join(lines).encode()


def _gltf(vertices, faces, form):
    file = Gltf()
    file.primitive["attributes"]["POSITION"] = file.add(vertices.astype("<f4"))
    file.primitive["indices"] = file.add(faces.astype("<u4").reshape(-1, 1))
    return getattr(file, form)()


WRITERS = {
    f"{form}.ply": lambda v, f, form=form: ply(
        form, ("vertex", XYZ, v.tolist()), ("face", FACES, [[face] for face in f.tolist()])
    )
    for form in FORMS
} | {
    "binary.stl": lambda v, f: binary_stl(v[f], attribute=0),
    "ascii.stl": lambda v, f: ascii_stl(v[f]).encode(),
    "mesh.off": _off,
    "mesh.glb": lambda v, f: _gltf(v, f, "glb"),
    "mesh.gltf": lambda v, f: _gltf(v, f, "gltf"),
}  # fmt: skip
SOURCES = ["memory", "mesh.obj", *WRITERS]


def mesh_of(source, vertices, faces, folder, **fields):
    if source == "memory":
        return rt.Mesh(vertices=vertices, faces=faces, **fields)
    if source == "mesh.obj":
        write_obj(folder / source, vertices, faces)
    else:
        (folder / source).write_bytes(WRITERS[source](vertices, faces))
    return rt.Mesh(file=source, **fields)


def placed(folder, *shapes, **parts):
    """A scene whose files are in `folder`."""
    scene = rt.Scene(shapes=shapes, **parts)
    return rt.Scene.parse(scene.to_json(), folder=folder)


def told(flat):
    return rf"{len(flat)} of {COUNT} triangles have no area, .*are left out"


def tables_of(scene, flat):
    if not flat:
        return scene.tables
    with pytest.warns(rt.SceneWarning, match=told(flat)):
        return scene.tables


@pytest.mark.parametrize("flat", PLACES.values(), ids=PLACES)
@pytest.mark.parametrize("source", SOURCES)
def test_every_reader(tmp_path, source, flat):
    """Also under a transform that mirrors: the order of the triangles stays."""
    mesh = mesh_of(source, *grid(flat), tmp_path, transform=[{"scale": [1, -2, 3]}])
    kept = np.setdiff1d(np.arange(COUNT), flat)
    triangles = tables_of(placed(tmp_path, mesh), flat).geometry.shapes.triangles
    order = np.argsort(triangles.face)  # the hierarchy has an order of its own
    assert np.array_equal(triangles.face[order], kept)
    lowest = triangles.vertices.reshape(-1, 3, 3)[order, 0]
    assert np.array_equal(lowest, np.column_stack([kept % SIDE, -2 * (kept // SIDE), 0 * kept]))


AIMED = np.array([[k % SIDE + 0.125, k // SIDE + 0.125, 5.0] for k in range(COUNT)])
DOWN = np.tile([0.0, 0.0, -1.0], (COUNT, 1))


def check_numbers(scene, flat):
    """Rays find the triangles' numbers in the mesh and in its copy, 10 above it."""
    for k, by in enumerate((0.0, 10.0)):
        hits = scene.intersect(AIMED + np.array([0, by, 0]), DOWN)
        expected = np.where(np.isin(np.arange(COUNT), flat), -1, np.arange(COUNT))
        assert hits.primitive.tolist() == expected.tolist()
        assert set(hits.shape[hits.shape >= 0]) == {k}


@pytest.mark.parametrize("hierarchy", ["auto", "none"])
def test_rays_find_the_number_of_the_file(tmp_path, hierarchy):
    flat = PLACES["everywhere"]
    vertices, faces = grid(flat)
    one = mesh_of("mesh.obj", vertices, faces, tmp_path)
    away = mesh_of("memory", vertices, faces, tmp_path, transform=[{"translate": [0, 10, 0]}])
    scene = placed(tmp_path, one, away, hierarchy=hierarchy)
    tables_of(scene, flat)
    check_numbers(scene, flat)


def test_in_groups(tmp_path):
    flat = PLACES["everywhere"]
    mesh = mesh_of("mesh.off", *grid(flat), tmp_path)
    copies = [rt.Instance(group="g", transform=[{"translate": [0, y, 0]}]) for y in (0, 10)]
    scene = placed(tmp_path, *copies, groups={"g": (rt.Sphere(center=(50, 0, 0)), mesh)})
    with pytest.warns(rt.SceneWarning, match=r"groups\.g\[1\]: mesh .*" + told(flat)):
        scene.tables  # noqa: B018
    check_numbers(scene, flat)


def test_in_solids(tmp_path):
    """A closed mesh stays closed with faces of two equal corners among its own."""
    vertices, faces = cube(1)
    with_flat = np.insert(faces, [0, 4, len(faces)], [[0, 0, 1], [2, 3, 3], [5, 5, 5]], axis=0)
    numbers = np.flatnonzero([len(set(f)) == 3 for f in with_flat.tolist()])
    mesh = mesh_of("memory", vertices, with_flat, tmp_path)
    whole = mesh_of("memory", vertices, faces, tmp_path)
    ball = rt.Sphere(center=(9, 9, 9), radius=0.5)
    solid, expected = rt.Scene(shapes=(mesh - ball,)), rt.Scene(shapes=(whole - ball,))
    with pytest.warns(rt.SceneWarning, match=r"^shapes\[0\]: the mesh: 3 of 15 triangles"):
        solid.tables  # noqa: B018
    rng = np.random.default_rng(5)
    d = rng.normal(size=(200, 3))
    found, truth = solid.intersect(-4.0 * d, d), expected.intersect(-4.0 * d, d)
    assert np.array_equal(found.t, truth.t)
    hit = np.isfinite(found.t)
    assert hit.mean() > 0.9
    assert np.array_equal(found.primitive[hit], numbers[truth.primitive[hit]])
    assert len(set(found.primitive[hit])) == len(faces)


def test_polygons_are_numbered_as_their_fans(tmp_path):
    """Triangles of polygons count in the order of the file, before any is left out."""
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0 0\nf 1 5 2 3 4\nf 1 2 3 4\n"
    (tmp_path / "mesh.obj").write_text(text)
    scene = placed(tmp_path, rt.Mesh(file="mesh.obj"))
    with pytest.warns(rt.SceneWarning, match="1 of 5 triangles have no area"):
        face = scene.tables.geometry.shapes.triangles.face
    assert sorted(face.tolist()) == [1, 2, 3, 4]


def test_explain_and_the_command_line_report(tmp_path):
    flat = PLACES["everywhere"]
    mesh_of("mesh.obj", *grid(flat), tmp_path)
    (tmp_path / "scene.yaml").write_text(
        "integrator: {type: ray_cast}\n"
        "shapes:\n  - {type: sphere}\n  - {type: mesh, file: mesh.obj}\n"
        "groups: {g: [{type: mesh, file: mesh.obj, smooth: true}]}\n"
    )
    scene = rt.Scene.load(tmp_path / "scene.yaml")
    used, left_out = explain(scene, tables_of(scene, flat))
    assert [what for what, why in left_out if f"6 of {COUNT} triangles" in why] == [
        "of shapes[1]",
        "of groups.g[0]",
    ]
    assert "smooth groups.g[0]" in dict(used)
    result = invoke("explain", tmp_path / "scene.yaml")
    assert result.exit_code == 0
    assert f"warning: {tmp_path}/scene.yaml:4: shapes[1]: mesh {tmp_path}/mesh.obj: 6 of " in (
        result.stderr
    )


def test_reported_once(tmp_path):
    """Not again for second tables, nor for those of a changed scene."""
    flat = PLACES["middle"]
    scene = placed(tmp_path, mesh_of("mesh.obj", *grid(flat), tmp_path))
    tables_of(scene, flat)
    rt.build_tables(scene)
    scene.changed(film=rt.Film(width=4)).tables  # noqa: B018


def test_nothing_is_reported_where_nothing_is_left_out(tmp_path):
    scene = placed(tmp_path, mesh_of("mesh.obj", *grid(()), tmp_path))
    used, left_out = explain(scene, scene.tables)
    assert not [what for what, _ in [*used, *left_out] if "shapes[0]" in what]


@pytest.mark.parametrize("count", [1, 2])
def test_ids_are_one_row_where_they_are_the_same_for_all(count):
    corners = np.eye(3) + np.arange(4)[:, None, None]
    faces = np.arange(12).reshape(4, 3)
    mesh = rt.Mesh(vertices=corners.reshape(-1, 3), faces=faces)
    scene = rt.Scene(shapes=(mesh,) * count)
    ids = scene.tables.geometry.shapes.triangles
    rows = [len(column) for column in (ids.owner, ids.material, ids.light, ids.face)]
    assert rows == [1 if count == 1 else 8, 1, 1, 4 * count]
    hits = scene.first_hits(np.full(3, 9.0), -np.ones(3))
    assert (hits.shape, hits.primitive) == (0, 3)
