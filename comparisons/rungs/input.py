"""The rung of the input: whether the pictures can be compared at all.

It finds wrong shapes and sizes, values that are not finite, transparent, black or constant
pictures, repeated, correlated or odd replicates, 8-bit quantisation and clamped highlights.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray, RungResult, Status
from comparisons.statistics.metrics import nonfinite_pixels, white_level
from comparisons.statistics.odd_replicate import odd_replicate
from comparisons.statistics.order import successive
from comparisons.statistics.repeated import (
    Rounding,
    may_all_be_the_same,
    may_be_flat,
    may_be_the_same,
    same_pairs,
)
from comparisons.statistics.shared_noise import common_noise, correlated_pair

DIM = 1e-3
"""Fraction of the reference's white level above which a pixel counts as lit."""

CODES = 255.0
"""The largest code of 8 bits."""

ON_GRID = 0.07
"""How far a value may be from an 8-bit code, in codes.  Half floats round by 2^-12 at most, which
is 0.062 of a code; of values that are not quantised 14 % are so near to a code by chance."""

FEWEST_CODES = 16
"""Least number of different values: a picture with fewer may have flat colours, which do not prove
8 bits."""

CLAMPED = 1.05
"""Factor by which the reference must be above values that are reported as clamped."""

FEWEST_CLAMPED = 16
"""Least number of values at the maximum: fewer share it by chance, or are the flat radiance of a
lamp."""


def input_rung(
    candidate: npt.ArrayLike, reference: npt.ArrayLike, opacity: npt.ArrayLike | None = None
) -> RungResult:
    """Report the first problem of the pictures; `agree` if there is none.

    candidate: (R, height, width, 3) replicates, or one picture (height, width, 3) without noise;
    reference: likewise, or the mean of noisy ones;  opacity: the candidate's alpha, (R, height,
    width) or (height, width).  `invalid` if the pictures cannot be compared, `differ` if the
    candidate is certainly wrong.
    """
    a, b = np.asarray(candidate, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    alone = a.ndim == 3
    if problem := _of_shapes(a, b) or _of_sizes(a, b):
        return _result("invalid", problem)
    a, b = (x[None] if x.ndim == 3 else x for x in (a, b))
    numbers: dict[str, Any] = {
        "width": a.shape[2],
        "height": a.shape[1],
        "replicates_candidate": len(a),
        "replicates_reference": len(b),
        "negative_values": int(np.count_nonzero(a < 0.0)) if not (b < 0.0).any() else 0,
    }
    alpha = None if opacity is None else np.asarray(opacity, dtype=np.float64)
    problem = (
        _not_finite("the candidate", a)
        or _not_finite("the reference", b)
        or (None if alpha is None else _transparent(alpha, a, b))
        or _black(a, b)
        or _constant(a, b)
        or (None if alone else _repeated(a, b))
        or (_odd("candidate", a) or _odd("reference", b))
        or (_in_order("candidate", a) or _in_order("reference", b))
        or _sharing_noise(a, b)
        or _quantised(a, b)
    )
    if problem is not None:
        return _result("invalid", problem, numbers)
    problem = _clamped(a, b)
    if problem is not None:
        return _result("differ", problem, numbers)
    text = f"{a.shape[2]} x {a.shape[1]} pixels, all finite"
    if numbers["negative_values"]:
        text += f"; {numbers['negative_values']} negative values, where the reference has none"
    for whose, x in (("candidate", a), ("reference", b)):
        order = successive(x)
        if order is not None and order.makes_up:
            text += (
                f"; successive replicates of the {whose} make up for each other (correlation "
                f"{order.correlation:+.2f}), as antithetic pairs do: their mean is better than "
                "their spread says; of 16 or more in pairs the pairs' means are compared"
            )
    return _result("agree", text, numbers)


def _result(status: Status, reason: str, numbers: dict[str, Any] | None = None) -> RungResult:
    return RungResult("input", status, reason, numbers or {})


def _of_shapes(a: FloatArray, b: FloatArray) -> str | None:
    for name, x in (("candidate", a), ("reference", b)):
        if x.ndim not in (3, 4) or x.shape[-1] != 3:
            channels = f"{x.shape[-1]} channels" if x.ndim in (3, 4) else f"{x.ndim} dimensions"
            return (
                f"the {name} has {channels}, its shape is {x.shape}; expected R, G and B: (height, "
                "width, 3) or (replicates, height, width, 3)"
            )
        if x.size == 0:
            return f"the {name} is empty, its shape is {x.shape}; expected one pixel at least"
    return None


def _of_sizes(a: FloatArray, b: FloatArray) -> str | None:
    (h, w), (y, x) = a.shape[-3:-1], b.shape[-3:-1]
    if (h, w) == (y, x):
        return None
    text = f"the candidate is {w} x {h} pixels; expected {x} x {y}, as the reference"
    if (h, w) == (x, y):
        return f"{text}; width and height are exchanged"
    if w * y == x * h:
        return f"{text}; it is the same view, {_times(w / x)} as large"
    return text


def _times(factor: float) -> str:
    return f"{factor:.3g} times" if factor >= 1.0 else f"1/{1.0 / factor:.3g}"


def _where(at: npt.NDArray[np.bool_]) -> str:
    """The first true pixel of (replicates, height, width), in words."""
    k, y, x = (int(i[0]) for i in np.nonzero(at))
    return f"column {x}, row {y}" + (f" of replicate {k}" if len(at) > 1 else "")


def _counted(count: int, what: str = "pixel") -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _not_finite(whose: str, x: FloatArray) -> str | None:
    bad = nonfinite_pixels(x)
    if not bad.any():
        return None
    k, row, column = (int(i[0]) for i in np.nonzero(bad))
    value = next(v for v in x[k, row, column] if not np.isfinite(v))
    text = f"{_counted(int(np.count_nonzero(bad)))} of {whose}"
    return f"{text} not finite, the first {value} at {_where(bad)}; expected finite radiance"


def _transparent(alpha: FloatArray, a: FloatArray, b: FloatArray) -> str | None:
    alpha = alpha[None] if alpha.ndim == 2 else alpha
    if alpha.shape not in (a.shape[:3], (1, *a.shape[1:3])):
        return f"the opacity's shape is {alpha.shape}; expected that of the pictures, {a.shape[:3]}"
    bad = ~np.isfinite(alpha)
    if bad.any():
        return f"the opacity is not finite at {_where(bad)}; expected 0 to 1"
    if not alpha.any():
        return "the candidate is transparent throughout; expected an opaque picture"
    lit = b.mean(axis=0).max(axis=-1) > DIM * white_level(b)
    holes = (alpha <= 0.0) & lit & (a.max(axis=-1) <= 0.0)
    if not holes.any():
        return None
    return (
        f"{_counted(int(np.count_nonzero(holes)))} of the candidate transparent and black where "
        f"the reference is lit, the first at {_where(holes)}; expected an opaque picture"
    )


def _replicates(which: list[int], total: int) -> str:
    """For example "replicates 2 and 5 of 16"."""
    if len(which) == total:
        return "all replicates" if total > 1 else "the picture"
    shown = ", ".join(map(str, which[:8])) + (", ..." if len(which) > 8 else "")
    return f"replicate{'s' if len(which) > 1 else ''} {shown} of {total}"


def _lit(picture: FloatArray) -> int:
    return int(np.count_nonzero(picture.any(axis=-1)))


def _not_as_most(picture: FloatArray) -> int:
    return int(np.count_nonzero((picture != np.median(picture, axis=(0, 1))).any(axis=-1)))


def _black(a: FloatArray, b: FloatArray) -> str | None:
    black = [k for k, picture in enumerate(a) if not picture.any()]
    if not black or not b.any() or may_be_flat(a, b, _lit):
        return None
    mean = f"{b.mean():.3g} W/sr/m² on average"
    return f"the candidate is black throughout ({_replicates(black, len(a))}); expected {mean}"


def _constant(a: FloatArray, b: FloatArray) -> str | None:
    flat = [k for k, picture in enumerate(a) if (picture == picture[0, 0]).all()]
    pixels = a.shape[1] * a.shape[2]
    if not flat or pixels == 1 or any((picture == picture[0, 0]).all() for picture in b):
        return None
    if may_be_flat(a, b, _not_as_most):
        return None
    colour = ", ".join(f"{v:.3g}" for v in a[flat[0], 0, 0])
    return (
        f"every pixel of the candidate is ({colour}) ({_replicates(flat, len(a))}); expected a "
        "picture, as the reference is"
    )


def _repeated(a: FloatArray, b: FloatArray) -> str | None:
    """Replicates that are identical, although the other side's differ: there is noise."""
    same = {"candidate": same_pairs(a), "reference": same_pairs(b)}
    if same["candidate"] and len(b) > 1 and same["reference"]:
        is_fixed = len(same["candidate"]) == math.comb(len(a), 2)
        if not is_fixed or may_all_be_the_same(len(a), b):
            return None  # there is no noise, or so little that both repeat themselves
    for name, x, other in (("candidate", a, b), ("reference", b, a)):
        if name == "reference" and len(a) == 1:
            continue
        if same[name] and not may_be_the_same(x, other):
            which = sorted({k for pair in same[name] for k in pair})
            return (
                f"{_replicates(which, len(x))} of the {name} are the same bit for bit; expected "
                "independent noise, a seed of its own for each"
            )
    if not any(same.values()):
        return _repeated_but_for_rounding(a, b)
    return None


def _repeated_but_for_rounding(a: FloatArray, b: FloatArray) -> str | None:
    """Replicates that differ from others by rounding alone, although the other side's do not."""
    sides = {"candidate": Rounding(a), "reference": Rounding(b)}
    same = {name: side.repeats() for name, side in sides.items()}
    if all(same.values()):
        return None
    for name, other in (("candidate", "reference"), ("reference", "candidate")):
        if same[name] and not sides[name].may_repeat(same[name], sides[other]):
            which = sorted({k for pair in same[name] for k in pair})
            count = len(a if name == "candidate" else b)
            return (
                f"{_replicates(which, count)} of the {name} are the same as others but for "
                "rounding; expected independent noise, a seed of its own for each"
            )
    return None


def _odd(whose: str, x: FloatArray) -> str | None:
    """One replicate with another mean than the rest, in words."""
    odd = odd_replicate(x) if len(x) > 1 else None
    if odd is None:
        return None
    of = f" in {odd.channel}" if odd.channel else ""
    where = f" {odd.where}" if odd.where else ""
    return (
        f"replicate {odd.index} of the {whose} is unlike the other {len(x) - 1}: its median "
        f"block is {100.0 * odd.bias:+.2g} % from theirs{of}{where} ({odd.errors:.0f} standard "
        "errors of its ranks); expected replicates that differ by noise only"
    )


INDEPENDENT = "expected independent noise, a seed of its own for each replicate"


def _in_order(whose: str, x: FloatArray) -> str | None:
    """Replicates that depend on the one before, in words."""
    order = successive(x)
    if order is None or order.makes_up:
        return None
    if any(order.movement):
        x_moved, y_moved = order.movement
        return (
            f"each replicate of the {whose} is like the one before, moved by {x_moved:+d}, "
            f"{y_moved:+d} pixels (right, down; correlation {order.correlation:.2f}), as where "
            "the seed plus the pixel's number seeds a pixel; expected independent noise: seeds "
            "that are far apart, or hashed with the pixel's number"
        )
    return (
        f"the replicates of the {whose} depend on their order: the correlation of successive ones "
        f"is {order.correlation:+.2f} from that of any two, as in a history or in prefixes of one "
        f"accumulation; {INDEPENDENT}"
    )


COMMON = 0.05
"""Variance of the noise common to all replicates, over a replicate's own, above which it is
reported.  At 16 replicates the mean's error is then underestimated by a third."""


def _sharing_noise(a: FloatArray, b: FloatArray) -> str | None:
    if len(a) < 2:
        return None
    if (found := correlated_pair(a)) is not None:
        i, j, correlation = found
        return (
            f"replicates {i} and {j} of the candidate share noise (correlation {correlation:.2f}); "
            f"{INDEPENDENT}"
        )
    rounding = Rounding(a)
    is_rounded = rounding.coarse and len(rounding.repeats()) == math.comb(len(a), 2)
    hidden = rounding.step if is_rounded else None
    common = common_noise(a, b, hidden) if len(b) > 1 else None
    if common is not None and common > COMMON:
        share = common / (1.0 + common)
        return (
            f"the candidate's replicates share noise: {100.0 * share:.0f} % of their variance is "
            f"the same in all; {INDEPENDENT}"
        )
    return None


def _codes(x: FloatArray) -> dict[str, FloatArray]:
    """Values in [0, 1] as (fractional) 8-bit codes, by encoding."""
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0) ** (1.0 / 2.4) - 0.055)
    return {
        "sRGB": CODES * srgb,
        "linear": CODES * x,
        "gamma 2.2": CODES * np.maximum(x, 0.0) ** (1.0 / 2.2),
    }


def _encoding(x: FloatArray) -> str | None:
    """The encoding in which all values of a picture are 8-bit codes; None if there is none."""
    if x.min() < 0.0 or x.max() > 1.0 + 1e-3:
        return None
    values = np.unique(x.astype(np.float32)).astype(np.float64)
    # Rounding to half floats does not split a code into several values.
    if not FEWEST_CODES <= len(values) <= CODES + 1:
        return None
    for name, codes in _codes(values).items():
        if (np.abs(codes - np.round(codes)) <= ON_GRID).all():
            return name
    return None


def _quantised(a: FloatArray, b: FloatArray) -> str | None:
    encoding = _encoding(a[0])
    if encoding is None or _encoding(b[0]) is not None:
        return None
    # A reference with few values has flat colours; the candidate's few values then prove nothing.
    values = [len(np.unique(x.astype(np.float32))) for x in (a[0], b[0])]
    if values[1] < 2 * values[0]:
        return None
    return (
        f"the candidate has {values[0]} different values, all of them 8-bit {encoding} codes: it "
        "is rounded, and clipped at 1; expected floating-point radiance (EXR, PFM, HDR or NPY)"
    )


def _clamped(a: FloatArray, b: FloatArray) -> str | None:
    top = float(a.max())
    at = (a == top).mean(axis=0) > 0.5
    count = int(np.count_nonzero(at))
    there = b.mean(axis=0)[at]
    if count < FEWEST_CLAMPED or not top > 0.0:
        return None
    above = there > CLAMPED * top
    # The reference must vary there: a flat lamp that is only dimmer is not clamped.
    if above.mean() < 0.9 or np.ptp(there) < 0.05 * top or not math.isfinite(top):
        return None
    return (
        f"{_counted(count, 'value')} of the candidate {'is' if count == 1 else 'are'} exactly "
        f"{top:.6g}, its maximum, where the reference has {there.min():.3g} to {there.max():.3g}: "
        "highlights are clamped; expected radiance without an upper limit"
    )
