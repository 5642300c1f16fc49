"""The rung `sampling` of Russian roulette: right paths agree, and a wrong compensation is seen; and
faults of the source, in plain Python."""

import json
from unittest import mock

import numpy as np
import pytest
from builders import SCENES, in_plain_python
from faulty_sources import SOURCE_FAULTS, plant

from comparisons.rungs.sampling import materials, roulette
from reference_rt.rendering.scene import Scene


def test_ours_agrees():
    assert roulette.check().status == "agree"


def changed(values, change):
    """Paths of a closed box whose weights at each edge, 1 for the first, are changed."""

    def of(scene, integrator, count):
        found = values(scene, integrator, count)
        reflectance = np.array(scene.materials["paint"].reflectance)
        edges = np.arange(integrator.max_depth)[:, None]
        weights = (reflectance / min(reflectance.max(), 0.999)) ** edges
        brightest = np.argmax(reflectance)
        sums = np.cumsum(weights[:, brightest])
        ends = np.abs(found[:, brightest, None] - sums).argmin(axis=1)
        return np.cumsum(change(edges) * weights, axis=0)[ends]

    return of


WRONG = {
    "1 % too bright": lambda edge: 1.01**edge,
    "1 % too dark": lambda edge: 0.99**edge,
    "beyond the eighth edge": lambda edge: np.where(edge > 8, 0.9, 1.0),
    "before roulette": lambda edge: np.where(edge == 0, 1.01, 1.0),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_weights_are_seen(name):
    assert roulette.of_values(changed(roulette.traced, lambda edge: 1.0)).status == "agree"
    found = roulette.of_values(changed(roulette.traced, WRONG[name]))
    assert found.status == "differ"
    assert "roulette" in found.reason


def test_paths_that_end_too_often_are_seen():
    def thinned(scene, integrator, count):
        found = roulette.traced(scene, integrator, count)
        found[::40] = 1.0  # their first edge
        return found

    assert roulette.of_values(thinned).status == "differ"


@pytest.mark.slow
def test_false_alarms():
    """Right paths with 300 seeds."""
    for seed in range(300):
        found = roulette.of_values(lambda *given, seed=seed: roulette.traced(*given, seed))
        assert found.status == "agree", found.reason


# ---- faults of the source -----------------------------------------------------------------------


def of_roulette():
    """Of paths that nearly all live, so that few show what is wrong: ten end at each edge."""
    with mock.patch.object(roulette, "WALLS", (((0.995, 0.9, 0.5), 2048),)):
        return roulette.of_values(roulette.traced).status


def of_glass():
    few = materials.Effort((2, 12, 16), 16, 1e-3, 4, 1e-2)
    glass = Scene.load(SCENES / "material_rough_dielectric.yaml")
    with mock.patch.multiple(
        materials, QUICK=few, CAREFUL=few, VIEWS=materials.VIEWS[:1], CHECKED=16
    ):
        return materials.check(glass, glass.tables).status


PARTS = {
    "roulette 1 % too bright": of_roulette,
    "density of rough glass without eta²": of_glass,
}


def write_answers(fault, out):
    """What a part of the rung says, in plain Python, of the right source and of a wrong one."""
    part = PARTS[fault.name]
    with np.errstate(all="ignore"), pytest.MonkeyPatch.context() as patch:
        found = [part()]
        plant(patch, SOURCE_FAULTS[fault.name])
        found.append(part())
    out.write_text(json.dumps(found))


@pytest.mark.slow
@pytest.mark.parametrize("name", PARTS)
def test_faults_of_the_source_are_seen(name, tmp_path):
    """With few paths and directions, as plain Python is slow.  The loop that says what a path is
    has the bits of the blocks (`test_simple_path`), and so their roulette."""
    in_plain_python(__file__, "write_answers", tmp_path / name, tmp_path / "out.json")
    assert json.loads((tmp_path / "out.json").read_text()) == ["agree", "differ"]
