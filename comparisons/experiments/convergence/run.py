"""The convergence of one scene, from the scene to its curves."""

from dataclasses import asdict, dataclass, replace
from functools import cache, partial

from comparisons.compare.budget import Budget
from comparisons.compare.compare import budgeted
from comparisons.experiments.convergence.crops import crops_of
from comparisons.experiments.convergence.curves import Curves
from comparisons.experiments.convergence.data import FIRST, WIDEST, Settings, size_within
from comparisons.experiments.convergence.deterministic import WHOSE, grids_of
from comparisons.experiments.convergence.findings import findings_of
from comparisons.experiments.convergence.ladder import Climb, climb
from comparisons.experiments.convergence.methods import (
    BEST,
    METHODS,
    AbsentError,
    Method,
    Renderer,
    Stable,
    chosen,
    remarks,
    with_sampler,
)
from comparisons.experiments.convergence.plan import Cost, affordable, estimate, rungs, why_left_out
from comparisons.experiments.convergence.reference import COUNT, reference_of
from comparisons.experiments.convergence.samplers import SPP, merits
from comparisons.experiments.convergence.starts import starts_of
from comparisons.experiments.convergence.store import Store
from comparisons.mitsuba.backend import SCALAR
from reference_rt.cameras.filters import BoxFilter
from reference_rt.rendering.render import Progress
from reference_rt.rendering.scene import Scene

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
        starts = starts_of(scene, by_name.values(), self.store, self.say) if settings.starts else {}
        left_out += [f"starts of {side}: a process failed" for side, t in starts.items() if not t]
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
            starts=starts,
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
