"""Planted causes, single ones and two together, have their names, and no wrong ones."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from planted_causes import PLANTED, Change, is_named

from comparisons.compare.diagnosis import IN_PART, likeliest
from comparisons.compare.diagnosis.tones import A_CURVE
from comparisons.results.case import FloatArray, Images
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

SCENES = Path(__file__).parents[3] / "scenes"

NOISE = {"shaded": 0.05, "cornell_box": 0.05, "textured_room": 0.1, "spheres_whitted": 0.0}
"""Relative, of a replicate."""


@cache
def picture(name: str) -> FloatArray:
    if name == "shaded":
        return shaded()
    scene = Scene.load(SCENES / f"{name}.yaml")
    side = {"width": 96, "height": 96 if name == "cornell_box" else 72}
    scene = scene.changed(film=scene.film.model_copy(update=side))
    if not scene.integrator.deterministic:
        sampler = scene.resolved_sampler.model_copy(update={"spp": 256})
        scene = scene.changed(sampler=sampler)
    return render(scene).colour


def shaded() -> FloatArray:
    """A smooth wall, a brighter disk, a lamp and a dark border: channels are proportional."""
    y, x = np.mgrid[:40, :40] / 40
    p = (0.3 + 0.17 * np.sin(4 * x + 1) * np.cos(6 * y + 0.4))[..., None] * [0.7, 0.9, 1.0]
    p[(x - 0.35) ** 2 + (y - 0.6) ** 2 < 0.04] *= 2.3
    p[8:12, 13:26] = 7.0
    p[:, :4] *= 0.02
    return p


def images(name: str, change: Change) -> Images:
    """Of 8 replicates, each changed, and of 16 right ones."""
    p, noise = picture(name), NOISE[name]
    if noise == 0.0:
        return Images(change(p), p)
    rng = np.random.default_rng(0)
    a, b = (p * rng.gamma(noise**-2, noise**2, (n, *p.shape)) for n in (8, 16))
    a = np.stack([change(one) for one in a])
    of_a, of_b = a.var(axis=0, ddof=1) / 8, b.var(axis=0, ddof=1) / 16
    means = a.mean(axis=0), b.mean(axis=0)
    return Images(*means, np.sqrt(of_a + of_b), reference_error=np.sqrt(of_b))


def named(scene: str, planted: str) -> str:
    found = likeliest(images(scene, PLANTED[planted]))
    return "" if found is None else found.name


@pytest.mark.cases(7)
@pytest.mark.parametrize("planted", PLANTED)
def test_a_planted_cause_is_named(planted: str) -> None:
    assert is_named(named("shaded", planted), planted)


@pytest.mark.slow
@pytest.mark.parametrize("scene", NOISE)
def test_nine_tenths_are_named_and_none_wrongly(scene: str) -> None:
    found = {planted: named(scene, planted) for planted in PLANTED}
    right = [
        planted
        for planted, name in found.items()
        if is_named(name, ALIKE.get((scene, planted), planted))
    ]
    wrong = {
        planted: name
        for planted, name in found.items()
        if name and planted not in right and not is_part(name, planted)
    }
    assert not wrong
    assert len(right) >= 0.9 * len(PLANTED)


ALIKE = {
    ("cornell_box", "shift by +1, +0 pixels that wraps around"): "shift by one pixel in x",
    (
        "cornell_box",
        "shift by +1, +0 pixels that wraps around, then constant gain of 1.414",
    ): "shift by one pixel in x, then constant gain of 1.414",
}
"""What is the same: the outermost pixels of that scene are black."""


def is_part(name: str, planted: str) -> bool:
    """Whether one of two planted causes is named as a part; sRGB's encoding is a tone curve."""
    if "sRGB" in planted and name == f"{IN_PART}{A_CURVE}":
        return True
    return name.startswith(IN_PART) and any(
        is_named(name.removeprefix(IN_PART), one) for one in planted.split(", then ")
    )


def test_one_of_two_causes_is_no_whole() -> None:
    """What no pair of causes is: a gain, and a tile that is another's."""

    def change(p: FloatArray) -> FloatArray:
        p = 1.3 * p
        p[20:28, 4:12] = p[30:38, 28:36]
        return p

    found = likeliest(images("shaded", change))
    assert found is None or found.name.startswith(IN_PART)
    if found is not None:
        assert "constant gain" in found.name
        assert "something else differs, too" in found.evidence


def test_a_moved_object_is_no_known_cause() -> None:
    def change(p: FloatArray) -> FloatArray:
        p = p.copy()
        lamp = p[8:12, 13:26].copy()
        p[8:12, 13:26] = p[12:16, 13:26]
        p[9:13, 15:28] = lamp
        return p

    found = likeliest(images("shaded", change))
    assert found is None or found.name == "one bad tile"
