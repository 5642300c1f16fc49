"""The compiled scanner of .obj files makes of a file what the reader of lines does, or leaves it to
that."""

import numpy as np
import pytest

from reference_rt.shapes.meshes.files import obj
from reference_rt.shapes.meshes.files.obj_scanner import LONGEST, scan


@pytest.fixture(autouse=True)
def no_small_files(monkeypatch):
    """Small files too are left to the scanner."""
    monkeypatch.setattr(obj, "LARGE", 0)


def written(rng, form, end, mixed, sides, header, negative=False):
    """A file: corners of a form, lines that end with `end`, kinds of lines mixed or in blocks."""
    n, faces = int(rng.integers(4, 30)), []
    number = (
        (lambda: f"{rng.normal():.{rng.integers(1, 17)}g}")
        if mixed
        else (lambda: repr(float(rng.normal())))
    )
    colour = " 0.25 1 0.5" if "c" in form else ""
    points = [f"v {number()} {number()} {number()}{colour}" for _ in range(n)]
    uv = [f"vt {number()} {number()}" for _ in range(5)] if "t" in form else []
    normals = [f"vn {number()}\t{number()}  {number()}" for _ in range(6)] if "n" in form else []
    for _ in range(int(rng.integers(1, 40))):
        corners = []
        for _ in range(int(rng.choice(sides))):
            v, t, m = (int(rng.integers(1, k + 1)) for k in (n, 5, 6))
            if negative:
                v, t, m = v - n - 1, t - 6, m - 7
            corners.append(
                form.strip("c").replace("v", str(v)).replace("t", str(t)).replace("n", str(m))
            )
        faces.append("f " + " ".join(corners))
    rest = ["# a comment", "o one", "g a b", "s off", "s 1", "usemtl gold", "", "mtllib a.mtl"]
    lines = [*header, *points, *uv, *normals]
    for face in faces:
        lines.append(face)
        if rng.uniform() < 0.2:
            lines.append(str(rng.choice(rest)))
        if mixed and rng.uniform() < 0.2:
            lines.append(f"v 1 2 3{colour}")
    return (end.join(lines) + (end if rng.uniform() < 0.7 else "")).encode()


def result_or_error(read, content):
    try:
        return read(content)
    except ValueError as error:
        return str(error)


def assert_read_alike(content):
    assert_same(obj.read(content), obj.read_lines(content))


def assert_same(found, expected):
    for name, ours, theirs in zip(found._fields, found, expected, strict=True):
        if isinstance(theirs, tuple) or theirs is None:
            assert ours == theirs, name
        else:
            assert np.array_equal(ours, theirs), name
            assert ours.dtype == theirs.dtype


@pytest.mark.cases(6)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("form", ["v", "v/t", "v//n", "v/t/n", "v/t/nc", "vc"])
def test_the_same_mesh(form, end):
    rng = np.random.default_rng(5)
    for k in range(20):
        sides = ([3], [3, 4, 5])[k % 2]
        mixed, header = bool(k // 2 % 2), ["# made"] * (k % 3)
        content = written(rng, form, end, mixed, sides, header, negative=not mixed and k % 3 == 0)
        assert scan(content) is not None
        assert_read_alike(content)


NUMBERS = (
    "0 -0 +1 1. .5 -.5 1e3 1E-3 1e+22 1e22 1e23 -1e-22 1e-23 9007199254740992 9007199254740993 "
    "9007199254740991e22 123456789012345678 1234567890123456789 0.1 0.30000000000000004 "
    "2.2250738585072011e-308 5e-324 1e-400 1.7976931348623157e308 0e99999999999999999999 "
    "0.000000000000000000000000000000000001 000000000000000000000000001.5 1e00000000000000000001 "
    "0.00000000000000000000000000000000 3.14159265358979323846264338327950288 8.5e0 100000e-5"
)


def test_decimals_are_rounded_once():
    """To the nearest float64, as Python's, bit by bit."""
    rng = np.random.default_rng(8)
    words = NUMBERS.split() + [repr(float(x)) for x in rng.normal(size=2000)]
    words += [f"{x:.{rng.integers(1, 20)}g}" for x in rng.normal(size=2000)]
    words += [f"{m}e{e}" for m, e in rng.integers([1, -30], [1 << 54, 30], (2000, 2)).tolist()]
    words += ["0"] * (-len(words) % 3)
    rows = [" ".join(words[k : k + 3]) for k in range(0, len(words), 3)]
    content = "".join(f"v {row}\n" for row in rows) + "f 1 2 3\n"
    found = scan(content.encode())
    expected = np.array([float(word) for word in words]).reshape(-1, 3)
    assert found.positions.tobytes() == expected.tobytes()


def test_damaged_files_are_read_or_refused_alike():
    """Bytes replaced, left out and repeated: the same mesh or the same error."""
    rng = np.random.default_rng(12)
    refused = 0
    for k in range(600):
        form = ["v", "v/t", "v//n", "v/t/n", "vc"][k % 5]
        content = bytearray(written(rng, form, "\n", True, [3, 4], ["# made"]))
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(len(content)))
            what = int(rng.integers(3))
            if what == 0:
                content[at] = rng.choice(list(b" \t\r\n\x0b\x0c\x00/-+.#\\0e9vfntsx\xff"))
            elif what == 1:
                del content[at : at + int(rng.integers(1, 20))]
            else:
                content[at:at] = content[at : at + int(rng.integers(1, 40))]
        found, expected = (
            result_or_error(read, bytes(content)) for read in (obj.read, obj.read_lines)
        )
        if isinstance(expected, str):
            refused += 1
            assert found == expected
        else:
            assert_same(found, expected)
    assert 60 < refused < 540


def test_a_position_with_many_texture_coordinates():
    """The pole of a sphere; beyond LONGEST the search would take too long, and lines are read."""
    for count in (LONGEST, LONGEST + 9):
        ring = [f"v {k} 1 0\nvt {k} 0\n" for k in range(count + 2)]
        faces = [f"f 1/{k} {k + 1}/{k} {k + 2}/{k}\n" for k in range(1, count + 1)]
        content = ("".join(ring) + "".join(faces)).encode()
        assert (scan(content) is not None) == (count <= LONGEST)
        assert_read_alike(content)


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
    assert_read_alike(ODD[name])


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
