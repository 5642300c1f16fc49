"""Regular .obj files are read as arrays to what the reader of lines makes of them."""

import numpy as np
import pytest

from reference_rt.shapes.meshes.files import obj, obj_regular


def written(rng, form, end, mixed, sides, header):
    """A file: corners of a form, lines that end with `end`, kinds of lines mixed or in blocks."""
    n, faces = int(rng.integers(4, 30)), []
    number = (
        (lambda: f"{rng.normal():.{rng.integers(1, 17)}g}")
        if mixed
        else (lambda: repr(float(rng.normal())))
    )
    points = [f"v {number()} {number()} {number()}" for _ in range(n)]
    uv = [f"vt {number()} {number()}" for _ in range(5)] if "t" in form else []
    normals = [f"vn {number()}\t{number()}  {number()}" for _ in range(6)] if "n" in form else []
    for _ in range(int(rng.integers(1, 40))):
        corners = []
        for _ in range(int(rng.choice(sides))):
            v, t, m = (int(rng.integers(1, k + 1)) for k in (n, 5, 6))
            corners.append(form.replace("v", str(v)).replace("t", str(t)).replace("n", str(m)))
        faces.append("f " + " ".join(corners))
    rest = ["# a comment", "o one", "g a b", "s off", "s 1", "usemtl gold", "", "mtllib a.mtl"]
    lines = [*header, *points, *uv, *normals]
    for face in faces:
        lines.append(face)
        if rng.uniform() < 0.2:
            lines.append(str(rng.choice(rest)))
        if mixed and rng.uniform() < 0.2:
            lines.append("v 1 2 3")
    return (end.join(lines) + (end if rng.uniform() < 0.7 else "")).encode()


def assert_same(content):
    found, expected = obj.read(content), obj.read_lines(content)
    for name, ours, theirs in zip(found._fields, found, expected, strict=True):
        if isinstance(theirs, tuple) or theirs is None:
            assert ours == theirs, name
        else:
            assert np.array_equal(ours, theirs), name
            assert ours.dtype == theirs.dtype


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("form", ["v", "v/t", "v//n", "v/t/n"])
def test_the_same_mesh(form, end):
    rng = np.random.default_rng(5)
    for k in range(20):
        sides = ([3], [3, 4, 5])[k % 2]
        content = written(rng, form, end, bool(k // 2 % 2), sides, ["# made"] * (k % 3))
        assert obj_regular.parse(content) is not None
        assert_same(content)


ODD = {
    "colours": b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n",
    "w": b"v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 2\nf 1 2 3\n",
    "negative": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n",
    "forms": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1 2//1 3/1/1\n",
    "open": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1/ 2/1/ 3/1/\n",
    "continued": b"v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "comment": b"v 0 0 0 # here\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "indented": b"  v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "underscore": b"v 1_0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "one uv": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nf 1/1 2/1 3/1\n",
    "return": b"v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
    "names": "v 0 0 0\nv 1 0 0\nv 0 1 0\ng Körper\nf 1 2 3\n".encode(),
    "tabs": b"v\t0 0 0\nv 1\t0 0\nv 0 1 0\nf\t1 2 3\n",
}


@pytest.mark.parametrize("name", ODD)
def test_other_files_are_read_line_by_line(name):
    assert_same(ODD[name])


BAD = {
    "no number": b"v 0 x 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "two numbers": b"v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "shifted": b"v 0 0\nv 1 0 0 0\nv 0 1 0\nf 1 2 3\n",
    "none": b"v\nv 1 0 0\nv 0 1 0\nf 1 1 1\n",
    "infinite": b"v 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "index 0": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "too large": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
    "huge": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999999\n",
    "later": b"v 0 0 0\nv 1 0 0\nf 1 2 3\nv 0 1 0\n",
    "no uv": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n",
    "two and four": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1 3/1/1/\n",
    "slashes": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/ /2 3//\n",
    "a line": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n",
}


@pytest.mark.parametrize("name", BAD)
def test_errors_are_those_of_the_lines(name):
    with pytest.raises(ValueError, match="line") as found:
        obj.read(BAD[name])
    with pytest.raises(ValueError, match="line") as expected:
        obj.read_lines(BAD[name])
    assert str(found.value) == str(expected.value)
