"""Hypotheses about positions: mirrors, shifts, lenses, filters."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import scipy
from scipy import ndimage

from comparisons.compare.diagnosis.contest import Contender, Fit, contenders
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import REST, Misfit
from comparisons.compare.diagnosis.sample import chosen_pixels
from comparisons.compare.diagnosis.warps import FARTHEST, Search, Warp, grid
from comparisons.results.case import FloatArray


@dataclass(frozen=True)
class Move:
    """What happens to positions.  family, name, evidence, parameters, leaves: as in `Hypothesis`;
    of: a picture to which it happens, or  warp: what was fitted."""

    family: str
    name: str
    evidence: str
    parameters: int
    of: Callable[[FloatArray], FloatArray] | None = None
    leaves: float = 0.0
    warp: Warp | None = None

    def seen(self, misfit: Misfit) -> Misfit:
        """The misfit of the reference to which it happens."""
        if self.warp is not None:
            return misfit.seen(*self.warp.seen(misfit))
        assert self.of is not None
        return misfit.seen(self.of(misfit.reference))

    def sampled(self, misfit: Misfit, small: Misfit) -> Misfit:
        """The same at `chosen_pixels`;  small: the misfit of these."""
        return self.seen(misfit) if small is misfit else small.seen(*self._at(misfit))

    def then(self, fits: Iterable[Fit], misfit: Misfit, small: Misfit) -> Iterator[Contender]:
        """What is fitted to the reference to which it happens."""
        early = self.sampled(misfit, small)
        return contenders(
            fits, early, cache(lambda: early if small is misfit else self.seen(misfit))
        )

    def colours(self, misfit: Misfit) -> FloatArray:
        """(pixels, 3): what `chosen_pixels` show; NaN outside."""
        values, inside = self._at(misfit)
        return (values if inside is None else np.where(inside > 0.0, values, np.nan)).reshape(-1, 3)

    def _at(self, misfit: Misfit) -> tuple[FloatArray, FloatArray | None]:
        shape = misfit.reference.shape
        chosen = chosen_pixels(shape)
        if self.warp is not None:
            return self.warp.at(misfit, *grid(shape, chosen))
        assert self.of is not None
        return np.asarray(self.of(misfit.reference).reshape(-1, 3)[chosen]), None

    def alone(self, seen: Misfit) -> Iterator[Hypothesis]:
        """That nothing else happens;  seen: as above."""
        yield Hypothesis(
            self.family,
            self.name,
            self.evidence,
            seen.reference,
            self.parameters,
            self.leaves,
            self.slack(seen.reference),
        )

    def slack(self, picture: FloatArray) -> Callable[[], FloatArray] | None:
        """As in `Hypothesis`;  picture: the one that the candidate is predicted to be."""
        return None if self.warp is None else partial(self.warp.slack, picture)


def fits(misfit: Misfit, small: Misfit) -> Iterator[Contender]:
    """Moves alone;  small: of the sample."""
    for move in moves(misfit, misfit.reference):
        yield from move.then([move.alone], misfit, small)


def moves(misfit: Misfit, base: FloatArray) -> Iterator[Move]:
    """All, fitted so that `base`, the reference in the candidate's colours, becomes the
    candidate."""
    shape = base.shape
    yield from _turns(shape)
    if min(shape[:2]) <= 2 * FARTHEST:
        return
    rolled = x, y = _largest_correlation(misfit.candidate, base)
    enters = np.roll(base, (y, x), axis=(0, 1))
    at = [np.clip(np.arange(n) - by, 0, n - 1) for n, by in zip(shape, (y, x), strict=False)]
    wraps = misfit.prefers(enters, base[np.ix_(*at)])
    if wraps:
        yield Move(
            "shift",
            f"shift by {x:+d}, {y:+d} pixels that wraps around",
            f"the candidate is the reference shifted {x:+d}, {y:+d} pixels (right, down), and what "
            "leaves it on one side enters on the other",
            1,
            lambda p: np.roll(p, (y, x), axis=(0, 1)),
        )
    for bilinear in (False, True):
        yield Move(
            "half the size",
            "half the size, enlarged",
            "the candidate is the reference at half its size, enlarged again",
            0,
            _halved_smoothly if bilinear else _halved,
        )
    yield from filters(misfit, base)
    for warp in Search(misfit, base).warps(rolled):
        if not (wraps and warp.is_shift(x, y)):
            yield of_warp(warp, shape)


def of_warp(warp: Warp, shape: tuple[int, ...]) -> Move:
    name, evidence = warp.told(shape)
    return Move(warp.family, name, evidence, warp.parameters, warp=warp)


def _turns(shape: tuple[int, ...]) -> Iterator[Move]:
    turned: dict[str, Callable[[FloatArray], FloatArray]] = {
        "mirrored left to right": lambda r: r[:, ::-1],
        "upside down": lambda r: r[::-1],
        "rotated by 180 degrees": lambda r: r[::-1, ::-1],
    }
    if shape[0] == shape[1]:
        turned |= {
            "rows and columns exchanged": lambda r: r.transpose(1, 0, 2),
            "rotated by 90 degrees to the left": lambda r: r.transpose(1, 0, 2)[::-1],
            "rotated by 90 degrees to the right": lambda r: r.transpose(1, 0, 2)[:, ::-1],
            "rows and columns exchanged, and rotated by 180 degrees": lambda r: r.transpose(
                1, 0, 2
            )[::-1, ::-1],
        }
    for name, change in turned.items():
        evidence = f"the candidate is the reference, {name}"
        yield Move("mirrored", name, evidence, 0, change)


def _largest_correlation(candidate: FloatArray, base: FloatArray) -> tuple[int, int]:
    """The movement to the right and down, with what leaves on one side entering on the other, by
    which the two are most alike."""
    total = np.zeros(base.shape[:2])
    for k in range(3):
        a, b = (np.fft.rfft2(p[..., k] - p[..., k].mean()) for p in (candidate, base))
        total += np.fft.irfft2(a * b.conj(), base.shape[:2])
    y, x = (int(v) for v in np.unravel_index(int(total.argmax()), total.shape))
    height, width = base.shape[:2]
    return x - width * (2 * x > width), y - height * (2 * y > height)


def _halved(p: FloatArray) -> FloatArray:
    """Each pixel has the mean of the two by two to which it belongs."""
    h, w = (n - n % 2 for n in p.shape[:2])
    found = p.copy()
    small = p[:h, :w].reshape(h // 2, 2, w // 2, 2, 3).mean(axis=(1, 3))
    found[:h, :w] = small.repeat(2, axis=0).repeat(2, axis=1)
    return found


def _halved_smoothly(p: FloatArray) -> FloatArray:
    """The same, interpolated between the middles of these."""
    h, w = (n - n % 2 for n in p.shape[:2])
    small = p[:h, :w].reshape(h // 2, 2, w // 2, 2, 3).mean(axis=(1, 3))
    at = np.mgrid[: p.shape[0], : p.shape[1]] / 2.0 - 0.25
    channels = [
        ndimage.map_coordinates(small[..., k], at, order=1, mode="nearest") for k in range(3)
    ]
    return np.stack(channels, axis=-1)


NARROWEST, SMALL = 0.15, (0.3, 0.8)
"""Widths of Gaussians in pixels: one that changes nothing, and two, one of which is less than twice
as far from the square of any right one as no blur is."""


def filters(misfit: Misfit, base: FloatArray) -> Iterator[Move]:
    """Blurs, fitted so that `base` becomes the candidate."""

    def blurred(p: FloatArray, sigma: float) -> FloatArray:
        return np.asarray(ndimage.gaussian_filter(p, (sigma, sigma, 0.0), mode="nearest"))

    def squares(sigma: float) -> float:
        return misfit.squares(blurred(base, sigma))

    # Hardly any picture is blurred: squares fall towards the right width from 0 on, so that one of
    # few widths is better than none.
    sigma = NARROWEST
    if min(map(squares, SMALL)) < misfit.squares(base):
        fit = scipy.optimize.minimize_scalar(
            squares,
            bounds=(NARROWEST, 3.0),
            method="bounded",
            options={"xatol": 0.01, "maxiter": 25},
        )
        sigma = float(fit.x)
    evidence = f"the candidate is the reference through a Gaussian of sigma {sigma:.2g} pixels"
    # A filter is only nearly a Gaussian.
    yield Move(
        "filter",
        f"blurred by {sigma:.2g} pixels",
        evidence,
        1,
        lambda p: blurred(p, sigma),
        REST,
    )


def sharpened(misfit: Misfit) -> Iterator[Hypothesis]:
    r = misfit.reference
    detail = r - ndimage.gaussian_filter(r, (0.7, 0.7, 0.0), mode="nearest")
    amount = misfit.amount(detail)
    if amount > 0.0 and min(r.shape[:2]) > 2 * FARTHEST:
        evidence = (
            f"details of the size of a pixel are {1.0 + amount:.3g} times as strong as the "
            "reference's"
        )
        yield Hypothesis("filter", "sharpened", evidence, r + amount * detail, 1, REST)
