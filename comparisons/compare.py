"""The comparison of scenes, from loading to verdicts, `results.json` and the report."""

import datetime
import importlib.metadata
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from comparisons import pictures, tiers
from comparisons.metrics import image_metrics
from comparisons.mitsuba_backend import Backend, backend, mitsuba
from comparisons.report import write_report, write_results
from comparisons.results import Case, Tier
from comparisons.statistics import compare_replicates
from comparisons.translate import UntranslatableError, load
from comparisons.translate.notes import notes_of
from comparisons.twin import Twin
from comparisons.verdict import decide
from reference_rt.filters import BoxFilter
from reference_rt.integrators import RayCast, Whitted
from reference_rt.scene import Scene
from reference_rt.tables import SceneTables, build_tables

_NO_LIGHT = "ray casting shows surfaces, not light"


@dataclass(frozen=True)
class Options:
    """replicates: independent renderings on each side of a path-traced scene;  threads: of ours,
    None for all cores."""

    replicates: int = 16
    threads: int | None = None


def compare_scenes(scenes: Sequence[Scene], out: Path, options: Options) -> list[Case]:
    """Compare each scene with Mitsuba; `results.json` and `report.html` in `out` tell of it.

    Every scene's files are read before the first is compared.  `results.json` is whole after each
    scene, so that an interrupted run keeps what it found.  Raises SceneError, ImageError,
    ReferenceUnavailableError.
    """
    console = Console(stderr=True, highlight=False)
    tables = []
    for scene in scenes:
        start = time.perf_counter()
        built = build_tables(scene)
        tables.append((built, time.perf_counter() - start))
    chosen = backend()
    console.print(f"Mitsuba {chosen.version}, {chosen.variant}: {chosen.reason}", markup=False)
    mitsuba()
    facts = provenance(chosen, options)
    cases: list[Case] = []
    for scene, (built, seconds) in zip(scenes, tables, strict=True):
        case = compare_scene(scene, built, seconds, options, console)
        cases.append(case)
        console.print(f"{case.scene}: {case.verdict}: {case.reason}", markup=False)
        write_results(out / "results.json", cases, facts)
    write_report(out / "report.html", cases, facts)
    console.print(f"{out / 'results.json'}, {out / 'report.html'}", markup=False)
    return cases


def compare_scene(
    scene: Scene, tables: SceneTables, load_seconds: float, options: Options, console: Console
) -> Case:
    """One scene, rung by rung."""
    # A filter wider than the pixel shares samples between pixels on Mitsuba's side, and their
    # noise with them: the statistics need independent pixels, and the filter is not in question.
    notes = [] if isinstance(scene.film.filter, BoxFilter) else ["compared with a box filter"]
    film_filter = scene.film.filter
    scene = scene.changed(film=scene.film.model_copy(update={"filter": BoxFilter()}))
    clock = time.perf_counter()
    try:
        twin = load(scene)
    except UntranslatableError as error:
        tier = Tier("geometry", "not-comparable", str(error))
        seconds = {"ours": {"load": load_seconds}, "mitsuba": {}}
        return Case(scene.name, "not-comparable", str(error), (tier,), None, seconds)
    seconds = {
        "ours": {"load": load_seconds},
        "mitsuba": {"load": time.perf_counter() - clock},
    }
    rungs = [] if isinstance(film_filter, BoxFilter) else [tiers.film(film_filter)]
    rungs += _deterministic_rungs(scene, tables, twin, console)
    notes += [*twin.notes(), *notes_of(scene)]
    if twin.lacking and not isinstance(scene.integrator, RayCast):
        rungs += [Tier(name, "not-comparable", twin.lacking) for name in ("statistics", "images")]
        verdict, reason = decide(rungs, None)
        return Case(scene.name, verdict, reason, tuple(rungs), None, seconds, None, tuple(notes))
    rendered, more = _pictures(scene, tables, twin, options, console)
    rungs += more
    for side, times in rendered.seconds.items():
        seconds[side] |= times
    metrics = image_metrics(rendered.images.ours, rendered.images.mitsuba)
    rungs.append(pictures.images_tier(rendered, metrics))
    verdict, reason = decide(rungs, metrics)
    return Case(
        scene.name,
        verdict,
        reason,
        tuple(rungs),
        metrics,
        seconds,
        rendered.images,
        (*notes, *rendered.notes),
    )


def _deterministic_rungs(
    scene: Scene, tables: SceneTables, twin: Twin, console: Console
) -> list[Tier]:
    """Geometry, then light, each only where the rung before it holds: a convention that is wrong
    below must not be reported as light that is wrong above."""
    found: list[Tier] = []
    for name, climb in (
        ("geometry", tiers.geometry),
        ("direct", tiers.direct),
        ("whitted", tiers.whitted),
    ):
        broken = next((t for t in found if t.status == "differ"), None)
        if broken is not None:
            tier = Tier(name, "not-applicable", f"the {broken.name} rung below is broken")
        elif name != "geometry" and isinstance(scene.integrator, RayCast):
            tier = Tier(name, "not-applicable", _NO_LIGHT)
        elif name != "geometry" and twin.lacking:
            tier = Tier(name, "not-comparable", twin.lacking)
        else:
            with console.status(f"{scene.name}: {name}"):
                start = time.perf_counter()
                tier = climb(scene, tables, twin)
                seconds = time.perf_counter() - start
            console.print(f"{scene.name}: {name}: {tier.status} ({seconds:.1f} s)", markup=False)
        found.append(tier)
    return found


def _pictures(
    scene: Scene, tables: SceneTables, twin: Twin, options: Options, console: Console
) -> tuple[pictures.Rendered, list[Tier]]:
    """The pictures of both sides, and the statistics where there is noise."""
    with console.status(f"{scene.name}: pictures") as status:

        def say(step: str) -> None:
            status.update(f"{scene.name}: {step}")

        if isinstance(scene.integrator, RayCast):
            rendered = pictures.cast(scene, tables, twin)
        elif isinstance(scene.integrator, Whitted):
            rendered = pictures.whitted(scene, tables, twin)
        else:
            rendered = pictures.replicates(
                scene, tables, twin, options.replicates, options.threads, say
            )
    if rendered.replicates is None:
        return rendered, [Tier("statistics", "not-applicable", "deterministic: there is no noise")]
    tier = compare_replicates(*rendered.replicates)
    console.print(f"{scene.name}: statistics: {tier.status}", markup=False)
    return rendered, [tier]


def provenance(chosen: Backend, options: Options) -> dict[str, Any]:
    """What a reader must know to repeat a run."""
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "reference_rt": importlib.metadata.version("reference-rt"),
        "mitsuba": f"{chosen.version}, {chosen.variant}: {chosen.reason}",
        "numpy": np.__version__,
        "numba": importlib.metadata.version("numba"),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {_processor()}",
        "cores": os.cpu_count(),
        "replicates": options.replicates,
    }


def _processor() -> str:
    """The processor's name, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown processor"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown processor"
