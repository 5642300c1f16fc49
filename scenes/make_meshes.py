"""Writes the meshes of the scenes: `python scenes/make_meshes.py` gives the same bytes always."""

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt

FOLDER = Path(__file__).parent / "meshes"
Array = npt.NDArray[np.float64]


def torus_knot(p: int, q: int, around: int, along: int, tube: float) -> tuple[Array, Array, Array]:
    """A tube along the (p, q) torus knot of radii 1 and 0.4.

    Returns vertices (along * around, 3), unit normals of the same shape and triangles
    (2 * along * around, 3), counter-clockwise seen from outside; closed.
    """
    s = np.linspace(0.0, 2.0 * math.pi, along, endpoint=False)
    r = 1.0 + 0.4 * np.cos(q * s)
    center = np.stack([r * np.cos(p * s), r * np.sin(p * s), 0.4 * np.sin(q * s)], axis=1)
    dr = -0.4 * q * np.sin(q * s)
    tangent = np.stack(
        [
            dr * np.cos(p * s) - p * r * np.sin(p * s),
            dr * np.sin(p * s) + p * r * np.cos(p * s),
            0.4 * q * np.cos(q * s),
        ],
        axis=1,
    )
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The torus' own outward direction, made perpendicular to the knot: a frame that closes.
    outward = np.stack(
        [np.cos(p * s) * np.cos(q * s), np.sin(p * s) * np.cos(q * s), np.sin(q * s)], axis=1
    )
    outward -= np.sum(outward * tangent, axis=1, keepdims=True) * tangent
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    side = np.cross(tangent, outward)
    a = np.linspace(0.0, 2.0 * math.pi, around, endpoint=False)[None, :, None]
    normals = np.cos(a) * outward[:, None] + np.sin(a) * side[:, None]
    vertices = center[:, None] + tube * normals
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    i2, j2 = (i + 1) % along, (j + 1) % around
    c00, c10, c01, c11 = i * around + j, i2 * around + j, i * around + j2, i2 * around + j2
    faces = np.stack([c00, c11, c10, c00, c01, c11], axis=-1).reshape(-1, 3)
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), faces


def obj(vertices: Array, normals: Array, faces: Array) -> str:
    """Wavefront text with vertex normals."""
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*v) for v in vertices]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*n) for n in normals]
    lines += ["f {0}//{0} {1}//{1} {2}//{2}".format(*(f + 1)) for f in faces]
    return "\n".join(lines).replace("-0.000000", "0.000000").replace("-0.00000 ", "0.00000 ") + "\n"


def petal(n: int) -> tuple[Array, Array, Array, Array]:
    """An open sheet of n x n squares, curled and waved, coloured by its place.

    Returns vertices ((n + 1)², 3), uv ((n + 1)², 2), 8-bit colours ((n + 1)², 3) and triangles
    (2 n², 3).
    """
    u, v = np.meshgrid(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, n + 1), indexing="ij")
    angle = 2.0 * (u - 0.5)
    vertices = np.stack(
        [
            np.sin(angle) * (0.6 + 0.5 * v),
            2.0 * v - 1.0,
            np.cos(angle) - 1.0 + 0.15 * np.sin(9.0 * v),
        ],
        axis=-1,
    ).reshape(-1, 3)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    colours = np.stack([255.0 * u, 120.0 + 100.0 * np.cos(6.0 * v), 255.0 * (1.0 - v)], axis=-1)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    c00, c10 = i * (n + 1) + j, (i + 1) * (n + 1) + j
    faces = np.stack([c00, c10, c10 + 1, c00, c10 + 1, c00 + 1], axis=-1).reshape(-1, 3)
    return vertices, uv, np.round(colours).reshape(-1, 3), faces


def ply(vertices: Array, uv: Array, colours: Array, faces: Array) -> str:
    """Text of a .ply file with uv and 8-bit colours."""
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "u", "v")]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [
        "{:.6f} {:.6f} {:.6f} {:.5f} {:.5f} {:.0f} {:.0f} {:.0f}".format(*row)
        for row in np.hstack([vertices, uv, colours])
    ]
    lines += ["3 {} {} {}".format(*face) for face in faces]
    return "\n".join(lines).replace("-0.000000", "0.000000") + "\n"


def lanterns(n: int) -> tuple[Array, Array, Array, Array]:
    """n small octahedra strewn over a square of 8 x 8, between heights 0.2 and 1.2, each of a
    colour of its own.

    Returns vertices (6 n, 3), uv (6 n, 2), 8-bit colours (6 n, 3) and triangles (8 n, 3),
    counter-clockwise seen from outside.
    """
    rng = np.random.default_rng(1980)
    center = rng.uniform([-4.0, 0.2, -4.0], [4.0, 1.2, 4.0], (n, 3))
    size = rng.uniform(0.04, 0.09, (n, 1, 1))
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    vertices = (center[:, None] + size * axes).reshape(-1, 3)
    hue = rng.uniform(0.0, 1.0, n)[:, None] + np.array([0.0, 1.0 / 3.0, 2.0 / 3.0])
    colours = np.round(255.0 * (0.55 + 0.45 * np.cos(2.0 * math.pi * hue)))
    corners = [
        (a, b, c) if signs % 2 == 0 else (a, c, b)
        for x in (0, 3)
        for y in (1, 4)
        for z in (2, 5)
        for a, b, c, signs in [(x, y, z, (x == 3) + (y == 4) + (z == 5))]
    ]
    faces = (6 * np.arange(n)[:, None, None] + np.array(corners)).reshape(-1, 3)
    return vertices, np.zeros((6 * n, 2)), np.repeat(colours, 6, axis=0), faces


def slivers(around: int, along: int, hair: float) -> tuple[Array, Array]:
    """A closed vase: a profile turned about y, whose columns are broad and `hair` radians wide in
    turn, its rows high and `hair` of that, so that three of four triangles are slivers.

    Returns vertices and triangles, counter-clockwise seen from outside; the poles are fans.
    """
    steps = np.arange(around) * (2.0 * math.pi / around)
    phi = np.stack([steps, steps + hair], axis=1).ravel()
    inner = np.arange(1, along) / along
    s = np.stack([inner, inner + hair], axis=1).ravel()
    angle = math.pi * s
    r = np.sin(angle) * (0.62 + 0.3 * np.cos(2.6 * angle - 0.4))
    y = 1.0 - np.cos(angle)
    ring = np.stack(np.broadcast_arrays(
        r[:, None] * np.cos(phi), y[:, None], r[:, None] * np.sin(phi)), axis=-1)  # fmt: skip
    vertices = np.concatenate([ring.reshape(-1, 3), [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]])
    rows, columns = len(s), len(phi)
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    j2 = (j + 1) % columns
    c00, c10, c01, c11 = (a * columns + b for b in (j, j2) for a in (i, i + 1))
    sides = np.stack([c00, c10, c11, c00, c11, c01], axis=-1).reshape(-1, 3)
    k, k2 = np.arange(columns), (np.arange(columns) + 1) % columns
    bottom, top, last = np.full(columns, rows * columns), np.full(columns, rows * columns + 1), (
        rows - 1) * columns  # fmt: skip
    fans = np.concatenate([np.stack([bottom, k, k2], 1), np.stack([top, last + k2, last + k], 1)])
    return vertices, np.concatenate([sides, fans])


def binary_ply(vertices: Array, faces: Array) -> bytes:
    """A .ply file of float64 positions: text would round slivers away."""
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    head += [f"property double {name}" for name in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = np.zeros(len(faces), [("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, faces
    return ("\n".join(head) + "\n").encode() + vertices.astype("<f8").tobytes() + rows.tobytes()


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "knot.obj").write_text(obj(*torus_knot(2, 3, around=24, along=440, tube=0.22)))
    (FOLDER / "petal.ply").write_text(ply(*petal(24)))
    (FOLDER / "lanterns.ply").write_text(ply(*lanterns(313)))
    (FOLDER / "slivers.ply").write_bytes(binary_ply(*slivers(around=40, along=20, hair=1e-8)))


if __name__ == "__main__":
    main()
