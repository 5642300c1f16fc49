"""Environment map: radiance from every direction, from an image of the whole sphere."""

import math
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.core.model import Description, Examples, Positive
from reference_rt.core.ray import BLOCK, HitBlock, RayBlock, put_vector, vector_of
from reference_rt.core.transform import Transform, affine
from reference_rt.core.vec3 import Vec3, dot, luminance, triple
from reference_rt.jit.kernel import kernel, local_floats
from reference_rt.jit.simd import (
    TINY,
    VECTOR_WIDTH,
    larger,
    number_at,
    select,
    simd_kernel,
    smaller,
    square_root,
    whole_part,
)
from reference_rt.lights.light import (
    Background,
    LightBlock,
    LightSample,
    put_background,
    put_light,
)
from reference_rt.sampling.distribution import guide, guided_cell_of, linear, running_sums
from reference_rt.sampling.warp import on_circle, turns
from reference_rt.textures.image_file import read_image


class EnvironmentMap(Description):
    """Radiance from infinitely far away by an image of all directions (latitude and longitude).

    Its top row is +y, its middle +z; right of the middle is -x.
    """

    EXAMPLES: ClassVar[Examples] = (
        {"file": "image.npy"},
        {
            "file": "image.npy",
            "scale": 0.5,
            "transform": ({"rotate": {"axis": (1.0, 2.0, 3.0), "degrees": 40.0}},),
        },
    )
    type: Literal["environment_map"] = "environment_map"
    file: str
    """The image, relative to the scene file: .exr, .hdr, .pfm, .npy (linear radiance), or .png,
    .jpg, .tif, .webp, .bmp, .tga, .ppm, .gif (sRGB).  Usually twice as wide as high."""
    encoding: Literal["auto", "radiance"] = "auto"
    """`radiance`: .hdr as Radiance itself decodes it, half a step of a mantissa brighter, EXPOSURE
    and COLORCORR undone; other renderers ignore these."""
    layer: str = ""
    """Of an .exr file with several pictures: the one whose channels begin so, such as `diffuse` for
    diffuse.R.  Default: R, G, B, or the file's only picture."""
    scale: Positive = 1.0
    """A factor of the image's values, which gives W sr^-1 m^-2, linear sRGB."""
    transform: Transform = ()
    """Steps that rotate or mirror the map, the first one first; steps that scale or translate are
    an error.  Default: +y is up."""

    def tabulate(self, folder: Path) -> "EnvironmentMaps":
        """One row.  Raises ValueError (what is wrong, what was expected)."""
        path = folder / self.file
        texels = read_image(path, self.encoding, self.scale, self.layer, BESIDE)
        if len(texels) < 2:
            raise ValueError(f"{path}: has one row of pixels; expected two or more")
        with np.errstate(over="ignore", invalid="ignore"):
            made = tabulate(texels, orthogonal(self.transform))
        if not np.isfinite(made.total[0]):
            raise ValueError(f"{path}: its power overflows; expected a smaller scale")
        if made.total[0] == 0.0:
            raise ValueError(f"{path}: has no power; expected a pixel that is not black")
        return made


def orthogonal(steps: Transform) -> FloatArray:
    """The (3, 3) rotation or reflection of a transform.  Raises ValueError for any other map, with
    a tolerance of 1e-6: the accuracy of numbers written with seven digits."""
    m = affine(steps)
    linear_part = m[:, :3]
    if m[:, 3].any() or not np.abs(linear_part.T @ linear_part - np.eye(3)).max() <= 1e-6:
        raise ValueError(
            "the transform moves, scales or shears; expected rotations and reflections alone"
        )
    left, _, right = np.linalg.svd(linear_part)
    return np.asarray(left @ right)  # the nearest one


BESIDE = 12
"""Bytes per texel of a map's sums and guides, beside those of its radiance."""


class EnvironmentMaps(NamedTuple):
    """One map.  texels (h, w, 3): radiance, row 0 on top; to_map (1, 9): the world's directions
    in the map's coordinates; heights (h,): cosines of the rows' polar angles; down_sums (w,
    h): running sums down each column of cells of their luminance, in radiance times solid angle;
    across_sums (w + 1,): running sums of whole columns of cells; down_guides, across_guides: where
    to search in these, see `guide`; total (1,): the sum of all.

    Radiance is bilinear between texels: across, texel x stands at azimuth 2 pi (x + 1/2) / w and
    the first follows the last; upright, texel y stands at polar angle pi y / (h - 1), so that the
    top and the bottom row are the poles.  Cell (x, y) has its texel at the upper left corner.  For
    samples the luminance in a cell is bilinear between its corners in azimuth and height, the
    cosine of the polar angle, which makes its integral and its inverse elementary.
    """

    texels: FloatArray
    to_map: FloatArray
    heights: FloatArray
    down_sums: FloatArray
    across_sums: FloatArray
    down_guides: IdArray
    across_guides: IdArray
    total: FloatArray


def tabulate(texels: FloatArray, to_world: FloatArray) -> EnvironmentMaps:
    """The table of an image (h, w, 3) of radiance;  to_world: an orthogonal (3, 3)."""
    height, width = texels.shape[:2]
    heights = np.cos(np.linspace(0.0, math.pi, height))
    solid_angles = (heights[:-1] - heights[1:]) * (2.0 * math.pi / width)
    down_sums = np.empty((width, height))
    for x in range(0, width, 64):  # some at a time, since the table itself is what memory holds
        columns = texels[:, np.arange(x, min(x + 64, width) + 1) % width]
        light = np.asarray(luminance(Vec3(*np.moveaxis(columns, -1, 0))))
        light = 0.5 * light[:, 1:] + 0.5 * light[:, :-1]
        cells = (0.5 * light[1:] + 0.5 * light[:-1]) * solid_angles[:, None]
        down_sums[x : x + 64] = running_sums(cells.T)
    across_sums = running_sums(down_sums[:, -1])
    return EnvironmentMaps(
        texels=np.ascontiguousarray(texels),
        to_map=to_world.T.reshape(1, 9).copy(),
        heights=heights,
        down_sums=down_sums,
        across_sums=across_sums,
        down_guides=guide(down_sums),
        across_guides=guide(across_sums[None])[0],
        total=across_sums[-1:].copy(),
    )


class _Sky(NamedTuple):
    """What generic functions (`jit.simd`) read;  right, up, back: the rows of `to_map`;  width,
    last: the numbers of columns and of rows of cells."""

    texels: Any
    heights: Any
    right: Vec3
    up: Vec3
    back: Vec3
    width: Any
    last: Any


class Arriving(NamedTuple):
    """wi: the direction in which `radiance` arrives;  light: the density of `sample` per solid
    angle in that direction, times `EnvironmentMaps.total`."""

    wi: Vec3
    radiance: Vec3
    light: Any


@kernel
def _sky(table: EnvironmentMaps) -> _Sky:
    height, width = table.texels.shape[0], table.texels.shape[1]
    m = table.to_map
    axes = triple(m, 0, 0), triple(m, 0, 1), triple(m, 0, 2)
    return _Sky(table.texels, table.heights, *axes, float(width), float(height - 1))


@kernel
def _texel(sky: _Sky, row: Any, x: Any) -> Vec3:
    """A texel of the row that begins at texel number `row`."""
    at, texels = 3.0 * (row + x), sky.texels
    return Vec3(number_at(texels, at, 0), number_at(texels, at, 1), number_at(texels, at, 2))


@kernel
def _corners(sky: _Sky, x: Any, y: Any) -> tuple[Vec3, Vec3, Vec3, Vec3]:
    """The texels at the corners of a cell: upper left, upper right, lower left, lower right."""
    beside, row = select(x + 1.0 < sky.width, x + 1.0, 0.0), y * sky.width
    upper = _texel(sky, row, x), _texel(sky, row, beside)
    row = row + sky.width
    return (*upper, _texel(sky, row, x), _texel(sky, row, beside))


@kernel
def _look_up(sky: _Sky, d: Vec3) -> Arriving:
    """The light from direction d, of any length; a generic function."""
    right, up, back = dot(sky.right, d), dot(sky.up, d), dot(sky.back, d)
    out2 = right * right + back * back
    across = turns(right, -back) * sky.width - 0.5
    down = turns(square_root(out2), up) * (2.0 * sky.last)
    column, y = whole_part(across), smaller(whole_part(down), sky.last - 1.0)
    s, t = across - column, down - y
    x = select(column < 0.0, column + sky.width, column)
    a, b, c, e = _corners(sky, x, y)
    upper, lower = a * (1.0 - s) + b * s, c * (1.0 - s) + e * s
    top, bottom = number_at(sky.heights, y, 0), number_at(sky.heights, y, 1)
    height = up / larger(square_root(out2 + up * up), TINY)
    w = smaller(larger((top - height) / (top - bottom), 0.0), 1.0)
    light = luminance(upper) * (1.0 - w) + luminance(lower) * w
    return Arriving(d, upper * (1.0 - t) + lower * t, light)


@kernel
def _in_cell(sky: _Sky, x: Any, y: Any, u0: Any, u1: Any) -> Arriving:
    """The direction in a cell at the shares u0 of its light down and u1 across; a generic
    function."""
    a, b, c, e = _corners(sky, x, y)
    a_light, b_light, c_light, e_light = luminance(a), luminance(b), luminance(c), luminance(e)
    s = linear(u1, a_light + c_light, b_light + e_light)
    upper, lower = a * (1.0 - s) + b * s, c * (1.0 - s) + e * s
    above, below = a_light * (1.0 - s) + b_light * s, c_light * (1.0 - s) + e_light * s
    w = linear(u0, above, below)
    height = number_at(sky.heights, y, 0) * (1.0 - w) + number_at(sky.heights, y, 1) * w
    out = square_root(larger((1.0 - height) * (1.0 + height), 0.0))
    t = smaller(larger(turns(out, height) * (2.0 * sky.last) - y, 0.0), 1.0)
    azimuth = (x + 0.5 + s) / sky.width
    cosine, sine = on_circle(select(azimuth < 1.0, azimuth, azimuth - 1.0))
    across = sky.right * (out * sine) - sky.back * (out * cosine)
    light = above * (1.0 - w) + below * w
    return Arriving(across + sky.up * height, upper * (1.0 - t) + lower * t, light)


class _Cell(NamedTuple):
    """A cell, and the shares of its light down and across at a sample."""

    x: float
    y: float
    u0: float
    u1: float


@kernel
def _cell_of(table: EnvironmentMaps, u0: float, u1: float) -> _Cell:
    """The cell of a sample: u1 chooses the column, u0 the row in it.

    In this order samples of a stratum stay closer together than in the other: for the irradiance
    from ten kinds of skies and rooms, 64 Sobol' points have 0.5 to 1.0 of the variance (measured).
    """
    x = guided_cell_of(table.across_sums, table.across_guides, u1)
    column = table.down_sums[x]
    y = guided_cell_of(column, table.down_guides[x], u0)
    return _Cell(float(x), float(y), _share(column, y, u0), _share(table.across_sums, x, u1))


@kernel
def _share(sums: FloatArray, i: int, u: float) -> float:
    """Where in cell i the share u of all is, from 0 to 1."""
    cell = sums[i + 1] - sums[i]
    if cell <= 0.0:
        return 0.0
    return float(min(max((u * sums[-1] - sums[i]) / cell, 0.0), 1.0))


@kernel
def radiance(table: EnvironmentMaps, d: Vec3) -> Vec3:
    """The radiance from direction d, of any length."""
    return _look_up(_sky(table), d).radiance


@kernel
def pdf(table: EnvironmentMaps, d: Vec3) -> float:
    """The density of `sample` per solid angle in direction d, of any length."""
    return float(_look_up(_sky(table), d).light / table.total[0])


@kernel
def sample(table: EnvironmentMaps, u0: float, u1: float) -> LightSample:
    """A direction with a density that is proportional to the luminance, but for its course within a
    cell: see `EnvironmentMaps`."""
    cell = _cell_of(table, u0, u1)
    found = _in_cell(_sky(table), cell.x, cell.y, cell.u0, cell.u1)
    return _sampled(table, found)


@kernel
def _sampled(table: EnvironmentMaps, found: Arriving) -> LightSample:
    wi = found.wi
    return LightSample(wi, found.radiance, found.light / table.total[0], wi, math.inf, False)


# ---- for a block of paths at once, VECTOR_WIDTH of them together ---------------------------------
# (Measured: a scene lit by a sky renders in 0.6 of the time.)

_FLOATS = 11 * BLOCK
"""Columns of BLOCK numbers.  For look-ups: the direction, then radiance and light of `Arriving`.
For samples: x and y of the cell, u0 and u1, then all of `Arriving`."""

_RADIANCE, _LIGHT, _ARRIVING = 3 * BLOCK, 6 * BLOCK, 4 * BLOCK


def _sky_of(texels: Any, heights: Any, to_map: Any, width: Any, last: Any) -> _Sky:
    m = [to_map.everywhere(i) for i in range(9)]
    return _Sky(texels, heights, Vec3(*m[:3]), Vec3(*m[3:6]), Vec3(*m[6:]), width, last)


@simd_kernel
def _look_up_lanes(
    texels: Any, heights: Any, to_map: Any, width: Any, last: Any, numbers: Any, k: Any
) -> Any:
    x, y, z = numbers.load(k), numbers.load(k + BLOCK), numbers.load(k + 2 * BLOCK)
    found = _look_up(_sky_of(texels, heights, to_map, width, last), Vec3(x, y, z))
    for column, value in enumerate((*found.radiance, found.light)):
        numbers.store(k + (_RADIANCE + column * BLOCK), value)
    return found.light > 0.0


@simd_kernel
def _in_cell_lanes(
    texels: Any, heights: Any, to_map: Any, width: Any, last: Any, numbers: Any, k: Any
) -> Any:
    x, y, u0, u1 = (numbers.load(k + column * BLOCK) for column in range(4))
    found = _in_cell(_sky_of(texels, heights, to_map, width, last), x, y, u0, u1)
    for column, value in enumerate((*found.wi, *found.radiance, found.light)):
        numbers.store(k + (_ARRIVING + column * BLOCK), value)
    return found.light > 0.0


@kernel
def backgrounds(
    table: EnvironmentMaps, rays: RayBlock, hits: HitBlock, n: int, lit: LightBlock
) -> None:
    """`radiance` and `pdf` of those of the first n rays that hit nothing: see `put_background`."""
    numbers, k = local_floats(_FLOATS), 0
    for j in range(n):
        if hits.codes[j] < 0:
            put_vector(numbers, 0, k, vector_of(rays.numbers, 3, j))
            k += 1
    texels, width, last = table.texels, float(table.texels.shape[1]), table.texels.shape[0] - 1.0
    for first in range(0, k, VECTOR_WIDTH):
        _fill_up(numbers, first, k)
        _look_up_lanes(texels, table.heights, table.to_map, width, last, numbers, first)
    k = 0
    for j in range(n):
        if hits.codes[j] < 0:
            density = numbers[_LIGHT + k] / table.total[0]
            put_background(lit, j, Background(vector_of(numbers, 3, k), density))
            k += 1


@kernel
def samples(table: EnvironmentMaps, kind: int, lit: LightBlock, n: int) -> None:
    """`sample` for those of the first n paths that ask for a light of this kind."""
    numbers, asked, k = local_floats(_FLOATS), lit.numbers, 0
    for j in range(n):
        if lit.codes[j] == kind:
            cell = _cell_of(table, asked[12 * BLOCK + j], asked[13 * BLOCK + j])
            numbers[k], numbers[BLOCK + k] = cell.x, cell.y
            numbers[2 * BLOCK + k], numbers[3 * BLOCK + k] = cell.u0, cell.u1
            k += 1
    texels, width, last = table.texels, float(table.texels.shape[1]), table.texels.shape[0] - 1.0
    for first in range(0, k, VECTOR_WIDTH):
        _fill_up(numbers, first, k)
        _in_cell_lanes(texels, table.heights, table.to_map, width, last, numbers, first)
    k = 0
    for j in range(n):
        if lit.codes[j] == kind:
            wi, arriving = vector_of(numbers, 4, k), vector_of(numbers, 7, k)
            found = Arriving(wi, arriving, numbers[10 * BLOCK + k])
            put_light(lit, j, _sampled(table, found))
            k += 1


@kernel
def _fill_up(numbers: FloatArray, first: int, count: int) -> None:
    """Fill the lanes of a vector that are beyond `count` with copies of the last: uninitialised
    memory may hold subnormal numbers, on which some processors are a hundred times slower, and
    numbers that are no texel's."""
    for k in range(count, first + VECTOR_WIDTH):
        for column in range(4):
            numbers[column * BLOCK + k] = numbers[column * BLOCK + count - 1]


def power(table: EnvironmentMaps, scene_radius: float) -> FloatArray:
    """Luminance of the power (1,) into the sphere of the scene's radius R: pi R² times the integral
    of the luminance over all directions, 4 pi² R² times its mean."""
    return np.asarray(math.pi * scene_radius * scene_radius * table.total)
