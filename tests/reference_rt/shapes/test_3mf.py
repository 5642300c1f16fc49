""".3mf files: what lib3mf, the library of the format's consortium, writes; parts of an archive; and
one line for what is wrong."""

import io
import zipfile

import numpy as np
import pytest
from builders import cube
from mesh_writers import check, corners, expect_one_line, written

from reference_rt.shapes.meshes.files import read_mesh, threemf

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
MILLIMETRES = {
    "MicroMeter": 0.001,
    "MilliMeter": 1.0,
    "CentiMeter": 10.0,
    "Inch": 25.4,
    "Foot": 304.8,
    "Meter": 1000.0,
}
VERTICES, FACES = cube(1)
TURN = np.array([[0.0, 2, 0], [-1, 0, 0], [0, 0, 3], [5, 6, 7]])
"""Of rows on its left, as the format has transforms; the last row moves."""
MOVE = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-9, 0, 4]])


def by_rows(points, place):
    return points @ place[:3] + place[3]


@pytest.mark.parametrize("unit", MILLIMETRES)
def test_units_items_and_components(tmp_path, unit):
    """Two items of a mesh, and one of an object that has it twice, within another such object."""
    lib3mf = pytest.importorskip("lib3mf")
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(getattr(lib3mf.ModelUnit, unit))
    mesh = model.AddMeshObject()
    for point in VERTICES.tolist():
        position = lib3mf.Position()
        position.Coordinates[:] = point
        mesh.AddVertex(position)
    for face in FACES.tolist():
        triangle = lib3mf.Triangle()
        triangle.Indices[:] = face
        mesh.AddTriangle(triangle)

    def place(rows):
        made = lib3mf.Transform()
        for k, row in enumerate(rows.tolist()):
            made.Fields[k][:] = row
        return made

    pair = model.AddComponentsObject()
    pair.AddComponent(mesh, place(TURN))
    pair.AddComponent(mesh, place(MOVE))
    outer = model.AddComponentsObject()
    outer.AddComponent(pair, place(MOVE))
    model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
    model.AddBuildItem(mesh, place(TURN))
    model.AddBuildItem(outer, place(TURN))
    path = tmp_path / "a.3mf"
    model.QueryWriter("3mf").WriteToFile(str(path))
    found = read_mesh(path)
    check(found)
    points = [
        VERTICES,
        by_rows(VERTICES, TURN),
        by_rows(by_rows(by_rows(VERTICES, TURN), MOVE), TURN),
        by_rows(by_rows(by_rows(VERTICES, MOVE), MOVE), TURN),
    ]
    expected = MILLIMETRES[unit] * np.concatenate([p[FACES] for p in points])
    # The points are those of the file, the maps products and sums of a few small integers.
    assert np.abs(corners(found) - expected).max() <= 2.0**-48 * np.abs(expected).max()
    assert found.ignored == ()


def mesh_text(vertices=VERTICES, faces=FACES):
    points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in vertices.tolist())
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in faces.tolist())
    return f"<mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh>"


def model_text(resources, build="", attributes=""):
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><model xmlns="{CORE}" xmlns:p="{PRODUCTION}" '
        f"{attributes}><resources>{resources}</resources><build>{build}</build></model>"
    )


ITEM = '<item objectid="1"/>'
OBJECT = f'<object id="1" type="model">{mesh_text()}</object>'


def archive(folder, parts, name="a.3mf"):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as made:
        for part, text in parts.items():
            made.writestr(part, text)
    return written(folder, stream.getvalue(), name)


def test_parts_of_an_archive(tmp_path):
    """The model that the relationships name, and objects of the same number in another part."""
    other = model_text(
        f'<object id="1">{mesh_text(VERTICES + 10.0)}</object>'
        '<object id="2"><components><component objectid="1"/></components></object>'
    )
    root = model_text(
        f'{OBJECT}<object id="2"><components><component objectid="1"/>'
        '<component p:path="/3D/Other/part.MODEL" objectid="2"/></components></object>',
        '<item objectid="2"/><item objectid="1" p:path="/3D/Other/part.model"/>',
        'requiredextensions="p"',
    )
    relationships = (
        '<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/'
        'relationships"><Relationship Id="a" Type="http://schemas.openxmlformats.org/package/2006/'
        'relationships/metadata/thumbnail" Target="/t.png"/><Relationship Id="b" Type="http://'
        'schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/first.model"/>'
        "</Relationships>"
    )
    parts = {"_rels/.rels": relationships, "3D/Other/part.model": other, "3D/first.model": root}
    parts["3D/3dmodel.model"] = model_text(OBJECT)  # which nothing names
    found = read_mesh(archive(tmp_path, parts))
    far = (VERTICES + 10.0)[FACES]
    assert np.array_equal(corners(found), np.concatenate([VERTICES[FACES], far, far]))


def test_what_is_ignored_is_named(tmp_path):
    text = model_text(
        f'<basematerials id="9"><base name="a" displaycolor="#FF0000"/></basematerials>{OBJECT}'
        '<object id="3">'
        + mesh_text().replace("<triangle ", '<triangle pid="9" p1="0" ', 1)
        + "</object>",
        ITEM,
    )
    found = read_mesh(archive(tmp_path, {"3D/3dmodel.model": text}))
    assert found.ignored == ("basematerials", "pid of triangles (materials)")
    assert np.array_equal(corners(found), VERTICES[FACES])


def nested(count, uses):
    """Objects of which each has the one before it so many times."""
    return OBJECT + "".join(
        f'<object id="{k}"><components>'
        + f'<component objectid="{k - 1}"/>' * uses
        + "</components></object>"
        for k in range(2, count + 2)
    )


BEAM = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"
SLICE = "http://schemas.microsoft.com/3dmanufacturing/slice/2015/07"
WRONG = {
    "no model": ({"other": "x"}, "it has no part '/3D/3dmodel.model'"),
    "no XML": ({"3D/3dmodel.model": "x"}, "/3D/3dmodel.model, line 1: syntax error"),
    "another element": ({"3D/3dmodel.model": "<a/>"}, "its first element is 'a'; expected 'model'"),
    "document type": (
        {"3D/3dmodel.model": f"<!DOCTYPE model [<!ENTITY a 'b'>]>{model_text(OBJECT, ITEM)[38:]}"},
        "line 1: it has a document type; expected none",
    ),
    "nothing to build": (
        {"3D/3dmodel.model": model_text(OBJECT)},
        "is empty; expected vertices and faces",
    ),
    "no triangles": (
        {"3D/3dmodel.model": model_text('<object id="1"><mesh/></object>', ITEM)},
        "is empty; expected vertices and faces",
    ),
    "no object": (
        {"3D/3dmodel.model": model_text("", ITEM)},
        "/3D/3dmodel.model has no object '1'",
    ),
    "no such part": (
        {"3D/3dmodel.model": model_text(OBJECT, '<item objectid="1" p:path="/b"/>')},
        "it has no part '/b'",
    ),
    "twice": (
        {"3D/3dmodel.model": model_text(OBJECT + OBJECT, ITEM)},
        "object '1' is there twice; expected once",
    ),
    "unit": (
        {"3D/3dmodel.model": model_text(OBJECT, ITEM, 'unit="parsec"')},
        "its unit is 'parsec'; expected one of micron, millimeter, ",
    ),
    "eleven numbers": (
        {"3D/3dmodel.model": model_text(OBJECT, f'<item objectid="1" transform="{"1 " * 11}"/>')},
        "it has a transform that is not twelve finite numbers",
    ),
    "lacks y": (
        {"3D/3dmodel.model": model_text(OBJECT.replace(' y="', ' u="', 1), ITEM)},
        "line 1: it lacks 'y'",
    ),
    "word": (
        {"3D/3dmodel.model": model_text(OBJECT.replace(' y="', ' y="a', 1), ITEM)},
        "line 1: could not convert string to float",
    ),
    "index": (
        {"3D/3dmodel.model": model_text(OBJECT.replace(' v2="', ' v2="99', 1), ITEM)},
        "a part of 8 vertices has indices",
    ),
    "far index": (
        {"3D/3dmodel.model": model_text(OBJECT.replace(' v2="', f' v2="{10**30}', 1), ITEM)},
        "line 1: ",
    ),
    "circle": (
        {
            "3D/3dmodel.model": model_text(
                '<object id="1"><components><component objectid="1"/></components></object>', ITEM
            )
        },
        "or more than 100 within each other; expected fewer",
    ),
    "any number of copies": (
        {"3D/3dmodel.model": model_text(nested(40, 2), '<item objectid="41"/>')},
        "its components are more than 1000, or",
    ),
    "lattice": (
        {
            "3D/3dmodel.model": model_text(
                OBJECT, ITEM, f'xmlns:b="{BEAM}" requiredextensions="p b"'
            )
        },
        f"cannot be read: it requires the extension '{BEAM}'",
    ),
    "slices": (
        {
            "3D/3dmodel.model": model_text(
                OBJECT.replace("<object ", '<object s:meshresolution="lowres" '),
                ITEM,
                f'xmlns:s="{SLICE}" requiredextensions="s"',
            )
        },
        "cannot be read: the shape of object '1' is in slices",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(tmp_path, monkeypatch, name):
    monkeypatch.setattr(threemf, "MOST_USES", 1000)
    parts, message = WRONG[name]
    path = archive(tmp_path, parts)
    with pytest.raises(ValueError, match=r"^mesh ") as caught:
        read_mesh(path)
    expect_one_line(caught.value, f"mesh {path}")
    assert message in str(caught.value)


def test_damaged_archives(tmp_path):
    content = archive(tmp_path, {"3D/3dmodel.model": model_text(OBJECT, ITEM)}).read_bytes()
    for wrong, said in (
        (content[:-30], "it is no zip archive, or its end is missing"),
        (b"PK" + bytes(100), "it is no zip archive, or its end is missing"),
        (content[:60] + b"\xff\xff\xff\xff" + content[64:], "its part '/3D/3dmodel.model' is dam"),
    ):
        with pytest.raises(ValueError, match=said):
            read_mesh(written(tmp_path, wrong, "a.3mf"))


def test_what_unpacks_to_much_is_refused_before(tmp_path):
    """Of each part, and of all together."""
    blank = model_text(OBJECT, ITEM) + " " * (1 << 25)
    with pytest.raises(ValueError, match=r"unpacks from \d+ to \d+ bytes; expected at most"):
        read_mesh(archive(tmp_path, {"3D/3dmodel.model": blank}))
    parts = {f"{k}": model_text(OBJECT) + " " * (1 << 21) for k in range(12)}
    items = "".join(f'<item objectid="1" p:path="/{k}"/>' for k in range(12))
    parts["3D/3dmodel.model"] = model_text("", items)
    with pytest.raises(ValueError, match=r"unpacks from \d+ to \d+ bytes; expected at most"):
        read_mesh(archive(tmp_path, parts))


def test_the_memory_of_a_large_file(tmp_path):
    """`PARSED` is what reading takes, per byte, of the shortest elements."""
    import tracemalloc

    n = 20_000
    vertices = '<vertex x="0" y="0" z="0"/>' * n
    triangles = '<triangle v1="0" v2="1" v3="2"/>' * n
    text = model_text(
        f'<object id="1"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles>'
        "</mesh></object>",
        ITEM,
    )
    path = archive(tmp_path, {"3D/3dmodel.model": text})
    tracemalloc.start()
    try:
        assert len(read_mesh(path).faces) == n
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= threemf.PARSED * len(text)
