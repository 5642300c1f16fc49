"""Mutation testing: which seeded changes of the kernels' source does the harness catch?

A mutant counts if it changes a picture of a small scene that runs the changed function.  Then the
rungs without pictures are asked, with few rays and kernels in plain Python (`mutant_worker`), since
that takes seconds.  What they miss is compiled, and compared with the budgets of the smoke suite,
then with those of the standard suite."""

import os
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from scipy import stats

from comparisons.compare.compare import Say
from comparisons.experiments.selftest.fault import PACKAGE, SourceFault, run_patched, run_worker
from comparisons.experiments.selftest.mutants import Mutant, Place, functions_of, mutants
from comparisons.experiments.selftest.sensitivity import Budgets, compare_patched
from comparisons.results.files import write_json
from comparisons.runs.elsewhere import run_elsewhere
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import replacing
from reference_rt.util.workers import Workers

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


WORKER = "comparisons.experiments.selftest.mutant_worker"
PLAIN = {"NUMBA_DISABLE_JIT": "1", "REFERENCE_RT_MITSUBA_VARIANT": "scalar_rgb"}

FEW_RAYS = "few rays"
"""What catches a mutant in plain Python: fewer rays than any suite has."""


@dataclass(frozen=True)
class Fate:
    """What became of a mutant: outcome: "same" (no picture changes), "fails" (the renderer stops
    with an error), "caught" or "survives";  by: FEW_RAYS or the suite that catches it;  rung,
    scene: where it was caught, or the scenes whose pictures changed;  reason: of the rung."""

    file: str
    function: str
    line: int
    what: str
    outcome: str
    by: str
    rung: str
    scene: str
    reason: str

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def mutation(
    count: int, seed: int, scenes: Path, budgets: Budgets, say: Say, workers: Workers
) -> Iterator[Fate]:
    """The fate of `count` mutants of the functions that SCENES run;  budgets: of the suites, the
    small one first."""
    paths = [str((scenes / f"{name}.yaml").resolve()) for name in SCENES]
    say(f"pictures of {len(paths)} scenes")
    right: dict[str, Any] = {}
    runs: dict[Place, list[str]] = {}
    for path, (found, places) in zip(
        paths, run_elsewhere(workers, _right, ((path,) for path in paths)), strict=True
    ):
        right |= found
        for place in places:
            runs.setdefault(place, []).append(path)
    places = [place for place in functions_of(PACKAGE) if place in runs]
    say(f"{len(places)} functions")
    tasks = []
    for mutant in mutants(PACKAGE, places, count, seed):
        some = runs[mutant.file, mutant.function][:MOST_SCENES]
        before = {path: right[path]["picture"] for path in some}
        tasks.append((mutant, before, scenes.resolve(), budgets))
    yield from run_elsewhere(workers, _fate, tasks)


def _right(path: str) -> tuple[dict[str, Any], list[Place]]:
    """The picture of a scene, and the functions of the package that it runs."""
    task = {"scenes": [path], "calls": True, "before": None}
    found = run_worker(WORKER, task, PLAIN, None)
    files = [(Path(file), function) for file, function in found[path].get("functions", ())]
    # Generated code is in no file.
    own = [(file, function) for file, function in files if file.is_relative_to(PACKAGE)]
    return found, [(file.relative_to(PACKAGE).as_posix(), function) for file, function in own]


def _fate(mutant: Mutant, before: dict[str, Any], scenes: Path, budgets: Budgets) -> Fate:
    plain = by_few_rays(mutant, before)
    return _by_suites(mutant, plain, scenes, budgets) if _survives(plain) else plain


def _survives(fate: Fate) -> bool:
    return fate.outcome == "survives"


def summary(fates: Sequence[Fate]) -> str:
    """The share that each suite catches of those that change a picture, and the survivors."""
    left = [fate for fate in fates if _survives(fate)]
    changing = [fate for fate in fates if fate.outcome in ("caught", "survives")]
    lines = [
        f"{len(changing)} of {len(fates)} mutants change a picture; "
        f"{sum(f.outcome == 'same' for f in fates)} change none, "
        f"{sum(f.outcome == 'fails' for f in fates)} stop the renderer",
        *(
            f"{name} catches {_share(sum(f.by in by for f in changing), len(changing))}"
            for name, by in (
                ("few rays", (FEW_RAYS,)),
                ("smoke", (FEW_RAYS, "smoke")),
                ("standard", (FEW_RAYS, "smoke", "standard")),
            )
        ),
    ]
    lines += [f"- {f.file}:{f.line} {f.function}: {f.what} ({f.scene}; {f.reason})" for f in left]
    return "\n".join(lines) + "\n"


def _share(caught: int, n: int) -> str:
    """In words, with its 95 % confidence interval (Clopper and Pearson 1934)."""
    low = float(stats.beta.ppf(0.025, caught, n - caught + 1)) if caught else 0.0
    high = float(stats.beta.ppf(0.975, caught + 1, n - caught)) if caught < n else 1.0
    return f"{caught} of {n} ({low:.0%} to {high:.0%})"


def write(fates: Sequence[Fate], seed: int, out: Path) -> None:
    """Write mutants.json and mutants.md into the folder `out`."""
    document = {"schema": 2, "seed": seed, "mutants": [fate.as_json() for fate in fates]}
    write_json(out / FILES[0], document)
    with replacing(out / FILES[1]) as temporary:
        temporary.write_text(summary(fates), encoding="utf-8")


def by_few_rays(mutant: Mutant, before: Mapping[str, Any]) -> Fate:
    """The fate of a mutant in plain Python;  before: the right pictures, by the scene's path."""

    def fate(outcome: str, by: str = "", rung: str = "", scene: str = "", reason: str = "") -> Fate:
        return Fate(*mutant[:4], outcome, by, rung, scene, reason)

    task = {"scenes": list(before), "calls": False, "before": before}
    try:
        found = run_patched(mutant.file, mutant.text, WORKER, task, MOST_SECONDS, PLAIN)
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
                return fate("caught", FEW_RAYS, rung, one["scene"], reason)
    said = "; ".join(f"{rung} {status}" for rung, status, _ in changed[0]["rungs"])
    return fate("survives", scene=", ".join(one["scene"] for one in changed), reason=said)


def _by_suites(mutant: Mutant, fate: Fate, scenes: Path, budgets: Budgets) -> Fate:
    """What the suites say, in each scene whose picture changed, to a mutant that few rays miss."""
    said = []
    threads = max(1, (os.cpu_count() or 1) // 2)
    for scene in fate.scene.split(", "):
        fault = SourceFault(mutant.what, scene, mutant.file, "", "")
        of_scene = {suite: by_scene[scene] for suite, by_scene in budgets.items()}
        try:
            found = compare_patched(fault, mutant.text, of_scene, scenes, threads, True)
        except (subprocess.TimeoutExpired, ReferenceRtError) as error:
            reason = str(error)
            return replace(fate, outcome="caught", by="smoke", rung="error", reason=reason[:200])
        if found[-1].caught:
            one = found[-1]
            caught = replace(fate, outcome="caught", by=one.suite, rung=one.rung, scene=scene)
            return replace(caught, reason=one.strength)
        said += [f"{one.suite} {one.verdict}: {one.strength}" for one in found]
    return replace(fate, reason="; ".join(said))
