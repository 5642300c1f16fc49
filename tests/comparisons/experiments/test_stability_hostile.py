"""The families of hostile values and of solids: planted faults are seen, and attributed."""

import contextlib
from pathlib import Path

import numpy as np
import pytest

import reference_rt as rt
from comparisons.experiments.fuzz.assets import files, write, write_files
from comparisons.experiments.stability.harness.solids import Stretch, Truth
from comparisons.experiments.stability.harness.solids import problem as list_problem
from comparisons.experiments.stability.hostile import worker
from comparisons.experiments.stability.hostile.bases import BASES
from comparisons.experiments.stability.hostile.damage import (
    as_text,
    damaged,
    deep,
    sentence,
    with_numbers,
    with_structure,
)
from comparisons.experiments.stability.hostile.files import bomb, example, problem
from comparisons.experiments.stability.hostile.rays import undefined
from comparisons.experiments.stability.hostile.worker import Answer, answers
from comparisons.experiments.stability.solids.trees import Tree, chain, rewritten
from reference_rt.rendering.query import Intersections
from reference_rt.util.errors import ImageError, SceneError

# ---- hostile scenes ------------------------------------------------------------------------------


def rng(seed=1):
    return np.random.default_rng(seed)


def test_the_same_seed_gives_the_same_cases(tmp_path):
    write(tmp_path)
    for make in (
        lambda r: as_text(with_numbers(r, BASES["light"], 4)),
        lambda r: as_text(with_structure(r, BASES["shapes"], 4)),
        lambda r: as_text(sentence(r, 0.1, tmp_path)),
        lambda r: damaged(r, files()["ball.ply"], 4),
    ):
        assert make(rng()) == make(rng())
        assert make(rng()) != make(rng(2))


def test_trees_deeper_than_python_recurses_are_made():
    """Seed 1287 copies 300 levels of solids."""
    with pytest.raises(RecursionError):
        as_text(with_structure(rng(1287), BASES["recursive"], 8))
    with deep():
        assert as_text(with_structure(rng(1287), BASES["recursive"], 8)).startswith("{")


def test_sentences_come_to_scenes(tmp_path):
    """Where one rule refused nearly all, what lies behind it would not be tested."""
    write(tmp_path)
    r, sound = rng(), 0
    for _ in range(20):
        (tmp_path / "case.json").write_text(as_text(sentence(r, 0.001, tmp_path)))
        with contextlib.suppress(SceneError, ImageError):
            rt.Scene.load(tmp_path / "case.json")
            sound += 1
    assert sound > 12


def test_sound_scenes_are_sound(tmp_path):
    write_files(tmp_path)
    for name, data in BASES.items():
        (tmp_path / f"{name}.json").write_text(as_text(data))
        assert isinstance(rt.Scene.load(tmp_path / f"{name}.json"), rt.Scene)


PLANTED = """
import json, os, signal, sys, time
for line in sys.stdin:
    case = json.loads(line)
    if "scene" not in case:
        continue
    kind = case["scene"]
    if kind == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == "hang":
        signal.setitimer(signal.ITIMER_PROF, 0.05)
        while True:
            pass
    print(json.dumps({"exit": 0, "said": "", "nonfinite": 0, "rendered": True}), flush=True)
"""


def test_what_dies_is_told_and_the_others_go_on(tmp_path, monkeypatch):
    (tmp_path / "planted_worker.py").write_text(PLANTED)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    scenes = [Path(kind) for kind in ("well", "crash", "well", "hang", "well")]
    monkeypatch.setattr(worker, "MODULE", "planted_worker")
    monkeypatch.setattr(worker, "_workers", {})
    found = list(answers(scenes))
    worker.close()
    assert [answer.exit for answer in found] == [0, None, 0, None, 0]
    assert "SIGSEGV" in found[1].said
    assert found[3].said.startswith("hangs")
    assert [problem(a, s) is None for a, s in zip(found, scenes, strict=True)] == [
        True, False, True, False, True,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("answer", "wrong"),
    [
        (Answer(0, "", 0, True), None),
        (Answer(3, "error: /f/a.json:1: radius: expected greater than 0"), None),
        (Answer(3, "error: /f/a.json: 2 pixels are not finite; expected light", 2, True), None),
        (Answer(0, "", 2, True), "not told"),
        (Answer(5, "error: internal error: ValueError: x"), "exit code 5"),
        (Answer(3, "error: /f/a.json: expected\nTraceback"), "not one line"),
        (Answer(3, "error: expected a number"), "names no file"),
        (Answer(3, "error: /f/a.json: bad"), "says not what"),
        (Answer(None, "hangs: computed for 5 s"), "hangs"),
    ],
)
def test_verdicts(answer, wrong):
    found = problem(answer, Path("/f/a.json"))
    assert (found is None) == (wrong is None)
    assert wrong is None or wrong in found


def test_a_failure_can_be_made_again_from_its_example(tmp_path):
    scene = tmp_path / "case0.json"
    scene.write_text("{}")
    (tmp_path / "case0_ball.obj").write_bytes(b"v 0 0 \xff")
    found = example(scene, "crashes")
    assert found["scene"] == "{}"
    assert found["file"] == "case0_ball.obj"
    assert found["base64"] == "diAwIDAg/w=="


def test_hostile_scenes_in_plain_python(tmp_path):
    """Some of each sort, through a process of their own."""
    write_files(tmp_path)
    r, scenes = rng(3), []
    texts = [as_text(with_numbers(r, BASES["recursive"], 2)) for _ in range(6)]
    texts += [as_text(with_structure(r, BASES["shapes"], 2)) for _ in range(6)]
    texts += [bomb(r, 4)]
    for k, text in enumerate(texts):
        path = tmp_path / f"case{k}.{'json' if text.startswith('{') else 'yaml'}"
        path.write_text(text)
        scenes.append(path)
    found = list(answers(scenes, by="plain"))
    assert [problem(a, s) for a, s in zip(found, scenes, strict=True)] == [None] * len(scenes)
    assert {answer.exit for answer in found} == {0, 3}


# ---- hostile rays --------------------------------------------------------------------------------


def hits_of(**changed):
    one = dict(  # noqa: C408
        t=np.array([1.0]), shape=np.array([0]), primitive=np.array([0]), part=np.array([0]),
        instance=np.array([-1]), p=np.zeros((1, 3)), n=np.array([[0.0, 0.0, 1.0]]),
        ns=np.array([[0.0, 0.0, 1.0]]), uv=np.zeros((1, 2)),
    )  # fmt: skip
    return Intersections(**(one | changed))


@pytest.mark.parametrize(
    ("changed", "d", "wrong"),
    [
        ({}, 1.0, False),
        ({"t": np.array([np.nan])}, 1.0, True),
        ({"n": np.array([[0.0, 0.0, 0.5]])}, 1.0, True),
        ({"p": np.array([[0.0, np.inf, 0.0]])}, 1.0, True),
        ({}, np.nan, True),
        ({}, 0.0, True),
        ({"t": np.array([np.inf]), "shape": np.array([-1])}, np.nan, False),
    ],
)
def test_undefined_answers_are_seen(changed, d, wrong):
    found = undefined(hits_of(**changed), np.zeros((1, 3)), np.array([[0.0, 0.0, d]]))
    assert found.tolist() == [wrong]


# ---- solids --------------------------------------------------------------------------------------


def members(tree: Tree, inside):
    """Whether points are in the set, by Boolean arrays of the leaves."""
    if isinstance(tree, int):
        return inside[tree]
    operation, a, b = tree
    a, b = members(a, inside), members(b, inside)
    return a | b if operation == "|" else a & b if operation == "&" else a & ~b


@pytest.mark.parametrize("depth", [1, 8, 64])
def test_laws_change_no_set(depth):
    """For all states of the leaves."""
    states = np.array([[bool(k >> j & 1) for k in range(32)] for j in range(5)])
    r = rng(depth)
    for _ in range(50):
        tree = chain(r, depth, 5)
        other = rewritten(r, tree, 8, 5)
        assert (members(tree, states) == members(other, states)).all()
        assert other != tree


TRUE = Truth(
    [Stretch(0.0, 1.0, False), Stretch(1.1, 2.0, True), Stretch(2.1, np.inf, False)],
    False,
    np.array([1.05, 2.05]),
    np.array([0.01, 0.01]),
    np.array([0, 0]),
)


@pytest.mark.parametrize(
    ("t", "wrong"),
    [
        ([1.05, 2.05], None),
        ([], "lost"),
        ([0.5, 0.6, 1.05, 2.05], "none"),
        ([0.3, 2.05], "none"),
        ([1.05, 1.051, 1.052, 2.05], "film"),
        ([1.05], "false"),
    ],
)
def test_wrong_lists_are_seen(t, wrong):
    found = list_problem(TRUE, np.array([*t, np.inf]))
    assert (found is None) == (wrong is None)
    assert wrong is None or wrong in found[0]
