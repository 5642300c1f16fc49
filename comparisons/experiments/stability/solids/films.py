"""What films look like: a turned box without a half of it, which has three faces in common."""

import numpy as np
import numpy.typing as npt

import reference_rt as rt
from comparisons.experiments.stability.harness import solids
from comparisons.experiments.stability.harness.meshes import write_smallest_ball
from comparisons.experiments.stability.harness.outcomes import OURS, FloatArray
from comparisons.experiments.stability.harness.shots import Shot, pixel_grid
from comparisons.experiments.stability.harness.steps import at, scaled, turned
from reference_rt.core import transform
from reference_rt.util.files import temporary_folder

PIXELS = 192

TURN = turned(-38.0, (0.4, 1.0, 0.2))

LIGHT = np.array([0.3, 0.8, 0.52])
COLOURS = np.array([[0.85, 0.45, 0.3], [0.4, 0.65, 0.85], [0.75, 0.75, 0.45]])
"""Of faces across x, y and z."""


def shoot(contestant: str, x: float) -> Shot:
    """Seen in parallel from the front, shaded by the face that the point found lies on."""
    half = (scaled(0.5, 1.0, 1.0), at(0.5 + 1.0 / x, 0.0, 0.0))
    solid = rt.Box(transform=(TURN,)) - rt.Box(transform=(*half, TURN))
    u, v = pixel_grid(PIXELS, 2.0)
    # Not along any of the box's axes, so that each pixel rounds in its own way.
    o = np.column_stack([u, v, np.full(u.size, 5.0)])
    d = np.tile([0.01, -0.02, -1.0], (len(o), 1))
    with temporary_folder() as folder:
        write_smallest_ball(folder)
        t = solids.LISTS[contestant](solid, folder, o, d)
    first = t[:, 0] if t.shape[1] else np.full(len(o), np.inf)
    pixels = _shaded(o, d, first).reshape(PIXELS, PIXELS, 3)
    caption = (
        "A turned box without its right half, whose faces lie in those of what is taken away: "
        "what is seen to the right of the cut is a film of rounding."
        if contestant != OURS
        else "The same by ours: the half is gone."
    )
    return Shot(pixels, caption)


def _shaded(o: FloatArray, d: FloatArray, t: FloatArray) -> npt.NDArray[np.uint8]:
    """8-bit sRGB (n, 3)."""
    m = transform.affine((TURN,))
    hit = np.isfinite(t)
    p = o + np.where(hit, t, 0.0)[:, None] * d
    q = transform.apply_points(transform.invert(m), p)
    off = np.concatenate([np.abs(q - 1.0), np.abs(q + 1.0), np.abs(q[:, :1])], axis=1)
    face = off.argmin(axis=1)
    axis, side = face % 3, np.where(face < 3, 1.0, np.where(face < 6, -1.0, 1.0))
    normal = m[:, :3].T[axis] * side[:, None]
    cosine = np.abs(normal @ LIGHT)
    colour = COLOURS[axis] * (0.25 + 0.75 * cosine[:, None])
    colour[~hit] = 0.12
    pixels: npt.NDArray[np.uint8] = np.round(255.0 * np.clip(colour, 0.0, 1.0)).astype(np.uint8)
    return pixels
