"""The convergence of one scene, with chance or without, from the scene to its curves."""

import math
import time
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from comparisons.compare import pictures
from comparisons.compare.budget import Budget
from comparisons.compare.compare import budgeted
from comparisons.experiments.convergence.best_sampler import SPP, merits
from comparisons.experiments.convergence.findings import (
    Curves,
    GridPoint,
    Grids,
    GridStep,
    crops_of,
    disturbed,
    findings_of,
)
from comparisons.experiments.convergence.methods import (
    BEST,
    METHODS,
    AbsentError,
    Climb,
    Cost,
    Method,
    Renderer,
    Stable,
    affordable,
    chosen,
    climb,
    estimate,
    remarks,
    rungs,
    why_left_out,
    with_sampler,
)
from comparisons.experiments.convergence.store import (
    COUNT,
    FIRST,
    WIDEST,
    Settings,
    Store,
    reference_of,
    run_key,
    size_within,
    weights,
)
from comparisons.mitsuba.backend import SCALAR, backend
from comparisons.renderers import NoCounterpartError
from comparisons.suites.suite import Changes, read
from comparisons.translator import UntranslatableError, load
from comparisons.translator.native import failing
from reference_rt.cameras.film import BoxFilter
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast
from reference_rt.rendering.image import display
from reference_rt.rendering.render import Progress, render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.util.errors import ReferenceUnavailableError, SceneError

# ---- scenes without chance ----------------------------------------------------------------------


REPEATS = 3
"""Renders of each picture; the median of their seconds is reported."""

FINER = 4
"""The finest grid has this many times more samples along each axis than the finest grid that is
compared with it: its own error is then a few percent of that one's."""

MOST_ACROSS = 64
"""Samples along each axis of a pixel in the finest grid: its error is then below the 8 bits of a
display."""


WHOSE = {
    "ray_cast": "Mitsuba's picture is made from its hits of the rays through the pixel centres",
    "whitted": "Mitsuba's picture is rendered by our plugin, traced in Python: its time says "
    "little about Mitsuba",
}
"""Notes about Mitsuba's pictures, by integrator."""


def grids_of(
    scene: Scene, settings: Settings, store: Store, say: Progress
) -> tuple[Grids, list[str]]:
    """Our pictures on grids of 1, 4, 9, ... samples per pixel against the finest, and Mitsuba's.

    The finest grid takes at most half of the time limit.  Ray casting has one ray per pixel: its
    grid is a larger picture, averaged in display values.  Also returns what was not measured, and
    why.  Raises SceneError, ReferenceUnavailableError.
    """
    question = [settings.time_limit, settings.max_spp]
    stored, finest = store.fact("grids", question), store.picture("grid")
    if stored is not None and finest is not None:
        steps = tuple(GridStep(*step) for step in stored["steps"])
        points = tuple(GridPoint(*point) for point in stored["points"])
        finest = np.asarray(finest, np.float64)
        return _timed_well(Grids(steps, points, stored["finest"], finest)), stored["left_out"]
    grids, left_out = _made(scene, settings, say)
    store.keep_picture("grid", grids.picture)
    fact = {"steps": grids.steps, "points": grids.points, "finest": grids.finest}
    store.keep_fact("grids", {**fact, "left_out": left_out}, question)
    return _timed_well(grids), left_out


def _timed_well(grids: Grids) -> Grids:
    """The grids without seconds that are `disturbed`."""
    seconds = [step.seconds for step in grids.steps]
    steps = tuple(
        step._replace(seconds=math.nan) if is_wrong else step
        for step, is_wrong in zip(grids.steps, disturbed(seconds, seconds), strict=True)
    )
    return replace(grids, steps=steps)


def _made(scene: Scene, settings: Settings, say: Progress) -> tuple[Grids, list[str]]:
    left_out: list[str] = []
    say("finest grid", 0.0)
    timed(scene, 2)  # compiles
    seconds = timed(scene, 2)[1] / 4.0
    most_asked = FINER * int(settings.max_spp**0.5)
    across = int((0.5 * settings.time_limit / seconds) ** 0.5)
    across = min(max(across, 2), MOST_ACROSS, most_asked)
    finest = timed(scene, across)[0]
    say("finest grid", 1.0)
    most = max(1, across // FINER)
    if across < min(MOST_ACROSS, most_asked):
        left_out.append(
            f"grids of more than {most * most} samples per pixel: their reference, {FINER} times "
            f"finer along each axis, would take more than half of {settings.time_limit:g} s"
        )
    steps = []
    say("grids", 0.0)
    for n in range(1, most + 1):
        shots = [timed(scene, n) for _ in range(REPEATS)]
        mse, relmse = differences(shots[0][0], finest)
        steps.append(GridStep(n * n, float(np.median([s for _, s in shots])), mse, relmse))
        say("grids", n / most)
    points = []
    try:
        with failing("Mitsuba cannot render the scene"):
            points.append(_mitsubas(scene))
    except (NoCounterpartError, ReferenceUnavailableError) as error:
        left_out.append(f"Mitsuba: {error}")
    return Grids(tuple(steps), tuple(points), across * across, finest), left_out


def timed(scene: Scene, n: int) -> tuple[FloatArray, float]:
    """The picture with n x n samples per pixel (ray casting: in display values) and its seconds."""
    start = time.perf_counter()
    if isinstance(scene.integrator, RayCast):
        film = scene.film
        size = {"width": n * film.width, "height": n * film.height}
        larger = scene.changed(film=film.model_copy(update=size))
        shown = display(render(larger, tables=scene.tables))
        picture = shown.reshape(film.height, n, film.width, n, 3).mean(axis=(1, 3))
    else:
        sampled = scene.changed(sampler=Grid(spp=n * n))
        picture = render(sampled, tables=scene.tables).colour
    return picture, time.perf_counter() - start


def differences(picture: FloatArray, other: FloatArray) -> tuple[float, float]:
    """The mean squared difference over pixels and channels, and the relative one."""
    squared = (picture - other) ** 2
    return float(squared.mean()), float((weights(other) * squared).mean())


def _mitsubas(scene: Scene) -> GridPoint:
    """Mitsuba's picture on the scene's own grid against ours.  Raises UntranslatableError."""
    casts = isinstance(scene.integrator, RayCast)
    sampler = Grid(spp=1) if casts else scene.resolved_sampler
    scene = scene.changed(sampler=sampler)
    counterpart = load(scene)
    if counterpart.no_light_reason and not casts:
        raise UntranslatableError(
            f"scene, in which {counterpart.no_light_reason},", "integrator for the"
        )
    ours = render(scene, tables=scene.tables)
    seconds = []
    for _ in range(REPEATS):  # the first compiles
        start = time.perf_counter()
        if casts:
            picture = pictures.mitsuba_cast(scene, counterpart, ours)[0]
        else:
            picture = pictures.mitsuba_whitted(scene, scene.tables, counterpart)
        seconds.append(time.perf_counter() - start)
    mse, relmse = differences(picture, display(ours) if casts else ours.colour)
    warm = float(np.median(seconds[1:]))
    return GridPoint(backend().variant, int(getattr(sampler, "spp", 1)), warm, mse, relmse)


# ---- scenes with chance -------------------------------------------------------------------------


NOWHERE = Store(None, "")
DEFAULTS = Settings()


def silent(what: str, fraction: float) -> None:
    """A `Progress` that says nothing."""


def prepared(scene: Scene, settings: Settings) -> Scene:
    """The scene as it is rendered: with a box filter, whose pixels are independent, and at most
    WIDEST pixels wide unless a size is requested."""
    return budgeted(scene, Budget(size=settings.size or size_within(scene.film, WIDEST)))


def converge(
    scene: Scene,
    settings: Settings = DEFAULTS,
    store: Store = NOWHERE,
    say: Progress = silent,
) -> Curves:
    """Measure error against time of our renderer and Mitsuba's variants for one scene.

    Finished rungs are taken from `store` and kept there.  Raises SceneError, UsageError for a name
    in `settings.only` that is no method's, ReferenceUnavailableError without Mitsuba,
    ImageError where the store cannot be written.
    """
    methods = chosen(settings.only)
    asked, scene = scene, prepared(scene, settings)
    notes = []
    if not isinstance(asked.film.filter, BoxFilter):
        notes.append("rendered with a box filter")
    if (asked.film.width, asked.film.height) != (scene.film.width, scene.film.height):
        notes.append(
            f"rendered at {scene.film.width} x {scene.film.height} pixels instead of the scene's "
            f"{asked.film.width} x {asked.film.height}"
        )
    size = (scene.film.width, scene.film.height)
    if scene.integrator.deterministic:
        grids, left_out = grids_of(scene, settings, store, say)
        notes += [WHOSE[scene.integrator.type]] if grids.points else []
        return Curves(asked.name, size, grids=grids, left_out=tuple(left_out), notes=tuple(notes))
    with Stable(scene) as stable:
        return _Run(scene, settings, store, say, stable).curves(methods, tuple(notes))


@dataclass(frozen=True)
class Plan:
    """rungs: by method;  reference_spp: samples per pixel of each picture of the reference;
    merits: of Mitsuba's samplers, by the variant that was tried;  left_out: which rungs of a
    method, and why;  absent: why methods have no rungs at all, by name."""

    rungs: dict[str, list[int]]
    reference_spp: int
    merits: dict[str, dict[str, float]]
    left_out: list[str]
    absent: dict[str, str]

    def resolved(self, method: Method) -> Method:
        """The method with the best sampler, where it asks for that."""
        if method.sampler != BEST:
            return method
        found = next(iter(self.merits.values()), None)
        if found is None:
            return method
        return with_sampler(method, min(found, key=lambda name: found[name]))


class _Run:
    """One scene's ladder; renderers are made ready when they are first needed."""

    def __init__(
        self, scene: Scene, settings: Settings, store: Store, say: Progress, stable: Stable
    ) -> None:
        self.scene, self.settings, self.store, self.say = scene, settings, store, say
        self.stable = stable
        self.renderer = cache(self._renderer)

    def _renderer(self, method: Method) -> Renderer:
        def compiling(what: str, fraction: float) -> None:
            if what == "compile":
                self.say(what, fraction)

        return self.stable.ready(method, compiling)

    def curves(self, methods: tuple[Method, ...], notes: tuple[str, ...]) -> Curves:
        scene, settings = self.scene, self.settings
        plan = self._plan(methods)
        reference = reference_of(scene, plan.reference_spp, self.say)
        share = settings.time_limit / (len(plan.rungs) + 1)
        everyone = {c.name: plan.resolved(c) for c in methods}
        by_name = {name: c for name, c in everyone.items() if plan.rungs.get(name)}
        climbs = {
            name: Climb(partial(self.renderer, c), plan.rungs[name], share, c.side == SCALAR)
            for name, c in by_name.items()
        }
        climb(climbs, reference, settings.replicates, self.store, self.say)
        absent = plan.absent | {name: one.failed for name, one in climbs.items() if one.failed}
        by_name = {name: c for name, c in by_name.items() if name not in absent}
        left_out = [*plan.left_out]
        stopped = {c.title: climbs[name].stopped for name, c in by_name.items()}
        left_out += [f"{title}: {why}" for title, why in stopped.items() if why]
        climbed = {name: climbs[name].rungs for name in by_name}
        renderers = {name: climbs[name].renderer for name in climbed}
        if any(c.side != "ours" for c in by_name.values()):
            notes += tuple(remarks(scene))
        notes += tuple(_sampler_note(side, found) for side, found in plan.merits.items())
        return Curves(
            scene.name,
            (scene.film.width, scene.film.height),
            everyone,
            {
                name: findings_of(rungs, reference, settings.targets, by_name[name].is_independent)
                for name, rungs in climbed.items()
            },
            reference,
            crops=crops_of(climbed, renderers, reference, self.store) if settings.crops else (),
            left_out=tuple(left_out),
            notes=notes,
            absent=absent,
        )

    def _plan(self, methods: tuple[Method, ...]) -> Plan:
        """As stored, where the same was planned before."""
        settings = self.settings
        question = [settings.time_limit, settings.max_spp, settings.only]
        stored = self.store.fact("plan", question)
        if stored is not None:
            return Plan(**stored)
        plan = Plan({}, 0, {}, [], {})
        costs = self._costs(methods, plan)
        share = settings.time_limit / (len(costs) + 1)
        pixels = self.scene.film.width * self.scene.film.height
        for method, cost in costs.items():
            factor = method.factor
            fit = affordable(cost, share, settings, pixels, factor)
            if len(fit) < 2 and method.side == "ours":
                fit = rungs(settings.max_spp)[:2]
            why = why_left_out(cost, fit, share, settings, pixels, factor)
            if len(fit) < 2:
                plan.absent[method.name] = f"two rungs at least make a curve; {why}"
                continue
            if why:
                plan.left_out.append(f"{method.title}: {why}")
            plan.rungs[method.name] = list(fit)
        ours = costs.get(METHODS[0]) or estimate(self.renderer(METHODS[0]))
        plan = replace(plan, reference_spp=_reference_spp(ours, share, settings.max_spp))
        self.store.keep_fact("plan", asdict(plan), question)
        return plan

    def _costs(self, methods: tuple[Method, ...], plan: Plan) -> dict[Method, Cost]:
        """Costs of the methods that can render the scene, with their best samplers.  The plan
        records why others cannot, and the merits of the samplers."""
        found = {}
        for number, method in enumerate(methods):
            self.say("trial pictures", number / len(methods))
            try:
                if method.sampler == BEST and not plan.merits:
                    # One trial for both variants, whose samples are alike.
                    plan.merits[method.side] = merits(self.scene, method)
                chosen_one = plan.resolved(method)
                found[chosen_one] = estimate(self.renderer(chosen_one))
            except AbsentError as error:
                plan.absent[method.name] = str(error)
        self.say("trial pictures", 1.0)
        return found


def _sampler_note(side: str, found: dict[str, float]) -> str:
    """A note about the trial of Mitsuba's samplers."""
    unit = found["independent"]
    listed = ", ".join(f"{name} {merit / unit:.2f}" for name, merit in found.items())
    trial = f"variance times time at {SPP} samples per pixel ({side})"
    return f"Mitsuba's best sampler, by {trial}: {listed}"


def _reference_spp(cost: Cost, share: float, max_spp: int) -> int:
    """The most samples per pixel, a power of two, that the share of the time allows COUNT pictures;
    no fewer than four times those of the first rung."""
    spp = 4 * FIRST
    while spp < 4 * max_spp and COUNT * cost.picture(2 * spp) <= share:
        spp *= 2
    return spp


# ---- a task for workers -------------------------------------------------------------------------


INVALID = "invalid: "
"""What the problem of curves begins with if the scene is invalid."""


def curves_of(
    path: Path,
    changes: Changes,
    settings: Settings,
    folder: Path,
    fresh: bool,
    say: Progress = silent,
) -> Curves:
    """The curves of one scene;  folder: where its rungs are stored, and found by the next run.
    Raises as `converge`, but an invalid scene has curves that say so."""
    try:
        scene = read(path, changes.on(path))
        if isinstance(scene, SceneError):
            raise scene
        key = run_key(prepared(scene, settings), settings.replicates)
        return converge(scene, settings, Store(folder, key, fresh=fresh), say)
    except SceneError as error:  # the other scenes have curves all the same
        return Curves(path.stem, problem=f"{INVALID}{error}")
