"""Images, and what they make between and beyond their texels, against Mitsuba's loader."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from comparisons.geometry import affine
from comparisons.mitsuba.second import image, rounding_of
from comparisons.rungs.files.findings import Findings, text
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3
from reference_rt.lights import EnvironmentMap
from reference_rt.lights.emitters import environment_map
from reference_rt.textures import Bitmap
from reference_rt.textures.bitmap import lookup


def _compare_images(
    where: str, path: Path, ours: FloatArray, theirs: FloatArray, scale: float, findings: Findings
) -> None:
    if ours.shape != theirs.shape:
        findings.differences.append(
            f"{where}: {path.name} has {ours.shape[1]} x {ours.shape[0]} pixels; Mitsuba's loader "
            f"finds {theirs.shape[1]} x {theirs.shape[0]}"
        )
        return
    theirs = theirs * scale
    error = np.abs(ours - theirs) - rounding_of(path, theirs, scale)
    if (error > 0.0).any():
        y, x, _ = np.unravel_index(int(error.argmax()), error.shape)
        findings.differences.append(
            f"{where}: {path.name}: the pixel at column {x}, row {y} is {text(ours[y, x])}; "
            f"Mitsuba's loader has {text(theirs[y, x])}"
        )
    findings.count("images")


def check_bitmap(where: str, bitmap: Bitmap, folder: Path, findings: Findings) -> None:
    path = folder / bitmap.file
    theirs = image(path, bitmap.encoding, bitmap.layer, bitmap.channel)
    if theirs is None:
        findings.unread.append(path.suffix.lower())
        return
    texels, before = bitmap.read(folder), len(findings.differences)
    if len(texels.decoded):
        codes = texels.values if texels.values.dtype != np.float16 else texels.values.view("u2")
        ours = texels.decoded[codes]
    else:
        ours = texels.values.astype(np.float64) * texels.scale
    ours = np.broadcast_to(ours, (*ours.shape[:2], 3))
    _compare_images(where, path, ours, theirs, bitmap.scale, findings)
    if len(findings.differences) > before:
        return
    theirs, table = theirs * bitmap.scale, bitmap.tabulate(folder)
    height, width = theirs.shape[:2]
    x, y = _at_borders(width), _at_borders(height)
    columns, lines = (
        partial(_wrapped, n=n, wrap=w) for n, w in zip((width, height), bitmap.wraps, strict=True)
    )
    if bitmap.filter == "nearest":
        expected = theirs[lines(np.floor(y)[:, None]), columns(np.floor(x))]
    else:
        expected = _bilinear(theirs, x - 0.5, y - 0.5, columns, lines)
    seen = np.array([[lookup(table, 0, u, v) for u in x / width] for v in 1.0 - y / height])
    if bitmap.cutoff is not None:
        slack = rounding_of(path, expected, bitmap.scale)
        unclear = np.abs(expected - bitmap.cutoff) <= slack
        expected = np.where(unclear, seen, expected >= bitmap.cutoff)
    _compare_seen(where, path, (x, y), seen, expected, (theirs, bitmap.scale), findings)


def _at_borders(n: int) -> FloatArray:
    """Positions on an axis of n texels, in texels: at both sides of its first texel, its middle and
    its end, and at those of the images before and after."""
    borders = np.unique([-n, 0, n // 2, n, 2 * n])
    return np.asarray((borders[:, None] + [-0.4, -1e-3, 1e-3, 0.4]).ravel())


def _wrapped(k: FloatArray, n: int, wrap: str) -> IntArray:
    """Texels, 0 to n - 1, of an axis that is continued beyond its n texels."""
    index = k.astype(np.int64)
    if wrap == "clamp":
        return np.clip(index, 0, n - 1)
    index = index % (n if wrap == "repeat" else 2 * n)
    return np.where(index < n, index, 2 * n - 1 - index)


Index = Callable[[FloatArray], IntArray]


def _bilinear(
    texels: FloatArray, x: FloatArray, y: FloatArray, columns: Index, lines: Index
) -> FloatArray:
    """(len(y), len(x), 3): between the centres of texels, which lie at whole x and y."""
    left, above = np.floor(x), np.floor(y)
    s, t = (x - left)[:, None], (y - above)[:, None, None]
    upper, lower = (
        texels[lines(row)[:, None], columns(left)] * (1.0 - s)
        + texels[lines(row)[:, None], columns(left + 1.0)] * s
        for row in (above, above + 1.0)
    )
    return np.asarray(upper * (1.0 - t) + lower * t)


def check_environment(where: str, light: EnvironmentMap, folder: Path, findings: Findings) -> None:
    path, table = folder / light.file, light.tabulate(folder)
    theirs = image(path, light.encoding, light.layer)
    to_map, expected = (
        table.to_map.reshape(3, 3),
        np.linalg.inv(affine.of_steps(light.transform)[:, :3]),
    )
    if theirs is None:
        findings.unread.append(path.suffix.lower())
    else:
        before = len(findings.differences)
        _compare_images(where, path, table.texels, theirs, light.scale, findings)
        if len(findings.differences) == before:
            _check_sky(where, path, table, theirs * light.scale, light.scale, findings)
    if np.abs(to_map - expected).max() > 1e-5:  # seven digits are taken for a rotation
        findings.differences.append(
            f"{where}: turns directions by {text(to_map)}; its transform undone is {text(expected)}"
        )


def _check_sky(
    where: str,
    path: Path,
    table: environment_map.EnvironmentMaps,
    theirs: FloatArray,
    scale: float,
    findings: Findings,
) -> None:
    """Directions at the seam of a sky, at the opposite meridian, and at its poles."""
    height, width = theirs.shape[:2]
    x = _at_borders(width)
    y = np.array([1e-3, 0.4, 0.5 * (height - 1) + 0.2, height - 1.4, height - 1.001])
    turn, polar = 2.0 * np.pi * x / width, np.pi * y[:, None] / (height - 1)
    right, up, back = np.broadcast_arrays(
        np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)
    )
    d = np.stack([right, up, back], axis=-1) @ table.to_map.reshape(3, 3)
    seen = np.array([[environment_map.radiance(table, Vec3(*ray)) for ray in row] for row in d])
    expected = _bilinear(
        theirs, x - 0.5, y, partial(_wrapped, n=width, wrap="repeat"), lambda k: k.astype(np.int64)
    )
    _compare_seen(where, path, (x, y), seen, expected, (theirs, scale), findings)


def _compare_seen(
    where: str,
    path: Path,
    at: tuple[FloatArray, FloatArray],
    seen: FloatArray,
    expected: FloatArray,
    scaled: tuple[FloatArray, float],
    findings: Findings,
) -> None:
    """Values (len(y), len(x), 3) at places x, y, in texels from the upper left corner;  scaled:
    Mitsuba's texels times a scale, and that."""
    texels, scale = scaled
    greatest = float(np.abs(texels).max())
    # Between texels of both signs the value may be smaller than their rounding.
    size = expected if texels.min() >= 0.0 else np.full_like(expected, greatest)
    # The rounding of a place moves it by less than 2^-40 of a texel.
    slack = rounding_of(path, size, scale) + 2.0**-40 * greatest
    wrong = ~(np.abs(seen - expected) <= slack).all(axis=-1)
    if not wrong.any():
        return
    j, i = np.argwhere(wrong)[0]
    findings.differences.append(
        f"{where}: {path.name}: {np.count_nonzero(wrong)} of {wrong.size} places at borders of "
        f"texels differ; {at[0][i]:.6g} texels from the left and {at[1][j]:.6g} from the top we "
        f"see {text(seen[j, i])}; Mitsuba's texels make it {text(expected[j, i])}"
    )
