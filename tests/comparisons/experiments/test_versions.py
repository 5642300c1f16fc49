"""Versions of Mitsuba against each other; the other version is a fake one."""

import sys
from pathlib import Path

import numpy as np
import pytest

from comparisons.compare.budget import Budget
from comparisons.experiments import versions
from comparisons.mitsuba.backend import Backend
from reference_rt.util.errors import UsageError

SCENES = Path(__file__).parents[3] / "scenes"

FAKE = f"""\
#!{sys.executable}
import json, sys
from pathlib import Path
import numpy as np
variant, folder, replicates, spp, *names = sys.argv[3:]
gain = {{gain}}
for name in names:
    rng = np.random.default_rng(len(name))
    noise = rng.gamma(400.0, 1 / 400.0, (int(replicates), 24, 24, 1))
    if name == "soft_shadows" and gain != 1.0:
        sys.exit("aborted")
    mean = rng.uniform(0.5, 1.5, (24, 24, 3)) * (gain if name == "cornell_box" else 1.0)
    np.save(Path(folder) / (name + ".npy"), mean * noise)
    with open(Path(folder) / "told.jsonl", "a") as file:
        print(json.dumps([name, ""]), file=file)
        if name == "colour_bleeding":
            print(json.dumps(["soft_shadows", "it crashed" if gain != 1.0 else ""]), file=file)
"""


def test_what_changed_and_since_when(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    programs = {}
    for version, gain in (("3.7.1", 1.0), ("3.8.0", 1.0), ("3.9.1", 1.002)):
        programs[version] = str(tmp_path / version)
        Path(programs[version]).write_text(FAKE.format(gain=gain))
        Path(programs[version]).chmod(0o700)
    monkeypatch.setattr(versions, "interpreter", lambda version, *more: programs[version])
    names = ("cornell_box", "colour_bleeding", "soft_shadows", "spheres_whitted", "instances")
    cases, left_out = versions.compared(
        list(programs),
        [SCENES / f"{name}.yaml" for name in names],
        Budget(size=(24, 24), spp=4, replicates=8),
        Backend("scalar_rgb", "3.9.1", "", None),
        lambda line: None,
    )
    verdicts = {case.scene: case.verdict for case in cases}
    assert verdicts["cornell_box: 3.7.1 to 3.8.0"] == "unchanged"
    assert verdicts["cornell_box: 3.8.0 to 3.9.1"] == "differ"
    assert verdicts["colour_bleeding: 3.8.0 to 3.9.1"] == "unchanged"
    assert verdicts["soft_shadows: 3.8.0 to 3.9.1"] == "not-comparable"
    assert left_out == [
        "spheres_whitted: the integrator 'whitted' is ours",
        "instances: Mitsuba takes minutes to compile many instances",
    ]
    head, _, *rows = versions.table(cases).markdown()
    assert "changed" in head
    assert [row.split(" | ")[:2] for row in rows] == [
        ["| cornell_box", "from 3.8.0 to 3.9.1"],
        ["| soft_shadows", "from 3.8.0 to 3.9.1"],
    ]
    assert "+0.2, +0.2, +0.2 %" in rows[0]
    assert "constant gain of 1.002" in rows[0]


def test_the_installed_version_needs_no_environment_of_its_own() -> None:
    here = Backend("scalar_rgb", "3.9.1", "", None)
    assert versions.interpreter("3.9.1", here, lambda line: None) == sys.executable
    with pytest.raises(UsageError, match="is no version"):
        versions.compared(["3.9.1", "../x"], [], Budget(), here, lambda line: None)


@pytest.mark.slow
def test_the_installed_version_agrees_with_itself() -> None:
    from comparisons.mitsuba.backend import backend

    version = backend().version
    cases, left_out = versions.compared(
        [version, version],
        [SCENES / "cornell_box.yaml"],
        Budget(size=(24, 24), spp=32, replicates=8),
        backend(),
        lambda line: None,
    )
    assert cases[0].verdict in ("agree", "unchanged"), cases[0].reason
    assert left_out == []
    images = cases[0].images
    assert images is not None
    # Threads add up the 32 floats of a pixel in any order.
    np.testing.assert_allclose(images.candidate, images.reference, rtol=32 * 2.0**-24)
