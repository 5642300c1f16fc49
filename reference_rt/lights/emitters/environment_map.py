"""Environment map: radiance from every direction, from an image of the whole sphere."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from reference_rt.core.arrays import FloatArray, IdArray
from reference_rt.core.model import Description, Positive
from reference_rt.core.transform import Transform, affine
from reference_rt.core.vec3 import Vec3, dot, luminance, triple
from reference_rt.jit.kernel import kernel
from reference_rt.lights.light import NO_LIGHT, LightSample
from reference_rt.sampling.distribution import (
    blended,
    blended_cell_of,
    bracket,
    cell_of,
    guide,
    linear,
    running_sums,
)
from reference_rt.sampling.warp import on_circle
from reference_rt.textures.image_file import read_image


class EnvironmentMap(Description):
    """Radiance from infinitely far away by an image of all directions (latitude and longitude).

    Its top row is +y, its middle +z; right of the middle is -x.
    """

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
        texels = read_image(path, self.encoding, self.scale, self.layer)
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


class EnvironmentMaps(NamedTuple):
    """One map.  texels (h, w, 3): radiance, row 0 on top; to_map (1, 9): the world's directions in
    the map's coordinates; row_sums (h, w + 1): running sums of each row's luminance across its
    cells, in radiance; guides (h, n): where to search in these, see `guide`; height_sums (h,):
    running sums of whole cell rows, in radiance times solid angle; total (1,): their last, the
    integral of the luminance over all directions.

    Radiance is bilinear between texels: across, texel x stands at azimuth 2 pi (x + 1/2) / w and
    the first follows the last; upright, texel y stands at polar angle pi y / (h - 1), so that the
    top and the bottom row are the poles.  Cell (x, y) has its texel at the upper left corner.
    """

    texels: FloatArray
    to_map: FloatArray
    row_sums: FloatArray
    guides: IdArray
    height_sums: FloatArray
    total: FloatArray


def tabulate(texels: FloatArray, to_world: FloatArray) -> EnvironmentMaps:
    """The table of an image (h, w, 3) of radiance;  to_world: an orthogonal (3, 3)."""
    height, width = texels.shape[:2]
    row_sums = np.empty((height, width + 1))
    for y, row in enumerate(texels):  # one at a time, since the table itself is what memory holds
        light = np.asarray(luminance(Vec3(*row.T)))
        row_sums[y] = running_sums(0.5 * (light + np.roll(light, -1)))
    across = row_sums[:, -1] * (2.0 * math.pi / width)
    step = math.pi / (height - 1)
    height_sums = np.zeros(height)
    for y in range(height - 1):
        mass = polar_integral(across[y], across[y + 1], y * step, step, step)
        height_sums[y + 1] = height_sums[y] + mass
    return EnvironmentMaps(
        texels=np.ascontiguousarray(texels),
        to_map=to_world.T.reshape(1, 9).copy(),
        row_sums=row_sums,
        guides=guide(row_sums),
        height_sums=height_sums,
        total=height_sums[-1:].copy(),
    )


@kernel
def polar_integral(a: float, b: float, start: float, step: float, width: float) -> float:
    """The integral of f(theta) sin(theta) from `start` over `width`, where f is linear with values
    a at start and b at start + step.

    With t = theta - start: sin(start + t) has the integral 2 sin(t/2) sin(start + t/2), and
    t sin(start + t) has 2 sin(t/2) cos(start + t/2) - t cos(start + t).
    """
    chord, middle = 2.0 * math.sin(0.5 * width), start + 0.5 * width
    flat = chord * math.sin(middle)
    rising = chord * math.cos(middle) - width * math.cos(start + width)
    return a * flat + (b - a) * max(0.0, rising) / step


@kernel
def radiance(table: EnvironmentMaps, d: Vec3) -> Vec3:
    """The radiance from direction d, of any length."""
    height, width = table.texels.shape[0], table.texels.shape[1]
    right, up, back = (
        dot(triple(table.to_map, 0, 0), d),
        dot(triple(table.to_map, 0, 1), d),
        dot(triple(table.to_map, 0, 2), d),
    )
    azimuth = math.atan2(right, -back) * (0.5 / math.pi)
    polar = math.atan2(math.sqrt(right * right + back * back), up) * (1.0 / math.pi)
    across, down = azimuth * width - 0.5, polar * (height - 1)
    column, line = math.floor(across), min(int(down), height - 2)
    s, t = across - column, down - line
    left, beside = column % width, (column + 1) % width
    upper = texel(table, line, left) * (1.0 - s) + texel(table, line, beside) * s
    lower = texel(table, line + 1, left) * (1.0 - s) + texel(table, line + 1, beside) * s
    arriving: Vec3 = upper * (1.0 - t) + lower * t
    return arriving


@kernel
def texel(table: EnvironmentMaps, y: int, x: int) -> Vec3:
    texels = table.texels
    return Vec3(texels[y, x, 0], texels[y, x, 1], texels[y, x, 2])


@kernel
def pdf(table: EnvironmentMaps, arriving: Vec3) -> float:
    """The density of `sample` per solid angle in a direction of this radiance: its luminance, over
    the integral of the luminance."""
    return float(luminance(arriving) / table.total[0])


@kernel
def sample(table: EnvironmentMaps, u0: float, u1: float) -> LightSample:
    """A direction with a density exactly proportional to its luminance: u0 inverts the integral
    over polar angles, u1 that over the azimuth there."""
    height, width = table.texels.shape[0], table.texels.shape[1]
    mass = u0 * table.total[0]
    y = cell_of(table.height_sums, mass)
    t = _down_in_cells(table, y, mass - table.height_sums[y])
    mass = u1 * blended(table.row_sums, y, t, width)
    low, high = bracket(table.guides, y, u1)
    x = blended_cell_of(table.row_sums, y, t, mass, low, high)
    before = blended(table.row_sums, y, t, x)
    cell = blended(table.row_sums, y, t, x + 1) - before
    if cell <= 0.0:
        return NO_LIGHT
    beside = (x + 1) % width
    left = texel(table, y, x) * (1.0 - t) + texel(table, y + 1, x) * t
    right = texel(table, y, beside) * (1.0 - t) + texel(table, y + 1, beside) * t
    s = linear((mass - before) / cell, luminance(left), luminance(right))
    arriving = left * (1.0 - s) + right * s
    turns = (x + 0.5 + s) / width
    cosine, sine = on_circle(turns - math.floor(turns))
    theta = math.pi * (y + t) / (height - 1)
    out = math.sin(theta)
    wi = (
        triple(table.to_map, 0, 0) * (out * sine)
        + triple(table.to_map, 0, 1) * math.cos(theta)
        - triple(table.to_map, 0, 2) * (out * cosine)
    )
    return LightSample(wi, arriving, pdf(table, arriving), wi, math.inf, False)


@kernel
def _down_in_cells(table: EnvironmentMaps, y: int, mass: float) -> float:
    """The place t in cell row y, from 0 to 1, at which the integral over polar angles is `mass`: by
    Newton's iteration, kept inside the bounds found so far.

    It begins with the place if luminance times sin(theta) were linear, and ends with an error of
    2^-32 of a cell, the spacing of the numbers that samplers draw.  The density is a product of two
    functions that are concave and not negative, so that a step d from t leaves an error of at most
    d² / min(t, 1 - t).
    """
    height, width = table.texels.shape[0], table.texels.shape[1]
    step = math.pi / (height - 1)
    a = table.row_sums[y, width] * (2.0 * math.pi / width)
    b = table.row_sums[y + 1, width] * (2.0 * math.pi / width)
    cell = table.height_sums[y + 1] - table.height_sums[y]
    if cell <= 0.0:
        return 0.5
    low, high = 0.0, 1.0
    t = linear(mass / cell, a * math.sin(y * step), b * math.sin((y + 1) * step))
    for _ in range(64):  # as many as halvings alone could take, and more
        excess = polar_integral(a, b, y * step, step, t * step) - mass
        if excess > 0.0:
            high = t
        else:
            low = t
        slope = (a + (b - a) * t) * math.sin((y + t) * step) * step
        following = 0.5 * (low + high)
        if slope > 0.0:
            newton = t - excess / slope
            if low < newton < high:
                following = newton
        moved = following - t
        if moved * moved <= 2.0**-32 * min(t, 1.0 - t) or abs(moved) <= 2.0**-32:
            return following
        t = following
    return t


def power(table: EnvironmentMaps, scene_radius: float) -> FloatArray:
    """Luminance of the power (1,) into the sphere of the scene's radius R: pi R² times the integral
    of the luminance over all directions, 4 pi² R² times its mean."""
    return np.asarray(math.pi * scene_radius * scene_radius * table.total)
