"""The comparison of one scene with Mitsuba, rung by rung, from the scene to the verdict."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from comparisons import rungs as ladder
from comparisons.compare import looks, pictures, precision, ray_starts
from comparisons.compare.budget import Budget, part_of
from comparisons.compare.control import control
from comparisons.compare.darkness import why_dark
from comparisons.compare.derivative import derivative_case
from comparisons.compare.judge import Evidence, Rendered, at_look, check, judge
from comparisons.compare.path_length import path_lengths
from comparisons.compare.single_lights import single_lights
from comparisons.compare.watched import Say
from comparisons.geometry.flatten import copies_of
from comparisons.mitsuba.backend import scalar
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.parse import file_of
from comparisons.results.case import Case, RungResult
from comparisons.rungs.layers.rung import applies
from comparisons.rungs.limited import Rest
from comparisons.rungs.witness import witnesses_of
from comparisons.translator import MOST_INSTANCES, UntranslatableError, load
from comparisons.translator.mistakes import in_place_of
from comparisons.translator.moved import with_float32_vertices
from comparisons.translator.notes import notes_of
from comparisons.translator.reference import changes_to, own_scene
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.cli.explain import explain
from reference_rt.integrators import Light, RayCast, Whitted
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid, Sobol
from reference_rt.scene.build import build_tables

__all__ = ["Evidence", "Say", "Subject", "budgeted", "compare_scene", "gather"]


_NO_LIGHT = "ray casting shows surfaces, not light"

_MEDIA = "path tracing alone follows light through media, and what is no surface"


@dataclass(frozen=True)
class Subject:
    """scene: what we render;  reference: what Mitsuba renders;  witness: what a third renderer
    renders; None: the same, which they are unless a test plants a fault in one of them."""

    scene: Scene
    reference: Scene | None = None
    witness: Scene | None = None


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
    if budget.derivative is not None:
        return derivative_case(budgeted(subject.scene, budget), budget, say, threads)
    witness = None
    if budget.witness:
        scene = budgeted(subject.witness or subject.scene, budget)
        seen = budgeted(subject.scene, budget)
        witness = witnesses_of(budget.witness, scene, budget.limit, threads, say, seen)
    evidence = gather(subject, budget, say, threads, rungs)
    return judge(replace(evidence, witness=witness), budget.limit)


def budgeted(scene: Scene, budget: Budget) -> Scene:
    """The scene with the budget's size and samples, a box filter, and no layers; without noise on a
    grid of samples, since the points of our other samplers are our own.

    With a filter wider than a pixel, Mitsuba's neighbouring pixels share samples and hence noise,
    but the statistics need independent pixels.  The scene's own filter and layers have rungs of
    their own.  Caustics of points, which no path from the camera finds, are left out of light
    tracing, since Mitsuba's path tracer stands beside it.
    """
    film: dict[str, object] = {"filter": BoxFilter(), "layers": ()}
    if budget.size is not None:
        film |= dict(zip(("width", "height"), budget.size, strict=True))
    sampler = scene.resolved_sampler
    if isinstance(sampler, Grid) and not scene.integrator.deterministic:
        sampler = Sobol()
    elif not isinstance(sampler, Grid) and scene.integrator.deterministic:
        sampler = Grid(spp=math.isqrt(sampler.spp) ** 2)
    if not scene.integrator.deterministic:
        pixels = scene.film.width * scene.film.height
        if budget.size is not None:
            pixels = math.prod(budget.size)
        spp = budget.spp or part_of(sampler.spp, budget.parts, pixels)
        sampler = sampler.model_copy(update={"spp": spp})
    scene = scene.changed(film=scene.film.model_copy(update=film), sampler=sampler)
    if isinstance(scene.integrator, Light):
        found = scene.integrator.model_copy(update={"caustics_of_points": False})
        return scene.changed(integrator=found)
    return scene


def gather(
    subject: Subject,
    budget: Budget,
    say: Say,
    threads: int | None = None,
    only: tuple[str, ...] = (),
) -> Evidence:
    """Run the deterministic rungs and render the pictures of both sides."""
    if not _has_many_instances(subject.reference or subject.scene):
        return _gather(subject, budget, say, threads, only)
    with scalar():
        evidence = _gather(subject, budget, say, threads, only)
    note = (
        "Mitsuba renders in its scalar variant: its fast ones compile code for each of the many "
        "instances"
    )

    def rest_of(rendered: Rendered, share: float) -> Rest:
        assert evidence.rest_of is not None
        with scalar():
            return evidence.rest_of(rendered, share)

    left = None if evidence.rest_of is None else rest_of
    return replace(evidence, lights=None, rest_of=left, notes=(note, *evidence.notes))


def _has_many_instances(scene: Scene) -> bool:
    """Whether light on instances is to be compared in Mitsuba's scalar variant."""
    if isinstance(scene.integrator, RayCast):
        return False  # which needs their hits alone: see `InstancedGroup`
    return sum(copy.instance >= 0 for copy in copies_of(scene)) > MOST_INSTANCES


def _gather(
    subject: Subject, budget: Budget, say: Say, threads: int | None, only: tuple[str, ...]
) -> Evidence:
    """The same in the current variant of Mitsuba."""
    if subject.scene.media:
        # Its stratified samplers are biased where a colour of the medium is drawn, by percents
        # (`findings/mitsuba-media-stratified.sh`).
        budget = budget.model_copy(update={"reference_sampler": "independent"})
    clock = time.perf_counter()
    scene, moved, theirs = with_float32_vertices(budgeted(subject.scene, budget))
    tables = build_tables(scene)
    seconds: dict[str, dict[str, float]] = {
        "candidate": {"load": time.perf_counter() - clock},
        "reference": {},
    }
    left_out = _left_out(scene, tables)
    clock = time.perf_counter()
    if subject.reference is not None:
        _, _, theirs = with_float32_vertices(budgeted(subject.reference, budget))
    judged_by = theirs()
    own = _own_file(judged_by, budget)
    try:
        counterpart = load(judged_by, sampler=budget.reference_sampler)
    except UntranslatableError as error:
        rung = RungResult("geometry", "not-comparable", str(error))
        if own is None:
            return Evidence(scene.name, (rung,), None, seconds, left_out=left_out)
        is_ours = in_place_of(judged_by) is not None
        counterpart = Counterpart(own, {}, has_our_integrator=is_ours)
        only = ("statistics", "images")
    seconds["reference"] = {"load": time.perf_counter() - clock}

    notes = [*counterpart.notes(), *notes_of(scene)]
    if own is not None:
        changes = dict.fromkeys([_OWN_FILE.format(file_of(scene)), *changes_to(scene)])
        notes = [*counterpart.notes(), *changes]
    if not isinstance(subject.scene.film.filter, BoxFilter):
        notes.insert(0, "compared with a box filter")
    if not scene.integrator.deterministic and isinstance(subject.scene.sampler, Grid):
        notes.insert(0, "compared with random samples in place of a grid, as Mitsuba has them")
    if scene.integrator.deterministic and not isinstance(subject.scene.resolved_sampler, Grid):
        notes.insert(0, "compared with a grid of samples in each pixel, whose rays both trace")
    if isinstance(scene.integrator, Light):
        notes.append("compared without caustics of lamps without extent, which no path finds")
    if moved > 0.0:
        notes.append(
            f"compared with the vertices of meshes rounded to float32, as Mitsuba holds them: they "
            f"move by at most {moved:.2g}"
        )
    films = (subject.scene.film, (subject.reference or subject.scene).film)
    rungs = _deterministic_rungs(
        subject.scene, scene, tables, counterpart, films, budget, only, say, threads
    )
    pictured = not only or not {"statistics", "images"}.isdisjoint(only)
    reason = _no_pictures(counterpart, scene)
    if reason:
        rungs += [RungResult(name, "not-comparable", reason) for name in ("statistics", "images")]
        pictured = False
    if not pictured:
        return Evidence(scene.name, tuple(rungs), None, seconds, tuple(notes), left_out)
    decided = any(rung.status == "differ" for rung in rungs)
    shown = counterpart if own is None else Counterpart(own, counterpart.mi_shapes)
    rendered, looked = _pictures(scene, tables, shown, budget, threads, say, decided)
    shapes = pictures.layers(scene, tables, counterpart)
    rendered = replace(rendered, images=replace(rendered.images, layers=shapes))
    for side, times in rendered.seconds.items():
        seconds[side] = seconds[side] | times
    notes.extend(rendered.notes)
    return Evidence(
        scene.name,
        tuple(rungs),
        rendered,
        seconds,
        tuple(notes),
        left_out,
        lights=None if scene.integrator.deterministic else partial(single_lights, judged_by),
        lengths=path_lengths(judged_by, threads),
        looks=looked,
        ray_starts=None
        if budget.seconds is None or not ray_starts.may_matter(scene, shown)
        else partial(ray_starts.explained, scene, shown, budget.limit, budget.seconds, say),
        rest_of=partial(precision.rest_of, scene, tables, counterpart, budget.limit),
        darkness=partial(why_dark, scene),
    )


def _no_pictures(counterpart: Counterpart, scene: Scene) -> str:
    """Why pictures cannot be compared; empty if they can."""
    if isinstance(scene.integrator, RayCast):
        return ""
    noisy = not scene.integrator.deterministic
    return counterpart.no_pictures_reason if noisy else counterpart.no_light_reason


_OWN_FILE = (
    "Mitsuba's pictures are of {} itself, loaded by Mitsuba; its film's size and filter and its "
    "samples are changed, and what these notes name; the rungs below are of our translation of "
    "what we read"
)


def _own_file(scene: Scene, budget: Budget) -> Any:
    """Mitsuba's scene of the user's own file; None for other scenes, and where nothing is drawn at
    random."""
    if file_of(scene) is None or scene.integrator.deterministic:
        return None
    return own_scene(scene, budget.reference_sampler)


def _left_out(scene: Scene, tables: SceneTables) -> tuple[str, ...]:
    """The features that are left out because the scene lacks them, grouped by reason."""
    by_reason: dict[str, list[str]] = {}
    for what, why in explain(scene, tables)[1]:
        by_reason.setdefault(why, []).append(what)
    return tuple(f"{', '.join(names)}: {why}" for why, names in by_reason.items())


def _deterministic_rungs(
    written: Scene,
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    films: tuple[Film, Film],
    budget: Budget,
    only: tuple[str, ...],
    say: Say,
    threads: int | None,
) -> list[RungResult]:
    """Files, film, geometry, light, layers; each only if the rungs below it hold: a wrong
    convention must not be reported as wrong light.  written: the scene as its author wrote it."""
    film_filters = films[0].filter, films[1].filter
    climbs: dict[str, Callable[[], RungResult]] = {
        "solids": lambda: ladder.solids(scene, budget.pixels),
        "geometry": lambda: ladder.geometry(
            scene, tables, counterpart, budget.pixels, resolved=budget.resolution
        ),
        "direct": lambda: ladder.direct(scene, tables, counterpart, budget.light_pixels),
        "sampling": lambda: ladder.sampling(scene, tables),
        "transport": lambda: ladder.transport(scene, tables, threads),
        "whitted": lambda: ladder.whitted(scene, tables, counterpart, budget.pixels),
    }
    if any(not isinstance(film_filter, BoxFilter) for film_filter in film_filters):
        climbs = {"film": lambda: ladder.film(*film_filters), **climbs}
    climbs = {"files": lambda: ladder.files(written), **climbs}
    if applies(scene, films[0]):
        climbs["layers"] = lambda: ladder.layers(scene, tables, counterpart, films)
    rungs: list[RungResult] = []
    for name, climb in climbs.items():
        if only and name not in only:
            continue
        broken = next((t for t in rungs if t.status == "differ"), None)
        of_light = name in ("direct", "whitted")
        if broken is not None:
            rung = RungResult(name, "not-applicable", f"the {broken.name} rung below is broken")
        elif of_light and isinstance(scene.integrator, RayCast):
            rung = RungResult(name, "not-applicable", _NO_LIGHT)
        elif of_light and scene.has_media:
            rung = RungResult(name, "not-applicable", _MEDIA)
        elif of_light and counterpart.no_light_reason:
            rung = RungResult(name, "not-comparable", counterpart.no_light_reason)
        else:
            start = time.perf_counter()
            rung = climb()
            say(f"{name}: {rung.status} ({time.perf_counter() - start:.1f} s)")
        rungs.append(rung)
    return rungs


def _pictures(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    budget: Budget,
    threads: int | None,
    say: Say,
    decided: bool,
) -> tuple[Rendered, looks.Looks | None]:
    """decided: whether a rung has shown a difference already, which more replicates would only
    show again."""
    if isinstance(scene.integrator, RayCast):
        return pictures.cast(scene, tables, counterpart), None
    if isinstance(scene.integrator, Whitted):
        return pictures.whitted(scene, tables, counterpart), None
    start = time.perf_counter()
    first, numbers = budget.replicates, 3 * scene.film.width * scene.film.height
    enough = max(first, budget.most_first or 0)  # to show a difference, and its cause
    most = looks.most_kept(first, numbers)
    of_both = pictures.Replicates(
        scene, tables, counterpart, budget, threads, enough if decided else most, say
    )
    if budget.seconds is None or decided:
        of_both.grow(enough)
        say(f"{enough} + {enough} pictures ({time.perf_counter() - start:.1f} s)")
        return of_both.rendered(), None

    rendered: Rendered | None = None

    def look(level: float) -> RungResult:
        nonlocal rendered
        rendered = of_both.rendered()
        # The input is checked again at the end: each check has its own chance of a false alarm.
        if level == looks.level_of(1):
            rendered = replace(rendered, checked=check(rendered))
        return at_look(rendered, budget.limit, level)

    looked = looks.until_decided(
        of_both.grow,
        look,
        seconds=budget.seconds,
        first=first,
        most=most,
        most_first=enough,
        asked=partial(of_both.asked, budget.limit),
        say=lambda line: say(f"{line} ({time.perf_counter() - start:.1f} s)"),
    )
    if looked.rung.status == "differ" and of_both.count < enough:
        of_both.grow(enough)
        rendered = of_both.rendered()
    assert rendered is not None
    return rendered, looked
