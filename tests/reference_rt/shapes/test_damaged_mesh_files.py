"""Whatever bytes a mesh file has: a sound mesh, or one line of error; never anything else."""

import numpy as np
import pytest
from mesh_writers import (
    FACES,
    FORMS,
    SQUARE,
    TRIANGLES,
    Gltf,
    V,
    ascii_stl,
    binary_stl,
    check,
    expect_one_line,
    ply,
    read,
    square,
    written,
)

from reference_rt.shapes.meshes.files import read_mesh


def full_gltf():
    file = Gltf()
    attributes = file.primitive["attributes"]
    attributes["NORMAL"] = file.add(np.tile(np.float32([0, 3, 4]), (5, 1)))
    attributes["COLOR_0"] = file.add(np.full((5, 3), 99, np.uint8))
    file.root["nodes"] = [{"mesh": 0, "rotation": [0, 1, 0, 1], "children": [1]}, {"mesh": 0}]
    return file


def full_ply(form):
    properties = [*(f"float {n}" for n in ["x", "y", "z", "nx", "ny", "nz", "s", "t"])]
    properties += ["uchar red", "uchar green", "uchar blue"]
    rows = [[*p, 0, 0, 1, 0.5, 0.25, 1, 2, 3] for p in SQUARE.tolist()]
    faces = [[[0, 1, 2]], [[0, 1, 2, 3]]]
    return ply(form, ("vertex", properties, rows), ("face", FACES, faces))


SOUND = [
    (
        ".obj",
        (V + "vt 0 1\nvn 0 0 1\nf 1/1/1 2/1/1 \\\n-2/1/1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n").encode(),
    ),
    (".obj", V.replace("0\n", "0 0.1 0.2 0.3\n").encode() + b"f 1 2 3 4\n"),
    *((".ply", full_ply(form)) for form in FORMS),
    *((".ply", square(form)) for form in FORMS),
    (".stl", binary_stl(TRIANGLES)),
    (".stl", ascii_stl(TRIANGLES).encode()),
    (".off", b"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 0 0 0\n"),
    (".gltf", full_gltf().gltf()),
    (".glb", full_gltf().glb()),
]


def expect_mesh_or_error(folder, suffix, content):
    path = written(folder, content, f"damaged{suffix}")
    try:
        check(read_mesh(path))
    except ValueError as error:
        expect_one_line(error, f"mesh {path}")
    path.unlink()  # file systems wait for the disk when a file is written over


@pytest.mark.parametrize("number", range(len(SOUND)))
def test_sound_files(tmp_path, number):
    """What the damaged ones are made of is read."""
    suffix, content = SOUND[number]
    read(tmp_path, content, f"mesh{suffix}")


@pytest.mark.parametrize("number", range(len(SOUND)))
def test_files_cut_anywhere(tmp_path, number):
    suffix, content = SOUND[number]
    for length in range(0, len(content), 7):
        expect_mesh_or_error(tmp_path, suffix, content[:length])


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(SOUND)))
def test_any_bit_flipped(tmp_path, number):
    suffix, content = SOUND[number]
    for bit in range(8 * len(content)):
        data = bytearray(content)
        data[bit // 8] ^= 1 << bit % 8
        expect_mesh_or_error(tmp_path, suffix, bytes(data))
