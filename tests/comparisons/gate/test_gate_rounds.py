"""A renderer that the gate drives: the first picture is checked, others are added until they
decide."""

import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gate_checks import run

from comparisons import statistics
from comparisons.gate import request
from comparisons.gate.pictures_in import Picture
from comparisons.gate.request import Request
from comparisons.gate.rounds import SEEDS, Rounds, gated_renderer
from comparisons.results.case import Case
from reference_rt.core.arrays import FloatArray
from reference_rt.util.errors import ImageError, UsageError

SIDE = 32


def pictures(seeds: Sequence[int], noise: float = 0.1, gain: float = 1.0) -> list[Picture]:
    """A picture with normal noise for each seed."""
    found = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        values = gain * (1.0 + noise * rng.standard_normal((SIDE, SIDE, 3)))
        found.append(Picture(values.astype(np.float32).astype(np.float64), name=f"seed {seed}"))
    return found


class Renderer:
    """In place of a `Driver`: what it was asked for, and the pictures."""

    def __init__(self, together: bool = False, **more: Any) -> None:
        self.together, self._more = together, more
        self.starts: list[Sequence[int]] = []

    def pictures(self, seeds: Sequence[int]) -> list[Picture]:
        starts = [seeds] if self.together else [[seed] for seed in seeds]
        self.starts += [start for start in starts if start]
        return self._made(pictures(seeds, **self._more))

    def _made(self, made: list[Picture]) -> list[Picture]:
        return made

    @property
    def seeds(self) -> list[int]:
        return [seed for start in self.starts for seed in start]


def gated(renderer: Renderer, rounds: Rounds | None = None, exact: int = 16, **more: Any) -> Case:
    """Against `exact` pictures with a tenth of the noise."""
    reference = pictures(range(10**6, 10**6 + exact), 0.01)
    request = Request(references=tuple(reference), **{"limit": 0.005, **more})
    return gated_renderer(request, renderer, rounds or Rounds())  # type: ignore[arg-type]


def looks(case: Case) -> list[int]:
    (found,) = [rung for rung in case.rungs if rung.name == "statistics"]
    return list(found.numbers["replicates_at_looks"])


@pytest.mark.cases(2)
@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize(
    ("noise", "gain", "verdict", "counts"),
    [
        (0.01, 1.0, "agree", [8]),
        (0.02, 1.05, "differ", [8]),
        (0.03, 1.0, "agree", [8, 16]),
        (0.4, 1.05, "differ", [8]),
        (0.1, 1.0, "agree", [8, 16, 32, 64]),
    ],
)
def test_it_goes_on_until_it_is_decided(
    together: bool, noise: float, gain: float, verdict: str, counts: list[int]
) -> None:
    """The last look that agrees sees 0.8 of the limit, the one before only 1.1 times the limit."""
    renderer = Renderer(together, noise=noise, gain=gain)
    case = gated(renderer)
    assert case.verdict == verdict, case.reason
    assert looks(case) == counts
    assert renderer.seeds == Rounds().seeds(0, counts[-1])  # each once, in order
    assert len(renderer.starts) == (len(counts) if together else counts[-1])
    assert f"look {len(counts)}, at {counts[-1]} replicates" in case.reason


class SeedPlusPixel(Renderer):
    """A right renderer, the numbers of whose pixels follow each other from the seed on."""

    def __init__(self, noise: float = 0.05) -> None:
        super().__init__()
        self._noise = noise

    def pictures(self, seeds: Sequence[int]) -> list[Picture]:
        self.starts.append(seeds)
        numbers = np.arange(SIDE * SIDE)[:, None] * 3 + np.arange(3)
        found = []
        for seed in seeds:
            hashed = np.sin((numbers + 3 * seed) % 2**31 * 12.9898) * 43758.5453
            values = 1.0 + self._noise * (2.0 * (hashed - np.floor(hashed)) - 1.0)
            found.append(Picture(values.reshape(SIDE, SIDE, 3)))
        return found


def test_seeds_are_far_from_each_other() -> None:
    for first in (0, 1, 5, 12345):
        seeds = Rounds(seed=first).seeds(0, 1000)
        assert seeds[0] == first
        assert min(seeds) >= 0
        assert max(seeds) < SEEDS
        assert Rounds(seed=first).seeds(3, 9) == seeds[3:9]
        gaps = np.diff(np.sort(seeds))
        assert gaps.min() > SEEDS / 3000  # of a thousand random ones the least is about 4,000
    # Numbers of 16 bits do not repeat either, where a renderer cuts seeds off.
    assert len({seed % 65536 for seed in seeds}) == 1000


def test_a_renderer_that_adds_the_pixels_number_to_the_seed() -> None:
    """By seeds of its own it is judged; pictures of successive seeds are moved copies."""
    case = gated(SeedPlusPixel())
    assert case.verdict == "agree", case.reason
    nearby = SeedPlusPixel().pictures(range(1, 9))
    reference = Request(references=tuple(pictures(range(10**6, 10**6 + 16), 0.01)))
    case = request.gated(reference, nearby)
    assert case.verdict == "invalid"
    assert "is like the one before, moved by -1, +0 pixels" in case.reason


def test_fixed_replicates_are_looked_at_once() -> None:
    renderer = Renderer(noise=0.3)
    case = gated(renderer, Rounds(seed=5, replicates=6, seconds=None))
    assert case.verdict == "inconclusive"
    assert renderer.seeds == Rounds(seed=5).seeds(0, 6)
    assert "look 1" not in case.reason
    assert "there are too few replicates: it takes about " in case.reason
    assert "times the replicates of the candidate, or " in case.reason


def test_one_picture_is_one_picture() -> None:
    renderer = Renderer()
    gated(renderer, Rounds(replicates=1))
    assert renderer.seeds == [1]


class Broken(Renderer):
    """Whose pictures have a fault."""

    def __init__(self, how: str, **more: Any) -> None:
        super().__init__(**more)
        self._how = how

    def _made(self, made: list[Picture]) -> list[Picture]:
        for picture in made:
            if self._how == "nan":
                picture.radiance[3, 4, 1] = np.nan
            elif self._how == "black":
                picture.radiance[:] = 0.0
            elif self._how == "constant":
                picture.radiance[:] = 0.5
        if self._how == "size":
            return [Picture(picture.radiance[1:]) for picture in made]
        return made


@pytest.mark.parametrize("how", ["nan", "black", "constant", "size"])
def test_the_first_picture_is_checked_before_the_rest(how: str) -> None:
    renderer = Broken(how)
    if how == "size":
        with pytest.raises(ImageError, match="is 32 x 31 pixels; expected 32 x 32"):
            gated(renderer)
    else:
        case = gated(renderer)
        assert case.verdict == "invalid"
        assert case.reason.startswith("input: ")
    assert renderer.seeds == [1]


class BrokenLater(Renderer):
    """Whose third picture has a fault."""

    def __init__(self, how: str) -> None:
        super().__init__()
        self._how = how

    def _made(self, made: list[Picture]) -> list[Picture]:
        if len(self.starts) == 3 and self._how == "nan":
            made[0].radiance[3, 4, 1] = np.nan
        if len(self.starts) == 3 and self._how == "size":
            return [Picture(made[0].radiance[1:], name="the third")]
        return made


@pytest.mark.parametrize("seconds", [None, 600.0])
def test_each_picture_is_checked_before_the_next(seconds: float | None) -> None:
    renderer, rounds = BrokenLater("nan"), Rounds(seconds=seconds)
    case = gated(renderer, rounds)
    assert renderer.seeds == rounds.seeds(0, 3)
    assert case.verdict == "invalid"
    assert "1 pixel of the candidate not finite" in case.reason
    assert f"seed {rounds.seeds(2, 3)[0]} is the first with such pixels" in str(case.notes)
    renderer = BrokenLater("size")
    with pytest.raises(ImageError, match="the third: is 32 x 31 pixels; expected 32 x 32"):
        gated(renderer, rounds)
    assert renderer.seeds == rounds.seeds(0, 3)


@pytest.mark.parametrize("copied", [8, 3])
def test_seeds_of_the_reference(copied: int) -> None:
    """All copies: unchanged after the first look. Some: the others are compared."""
    renderer, seeds = Renderer(noise=0.05), Rounds().seeds(0, 8)
    exact = [*pictures(seeds[:copied], 0.05), *pictures(range(99, 115 - copied), 0.05)]
    request = Request(references=tuple(exact), limit=0.02)
    case = gated_renderer(request, renderer, Rounds())  # type: ignore[arg-type]
    assert case.verdict == ("unchanged" if copied == 8 else "agree"), case.reason
    if copied < 8:
        assert "3 of 8 candidates are copies" in str(case.notes)
    assert renderer.seeds == seeds


@pytest.mark.cases(1)
@pytest.mark.parametrize("noise", [0.1, 0.4])
def test_more_candidates_than_pictures_of_a_precise_reference(noise: float) -> None:
    """Sixteen precise pictures are no limit for sixty-four noisy ones: the standard error is that
    of the candidate's mean, and not of sixteen of its pictures."""
    renderer = Renderer(noise=noise)
    case = gated(renderer, Rounds(replicates=64, seconds=None), limit=0.5)
    (found,) = [rung for rung in case.rungs if rung.name == "statistics"]
    expected = noise / np.sqrt(64 * SIDE**2)
    errors = np.array(list(found.numbers["standard_error_of_bias"].values()))
    # The largest of two estimates, one of 15 degrees of freedom: 99.9 % are below 1.6 times.
    assert (errors < 1.7 * np.hypot(expected, 0.01 / np.sqrt(16 * SIDE**2))).all()


@pytest.mark.parametrize("limit", [0.0, 0.0005, 0.001, 1.0])
def test_a_limit_that_cannot_be_met(limit: float) -> None:
    with pytest.raises(UsageError, match=r"expected a fraction above 0\.001, the bias"):
        gated(Renderer(), limit=limit)


def test_dim_pictures_of_float32() -> None:
    """Whose variances' squares are 0 even as float64."""
    candidate, reference = (
        [Picture(1e-41 * p.radiance) for p in pictures(range(k, k + 8))] for k in (1, 100)
    )
    case = request.gated(Request(references=tuple(reference), limit=0.02), candidate)
    assert case.verdict == "agree", case.reason


def test_a_reference_of_few_pictures_is_named_as_the_limit() -> None:
    case = gated(Renderer(noise=0.05), Rounds(seconds=None), exact=2, limit=0.002)
    assert case.verdict == "inconclusive"
    told = "the noise of the reference is the limit: even with a candidate without noise, a bias"
    assert told in case.reason
    assert "times the replicates of the reference" in case.reason


@pytest.mark.cases(1)
@pytest.mark.parametrize(("count", "exact"), [(4, 64), (8, 64), (8, 8), (16, 16)])
def test_the_stated_number_of_replicates_decides(count: int, exact: int) -> None:
    """Within a factor of two and a bit: twice the number decides, a third of it does not."""
    limit, decided, early = 0.01, 0, 0
    for seed in range(10):
        candidates = pictures(range(1000 * seed, 1000 * seed + count), 0.25)
        judges = np.stack([p.radiance for p in pictures(range(10**6, 10**6 + exact), 0.02)])

        def compared(candidates: list[Picture], judges: FloatArray = judges) -> Any:
            stacked = np.stack([p.radiance for p in candidates])
            return statistics.compare(stacked, judges, limit=limit, fixed_reference=True)

        found = compared(candidates)
        assert found.status == "inconclusive"
        told = re.search(r"about ([\d.]+) times the (replicates|samples)", found.reason)
        assert told is not None, found.reason
        for factor, is_early in ((2.0 * float(told[1]), False), (float(told[1]) / 3.0, True)):
            more = max(2, round(factor * count))
            again = compared(pictures(range(10**5 + 1000 * seed, 10**5 + 1000 * seed + more), 0.25))
            decided += again.status == "agree" and not is_early
            early += again.status == "agree" and is_early
    assert decided >= 8
    assert early <= 3


MANY = """\
import sys
from pathlib import Path
import numpy as np
output, seeds, size = sys.argv[1], sys.argv[2].split(","), [int(n) for n in sys.argv[3:]]
with open("starts.txt", "a") as file:
    print(*seeds, *size, file=file)
for seed in seeds:
    rng = np.random.default_rng(int(seed))
    values = 1.0 + 0.01 * rng.standard_normal((size[1], size[0], 3))
    if seed == "1" or size[0] != 20:
        with open(output % int(seed), "wb") as file:
            np.save(file, values)
"""


def many(size: str, *more: str) -> tuple[Any, Any]:
    Path("renderer.py").write_text(MANY)
    command = f"{shlex.quote(sys.executable)} renderer.py {{output}} {{seeds}} {{width}} {{height}}"
    return run(
        "--command", command, "--scene", "ball.yaml", "--suffix", ".npy", "--size", size, *more
    )


@pytest.mark.slow
@pytest.mark.usefixtures("gate_folder")
def test_one_start_makes_all_seeds_at_the_size_that_was_asked_for() -> None:
    result, found = many("24x16")
    seeds = " ".join(map(str, Rounds().seeds(0, 8)))
    assert Path("starts.txt").read_text().splitlines()[0] == f"{seeds} 24 16"
    assert result.exit_code == 1, result.output  # noise is no ball
    assert found["cases"][0]["verdict"] == "differ"
    assert found["cases"][0]["tiers"]["input"]["width"] == 24
    kept = [f"candidate-0{k}.npy" for k in range(8)]
    assert sorted(p.name for p in Path("out/candidates").iterdir()) == kept
    result, _ = many("20x16")
    assert result.exit_code == 4
    assert "another file with seeds 1, 1327217886, " in result.output


@pytest.mark.usefixtures("gate_folder")
def test_files_at_another_size_than_the_scenes_own(right: FloatArray) -> None:
    np.save("half.npy", right.reshape(4, 16, 2, 16, 2, 3).mean(axis=(2, 4)))
    result, _ = run("half.npy", "--scene", "ball.yaml")
    assert result.exit_code == 3
    result, found = run("half.npy", "--scene", "ball.yaml", "--size", "16x16", "--spp", "64")
    assert (result.exit_code, found["cases"][0]["verdict"]) == (0, "agree"), result.output
