"""A pair of renderers: the random numbers that they share, the statistics, the command, the
fixture."""

import json
import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import invoke
from gate_checks import SCENE
from picture_writers import pfm
from test_pytest_plugin import project as project  # a fixture
from test_pytest_plugin import run

import comparisons
from comparisons.gate.pair_noise import of_pixels, streams_of
from comparisons.statistics import compare
from reference_rt.core.arrays import FloatArray

pytest_plugins = ["pytester"]

SHAPE = (24, 32, 3)


def mean() -> FloatArray:
    y, x = np.mgrid[:24, :32]
    return (1.0 + 0.5 * np.sin(x / 5.0) * np.cos(y / 4.0))[..., None] * np.array([1.0, 0.7, 0.4])


def pictures(seed: int, count: int = 8, kind: str = "gamma") -> FloatArray:
    """Replicates whose noise is skewed, or has fireflies."""
    rng = np.random.default_rng(seed)
    noise = rng.gamma(40.0, 1.0 / 40.0, (count, *SHAPE[:2], 1))
    if kind == "fireflies":
        noise = noise + 20.0 * (rng.uniform(size=noise.shape) < 1e-3) - 0.02
    return mean() * noise


def test_shared_random_numbers_show_small_biases() -> None:
    a = pictures(1)
    case = comparisons.gate_pair(a, 1.0003 * a)
    assert case.verdict == "differ"
    assert case.cause is not None
    assert case.cause.name.startswith("constant gain")
    assert any(note.startswith("paired: ") for note in case.notes)
    same = comparisons.gate_pair(
        a, a * (1.0 + 1e-7 * np.random.default_rng(2).normal(size=a.shape))
    )
    assert same.verdict == "agree"
    (rung,) = [rung for rung in same.rungs if rung.name == "statistics"]
    assert max(rung.numbers["detectable_bias"].values()) < 1e-4
    # Without the pairs nothing is seen: the noise of the means is 0.05 %.
    assert compare(a, 1.0003 * pictures(9)).status == "inconclusive"


def test_light_that_neither_side_met_is_counted_by_the_pictures_not_by_their_differences() -> None:
    a = pictures(1, kind="fireflies")
    paired, alone = compare(a, a, paired=True), compare(a, pictures(2, kind="fireflies"))
    met = [rung.numbers["unseen_light"]["met_once"] for rung in (paired, alone)]
    assert met[0] == pytest.approx(met[1], rel=0.3)
    assert met[0] > 0.01
    with pytest.raises(ValueError, match="as many on both sides"):
        compare(a, a[:4], paired=True)


def test_other_random_numbers_are_not_paired() -> None:
    a, b = pictures(1), pictures(2)
    assert not streams_of(a, b).shared
    assert streams_of(a, 2.0 * a).shared
    assert not streams_of(a, np.roll(a, 1, axis=0)).shared  # in another order
    half = 0.5 * (a + b)
    assert streams_of(a, half).correlation == pytest.approx(np.sqrt(0.5), abs=0.03)
    few = np.random.default_rng(3).normal(size=(8, 1, 1, 1)) * np.ones(SHAPE)
    other = np.random.default_rng(4).normal(size=(8, 1, 1, 1)) * np.ones(SHAPE)
    assert not streams_of(few, other).shared  # one random number for all pixels


def test_pixels_that_share_numbers_are_found_at_any_distance() -> None:
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(8, *SHAPE[:2], 1))
    assert of_pixels(noise * np.ones(3))[0] < 0.1
    moved = noise + np.roll(noise, (5, -7), axis=(1, 2))
    share, (x, y) = of_pixels(moved * np.ones(3))
    assert share == pytest.approx(0.5, abs=0.1)
    assert (abs(x), abs(y)) == (7, 5)


def test_sizes_and_sides_without_noise() -> None:
    picture = mean()
    assert comparisons.gate_pair(picture, picture, noise_free=True).verdict == "agree"
    wrong = comparisons.gate_pair(picture, 1.02 * picture, noise_free=True)
    assert wrong.verdict == "differ"
    with pytest.raises(Exception, match="is 32 x 23 pixels; expected 32 x 24, as A's first"):
        comparisons.gate_pair(picture, picture[1:])
    repeated = np.stack([picture] * 8)
    assert comparisons.gate_pair(repeated, repeated).verdict == "agree"
    found = comparisons.gate_pair(repeated, pictures(1))
    assert found.verdict == "invalid"
    assert "the same bit for bit" in found.reason


def test_ours_says_who_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gate_checks import pictures as rendered

    monkeypatch.chdir(tmp_path)
    Path("ball.yaml").write_text(SCENE)
    right = rendered(count=8)
    for a, b, alone in ((1.05 * right, right, "A's"), (right, 1.05 * right, "B's")):
        case = comparisons.gate_pair(a, b, scene="ball.yaml", judged=True, limit=0.01)
        assert case.verdict == "differ"
        (vote,) = [rung for rung in case.rungs if rung.name == "witness"]
        assert vote.numbers["alone"] == alone
        assert case.reason.endswith(f"{alone} stands alone")
    with pytest.raises(Exception, match="expected a scene"):
        comparisons.gate_pair(right, right, judged=True)


RENDERER = """\
import sys
import numpy as np
output, seed, gain, other = sys.argv[1], *map(float, sys.argv[2:])
y, x = np.mgrid[:24, :32]
mean = (1 + 0.5 * np.sin(x / 5) * np.cos(y / 4))[..., None] * np.array([1, 0.7, 0.4])
if other >= 0:
    gain *= np.random.default_rng(int(seed + other)).gamma(400, 1 / 400, mean.shape)
np.save(output, gain * mean)
"""


def drive(gain: str, other: str) -> str:
    program = f"{shlex.quote(sys.executable)} renderer.py"
    return f"{program} {{output}} {{seed}} {gain} {other}"


@pytest.mark.usefixtures("gate_folder")
def test_the_command() -> None:
    Path("renderer.py").write_text(RENDERER)
    right, wrong = drive("1", "0"), drive("1.001", "0")
    result = invoke("gate", "--pair", right, wrong, "--suffix", ".npy", "--replicates", "4")
    assert result.exit_code == 1, result.output
    assert "A's picture is 0.100 % darker than B's" in result.output
    assert "paired: replicate k" in result.output
    found = json.loads(Path("out/results.json").read_text())
    assert found["provenance"]["A"] == right
    for name in "AB":
        assert len(list(Path(f"out/candidates/{name}").glob("*.npy"))) == 4
    result = invoke("gate", "--pair", "out/candidates/A", "out/candidates/A")
    assert result.exit_code == 0, result.output
    assert "A and B are the same files" in result.output
    # Renderers that make the same pictures are told apart by no number of further ones.
    result = invoke("gate", "--pair", right, right, "--suffix", ".npy", "--replicates", "4")
    assert result.exit_code == 0, result.output
    assert "A's 4 pictures are, one by one, B's, bit for bit" in result.output
    still = drive("1", "-1")
    result = invoke("gate", "--pair", still, still, "--suffix", ".npy")
    assert result.exit_code == 0, result.output
    assert "there is no noise" in result.output
    assert len(list(Path("out/candidates/A").glob("*.npy"))) == 2


@pytest.mark.parametrize("kind", ["gamma", "fireflies"])
@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_the_same_pictures_on_both_sides_are_unchanged(kind: str, count: int) -> None:
    """Also where so few, or such rare light, would be too noisy to tell."""
    a = pictures(1, count, kind)
    for b in (a, a[::-1]):
        case = comparisons.gate_pair(a, b)
        assert case.verdict == "unchanged"
        assert "bit for bit" in case.reason
    other = a.copy()
    other[-1, 3, 4, 1] *= 1.0 + 1e-15
    assert comparisons.gate_pair(a, other).verdict != "unchanged"
    if count > 2:  # a picture of B is twice in A
        assert comparisons.gate_pair(a[[0, *range(count - 1)]], a).verdict != "unchanged"
    for nothing in (np.full_like(a, np.nan), np.zeros_like(a)):
        assert comparisons.gate_pair(nothing, nothing).verdict != "unchanged"


def test_ours_judges_the_same_pictures_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gate_checks import pictures as rendered

    monkeypatch.chdir(tmp_path)
    Path("ball.yaml").write_text(SCENE)
    wrong = 1.05 * rendered(count=8)
    case = comparisons.gate_pair(wrong, wrong, scene="ball.yaml", judged=True, limit=0.01)
    (vote,) = [rung for rung in case.rungs if rung.name == "witness"]
    assert vote.numbers["alone"] == "reference_rt's"
    assert case.verdict == "differ"


@pytest.mark.usefixtures("gate_folder")
def test_pictures_of_two_folders_belong_together_by_name() -> None:
    a = pictures(1).astype(np.float32)
    for name, gain in (("A", 1.0), ("B", 1.0003)):
        Path(name).mkdir()
        for k, picture in enumerate(a):
            np.save(f"{name}/{k}.npy", np.float32(gain) * picture)
    assert "paired: " in invoke("gate", "--pair", "A", "B").output
    Path("B/._0.npy").write_bytes(b"of another system")
    Path("A/notes.txt").touch()
    assert "paired: " in invoke("gate", "--pair", "A", "B").output
    # One more at the beginning: by position none would belong together.
    Path("B/7.npy").rename("B/-1.npy")
    result = invoke("gate", "--pair", "A", "B")
    assert result.exit_code == 2
    assert "--pair: A has no -1.npy; B has no 7.npy; expected pictures of the same" in result.stderr
    for path in Path("B").glob("*.npy"):
        path.unlink()
    Path("B/x.npy").touch()
    assert "A has no x.npy; B has no 0.npy, 1.npy, 2.npy, 3.npy, 4.npy, ..." in (
        invoke("gate", "--pair", "A", "B").stderr
    )


@pytest.mark.usefixtures("gate_folder")
def test_folders_of_two_formats_are_matched_without_suffixes() -> None:
    """In any order of their names as texts: 10 is before 9."""
    a = pictures(1).astype(np.float32)
    for name in "AB":
        Path(name).mkdir()
    for k, picture in enumerate(a):
        np.save(f"A/{k + 5}.npy", picture)
        Path(f"B/{k + 5}.pfm").write_bytes(pfm(picture, "-1"))
    assert "one by one, B's, bit for bit" in invoke("gate", "--pair", "A", "B").output
    np.save("B/5.npy", a[0])  # which of the two is meant?
    result = invoke("gate", "--pair", "A", "B")
    assert result.exit_code == 2
    assert "A has no 10.pfm, 11.pfm, 12.pfm, 5.pfm, 6.pfm, ...; B has no 10.npy" in result.stderr


BALL = """\
film: {width: 32, height: 24}
sampler: {type: independent, spp: 4}
shapes: [{type: sphere, center: [0, 0, -2]}]
lights: [{type: constant, radiance: 1}]
"""


@pytest.mark.usefixtures("gate_folder")
def test_ours_judges_without_the_rim_too() -> None:
    Path("renderer.py").write_text(RENDERER)
    Path("ball.yaml").write_text(BALL)
    words = ["--suffix", ".npy", "--replicates", "4", "--scene", "ball.yaml", "--judge"]
    result = invoke("gate", "--pair", drive("1", "0"), drive("1.1", "0"), *words, "--rim", "2")
    assert result.exit_code == 1, result.output
    (case,) = json.loads(Path("out/results.json").read_text())["cases"]
    assert "of another size" not in case["tiers"]["witness"]["reason"]
    result = invoke("gate", "--pair", drive("1", "0"), drive("1", "0"), *words, "--size", "16x12")
    assert result.exit_code == 3, result.output
    assert "is 32 x 24 pixels; expected 16 x 12, the size of the scene 'ball'" in result.output


@pytest.mark.usefixtures("gate_folder")
def test_one_start_makes_all_pictures_of_the_first_look() -> None:
    several = "import sys\nsys.argv[2:3], seeds = [''], sys.argv[2].split(',')\n"
    several += (
        "path = sys.argv[1]\nfor seed in seeds:\n    sys.argv[1:3] = path % int(seed), seed\n"
    )
    body = RENDERER.replace("import sys\n", "")
    Path("renderer.py").write_text(several + "".join(f"    {line}\n" for line in body.splitlines()))
    right, too = (drive(gain, "0").replace("{seed}", "{seeds}") for gain in ("1", "1.000001"))
    result = invoke("gate", "--pair", right, too, "--suffix", ".npy", "--replicates", "2")
    assert result.exit_code == 0, result.output
    assert "look 1, 2 replicates" in result.output
    assert "paired: replicate k" in result.output  # seen as soon as there are enough


@pytest.mark.usefixtures("gate_folder")
def test_a_later_picture_of_another_size_is_invalid() -> None:
    small = "if seed > 1.5e9:\n    mean = mean[1:]\n"  # the fourth of the first look
    Path("renderer.py").write_text(RENDERER.replace("if other", f"{small}if other"))
    result = invoke("gate", "--pair", drive("1", "0"), drive("1", "0"), "--suffix", ".npy")
    assert result.exit_code == 3, result.output
    assert "is 32 x 23 pixels; expected 32 x 24, as A's first" in result.output


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite(value: float) -> None:
    a, b = pictures(1), pictures(2)
    b[3, 2, 1, 0] = value
    case = comparisons.gate_pair(a, b)
    assert case.verdict == "invalid"
    assert "1 pixel of B's picture not finite" in case.reason.replace(
        "the reference", "B's picture"
    )
    assert not any("nan" in note for note in case.notes)


def test_values_whose_squares_overflow_are_refused() -> None:
    with pytest.raises(Exception, match="has the value 1e\\+200; expected radiance within"):
        comparisons.gate_pair(pictures(1), np.full((8, *SHAPE), 1e200))


@pytest.mark.usefixtures("gate_folder")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--pair", "prog {output}", "."], "has no pictures"),
        (["--pair", "prog {output}", "pictures"], "expected two commands or pages, or pictures"),
        (["--pair", "prog", "prog {output}"], "--pair: has no {output}"),
        (["--pair", "a {output}", "b {output}", "--baseline", "x"], "does not apply to --pair"),
        (["--pair", "pictures", "pictures", "--replicates", "4"], "only applies to commands"),
        (["--pair", "pictures", "pictures", "--judge"], "expected a scene"),
        (["--judge", "x.npy"], "only applies to --pair"),
    ],
)
def test_wrong_usage(words: list[str], said: str) -> None:
    Path("pictures").mkdir()
    np.save("pictures/a.npy", pictures(1))
    result = invoke("gate", *words)
    assert result.exit_code == 2, result.output
    assert said in result.output


@pytest.mark.slow
def test_the_fixture(project: pytest.Pytester) -> None:
    result = run(
        project,
        """
def test_right(pair_gate):
    case = pair_gate(my_renderer(SCENE), my_renderer(SCENE, first=900), scene=SCENE)
    assert case.verdict == "agree"

def test_gain(pair_gate):
    pair_gate(my_renderer(SCENE), my_renderer(SCENE, gain=1.001))
""",
    )
    result.assert_outcomes(passed=1, failed=1)
    assert "pair_gate: differ: likeliest cause: constant gain of 0.999" in result.stdout.str()


def alarms(kind: str, shared: bool, cases: int, first: int = 0) -> int:
    """How often two right renderers differ."""
    count = 0
    for k in range(first, first + cases):
        a = pictures(2 * k, kind=kind)
        b: Any = pictures(2 * k + 1, kind=kind)
        if shared:  # a hundredth of the paths go another way
            other = np.random.default_rng(k).uniform(size=(8, *SHAPE[:2], 1)) < 0.01
            b = np.where(other, b, a)
        count += comparisons.gate_pair(a, b).verdict in ("differ", "invalid")
    return count


@pytest.mark.parametrize("kind", ["gamma", "fireflies"])
@pytest.mark.parametrize("shared", [True, False], ids=["paired", "unpaired"])
def test_right_pairs_do_not_differ(kind: str, shared: bool) -> None:
    assert alarms(kind, shared, 4) == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gamma", "fireflies"])
@pytest.mark.parametrize("shared", [True, False], ids=["paired", "unpaired"])
def test_false_alarms(kind: str, shared: bool) -> None:
    # One in a thousand cases at most: of 500, three or more have a chance of 1.4 %.
    assert alarms(kind, shared, 500) <= 2
