"""Diagnoses: each fault planted in a picture is named, and none where only noise differs."""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from comparisons.compare.diagnosis import brightness, likeliest, of_rungs
from comparisons.compare.diagnosis.contest import contenders, possible
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import Misfit
from comparisons.compare.diagnosis.sample import POINTS
from comparisons.results.case import FloatArray, Images, RungResult
from reference_rt.rendering.image import srgb
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.textures.image_file import linear

SCENES = Path(__file__).parents[3] / "scenes"

ERROR = {"cornell_box": 0.015, "textured_room": 0.03, "spheres_whitted": 0.0}
"""Relative noise of the pictures: of 64 samples per pixel in the first, 16 in the second."""


@cache
def picture(name: str) -> FloatArray:
    """Rendered: with many samples, as a truth to which noise is added, so that it is known."""
    scene = Scene.load(SCENES / f"{name}.yaml")
    height = 72 if name == "spheres_whitted" else 96
    scene = scene.changed(film=scene.film.model_copy(update={"width": 96, "height": height}))
    if not scene.integrator.deterministic:
        sampler = scene.resolved_sampler.model_copy(update={"spp": 64})
        scene = scene.changed(sampler=sampler)
    return render(scene).colour


def pair(name: str, change: Callable[[FloatArray], FloatArray], seed: int = 0) -> Images:
    """A changed picture and the right one, as means of 16 noisy ones of either."""
    clean, error = picture(name), ERROR[name]
    if error == 0.0:
        return Images(change(clean), clean)
    rng = np.random.default_rng(seed)
    deviation = error * np.maximum(clean, 0.1 * clean.mean())
    candidate, reference, *more = (
        clean + deviation * rng.normal(size=clean.shape) for _ in range(10)
    )
    # What changes a picture changes its noise.
    own = np.var([change(one) for one in more], axis=0, ddof=1)
    error = np.sqrt(own + deviation**2)
    return Images(change(candidate), reference, error, reference_error=deviation)


def shifted(x: float, y: float, order: int = 1) -> Callable[[FloatArray], FloatArray]:
    return lambda p: ndimage.shift(p, (y, x, 0.0), order=order, mode="nearest")


def blurred(sigma: float) -> Callable[[FloatArray], FloatArray]:
    return lambda p: ndimage.gaussian_filter(p, (sigma, sigma, 0.0), mode="nearest")


def part(
    rows: slice | int, columns: slice | int, gain: float
) -> Callable[[FloatArray], FloatArray]:
    def change(p: FloatArray) -> FloatArray:
        p = p.copy()
        p[rows, columns] *= gain
        return p

    return change


ALL = slice(None)


def lens(*factors: float, barrel: float = 0.0) -> Callable[[FloatArray], FloatArray]:
    """Seen with each channel's distances from the middle times a factor, and 1 + barrel r²."""

    def change(p: FloatArray) -> FloatArray:
        middle = (np.array(p.shape[:2]) - 1.0)[:, None, None] / 2.0
        away = np.stack(np.mgrid[: p.shape[0], : p.shape[1]]) - middle
        bent = 1.0 + barrel * (away**2).sum(axis=0) / (middle**2).sum()
        seen = [
            ndimage.map_coordinates(p[..., k], middle + away * f * bent, order=3, mode="nearest")
            for k, f in enumerate(np.broadcast_to(factors or 1.0, 3))
        ]
        return np.stack(seen, axis=-1)

    return change


def matrix(rows: FloatArray) -> Callable[[FloatArray], FloatArray]:
    return lambda p: p @ np.asarray(rows).T


def clipped(p: FloatArray) -> FloatArray:
    return np.clip(p, 0.0, 1.0)


def hable(p: FloatArray) -> FloatArray:
    """The filmic curve of a game (Hable 2010)."""
    a = 2.0 * p
    return (a * (0.15 * a + 0.05) + 0.004) / (a * (0.15 * a + 0.5) + 0.06) - 0.02 / 0.3


REC_2020 = np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]])
"""ITU-R BT.2087, from Rec. 709."""

ACES_CG = np.array([[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0134], [0.0206, 0.1096, 0.8698]])
"""From Rec. 709, adapted by Bradford (the Academy's colour transforms, `ACEScg`)."""

XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""IEC 61966-2-1."""

MIXED = np.array([[0.9, 0.1, 0.05], [0.0, 0.8, 0.1], [0.1, -0.1, 1.1]])

PLANTED = {
    "swapped channels: all channels": lambda p: p[..., [1, 2, 0]],
    "grey: the luminance in each channel": matrix(np.tile(XYZ[1], (3, 1))),
    "grey: the mean of the channels in each": matrix(np.full((3, 3), 1.0 / 3.0)),
    "saturation of 0.8": matrix(0.8 * np.eye(3) + 0.2 * XYZ[1]),
    "Rec. 2020 where linear sRGB is expected": matrix(REC_2020),
    "linear sRGB taken for Rec. 2020": matrix(np.linalg.inv(REC_2020)),
    "ACEScg where linear sRGB is expected": matrix(ACES_CG),
    "CIE XYZ where linear sRGB is expected": matrix(XYZ),
    "a matrix of colours": matrix(MIXED),
    "zoom of 1.01": lens(1.0 / 1.01),
    "zoom of 0.95": lens(1.0 / 0.95),
    "barrel distortion of 0.01": lens(barrel=0.01),
    "pincushion distortion of 0.01": lens(barrel=-0.01),
    "chromatic aberration": lens(0.995, 1.0, 1.005),
    "Reinhard's tone curve": lambda p: p / (1.0 + p),
    "sRGB decoded by a gamma of 2.2": lambda p: srgb(clipped(p)) ** 2.2,
    "a gamma of 2 decoded as sRGB": lambda p: linear(clipped(p) ** 0.5),
    "tone curve: the power of 1.1": lambda p: 0.9 * np.maximum(p, 0.0) ** 1.1,
    "constant gain of 1.02": lambda p: 1.02 * p,
    "constant gain of 0.5": lambda p: 0.5 * p,
    "gain of red of 1.02": lambda p: p * [1.02, 1.0, 1.0],
    "gain of blue of 0.98": lambda p: p * [1.0, 1.0, 0.98],
    "another gain of each channel": lambda p: p * [1.03, 1.0, 0.97],
    "swapped channels: red and blue": lambda p: p[..., ::-1],
    "gamma of 0.95": lambda p: np.maximum(p, 0.0) ** (1.0 / 1.05),
    "sRGB-encoded values taken for linear ones": srgb,
    "linear values taken for sRGB-encoded ones": lambda p: linear(np.clip(p, 0.0, 1.0)),
    "constant offset of +0.01": lambda p: p + 0.01,
    "half-pixel shift in x": shifted(0.5, 0.0),
    "half-pixel shift in y": shifted(0.0, -0.5, order=3),
    "shift by one pixel in x": shifted(-1.0, 0.0),
    "shift by 0.28": shifted(0.2, 0.2),
    "mirrored left to right": lambda p: p[:, ::-1],
    "upside down": lambda p: p[::-1],
    "rotated by 180 degrees": lambda p: p[::-1, ::-1],
    "blurred by 1": blurred(1.0),
    "sharpened": lambda p: p + 0.8 * (p - blurred(0.7)(p)),
    "highlights clamped to 0.5": lambda p: np.minimum(p, 0.5),
    "one bad tile": part(slice(40, 56), slice(40, 56), 0.8),
    "one bad row": part(30, ALL, 0.3),
    "one bad column": part(ALL, 50, 0.3),
    "a few wrong pixels": part(slice(40, 48, 4), slice(20, 28, 4), 50.0),
}


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    "name",
    ["cornell_box", "spheres_whitted", pytest.param("textured_room", marks=pytest.mark.slow)],
)
@pytest.mark.parametrize("cause", PLANTED)
def test_planted(name: str, cause: str) -> None:
    found = likeliest(pair(name, PLANTED[cause]))
    assert found is not None
    *words, last = cause.split()
    *found_words, found_last = found.name.replace(" pixels", "").split()
    try:
        amount = float(last.removesuffix("pixels"))
    except ValueError:
        assert found.name == cause
    else:
        assert found_words == [word for word in words if word != "pixels"], found
        assert float(found_last) == pytest.approx(amount, rel=0.05)
    assert found.explained > 0.6
    assert found.evidence


def rimmed(width: int, loss: float) -> Callable[[FloatArray], FloatArray]:
    """A rim that is darker, as where a filter's weights beyond the border count without samples."""

    def change(p: FloatArray) -> FloatArray:
        y, x = np.mgrid[: p.shape[0], : p.shape[1]]
        from_border = np.minimum(np.minimum(x, x[::-1, ::-1]), np.minimum(y, y[::-1, ::-1]))
        return p * (1.0 - loss * np.maximum(0.0, 1.0 - from_border / width))[..., None]

    return change


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("name", "width", "loss"),
    [
        ("cornell_box", 2, -0.3),  # its outermost pixels are black
        ("cornell_box", 3, 0.3),
        ("cornell_box", 4, 0.2),
        ("spheres_whitted", 1, 0.5),
        ("spheres_whitted", 2, -0.3),
        ("spheres_whitted", 4, 0.2),
    ],
)
def test_the_rim(name: str, width: int, loss: float) -> None:
    found = likeliest(pair(name, rimmed(width, loss)))
    assert found is not None
    assert found.name == "filter at the picture's border"
    pixels = int(found.evidence.split(" px of the border")[0].rsplit(" ", 1)[1])
    assert pixels in range(1, width + 1) or pixels == 8  # 8 where only blocks show it


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("factor", "told"), [(np.pi, "pi times"), (0.5, "half"), (2.0, "twice"), (1 / np.pi, "1/pi")]
)
def test_remarkable_factors(factor: float, told: str) -> None:
    found = likeliest(pair("cornell_box", lambda p: factor * p))
    assert found is not None
    assert told in found.evidence


def test_transposed() -> None:
    found = likeliest(pair("cornell_box", lambda p: p.transpose(1, 0, 2)))
    assert found is not None
    assert found.name == "rows and columns exchanged"


def test_rounded() -> None:
    found = likeliest(
        pair("spheres_whitted", lambda p: linear(np.round(255.0 * srgb(np.clip(p, 0, 1))) / 255.0))
    )
    assert found is not None
    assert found.name == "rounded to 8 bits (sRGB)"


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("amount", "name"),
    [(-1.0, "lost light: lamp"), (1.0, "light counted twice: lamp"), (0.4, "light of another")],
)
def test_lights(amount: float, name: str) -> None:
    """Two lights: what each gives is known."""
    x = np.linspace(0.0, 1.0, 96)[None, :, None]
    lamp, sky = picture("cornell_box") * x, picture("cornell_box") * (1.0 - x) + 0.05
    noise = np.random.default_rng(5).normal(size=(2, *lamp.shape))
    images = Images(
        (1.0 + amount) * lamp + sky + 0.003 * noise[0],
        lamp + sky + 0.003 * noise[1],
        np.full(lamp.shape, 0.003 * np.sqrt(2.0)),
    )
    found = likeliest(images, {"lamp": lamp, "sky": sky})
    assert found is not None
    assert found.name.startswith(name)
    assert "lamp" in found.evidence
    without = likeliest(images)
    assert without is None or "light" not in without.name.replace("highlights", "")


@pytest.mark.parametrize("pairs", [20, pytest.param(100, marks=pytest.mark.slow)])
def test_noise_alone_has_no_cause(pairs: int) -> None:
    """Also not skewed noise whose strength is known from few replicates only."""
    for seed in range(pairs):
        for name in ("cornell_box", "textured_room"):
            assert likeliest(pair(name, lambda p: p, seed)) is None
    rng = np.random.default_rng(6)
    clean = picture("cornell_box")
    for count in (2, 4, 16):
        for _ in range(pairs // 5):
            sides = [
                clean * rng.gamma(1.0, 1.0, size=(count, *clean.shape[:2], 1)) for _ in range(2)
            ]
            error = np.sqrt(sum(x.var(axis=0, ddof=1) / count for x in sides))
            images = Images(*(x.mean(axis=0) for x in sides), error)
            assert likeliest(images) is None


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["cornell_box", "spheres_whitted"])
@pytest.mark.parametrize("curve", [hable, lambda p: 1.0 - np.exp(-1.5 * p)])
def test_a_tone_curve_without_a_name(name: str, curve) -> None:
    found = likeliest(pair(name, curve))
    assert found is not None
    assert "tone curve" in found.name


def ghost(p: FloatArray) -> FloatArray:
    return 0.95 * p + 0.05 * np.roll(p, (9, 13), axis=(0, 1))


def falls_to_the_right(p: FloatArray) -> FloatArray:
    return p * np.linspace(1.1, 0.9, p.shape[1])[None, :, None]


def two_tiles(p: FloatArray) -> FloatArray:
    return part(slice(10, 26), slice(60, 76), 1.2)(part(slice(40, 56), slice(40, 56), 0.8)(p))


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", ["cornell_box", "spheres_whitted"])
@pytest.mark.parametrize("change", [ghost, falls_to_the_right, two_tiles])
def test_what_does_not_reproduce_the_bias_has_no_name(name: str, change) -> None:
    assert likeliest(pair(name, change)) is None


def test_a_cause_reproduces_each_channel_and_each_block() -> None:
    clean = picture("cornell_box")
    error = np.full(clean.shape, 0.001)
    changed = Misfit(Images(1.1 * clean, clean, error))
    assert changed.reproduces(1.1 * clean)
    assert changed.reproduces(1.099 * clean)
    assert not changed.reproduces(1.08 * clean)
    assert not changed.reproduces(clean * [1.1, 1.1, 1.08])
    assert not changed.reproduces(falls_to_the_right(1.1 * clean))


def test_only_what_a_sample_leaves_possible_is_fitted_to_the_whole_picture() -> None:
    """An offset leaves much of a gain; in noise that hides both, the whole picture decides."""
    rng = np.random.default_rng(3)
    reference = rng.uniform(0.5, 1.0, (96, 96, 3)) * np.linspace(0.1, 2.0, 96)[:, None, None]
    error = np.full(reference.shape, 0.01)
    noise = error * rng.normal(size=reference.shape)

    def offset(misfit: Misfit) -> Iterator[Hypothesis]:
        return (one for one in brightness.FITS[1](misfit) if one.family == "offset")

    for gain, families in ((1.2, ["gain"]), (1.0005, ["gain", "offset"])):
        misfit = Misfit(Images(gain * reference + noise, reference, error))
        small = misfit.sampled()
        assert small.reference.size == 3 * POINTS < reference.size
        fits = (brightness.FITS[0], offset)
        found = possible(list(contenders(fits, small, lambda misfit=misfit: misfit)))
        assert [one.family for one, _ in found] == families


@pytest.mark.parametrize("power", [-20, -10, -7, -4, 0, 4, 7, 10, 20])
def test_a_gain_is_one_at_any_exposure(power: int) -> None:
    """Of radiances far from 1 a gamma of nearly 1 has the same effect, and so has sRGB's curve: a
    picture without deep shadows does not tell them apart in noise."""
    y, x = np.mgrid[:24, :32]
    shape = 1.0 + 0.5 * np.sin(x / 5.0) * np.cos(y / 4.0)
    clean = 2.0**power * shape[..., None] * np.array([1.0, 0.7, 0.4])
    error = 0.08 * clean
    noise = error * np.random.default_rng(5).normal(size=clean.shape)
    cause = likeliest(Images(1.05 * clean + noise, clean, error))
    assert cause is not None
    assert cause.name.startswith("constant gain of 1.0")


def test_what_is_no_single_cause_has_no_name() -> None:
    rng = np.random.default_rng(7)
    pattern = ndimage.gaussian_filter(rng.normal(size=(96, 96, 3)), (4.0, 4.0, 0.0))
    pattern *= 0.1 / pattern.std()
    found = likeliest(pair("cornell_box", lambda p: p * (1.0 + pattern)))
    assert found is None


def test_pictures_that_cannot_be_compared() -> None:
    clean = picture("cornell_box")
    broken = clean.copy()
    broken[0, 0, 0] = np.nan
    assert likeliest(Images(broken, clean)) is None
    assert likeliest(Images(clean[:10], clean)) is None
    assert likeliest(Images(clean, clean)) is None
    tiny = np.ones((1, 2, 3))
    found = likeliest(Images(1.5 * tiny, tiny))
    assert found is None  # of one colour it may be a gain as well as an offset


def geometry(mismatches: int, **kinds: int) -> RungResult:
    numbers = {"mismatches": mismatches, "mismatches_by_kind": kinds}
    return RungResult("geometry", "differ", "some rays differ", numbers)


@pytest.mark.parametrize(
    ("rung", "name"),
    [
        (geometry(50, hit=0, t=0, normal=50, shading_normal=50), "wrong normal"),
        (geometry(50, hit=0, t=0, normal=0, shading_normal=50), "wrong shading normal"),
        (geometry(50, hit=0, t=0, uv=49), "wrong texture coordinates"),
        (geometry(50, hit=2, t=49, normal=50, uv=50), "moved or resized surface"),
        (geometry(50, hit=49, t=1), "missing or additional surface"),
        (geometry(50, hit=20, t=10, uv=20), None),
        (RungResult("film", "differ", "the filters differ by 0.1"), "wrong filter or filter width"),
        (
            RungResult("direct", "differ", "", {"ratio_median": 1.7, "ratio_spread": 0.5,
                                          "ratio_times_cosine_spread": 0.001}),
            "missing cosine",
        ),
        (
            RungResult("direct", "differ", "", {"ratio_median": 3.14159, "ratio_spread": 1e-4}),
            "direct light times 3.142",
        ),
        # A factor that is nearly 1 explains nothing: the normals of a map are wrong.
        (
            RungResult("direct", "differ", "", {"ratio_median": 0.9998, "ratio_spread": 0.004}),
            None,
        ),
        (RungResult("direct", "differ", "", {}), None),
        (RungResult("whitted", "differ", ""), None),
    ],
)  # fmt: skip
def test_of_rungs(rung: RungResult, name: str | None) -> None:
    found = of_rungs([RungResult("input", "agree", ""), rung, RungResult("images", "differ", "")])
    assert (found.name if found else None) == name


def test_no_broken_rung_has_no_cause() -> None:
    assert of_rungs([RungResult("geometry", "agree", "", {})]) is None
    camera = RungResult("geometry", "differ", "the camera: 5 of 9 rays differ", {})
    assert of_rungs([camera]) is None


@pytest.mark.parametrize(("gain", "is_named"), [(2.015, True), (2.05, False), (1.9, False)])
def test_a_factor_is_named_within_one_percent(gain, is_named):
    reference = np.random.default_rng(1).uniform(0.1, 1.0, (24, 24, 3))
    found = next(h for h in brightness.FITS[0](Misfit(Images(gain * reference, reference))))
    assert ("what it should be" in found.evidence) == is_named


def test_pictures_of_8_bits_are_told_by_how_many_values_they_have():
    """However many of the 256 there are; not with more."""
    reference = np.random.default_rng(1).uniform(0.0, 1.0, (64, 64, 3))
    for levels, is_possible in ((200, True), (255, True), (300, False)):
        candidate = np.round(levels * reference) / levels
        misfit = Misfit(Images(candidate, reference))
        causes = {h.family for fit in brightness.FITS for h in fit(misfit)}
        assert ("8 bits" in causes) == is_possible
