"""Tone curves: what real-time renderers make of linear radiance before sRGB encodes it.

`CURVES` has those of three.js; `curve_of` reads one as a user names it, `estimated` recognises one
in a picture.

Contract: a curve takes linear radiance (..., 3) to linear values of the display (..., 3), from 0
to 1.  Increasing values per channel stay so only where a curve mixes no channels: ACES and AgX do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.textures.image_file import linear
from reference_rt.util.errors import ImageError, UsageError

# ---- the formulas, with the constants of three.js 0.187 ------------------------------------------


def _reinhard(c: FloatArray) -> FloatArray:
    """Reinhard et al. 2002, without a white point."""
    return c / (1.0 + c)


def _exponential(c: FloatArray) -> FloatArray:
    """Babylon's `TONEMAPPING_STANDARD`."""
    return 1.0 - np.exp2(-1.590579 * c)


def _filmic(c: FloatArray) -> FloatArray:
    """Narkowicz's fit to ACES (2015)."""
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14)


def _cineon(c: FloatArray) -> FloatArray:
    """Hejl and Burgess-Dawson (2010), decoded as they encode it."""
    x = np.maximum(c - 0.004, 0.0)
    return np.asarray((x * (6.2 * x + 0.5) / (x * (6.2 * x + 1.7) + 0.06)) ** 2.2)


# Matrices are transposed: the rows are what red, green and blue become.
ACES_IN = np.array(
    [[0.59719, 0.07600, 0.02840], [0.35458, 0.90834, 0.13383], [0.04823, 0.01566, 0.83777]]
)
ACES_OUT = np.array(
    [[1.60475, -0.10208, -0.00327], [-0.53108, 1.10813, -0.07276], [-0.07367, -0.00605, 1.07602]]
)


def _aces(c: FloatArray) -> FloatArray:
    """Hill's fit to ACES; three.js makes it brighter by 1 / 0.6."""
    x = (c / 0.6) @ ACES_IN
    x = (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081)
    return np.asarray(x @ ACES_OUT)


TO_2020 = np.array([[0.6274, 0.0691, 0.0164], [0.3293, 0.9195, 0.0880], [0.0433, 0.0113, 0.8956]])
FROM_2020 = np.array(
    [[1.6605, -0.1246, -0.0182], [-0.5876, 1.1329, -0.1006], [-0.0728, -0.0083, 1.1187]]
)
AGX_IN = np.array([
    [0.856627153315983, 0.137318972929847, 0.11189821299995],
    [0.0951212405381588, 0.761241990602591, 0.0767994186031903],
    [0.0482516061458583, 0.101439036467562, 0.811302368396859],
])  # fmt: skip
AGX_OUT = np.array([
    [1.1271005818144368, -0.1413297634984383, -0.14132976349843826],
    [-0.11060664309660323, 1.157823702216272, -0.11060664309660294],
    [-0.016493938717834573, -0.016493938717834257, 1.2519364065950405],
])  # fmt: skip
AGX_STOPS = -12.47393, 4.026069
AGX_SIGMOID = -0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5


def _agx(c: FloatArray) -> FloatArray:
    """Sobotka's AgX (2022), by the polynomial of Wrensch."""
    x = np.log2(np.maximum(c @ TO_2020 @ AGX_IN, 1e-10))
    least, most = AGX_STOPS
    x = np.clip((x - least) / (most - least), 0.0, 1.0)
    x = np.asarray(np.polynomial.polynomial.polyval(x, AGX_SIGMOID)) @ AGX_OUT
    return np.asarray(np.maximum(x, 0.0) ** 2.2 @ FROM_2020)


def _neutral(c: FloatArray) -> FloatArray:
    """Khronos' PBR Neutral (2024)."""
    start, d = 0.76, 0.24
    x = c.min(axis=-1, keepdims=True)
    c = c - np.where(x < 0.08, x - 6.25 * x * x, 0.04)
    peak = np.maximum(c.max(axis=-1, keepdims=True), start)  # below it c stays as it is
    shown = 1.0 - d * d / (peak + d - start)
    white = 1.0 - 1.0 / (0.15 * (peak - shown) + 1.0)
    return np.where(peak > start, c * shown / peak * (1.0 - white) + shown * white, c)


CURVES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "linear": lambda c: c,
    "reinhard": _reinhard,
    "cineon": _cineon,
    "aces": _aces,
    "agx": _agx,
    "neutral": _neutral,
    "filmic": _filmic,
    "exponential": _exponential,
}

ESTIMATE = "estimate"
"""In place of a curve: the one that the picture shows."""


@dataclass(frozen=True)
class ToneCurve:
    """name: as a user names it, without the exposure;  exposure: factor of the radiance."""

    name: str
    of: Callable[[FloatArray], FloatArray]
    exposure: float = 1.0

    def __call__(self, radiance: FloatArray) -> FloatArray:
        return np.clip(self.of(self.exposure * radiance), 0.0, 1.0)

    def __str__(self) -> str:
        return self.name if self.exposure == 1.0 else f"{self.name}:{self.exposure:.4g}"

    def errors(self, radiance: FloatArray, dark: float) -> tuple[float, FloatArray]:
        """How much larger relative errors of a picture (height, width, 3) become, at most, and the
        displayed values (3,) to which they are relative at least.  Those of radiance are relative
        to a value, or to the fraction `dark` of its channel's mean.

        Dark values change most, since curves have a foot or subtract: they do not make the errors
        of brighter ones larger."""
        floor = dark * np.abs(radiance.mean(axis=(0, 1)))
        shown, step = self(radiance), 1e-4  # of the difference quotient
        changes = np.zeros_like(shown)
        for channel in range(3):
            moved = radiance.copy()
            moved[..., channel] += step * np.maximum(radiance[..., channel], floor[channel])
            changes += np.abs(self(moved) - shown) / step
        lit = shown > 0.0
        bright = lit & (shown >= shown.mean(where=lit)) if lit.any() else lit
        steep = float((changes[bright] / shown[bright]).max(initial=1.0))
        least = float(changes[~bright].max(initial=0.0)) / steep
        return steep, np.full(3, max(least, dark * float(shown.mean())))


def curve_of(text: str) -> ToneCurve:
    """NAME, FILE, NAME:EXPOSURE or FILE:EXPOSURE.  Raises UsageError, ImageError."""
    name, _, number = text.rpartition(":")
    try:
        exposure = float(number) if name else 1.0
    except ValueError:
        name, exposure = text, 1.0  # a file name with a colon
    name = name or text
    if not (np.isfinite(exposure) and exposure > 0.0):
        raise UsageError(f"--tone-curve: {text} has the exposure {number}; expected a number > 0")
    if name in CURVES:
        return ToneCurve(name, CURVES[name], exposure)
    path = Path(name)
    if not path.is_file():
        known = ", ".join(CURVES)
        raise UsageError(
            f"--tone-curve: there is no {name}; expected {known}, a file, or {ESTIMATE}"
        )
    return ToneCurve(name, _table(path), exposure)


def _table(path: Path) -> Callable[[FloatArray], FloatArray]:
    """The curve of a file: in each line a linear value, and what the picture stores for it, of 1.
    Between them it is linear, and beyond them constant.  Raises ImageError."""
    wanted = "expected lines of two numbers: linear values that rise, and what is stored, 0 to 1"
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        rows = [line.partition("#")[0].replace(",", " ").split() for line in lines]
        table = np.array([[float(x) for x in row] for row in rows if row])
    except (OSError, ValueError) as error:
        raise ImageError(f"{path}: is no tone curve: {error}; {wanted}") from None
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2 or not np.isfinite(table).all():
        raise ImageError(f"{path}: is no tone curve; {wanted}")
    known, stored = table.T
    if (np.diff(known) <= 0.0).any() or stored.min() < 0.0 or stored.max() > 1.0:
        raise ImageError(f"{path}: has values that do not rise or are not from 0 to 1; {wanted}")
    if (np.diff(stored) < 0.0).any():
        raise ImageError(f"{path}: falls; {wanted}, that do not fall")
    return lambda c: linear(np.interp(c, known, stored))
