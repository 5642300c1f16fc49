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
    guide,
    guided_cell_of,
    linear,
    running_sums,
)
from reference_rt.sampling.warp import on_circle, turns
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
    the map's coordinates; down_sums (w + 1, h): running sums down each column of texels of the
    luminance in its cells, in radiance times polar solid angle, the first column again at the end;
    across_sums (w + 1,): running sums of whole columns of cells, in radiance times solid angle;
    down_guides, across_guides: where to search in these, see `guide`; total (1,): the integral of
    the luminance over all directions; polar (h, 2): sine and cosine of the rows' polar angles.

    Radiance is bilinear between texels: across, texel x stands at azimuth 2 pi (x + 1/2) / w and
    the first follows the last; upright, texel y stands at polar angle pi y / (h - 1), so that the
    top and the bottom row are the poles.  Cell (x, y) has its texel at the upper left corner.
    """

    texels: FloatArray
    to_map: FloatArray
    down_sums: FloatArray
    across_sums: FloatArray
    down_guides: IdArray
    across_guides: IdArray
    total: FloatArray
    polar: FloatArray


def tabulate(texels: FloatArray, to_world: FloatArray) -> EnvironmentMaps:
    """The table of an image (h, w, 3) of radiance;  to_world: an orthogonal (3, 3)."""
    height, width = texels.shape[:2]
    step = math.pi / (height - 1)
    angles = np.arange(height) * step
    flat, rising = polar_weights(angles[:-1, None], step)
    down_sums = np.zeros((width + 1, height))
    for x in range(0, width, 64):  # some at a time, since the table itself is what memory holds
        light = np.asarray(luminance(Vec3(*np.moveaxis(texels[:, x : x + 64], -1, 0))))
        masses = light[:-1] * np.maximum(flat - rising, 0.0) + light[1:] * rising
        down_sums[x : x + masses.shape[1]] = running_sums(masses.T)
    down_sums[width] = down_sums[0]
    columns = down_sums[:, -1]
    across_sums = running_sums((columns[:-1] + columns[1:]) * (math.pi / width))
    return EnvironmentMaps(
        texels=np.ascontiguousarray(texels),
        to_map=to_world.T.reshape(1, 9).copy(),
        down_sums=down_sums,
        across_sums=across_sums,
        down_guides=guide(down_sums),
        across_guides=guide(across_sums[None])[0],
        total=across_sums[-1:].copy(),
        polar=np.column_stack([np.sin(angles), np.cos(angles)]),
    )


def polar_weights(start: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """The integrals of sin(theta) and of sin(theta) (theta - start) / step, over the angles theta
    from `start` as far as `step`.

    With t = theta - start: sin(start + t) has the integral 2 sin(t/2) sin(start + t/2), and
    t sin(start + t) has 2 sin(t/2) cos(start + t/2) - t cos(start + t).
    """
    chord, middle = 2.0 * math.sin(0.5 * step), start + 0.5 * step
    rising = chord * np.cos(middle) - step * np.cos(start + step)
    return chord * np.sin(middle), np.maximum(rising, 0.0) / step


@kernel
def radiance(table: EnvironmentMaps, d: Vec3) -> Vec3:
    """The radiance from direction d, of any length."""
    height, width = table.texels.shape[0], table.texels.shape[1]
    right, up, back = (
        dot(triple(table.to_map, 0, 0), d),
        dot(triple(table.to_map, 0, 1), d),
        dot(triple(table.to_map, 0, 2), d),
    )
    across = turns(right, -back) * width - 0.5
    down = turns(math.sqrt(right * right + back * back), up) * (2.0 * (height - 1))
    column, line = math.floor(across), min(int(down), height - 2)
    s, t = across - column, down - line
    left = int(column)
    if left < 0:
        left += width
    beside = left + 1 if left + 1 < width else 0
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
    """A direction with a density exactly proportional to its luminance: u1 inverts the integral
    over the azimuth, u0 that over polar angles there.

    In this order samples of a stratum stay closer together than in the other: for the irradiance
    from ten kinds of skies and rooms, 64 Sobol' points have 0.5 to 1.0 of the variance (measured).
    """
    height, width = table.texels.shape[0], table.texels.shape[1]
    x = guided_cell_of(table.across_sums, table.across_guides, u1)
    cell = table.across_sums[x + 1] - table.across_sums[x]
    if cell <= 0.0:
        return NO_LIGHT
    last = height - 1
    before, after = table.down_sums[x, last], table.down_sums[x + 1, last]
    s = linear((u1 * table.total[0] - table.across_sums[x]) / cell, before, after)
    mass = u0 * blended(table.down_sums, x, s, last)
    low, high = bracket(table.down_guides, x, u0)
    y = blended_cell_of(table.down_sums, x, s, mass, low, high)
    above = blended(table.down_sums, x, s, y)
    cell = blended(table.down_sums, x, s, y + 1) - above
    beside = x + 1 if x + 1 < width else 0
    upper = texel(table, y, x) * (1.0 - s) + texel(table, y, beside) * s
    lower = texel(table, y + 1, x) * (1.0 - s) + texel(table, y + 1, beside) * s
    t = _down_in_cell(table, y, luminance(upper), luminance(lower), mass - above, cell)
    arriving = upper * (1.0 - t) + lower * t
    azimuth = (x + 0.5 + s) / width
    cosine, sine = on_circle(azimuth if azimuth < 1.0 else azimuth - 1.0)
    upwards, out = on_circle((y + t) / (2.0 * last))
    wi = (
        triple(table.to_map, 0, 0) * (out * sine)
        + triple(table.to_map, 0, 1) * upwards
        - triple(table.to_map, 0, 2) * (out * cosine)
    )
    return LightSample(wi, arriving, pdf(table, arriving), wi, math.inf, False)


LOW_CELL = math.pi / 64.0
"""The largest height of a cell for which the series of `_down_in_cell` has enough terms."""


@kernel
def _down_in_cell(
    table: EnvironmentMaps, y: int, a: float, b: float, mass: float, cell: float
) -> float:
    """The place t in a cell of row y, from 0 to 1, at which the integral over polar angles of the
    luminance, a on top and b at the bottom, is `mass`, of `cell` at 1: by Newton's iteration, kept
    inside the bounds found so far.

    It begins with the place if luminance times sin(theta) were linear, and ends with an error of
    2^-32 of a cell, the spacing of the numbers that samplers draw.  The density is a product of two
    functions that are concave and not negative, so that a step d from t leaves an error of at most
    d² / min(t, 1 - t).  In low cells it is c0 + c1 t + ... + c6 t^6: of sin(theta) there are the
    terms up to t^5 of its series, and the next is below 2e-11 of it.
    """
    if cell <= 0.0:
        return 0.5
    step, d = math.pi / (table.texels.shape[0] - 1), b - a
    sine, cosine = table.polar[y, 0], table.polar[y, 1]
    s0, s1 = sine * step, cosine * step * step
    s2, s3 = s0 * (-0.5 * step * step), s1 * (-1.0 / 6.0 * step * step)
    s4, s5 = s2 * (-1.0 / 12.0 * step * step), s3 * (-1.0 / 20.0 * step * step)
    c0, c1, c2, c3 = a * s0, a * s1 + d * s0, a * s2 + d * s1, a * s3 + d * s2
    c4, c5, c6 = a * s4 + d * s3, a * s5 + d * s4, d * s5
    i1, i2, i3, i4, i5, i6 = c1 / 2.0, c2 / 3.0, c3 / 4.0, c4 / 5.0, c5 / 6.0, c6 / 7.0
    low, high = 0.0, 1.0
    t = linear(mass / cell, a * sine, b * table.polar[y + 1, 0])
    for _ in range(64):  # as many as halvings alone could take, and more
        if step <= LOW_CELL:
            integral = t * (c0 + t * (i1 + t * (i2 + t * (i3 + t * (i4 + t * (i5 + t * i6))))))
            density = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6)))))
        else:
            angle = t * step
            s, c = math.sin(angle), math.cos(angle)
            flat = sine * s + cosine * (1.0 - c)
            rising = sine * (angle * s + c - 1.0) + cosine * (s - angle * c)
            integral = a * flat + d * rising / step
            density = (a + d * t) * (sine * c + cosine * s) * step
        excess = integral - mass
        if excess > 0.0:
            high = t
        else:
            low = t
        following = 0.5 * (low + high)
        if density > 0.0:
            newton = t - excess / density
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
