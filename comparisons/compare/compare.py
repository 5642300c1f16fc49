"""The comparison of one scene with Mitsuba, rung by rung, from the scene to the verdict."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from comparisons import rungs as ladder
from comparisons.compare import pictures
from comparisons.compare.budget import Budget
from comparisons.compare.control import control
from comparisons.compare.judge import Evidence, Rendered, judge
from comparisons.compare.single_lights import single_lights
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.notes import notes_of
from comparisons.mitsuba.reading.reference import file_of, own_scene
from comparisons.mitsuba.translate import UntranslatableError, load
from comparisons.results.case import Case, RungResult
from reference_rt.cameras.filters import BoxFilter, Filter
from reference_rt.cli.explain import explain
from reference_rt.integrators import RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

_NO_LIGHT = "ray casting shows surfaces, not light"

LIGHT_SPP = 64
"""Samples per pixel of pictures of single lights: enough to recognise them in a difference."""

Say = Callable[[str], None]
"""Called with a line of text about each step."""


@dataclass(frozen=True)
class Subject:
    """scene: what we render;  reference: what Mitsuba renders; None: the same, which it is unless a
    test plants a fault in one of them."""

    scene: Scene
    reference: Scene | None = None


def compare_scene(
    subject: Subject,
    budget: Budget,
    say: Say,
    threads: int | None = None,
    rungs: tuple[str, ...] = (),
) -> Case:
    """Compare one scene.  threads: ours, None for all cores;  rungs: only these; empty: all.

    Raises SceneError, ImageError, ReferenceUnavailableError.
    """
    if budget.control:
        return control(budgeted(subject.scene, budget), budget, say)
    evidence = gather(subject, budget, say, threads, rungs)
    return judge(evidence, budget.limit)


def budgeted(scene: Scene, budget: Budget) -> Scene:
    """The scene with the budget's size and samples, and a box filter.

    With a filter wider than a pixel, Mitsuba's neighbouring pixels share samples and hence noise,
    but the statistics need independent pixels.  The scene's own filter is compared by its own rung.
    """
    film: dict[str, object] = {"filter": BoxFilter()}
    if budget.size is not None:
        film |= dict(zip(("width", "height"), budget.size, strict=True))
    sampler = scene.resolved_sampler
    if budget.spp is not None and not scene.integrator.deterministic:
        sampler = sampler.model_copy(update={"spp": budget.spp})
    return scene.changed(film=scene.film.model_copy(update=film), sampler=sampler)


def gather(
    subject: Subject,
    budget: Budget,
    say: Say,
    threads: int | None = None,
    only: tuple[str, ...] = (),
) -> Evidence:
    """Run the deterministic rungs and render the pictures of both sides."""
    scene = budgeted(subject.scene, budget)
    clock = time.perf_counter()
    tables = build_tables(scene)
    seconds: dict[str, dict[str, float]] = {
        "candidate": {"load": time.perf_counter() - clock},
        "reference": {},
    }
    left_out = _left_out(scene, tables)
    judged_by = budgeted(subject.reference or subject.scene, budget)
    clock = time.perf_counter()
    own = _own_file(judged_by)
    try:
        counterpart = load(judged_by)
    except UntranslatableError as error:
        rung = RungResult("geometry", "not-comparable", str(error))
        if own is None:
            return Evidence(scene.name, (rung,), None, seconds, left_out=left_out)
        counterpart, only = Counterpart(own, {}), ("statistics", "images")
    seconds["reference"] = {"load": time.perf_counter() - clock}

    notes = [*counterpart.notes(), *notes_of(scene)]
    if own is not None:
        notes = [*counterpart.notes(), _OWN_FILE.format(file_of(scene))]
    if not isinstance(subject.scene.film.filter, BoxFilter):
        notes.insert(0, "compared with a box filter")
    film_filters = (subject.scene.film.filter, (subject.reference or subject.scene).film.filter)
    found = _deterministic_rungs(scene, tables, counterpart, film_filters, budget, only, say)
    pictured = not only or not {"statistics", "images"}.isdisjoint(only)
    if counterpart.no_light_reason and not isinstance(scene.integrator, RayCast):
        found += [
            RungResult(name, "not-comparable", counterpart.no_light_reason)
            for name in ("statistics", "images")
        ]
        pictured = False
    if not pictured:
        return Evidence(scene.name, tuple(found), None, seconds, tuple(notes), left_out)
    shown = counterpart if own is None else Counterpart(own, counterpart.mi_shapes)
    rendered = _pictures(scene, tables, shown, budget, threads, say)
    for side, times in rendered.seconds.items():
        seconds[side] = seconds[side] | times
    notes.extend(rendered.notes)
    return Evidence(
        scene.name,
        tuple(found),
        rendered,
        seconds,
        tuple(notes),
        left_out,
        lights=None
        if scene.integrator.deterministic
        else lambda: single_lights(judged_by, LIGHT_SPP),
    )


_OWN_FILE = (
    "Mitsuba's pictures are of {} itself, loaded by Mitsuba and changed in the film's size and "
    "filter and in its samples only; the rungs below are of our translation of what we read"
)


def _own_file(scene: Scene) -> Any:
    """Mitsuba's scene of the user's own file; None for other scenes, and where nothing is drawn at
    random."""
    if file_of(scene) is None or scene.integrator.deterministic:
        return None
    return own_scene(scene)


def _left_out(scene: Scene, tables: SceneTables) -> tuple[str, ...]:
    """The features that are specialised away because the scene lacks them, grouped by reason."""
    by_reason: dict[str, list[str]] = {}
    for what, why in explain(scene, tables)[1]:
        by_reason.setdefault(why, []).append(what)
    return tuple(f"{', '.join(names)}: {why}" for why, names in by_reason.items())


def _deterministic_rungs(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    film_filters: tuple[Filter, Filter],
    budget: Budget,
    only: tuple[str, ...],
    say: Say,
) -> list[RungResult]:
    """Film, geometry, then light; each only if the rungs below it hold: a wrong convention must not
    be reported as wrong light."""
    climbs: dict[str, Callable[[], RungResult]] = {
        "geometry": lambda: ladder.geometry(scene, tables, counterpart, budget.pixels),
        "direct": lambda: ladder.direct(scene, tables, counterpart, budget.light_pixels),
        "whitted": lambda: ladder.whitted(scene, tables, counterpart, budget.pixels),
    }
    if any(not isinstance(film_filter, BoxFilter) for film_filter in film_filters):
        climbs = {"film": lambda: ladder.film(*film_filters), **climbs}
    found: list[RungResult] = []
    for name, climb in climbs.items():
        if only and name not in only:
            continue
        broken = next((t for t in found if t.status == "differ"), None)
        of_light = name in ("direct", "whitted")
        if broken is not None:
            rung = RungResult(name, "not-applicable", f"the {broken.name} rung below is broken")
        elif of_light and isinstance(scene.integrator, RayCast):
            rung = RungResult(name, "not-applicable", _NO_LIGHT)
        elif of_light and counterpart.no_light_reason:
            rung = RungResult(name, "not-comparable", counterpart.no_light_reason)
        else:
            start = time.perf_counter()
            rung = climb()
            say(f"{name}: {rung.status} ({time.perf_counter() - start:.1f} s)")
        found.append(rung)
    return found


def _pictures(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    budget: Budget,
    threads: int | None,
    say: Say,
) -> Rendered:
    if isinstance(scene.integrator, RayCast):
        return pictures.cast(scene, tables, counterpart)
    if isinstance(scene.integrator, Whitted):
        return pictures.whitted(scene, tables, counterpart)
    start = time.perf_counter()
    rendered = pictures.replicates(
        scene, tables, counterpart, budget.replicates, budget.reference_spp, threads
    )
    say(f"{budget.replicates} + {budget.replicates} pictures ({time.perf_counter() - start:.1f} s)")
    return rendered


__all__ = ["Evidence", "Say", "Subject", "budgeted", "compare_scene", "gather"]
