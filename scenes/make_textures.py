"""Writes the scenes' images: `python scenes/make_textures.py` gives the same pixels always."""

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from reference_rt.core.exr import write_exr
from reference_rt.rendering.image import srgb

FOLDER = Path(__file__).parent / "textures"
SIZE = 128
Array = npt.NDArray[np.float64]
Bytes = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint16]

TILES = 4
"""Tiles along each side; all images of them repeat seamlessly."""
DEPTH = 0.02
"""The height that white stands for in the height map, as a part of the image's side."""
SUN = (math.radians(40.0), math.radians(60.0), math.radians(2.5))
"""Elevation; azimuth, from the image's middle to the right; angular radius: five texels wide."""


def places() -> tuple[Array, Array]:
    """u and v (SIZE, SIZE) of the texels' middles, row 0 on top, where v is 1."""
    middle = (np.arange(SIZE) + 0.5) / SIZE
    u, v = np.meshgrid(middle, 1.0 - middle)
    return u, v


def noise(cells: int, seed: int) -> Array:
    """Smooth noise from 0 to 1 that repeats: random values on a lattice, blended cubically."""
    lattice = np.random.default_rng(seed).random((cells, cells))
    at = (np.arange(SIZE) + 0.5) / SIZE * cells
    low = at.astype(np.int64)
    t = at - low
    t = t * t * (3.0 - 2.0 * t)
    rows = lattice[low] * (1.0 - t[:, None]) + lattice[(low + 1) % cells] * t[:, None]
    return np.asarray(rows[:, low] * (1.0 - t) + rows[:, (low + 1) % cells] * t)


def tile_parts() -> tuple[Array, npt.NDArray[np.int64]]:
    """(how much of a tile there is, 0 in the joints and 1 on the tiles; the tile's number)."""
    u, v = (axis * TILES for axis in places())
    # The distance to the nearest edge, in tiles' sides; every other row is moved by half a tile.
    u = np.mod(u + 0.5 * (np.floor(v) % 2.0), TILES)
    edge = 0.5 - np.maximum(np.abs(u % 1.0 - 0.5), np.abs(v % 1.0 - 0.5))
    rise = np.clip((edge - 0.04) / 0.08, 0.0, 1.0)
    number = np.floor(v).astype(np.int64) * TILES + np.floor(u).astype(np.int64)
    return rise * rise * (3.0 - 2.0 * rise), number


def tiles() -> Bytes:
    """Fired clay of various reds in grey joints, as sRGB."""
    on, number = tile_parts()
    shade = np.random.default_rng(1).uniform(0.7, 1.2, TILES * TILES)[number]
    shade = shade * (0.8 + 0.2 * noise(8, 2) + 0.2 * noise(32, 3))
    clay = shade[..., None] * np.array([0.48, 0.17, 0.09])
    joint = (0.28 + 0.1 * noise(64, 4))[..., None] * np.array([1.0, 0.96, 0.9])
    return eight_bits(srgb(joint + on[..., None] * (clay - joint)))


def height() -> Words:
    """The tiles' height, from 0 to 65535."""
    on, _ = tile_parts()
    worn = 0.08 * noise(8, 5) + 0.04 * noise(32, 6)
    return np.round(65535.0 * np.clip(0.1 * noise(64, 4) + on * (0.78 + worn), 0.0, 1.0)).astype(
        np.uint16
    )


def normals(heights: Words) -> Bytes:
    """The normals of a height map as (n + 1) / 2: x along u, y along v, z up."""
    h = heights / 65535.0 * DEPTH * SIZE
    dhdu = 0.5 * (np.roll(h, -1, axis=1) - np.roll(h, 1, axis=1))
    dhdv = 0.5 * (np.roll(h, 1, axis=0) - np.roll(h, -1, axis=0))
    n = np.stack([-dhdu, -dhdv, np.ones_like(h)], axis=-1)
    n /= np.sqrt(np.sum(n * n, axis=-1, keepdims=True))
    return eight_bits(0.5 * (n + 1.0))


def roughness() -> Bytes:
    """Glazed tiles, with stains, in rough joints: grey."""
    on, _ = tile_parts()
    stains = np.clip(2.0 * noise(6, 7) - 0.8, 0.0, 1.0)
    return eight_bits(0.9 + on * (0.12 + 0.35 * stains + 0.05 * noise(32, 8) - 0.9))


def leaf() -> Bytes:
    """The opacity of a leaf with three holes in it: grey, its edges a texel wide."""
    u, v = places()
    t = np.clip((v - 0.18) / 0.78, 0.0, 1.0)
    # Inside is positive, in units of the side: blade, stalk, less the holes.
    blade = 0.36 * np.sqrt(np.sin(math.pi * t)) * (1.0 - 0.55 * t)
    blade = blade * (1.0 + 0.06 * np.cos(26.0 * math.pi * t)) - np.abs(u - 0.5)
    stalk = np.where((v > 0.02) & (v < 0.3), 0.018 - np.abs(u - 0.5), -1.0)
    inside = np.maximum(blade, stalk)
    for x, y, radius in ((0.62, 0.42, 0.05), (0.41, 0.55, 0.035), (0.54, 0.68, 0.025)):
        inside = np.minimum(inside, np.hypot(u - x, v - y) - radius)
    return eight_bits(np.clip(0.5 + inside * SIZE, 0.0, 1.0))


def sky(width: int = 256, rows: int = 128) -> npt.NDArray[np.float32]:
    """(rows, width, 3) radiance of a clear sky with a sun, over dry ground: the top row is up, the
    middle of the image looks towards -z."""
    polar = np.linspace(0.0, math.pi, rows)[:, None]
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2.0 * math.pi
    up = np.cos(polar) + 0.0 * azimuth
    elevation, turn, radius = SUN
    to_sun = math.sin(elevation) * up + math.cos(elevation) * np.sin(polar) * np.cos(azimuth - turn)
    angle = np.arccos(np.clip(to_sun, -1.0, 1.0))
    high = np.sqrt(np.clip(up, 0.0, 1.0))[..., None]
    blue = (1.0 - high) * np.array([0.95, 0.98, 1.0]) + high * np.array([0.14, 0.32, 0.78])
    glow = (0.9 * np.exp(-angle / 0.12) + 0.3 * np.exp(-angle / 0.5))[..., None]
    air = blue + glow * np.array([1.0, 0.85, 0.6])
    ground = (0.9 + 0.1 * np.clip(-up, 0.0, 1.0))[..., None] * np.array([0.2, 0.16, 0.11])
    # The horizon a texel wide, and so is the sun's edge.
    step = math.pi / (rows - 1)
    over = np.clip(0.5 + (0.5 * math.pi - polar) / step, 0.0, 1.0)[..., None]
    in_sun = np.clip(0.5 + (radius - angle) / step, 0.0, 1.0)[..., None]
    radiance = ground + over * (air - ground) + in_sun * np.array([420.0, 370.0, 300.0])
    return radiance.astype(np.float32)


def exposed_sky() -> bytes:
    """A small sky as a .hdr file (Ward 1991), twice as bright as meant, as its header says."""
    blocks = sky().astype(np.float64).reshape(16, 8, 32, 8, 3).mean(axis=(1, 3))
    shared = np.frexp(2.0 * blocks.max(axis=-1))[1]
    mantissas = np.floor(256.0 * np.ldexp(2.0 * blocks, -shared[..., None]))
    pixels = np.concatenate([mantissas, shared[..., None] + 128.0], axis=-1).astype(np.uint8)
    head = b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n"
    return head + pixels.tobytes()


def eight_bits(values: Array) -> Bytes:
    return np.round(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    images = {
        "tiles.png": tiles(),
        "tiles_height.png": height(),
        "tiles_normal.png": normals(height()),
        "tiles_roughness.png": roughness(),
        "leaf.png": leaf(),
    }
    for name, pixels in images.items():
        Image.fromarray(pixels).save(FOLDER / name, optimize=True)
    planes = {c: sky()[..., k].astype(np.float64) for k, c in enumerate("RGB")}
    write_exr(FOLDER / "sky.exr", planes, {})
    (FOLDER / "sky_exposed.hdr").write_bytes(exposed_sky())


if __name__ == "__main__":
    main()
