"""How soon the fuzzer finds faults that are planted in the renderer's source, and how small the
scenes become that show them."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median

from comparisons.experiments.fuzz.schema import all_types
from comparisons.experiments.selftest import FAULTS
from comparisons.experiments.selftest.fault import SourceFault, patched
from comparisons.experiments.selftest.sensitivity import patched_text
from comparisons.results.files import write_json
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.processes import tied

MOST_SCENES = 500

REDUCE = 600.0
"""Seconds for the reduction of a finding: its scenes may need kernels that are not compiled yet."""

FILE = "planted.json"


@dataclass(frozen=True)
class Planted:
    """fault: its name;  scenes: how many were checked until it was found, 0 if it was not;  rung,
    cause: of the finding;  shapes, lines: of the reduced scene;  scene: its text."""

    fault: str
    scenes: int
    rung: str = ""
    cause: str = ""
    shapes: int = 0
    lines: int = 0
    scene: str = ""


def source_faults() -> list[SourceFault]:
    """The faults of the self-test that are planted in the source."""
    return [fault for fault in FAULTS if isinstance(fault, SourceFault)]


def feature_of(fault: SourceFault) -> str:
    """The type of the schema that the fault's file implements, which all scenes then have; empty
    for a file that is no type's."""
    stem = Path(fault.file).stem
    return stem if stem in {name for _, name in all_types()} else ""


def search(
    faults: Sequence[SourceFault], out: Path, seed: int, workers: int, count: int = MOST_SCENES
) -> Iterator[Planted]:
    """What becomes of each fault; writes FILE after each."""
    found: list[Planted] = []
    for fault in faults:
        found.append(_search(fault, out / "planted", seed, workers, count))
        write_json(out / FILE, {"seed": seed, "planted": [asdict(one) for one in found]})
        yield found[-1]


def summary(found: Sequence[Planted]) -> str:
    """In one line."""
    caught = [one for one in found if one.scenes]
    if not caught:
        return f"0 of {len(found)} faults found"
    return (
        f"{len(caught)} of {len(found)} faults found, after {median(o.scenes for o in caught):g} "
        f"scenes (median); reduced to {median(o.shapes for o in caught):g} shapes and "
        f"{median(o.lines for o in caught):g} lines (median)"
    )


def _search(fault: SourceFault, out: Path, seed: int, workers: int, count: int) -> Planted:
    """Run `reference-rt fuzz --stop` with a patched copy of the renderer.

    The copy compiles what its scenes need, into a cache of its own: `warm-up` would compile all
    kernels, most of which no scene uses before the fault is found.
    """
    text = patched_text(fault)
    folder = out.resolve() / "".join(c if c.isalnum() else "_" for c in fault.name)
    with patched(fault.file, text) as own:
        words = ["--count", str(count), "--seed", str(seed), "--workers", str(workers), "--stop"]
        words += ["--reduce", str(REDUCE), "--out", str(folder)]
        if feature := feature_of(fault):
            words += ["--features", feature]
        run = subprocess.run(
            # -P: do not import from the current folder, which may have a reference_rt.
            [sys.executable, "-P", "-m", "reference_rt", "fuzz", *words],
            env={**os.environ, **own},
            capture_output=True,
            text=True,
            # Workers import from the current folder first.
            cwd=own["PYTHONPATH"].partition(os.pathsep)[0],
            **tied(),
            check=False,
        )
    if run.returncode not in (0, 1):
        lines = [line for line in run.stderr.splitlines() if line.strip()]
        raise ReferenceRtError(f"fuzz: '{fault.name}': {lines[-1] if lines else run.returncode}")
    result = json.loads((folder / "fuzz.json").read_text(encoding="utf-8"))
    if not result["findings"]:
        return Planted(fault.name, 0)
    one = result["findings"][0]
    scene = one["scene"] or ""
    shapes = scene.partition("shapes:\n")[2].partition("\nlights:")[0]
    return Planted(
        fault.name,
        result["scenes"],
        one["rung"],
        one["cause"],
        sum(line.startswith("  - ") for line in shapes.splitlines()),
        len(scene.splitlines()),
        scene,
    )
