"""Causes of a difference of two back ends: what the usual diagnosis cannot know without the scene's
shapes, or without the number of samples."""

import warnings
from collections.abc import Iterator

import numpy as np
from scipy.stats import spearmanr

from comparisons.compare.diagnosis import IN_PART, is_sure
from comparisons.compare.diagnosis.misfit import REST, Misfit
from comparisons.compare.diagnosis.spots import FEW_PIXELS, ONE_PIXEL, ONE_TILE
from comparisons.compare.judge import likeliest_cause
from comparisons.compare.path_length import path_lengths
from comparisons.gate.rim import lengths_without_rim, without
from comparisons.results.case import Case, Cause, FloatArray, Images
from comparisons.statistics.cells import HALF
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.util.errors import SceneWarning

MOST = 0.8
"""Least share of the squared difference beyond noise that lies on the shape that is named."""

DENSER = 1.5
"""Least times that share is of the shape's share of the picture."""

DARK = 0.02
"""Largest fraction of the other side's light that a part which is black has."""

BLACK = "are black"
"""Ends the name of a cause that no change of paths makes."""

BACKS = 0.6
"""Least share of the back sides' pixels, some of which see an edge, that are black if all are."""

STEEP = 0.5
"""Least rank correlation of the difference with the angle of incidence."""

SHAPES = 3
"""So many shapes are taken away in turn, those that hold most of the difference."""


def cause_of(
    case: Case,
    a: FloatArray,
    b: FloatArray,
    scene: Scene | None,
    spp: int | None,
    threads: int | None = None,
    rim: int = 0,
) -> Cause | None:
    """The likeliest cause of a case that differs, which the pictures alone have told.  a, b
    (height, width, 3): a picture of either;  scene: what they show, None where it is not known;
    spp: samples per pixel of a picture;  rim: how many of the scene's outermost pixels the pictures
    lack."""
    images, told = case.images, case.cause
    assert images is not None
    if spp is not None and (found := _dropped(case, images, spp)) is not None:
        return found
    if (found := _halves(case.sides, images, a, b, spp)) is not None or is_sure(told):
        return found or told
    misfit = Misfit(images)
    if scene is None or not (misfit.clear and misfit.excess > 0):
        return told
    squares = misfit.weights * (images.candidate - images.reference) ** 2
    if images.error is not None:
        squares = squares - misfit.weights * images.error**2
    seen = _Seen(scene, case.sides, images, squares.sum(axis=-1), rim)
    if (found := _of_change(seen, threads)) is not None:
        return found
    of_shape = _on_shape(seen)
    if of_shape is not None and of_shape.name.endswith(BLACK):
        return of_shape
    lengths = path_lengths(scene, threads)
    also = likeliest_cause(images, None, lengths and lengths_without_rim(lengths, rim))
    is_place = also is None or also.name.endswith((ONE_TILE, FEW_PIXELS, ONE_PIXEL))
    if also is not None and not is_place and not also.name.startswith(IN_PART):
        return also
    return of_shape or also or told


def _dropped(case: Case, images: Images, spp: int) -> Cause | None:
    """Of every pixel the sum of one sample fewer, over the same number."""
    one, two = images.candidate, images.reference
    error = np.zeros_like(one) if images.error is None else images.error
    weights = two / (error**2 + (1e-4 * two) ** 2 + 1e-300)
    gain = float((weights * one).sum() / (weights * two).sum())
    doubt = float(np.sqrt((weights**2 * error**2).sum()) / (weights * two).sum())
    for whose, factor in zip(case.sides, (gain, 1.0 / gain), strict=True):
        lost = 1.0 - factor
        if spp > 1 and abs(lost * spp - 1.0) < max(4.0 * doubt * spp, 0.02) < 0.25:
            left = one - gain * two
            rest = float(
                (left**2 - error**2).sum() / max(((one - two) ** 2 - error**2).sum(), 1e-300)
            )
            if rest > REST:
                return None
            evidence = (
                f"{whose} pictures are {factor:.5g} times the other's: {spp - 1} of {spp} "
                "samples, divided by all"
            )
            return Cause("one sample is dropped", evidence, min(1.0, 1.0 - rest))
    return None


def _halves(
    sides: tuple[str, str], images: Images, a: FloatArray, b: FloatArray, spp: int | None
) -> Cause | None:
    """That the values of one side alone, or their sums over samples, are half floats, where the
    rounding of as many sums may make the difference."""
    means = images.candidate.mean(axis=(0, 1)), images.reference.mean(axis=(0, 1))
    if (np.abs(means[0] - means[1]) > HALF * (spp or 1) * means[1]).any():
        return None
    is_half = [_are_halves(x) or (spp is not None and _are_halves(x * spp)) for x in (a, b)]
    if is_half[0] == is_half[1]:
        return None
    whose, other = sides if is_half[0] else sides[::-1]
    evidence = (
        f"{whose} values{'' if spp is None else f', or {spp} times these,'} are all half floats, "
        f"and {other} are not: they are stored or added up in 16 bits"
    )
    return Cause("half floats", evidence, 0.0)


def _are_halves(values: FloatArray) -> bool:
    small = values[(np.abs(values) > TINY) & (np.abs(values) < LARGEST)].astype(np.float32)
    if small.size < FEWEST:
        return False
    with np.errstate(over="ignore"):
        return bool((small.astype(np.float16).astype(np.float32) == small).mean() > 0.999)


TINY, LARGEST, FEWEST = 2.0**-14, 65504.0, 64


class _Seen:
    """What differs, by the shapes that the rays through the pixels' centres meet.

    excess (height, width): squares beyond noise;  hit: the shapes' numbers, -1 for none;  facing:
    the cosine towards the eye, negative on back sides;  order: the shapes, those first that hold
    most.  All are without the rim.
    """

    def __init__(
        self, scene: Scene, sides: tuple[str, str], images: Images, excess: FloatArray, rim: int
    ) -> None:
        self.scene, self.sides, self.rim = scene, sides, rim
        self.images, self.excess = images, excess
        o, d, *_ = scene.camera_rays()
        hits = scene.intersect(o, d)
        self.hit = without(hits.shape, rim)
        self.facing = without(-(hits.n * d).sum(axis=-1) / np.linalg.norm(d, axis=-1), rim)
        shares = np.bincount(self.hit.ravel() + 1, excess.ravel(), len(scene.shapes) + 1)
        self.shares = shares[1:] / shares.sum()
        self.order = np.argsort(-self.shares).tolist()

    def picture(self, scene: Scene, threads: int | None) -> FloatArray:
        """Of the scene, or of a changed one."""
        return without(_picture(scene, threads), self.rim)

    def named(self, shape: int) -> str:
        one = self.scene.shapes[shape]
        material = getattr(one, "material", None)
        of = f" of the material {material}" if isinstance(material, str) else ""
        return f"shape {shape} ({one.type}{of})"


def _of_change(seen: _Seen, threads: int | None) -> Cause | None:
    """A change of the scene that makes the one side's picture from the other's."""
    images = seen.images
    there_and_back = (images, Images(images.reference, images.candidate, images.error))
    sides = list(zip(seen.sides, map(Misfit, there_and_back), strict=True))
    best: Cause | None = None
    for name, change in _changes(seen, threads):
        for whose, misfit in sides:
            noise = misfit.squares(misfit.reference) - misfit.excess
            left = (misfit.squares(misfit.reference + change) - noise) / misfit.excess
            explained = min(1.0 - left, 1.0)
            if left <= REST and (best is None or explained > best.explained):
                evidence = f"so does our picture change: {100.0 * explained:.3g} % of it"
                best = Cause(f"{whose} pictures are {name}", evidence, explained)
    return best


def _on_shape(seen: _Seen) -> Cause | None:
    """The one shape that holds what differs."""
    worst = seen.order[0]
    on, share, name = seen.hit == worst, min(float(seen.shares[worst]), 1.0), seen.named(worst)
    if share < max(MOST, DENSER * float(on.mean())):
        return None
    evidence = f"{100.0 * share:.0f} % of the difference are on {name}"
    grey = [x.sum(axis=-1) for x in (seen.images.candidate, seen.images.reference)]
    for whose, dark, other in zip(seen.sides, grey, grey[::-1], strict=True):
        black = on & (dark <= DARK * other) & (other > 0.0)
        if float(seen.excess[black].sum()) > MOST * float(seen.excess[on].sum()):
            back = on & (seen.facing < 0.0)
            what = f"{100.0 * black.sum() / on.sum():.0f} % of it {BLACK}"
            if not (black & ~back).any() and black.sum() > BACKS * back.sum():
                what = f"back sides {BLACK}"
            return Cause(f"{name}: {what}", f"{evidence}, in {whose} pictures", share)
    difference = np.abs(grey[0] - grey[1])[on] / np.maximum(grey[1][on], 1e-300)
    steep = float(spearmanr(difference, -np.abs(seen.facing[on])).statistic)
    if on.sum() > FEWEST and steep > STEEP:
        evidence += f", and grow towards grazing angles (rank correlation {steep:.2f})"
        return Cause(f"{name}: another Fresnel term", evidence, share)
    return Cause(f"{name} looks different", evidence, share)


def _changes(seen: _Seen, threads: int | None) -> Iterator[tuple[str, FloatArray]]:
    """How our picture changes (height, width, 3) without each of some shapes, and with the next or
    the last material of each in place of its own."""
    scene = seen.scene
    right = seen.picture(scene, threads)
    for shape in seen.order[:SHAPES]:
        rest = [one for k, one in enumerate(scene.shapes) if k != shape]
        other = scene.changed(shapes=rest)
        yield f"without {seen.named(shape)}", seen.picture(other, threads) - right
    names = list(scene.materials)
    used = [str(getattr(one, "material", None)) for one in scene.shapes]
    if len(names) < 2 or not all(name in names for name in used):
        return
    for step in (1, -1):
        moved = [
            one.model_copy(update={"material": names[(names.index(name) + step) % len(names)]})
            for one, name in zip(scene.shapes, used, strict=True)
        ]
        name = f"of materials whose index is off by {step:+d}"
        yield name, seen.picture(scene.changed(shapes=moved), threads) - right


def _picture(scene: Scene, threads: int | None) -> FloatArray:
    sampler = scene.resolved_sampler
    if not isinstance(sampler, Grid):
        pixels = scene.film.width * scene.film.height
        spp = max(LEAST, 1 << max(0, (SAMPLES // pixels).bit_length() - 1))
        scene = scene.changed(sampler=sampler.model_copy(update={"spp": spp}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # without its lamp a scene is black
        return render(scene, threads=threads).colour


SAMPLES, LEAST = 1 << 18, 16
"""Camera samples of a picture, and least of a pixel: both pictures of a change have the same random
numbers, and nothing is named that leaves a tenth of the difference."""
