"""References of the gate: our own pictures, precise enough and stored; and pictures from files."""

from pathlib import Path

import numpy as np
import pytest
from gate_checks import BALL

from comparisons.gate import reference, reference_cache
from comparisons.gate.pictures_in import from_array
from comparisons.gate.reference import is_noise_free, of_files, of_scene
from comparisons.gate.reference_cache import relative_error
from reference_rt.core.exr import write_exr
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ImageError, UsageError

SCENE = (
    BALL
    + """\
film: {width: 16, height: 12}
sampler: {type: independent, spp: 4}
lights: [{type: constant, radiance: [1, 0.5, 0.001]}]
"""
)
LIMIT = 0.01


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Of references only: kernels have theirs already."""
    folder = tmp_path / "references"
    monkeypatch.setattr(reference_cache, "cache_folder", lambda: folder)
    monkeypatch.setattr(reference, "_ROUND", 1 << 10)
    return folder


class Renderings:
    """Counts calls of `render`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.count, self._render = 0, reference_cache.render
        monkeypatch.setattr(reference_cache, "render", self)

    def __call__(self, *arguments: object, **more: object) -> object:
        self.count += 1
        return self._render(*arguments, **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_it_is_exact_enough_and_kept(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.parse(SCENE)
    calls = Renderings(monkeypatch)
    said: list[tuple[str, float]] = []
    found = of_scene(scene, LIMIT, say=lambda what, part: said.append((what, part)))
    assert found.pictures.shape == (reference.REPLICATES, 12, 16, 3)
    assert relative_error(found.pictures) <= LIMIT * reference.SHARE
    assert calls.count % reference.REPLICATES == 0
    assert calls.count > reference.REPLICATES  # one round would not have done
    parts = [part for what, part in said if what == "rendering the reference"]
    assert parts[0] == 0.0
    assert parts[-1] == 1.0
    assert all(a <= 1.0 for a in parts)
    rendered = calls.count

    again = of_scene(scene, LIMIT)
    assert calls.count == rendered
    np.testing.assert_array_equal(again.pictures, found.pictures)
    # What changes no expectation asks for no new rendering, but for the samples of a round.
    assert of_scene(scene.changed(hierarchy="none"), LIMIT).notes == found.notes
    assert calls.count == rendered

    # A smaller limit goes on from where the last one stopped.
    closer = of_scene(scene, LIMIT / 2)
    assert relative_error(closer.pictures) <= LIMIT / 2 * reference.SHARE
    # Four times as many, by errors that 16 replicates estimate: chi-square of 15 degrees of
    # freedom, whose mean is 1 and of which 99.9 % lie between 0.23 and 2.5.  Seeds follow the
    # sources.
    assert 0 < calls.count - rendered < 4 * (2.5 / 0.23) * rendered
    # As good as one that was rendered at once.
    for file in cache.iterdir():
        file.unlink()
    np.testing.assert_allclose(of_scene(scene, LIMIT / 2).pictures, closer.pictures, rtol=1e-12)


@pytest.mark.slow
def test_another_scene_is_another_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = Renderings(monkeypatch)
    of_scene(Scene.parse(SCENE), LIMIT)
    once = calls.count
    of_scene(Scene.parse(SCENE.replace("0.5}", "0.6}")), LIMIT)
    assert calls.count > once
    monkeypatch.setattr(reference_cache, "source_digest", lambda: "another source")
    twice = calls.count
    of_scene(Scene.parse(SCENE), LIMIT)
    assert calls.count > twice


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["truncated", "rubbish", "empty", "shape"])
def test_a_damaged_cache_is_not_believed(
    cache: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    scene = Scene.parse(SCENE)
    found = of_scene(scene, LIMIT)
    (path,) = cache.iterdir()
    content = path.read_bytes()
    if damage == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "shape":
        np.savez(path, pictures=np.zeros((2, 3)), rounds=100)
    else:
        path.write_bytes(b"" if damage == "empty" else b"rubbish")
    calls = Renderings(monkeypatch)
    np.testing.assert_array_equal(of_scene(scene, LIMIT).pictures, found.pictures)
    assert calls.count > 0


@pytest.mark.slow
def test_work_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "MOST_SAMPLES", 1)
    found = of_scene(Scene.parse(SCENE), 1e-6)
    assert "noisier than" in found.notes[1]


@pytest.mark.slow
def test_the_cache_forgets(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference_cache, "_KEPT", 1)
    for radius in ("1", "2"):
        of_scene(Scene.parse(SCENE.replace("radius: 1", f"radius: {radius}")), LIMIT)
    assert len(list(cache.iterdir())) == 1


def test_scenes_without_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    whitted = Scene.parse(SCENE.replace("independent", "grid") + "integrator: {type: whitted}\n")
    calls = Renderings(monkeypatch)
    found = of_scene(whitted, LIMIT)
    assert found.noise_free
    assert found.pictures.shape == (1, 12, 16, 3)
    of_scene(whitted, LIMIT)
    assert calls.count == 1
    assert is_noise_free(whitted)
    assert is_noise_free(Scene.parse(SCENE + "integrator: {type: ray_cast}\n"))
    assert not is_noise_free(Scene.parse(SCENE + "integrator: {type: whitted}\n"))
    assert not is_noise_free(Scene.parse(SCENE))


def test_references_from_files(tmp_path: Path) -> None:
    pictures = np.random.default_rng(1).random((3, 12, 16, 3))
    three = of_files(from_array(pictures, "three"), None, False)
    np.testing.assert_array_equal(three.pictures, pictures)
    variance = tmp_path / "v.exr"
    write_exr(variance, dict.fromkeys("RGB", np.full((12, 16), 0.25)), {})
    one = of_files(from_array(pictures[:1]), variance, False)
    assert one.variance is not None
    assert (one.variance == 0.25).all()
    with pytest.raises(UsageError, match="--variance: only applies to one reference"):
        of_files(from_array(pictures), variance, False)
    with pytest.raises(ImageError, match="is 16 x 12 pixels; expected 16 x 11, as array"):
        of_files(from_array(pictures[:1, 1:]), variance, False)
    with pytest.raises(ImageError, match=r"b: is 16 x 11 pixels; expected 16 x 12, as a: repl"):
        of_files((*from_array(pictures[0], "a"), *from_array(pictures[0, 1:], "b")), None, False)


def test_relative_error_is_a_standard_error() -> None:
    rng = np.random.default_rng(2)
    pictures = rng.normal(2.0, 0.1, (400, 4, 5, 3))
    # sigma / mean / sqrt(pixels * replicates), known to 1 / sqrt(2 * 399) = 3.5 % a channel.
    assert relative_error(pictures) == pytest.approx(0.05 / np.sqrt(20 * 400), rel=0.15)
    dark = pictures * np.array([1.0, 1.0, 0.0])
    assert relative_error(dark) <= relative_error(pictures)
    assert relative_error(np.zeros((4, 2, 2, 3))) == 0.0


class CutOffError(BaseException):
    """In place of Ctrl-C."""


@pytest.mark.slow
@pytest.mark.parametrize("at", [5, reference.REPLICATES + 3])
@pytest.mark.parametrize("how", ["interrupted", "killed"])
def test_what_was_cut_off_continues(
    cache: Path, monkeypatch: pytest.MonkeyPatch, at: int, how: str
) -> None:
    """After Ctrl-C nothing is lost; after a kill, which nothing can catch, what was stored in
    passing. The result is that of a run without a break, to the last bit."""
    scene = Scene.parse(SCENE)
    whole = of_scene(scene, LIMIT)
    for file in cache.iterdir():
        file.unlink()
    calls = Renderings(monkeypatch)
    counted, save = reference_cache.render, reference_cache._save
    if how == "killed":
        monkeypatch.setattr(reference_cache, "_SAVED_EACH", 0.0)

    def cut_off(*arguments: object, **more: object) -> object:
        if calls.count == at:
            if how == "killed":
                monkeypatch.setattr(reference_cache, "_save", lambda *kept: None)
            raise CutOffError
        return counted(*arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(reference_cache, "render", cut_off)
    with pytest.raises(CutOffError):
        of_scene(scene, LIMIT)
    monkeypatch.setattr(reference_cache, "render", counted)
    monkeypatch.setattr(reference_cache, "_save", save)
    assert calls.count == at
    np.testing.assert_array_equal(of_scene(scene, LIMIT).pictures, whole.pictures)
    rendered = calls.count
    for file in cache.iterdir():
        file.unlink()
    of_scene(scene, LIMIT)
    assert calls.count - rendered == rendered  # each picture was rendered once
