"""Mutation testing: which seeded changes of the kernels' source does the harness catch?

A mutant counts if it changes a picture of a small scene that runs the changed function; the rungs
without pictures are then asked, with few rays and kernels in plain Python (`mutant_worker`).  What
they miss, the pictures of a suite may still catch: the share is a lower bound.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scipy import stats

import reference_rt
from comparisons.compare.compare import Say
from comparisons.experiments.selftest.mutants import Mutant, Place, functions_of, mutants
from reference_rt.util.child_processes import tied
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import replacing

SCENES = (
    *("cornell_box", "colour_bleeding", "caustic_glass", "soft_shadows", "veach_mis"),
    *("environment", "tilted_lamps", "light_shapes", "light_spot", "light_directional"),
    *("material_blend", "material_bump", "material_conductor", "material_mask"),
    *("material_normal_map", "material_plastic", "material_principled", "material_two_sided"),
    *("material_rough_conductor", "material_rough_conductor_beckmann"),
    *("material_rough_dielectric", "material_rough_plastic", "material_thin_dielectric"),
    *("camera_orthographic", "camera_pinhole", "camera_thin_lens", "camera_view_rectangle"),
    *("filter_lanczos", "filter_mitchell", "filter_tent", "texture_filters", "texture_roughness"),
    *("csg_inside", "csg_nested", "cylinders_and_cones", "quadrics", "polygons_fill_rules"),
    *("phong_spheres", "whitted_classic", "textured_room"),
)
"""Scenes that plain Python renders in seconds: no large mesh, no thousand shapes."""

FILES = ("mutants.json", "mutants.md")

MOST_SCENES = 3
"""Most scenes that a mutant is tried on: the first ones that run the changed function."""

MOST_SECONDS = 600.0
"""Time limit of one process: a mutant may loop."""


@dataclass(frozen=True)
class Fate:
    """What became of a mutant: outcome: "same" (no picture changes), "fails" (the renderer stops
    with an error), "caught" or "survives";  rung, scene: where it was caught, or the scenes whose
    pictures changed;  reason: of the rung."""

    file: str
    function: str
    line: int
    what: str
    outcome: str
    rung: str
    scene: str
    reason: str

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def mutation(count: int, seed: int, scenes: Path, say: Say) -> Iterator[Fate]:
    """The fate of `count` mutants of the functions that SCENES run."""
    package = Path(reference_rt.__file__).resolve().parent
    paths = [str((scenes / f"{name}.yaml").resolve()) for name in SCENES]
    say(f"pictures of {len(paths)} scenes")
    right = _run(None, package, {"scenes": paths, "calls": True, "before": None})
    runs: dict[Place, list[str]] = {}
    for path, found in right.items():
        for file, function in found.get("functions", ()):
            if Path(file).is_relative_to(package):  # generated code is in no file
                place = Path(file).relative_to(package).as_posix(), function
                runs.setdefault(place, []).append(path)
    places = [place for place in functions_of(package) if place in runs]
    say(f"{len(places)} functions")
    for mutant in mutants(package, places, count, seed):
        yield _fate(mutant, package, runs[mutant.file, mutant.function], right)


def summary(fates: Sequence[Fate]) -> str:
    """The share that is caught of those that change a picture, with its 95 % confidence interval
    (Clopper and Pearson 1934), and the survivors."""
    caught = sum(fate.outcome == "caught" for fate in fates)
    left = [fate for fate in fates if fate.outcome == "survives"]
    n = caught + len(left)
    low = float(stats.beta.ppf(0.025, caught, n - caught + 1)) if caught else 0.0
    high = float(stats.beta.ppf(0.975, caught + 1, n - caught)) if left else 1.0
    lines = [
        f"{caught} of {n} mutants that change a picture are caught ({low:.0%} to {high:.0%}); "
        f"{sum(f.outcome == 'same' for f in fates)} of {len(fates)} change none, "
        f"{sum(f.outcome == 'fails' for f in fates)} stop the renderer"
    ]
    lines += [f"- {f.file}:{f.line} {f.function}: {f.what} ({f.scene}; {f.reason})" for f in left]
    return "\n".join(lines) + "\n"


def write(fates: Sequence[Fate], seed: int, out: Path) -> None:
    """Write mutants.json and mutants.md into the folder `out`."""
    document = {"schema": 1, "seed": seed, "mutants": [fate.as_json() for fate in fates]}
    texts = json.dumps(document, indent=1, ensure_ascii=False), summary(fates)
    for name, text in zip(FILES, texts, strict=True):
        with replacing(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _fate(mutant: Mutant, package: Path, paths: Sequence[str], right: Mapping[str, Any]) -> Fate:
    some = list(paths[:MOST_SCENES])
    before = {path: right[path]["picture"] for path in some}

    def fate(outcome: str, rung: str = "", scene: str = "", reason: str = "") -> Fate:
        return Fate(*mutant[:4], outcome, rung, scene, reason)

    try:
        found = _run(mutant, package, {"scenes": some, "calls": False, "before": before})
    except subprocess.TimeoutExpired:
        return fate("fails", reason="takes too long")
    except ReferenceRtError as error:
        return fate("fails", reason=str(error))
    errors = [one["error"] for one in found.values() if "error" in one]
    if errors:
        return fate("fails", reason=errors[0])
    changed = [one for one in found.values() if one["changed"]]
    if not changed:
        return fate("same")
    for one in changed:
        for rung, status, reason in one["rungs"]:
            if status in ("differ", "invalid", "error"):
                return fate("caught", rung, one["scene"], reason)
    said = "; ".join(f"{rung} {status}" for rung, status, _ in changed[0]["rungs"])
    return fate("survives", scene=", ".join(one["scene"] for one in changed), reason=said)


def _run(mutant: Mutant | None, package: Path, task: Mapping[str, Any]) -> dict[str, Any]:
    """Run the worker with a copy of the package that has the mutant, if any."""
    with tempfile.TemporaryDirectory(prefix="reference_rt_mutant_") as folder:
        there = Path(folder) / "reference_rt"
        path = os.environ.get("PYTHONPATH", "")
        if mutant is not None:
            shutil.copytree(package, there, ignore=shutil.ignore_patterns("__pycache__"))
            (there / mutant.file).write_text(mutant.text, encoding="utf-8")
            path = f"{folder}{os.pathsep}{path}" if path else folder
        run = subprocess.run(
            [sys.executable, "-P", "-m", "comparisons.experiments.selftest.mutant_worker"],
            input=json.dumps(task),
            env={
                **os.environ,
                "PYTHONPATH": path,
                "NUMBA_DISABLE_JIT": "1",
                "REFERENCE_RT_MITSUBA_VARIANT": "scalar_rgb",
            },
            capture_output=True,
            text=True,
            timeout=None if mutant is None else MOST_SECONDS,
            **tied(),
            check=False,
        )
    if run.returncode != 0:
        lines = [line for line in run.stderr.splitlines() if line.strip()]
        raise ReferenceRtError(lines[-1] if lines else f"exit code {run.returncode}")
    found: dict[str, Any] = json.loads(run.stdout)
    return found


__all__ = ["FILES", "Fate", "mutation", "summary", "write"]
