"""Who of three renderers stands alone, and a Cycles that is absent, broken or hangs."""

import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke

import reference_rt as rt
from comparisons.cycles import backend
from comparisons.renderers import NoCounterpartError, other
from comparisons.rungs.witness import vote, witness_of
from reference_rt.util.errors import ReferenceUnavailableError, UsageError

CYCLES = other("cycles")
NAMES = ("ours", "Mitsuba's", "Cycles'")
LIMIT = 0.02


def _pictures(seed, *, factor=1.0, spread=0.05, shadow=1.0, count=8):
    """Replicates of a picture with noise in proportion to its brightness; `shadow` multiplies a
    tile."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:48, 0:48]
    mean = (0.5 + 0.4 * np.sin(x / 9.0) * np.cos(y / 7.0))[..., None] * [1.0, 0.8, 0.6]
    mean[16:32, 16:32] *= shadow
    return factor * mean * (1.0 + spread * rng.standard_normal((count, 48, 48, 3)))


@pytest.mark.parametrize("who", [0, 1, 2])
@pytest.mark.parametrize(
    ("fault", "noisy"),
    [({"factor": 1.05}, 0.05), ({"shadow": 0.8}, 0.05), ({"factor": 0.9}, 0.6)],
    ids=["bright", "in one tile", "and the others noisy"],
)
def test_the_one_that_differs_stands_alone(who, fault, noisy):
    sides = [_pictures(k, **(fault if k == who else {"spread": noisy})) for k in range(3)]
    rung = vote(tuple(sides), NAMES, LIMIT)
    assert rung.numbers["alone"] == NAMES[who]
    assert rung.status == ("agree" if who == 1 else "differ")


def test_nobody_stands_alone_where_all_agree_and_where_all_differ():
    agree = vote(tuple(_pictures(k) for k in range(3)), NAMES, LIMIT)
    assert agree.status == "agree"
    differ = vote(tuple(_pictures(k, factor=1.0 + 0.1 * k) for k in range(3)), NAMES, LIMIT)
    assert differ.status == "not-applicable"
    for rung in (agree, differ):
        assert "alone" not in rung.numbers
        assert len(rung.numbers["pairs"]) == 3


@pytest.mark.slow
def test_false_votes():
    """Of 1,000 triples of right renderers at most 0.1 % are said to be alone, and at most 0.3 %
    (three pairs of a third of the level each: as of one comparison) do not agree."""
    found = [
        vote(tuple(_pictures(3 * k + j, spread=0.1) for j in range(3)), NAMES, LIMIT)
        for k in range(1000)
    ]
    assert sum("alone" in rung.numbers for rung in found) <= 1
    assert sum(rung.status != "agree" for rung in found) <= 3


SCENE = rt.Scene(
    shapes=(rt.Sphere(),),
    lights=(rt.Constant(radiance=(1, 1, 1)),),
    film=rt.Film(width=4, height=4),
)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("", "pip install bpy"),
        ("/no/such/python", "no such program"),
        (sys.executable, "No module named 'bpy'"),
    ],
)
def test_without_cycles_it_is_said_how_to_get_it(program, said, monkeypatch):
    monkeypatch.setenv(backend.PYTHON, program)
    with pytest.raises(ReferenceUnavailableError, match=said), CYCLES.load(SCENE) as loaded:
        loaded.render(1, 1)


KNOWN = "import sys\nif sys.argv[1] == '-c': print('5.0.1'); sys.exit()"
"""Answers the question for Blender's version."""

FAKES = {
    "dies": ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "died by signal 9"),
    "hangs": ("import time; time.sleep(600)", "took longer than"),
    "fails": ("""input(); print('{"failed": "no memory"}', flush=True); input()""", "no memory"),
}


@pytest.mark.parametrize("fault", FAKES)
def test_a_cycles_that_breaks_is_reported(fault, monkeypatch, tmp_path):
    code, said = FAKES[fault]
    program = tmp_path / "python"
    program.write_text(f"#!{sys.executable}\n{KNOWN}\n{code}\n")
    program.chmod(0o700)
    monkeypatch.setenv(backend.PYTHON, str(program))
    if fault == "hangs":
        monkeypatch.setattr(backend, "SECONDS", 0.1)
    with pytest.raises(ReferenceUnavailableError, match=said), CYCLES.load(SCENE) as loaded:
        loaded.render(1, 1)
    heard, pictures = witness_of("cycles", SCENE, LIMIT, 1, lambda line: None)(
        (_pictures(0), _pictures(1)), NAMES[:2]
    )
    assert (heard.status, pictures) == ("not-comparable", {})
    assert said in heard.reason


def test_all_reasons_are_given(monkeypatch, tmp_path):
    monkeypatch.setenv(backend.PYTHON, sys.executable)
    scene = rt.Scene(
        integrator=rt.Whitted(),
        materials={"glossy": rt.Plastic()},
        shapes=(rt.Plane(), rt.Sphere(material="glossy"), rt.Sphere() - rt.Box()),
        lights=(rt.Spot(origin=(0, 0, 5), target=(0, 0, 0), intensity=(1, 1, 1)),),
    )
    with pytest.raises(NoCounterpartError) as caught:
        CYCLES.load(scene).__enter__()
    for part in ("whitted", "plastic", "plane", "CSG", "spot"):
        assert part in str(caught.value)


def test_the_gate_hears_a_witness(monkeypatch):
    """The candidate's pictures, ours, and the witness's are one vote; a vote needs a scene."""
    from comparisons.gate import request as gate
    from comparisons.gate.pictures_in import Picture

    heard = []

    def witness_of(name, scene, limit, threads, say, seen):
        def hear(replicates, sides):
            heard.append(sides)
            third = _pictures(7, count=len(replicates[0]))
            rung = vote((*replicates, third), (*sides, "Cycles'"), limit)
            return rung, {"Cycles'": third.mean(axis=0)}

        return hear

    monkeypatch.setattr("comparisons.rungs.witness.witness_of", witness_of)
    scene = SCENE.changed(film=rt.Film(width=48, height=48))
    dark, right = (
        [Picture(x, name=f"{name} {k}") for k, x in enumerate(_pictures(seed, factor=factor))]
        for name, seed, factor in (("dark", 1, 0.9), ("right", 2, 1.0))
    )
    asked = gate.Request(scene, references=tuple(right), limit=LIMIT, witness="cycles")
    case = gate.gated(asked, dark)
    assert case.verdict == "differ"
    assert "candidate's stands alone" in case.reason
    assert [picture.shape for picture in case.images.others.values()] == [(48, 48, 3)]
    assert len(heard) == 1
    for wrong in ({"scene": None}, {"rim": 2}):
        with pytest.raises(UsageError, match="got a witness"):
            gate.Request(
                **{"scene": scene, "references": tuple(right), "witness": "cycles"} | wrong
            )


@pytest.mark.parametrize(
    ("scene", "witness", "code", "words"),
    [
        ("cornell_box", "cycles", 0, ["cycles votes"]),
        ("csg_die", "cycles", 0, ["does not vote", "plane", "CSG", "spot"]),
        ("csg_die", "another", 2, ["--witness: expected cycles"]),
    ],
)
def test_explain_says_who_may_vote(scene, witness, code, words):
    path = Path(__file__).parents[3] / "scenes" / f"{scene}.yaml"
    done = invoke("explain", path, "--witness", witness)
    assert done.exit_code == code
    assert all(word in done.output for word in words)
