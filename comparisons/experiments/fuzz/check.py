"""One scene: rendered, put through identities, and compared with Mitsuba rung by rung."""

import dataclasses
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from comparisons.compare.judge import judge
from comparisons.experiments.fuzz.data import Data, copy_of, named_in
from comparisons.experiments.fuzz.finding import (
    DETERMINISTIC,
    Checked,
    Effort,
    Finding,
    without_numbers,
)
from comparisons.experiments.fuzz.generate import parse
from comparisons.experiments.fuzz.identities import IDENTITIES, Original
from comparisons.experiments.fuzz.reduce import renamed, without_unused
from comparisons.experiments.fuzz.schema import types_in
from comparisons.geometry.flatten import copies_of
from comparisons.materials.translate import is_textured
from comparisons.mitsuba.context import TranslationContext
from comparisons.results.case import Case, RungResult
from comparisons.results.rungs import OF_LIGHT
from comparisons.rungs.limited import limited
from comparisons.shapes.stand_ins import coarser
from reference_rt.materials import (
    Blend,
    Bump,
    GltfPbr,
    Mask,
    Phong,
    Plastic,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
)
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Cone, Quadric, Torus
from reference_rt.util.errors import ReferenceUnavailableError, SceneError, SceneWarning

# ---- without what Mitsuba lacks -----------------------------------------------------------------


GREY = 0.5


def without_textures(scene: Data) -> Data:
    """The scene without textures, maps of normals and materials with a grain, and seen by square
    pixels.

    Mitsuba's uv differ from ours on many shapes, where it can compare none of these.
    """
    found: Data = copy_of(scene)
    found.get("camera", {}).pop("view", None)
    textures = {*found.get("textures", {})}
    for name in [*found.get("materials", {})]:
        material = found["materials"].get(name)  # it may have gone with another one
        if material is not None and material["type"] in ("bump", "normal_map"):
            found = renamed(found, name, material["base"])
    for material in found.get("materials", {}).values():
        for field, value in material.items():
            if field != "type" and isinstance(value, str) and value in textures:
                material[field] = GREY
        if isinstance(material.get("alpha"), list):
            material["alpha"] = material["alpha"][0]
        material.pop("anisotropic", None)
    for light in found.get("lights", ()):
        for at, key in [*named_in(light)]:
            if at[key] in textures:
                at[key] = GREY
        if isinstance(light.get("texture"), float):  # a factor that need not be there
            del light["texture"]
    return without_unused(found)


# ---- the scene as a whole -----------------------------------------------------------------------


FAILED = ("differ", "invalid")

COARSE = 0.35
"""The cells along each side of meshes that stand in for shapes that Mitsuba lacks, as a fraction of
those of other comparisons: a scene with a quadric takes a third of the time."""


def check(data: Data, number: int, effort: Effort, folder: Path) -> Checked:
    """What is found in a scene;  folder: of the files that it names.  Raises
    ReferenceUnavailableError."""
    start = time.perf_counter()
    found = Checked(number=number, types=sorted(f"{k}:{n}" for k, n in types_in(data)))
    with warnings.catch_warnings(), np.errstate(all="ignore"), coarser(COARSE):
        warnings.simplefilter("ignore", SceneWarning)
        _check(data, found, effort, folder)
    found.seconds = time.perf_counter() - start
    return found


def _check(data: Data, found: Checked, effort: Effort, folder: Path) -> None:
    try:
        scene = parse(data, found.number, folder)
    except SceneError as error:
        text = str(error.message)
        found.findings.append(Finding(rung="scene", cause=without_numbers(text), detail=str(error)))
        return
    original = Original(scene, np.random.default_rng(found.number), effort.identity_rays)
    if "render" in effort.rungs:
        _guarded("render", found, lambda: _render(original, found))
    if "identities" in effort.rungs and not found.findings:
        for name, identity in IDENTITIES.items():
            if not _guarded(f"identity {name}", found, partial(identity, original)):
                break
    only = tuple(rung for rung in DETERMINISTIC if rung in effort.rungs)
    if only and not found.findings:
        _guarded("compare", found, lambda: _compare(data, scene, found, effort, only, folder))
    if "statistics" in effort.rungs and not found.findings and found.number % effort.every == 0:
        _guarded("compare", found, lambda: _statistics(scene, found, effort))


def _guarded(name: str, found: Checked, task: Callable[[], str | Finding | None]) -> bool:
    """Run a step; its errors are findings.  Whether it found nothing."""
    try:
        result = task()
    except ReferenceUnavailableError:
        raise
    except SceneError as error:
        if name == "render":
            cause = f"refused: {without_numbers(error.message)}"
            found.findings.append(Finding(rung="scene", cause=cause, detail=str(error)))
        else:
            found.rungs[name] = "not-comparable"
        return False
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, {place.name}"
        cause = f"{type(error).__name__} in {where}: {without_numbers(str(error))}"
        detail = "".join(traceback.format_exception(error, limit=-6))[-1500:]
        found.findings.append(Finding(rung=name, cause=cause, detail=detail))
        return False
    if isinstance(result, Finding):
        found.findings.append(result)
        found.rungs.setdefault(result.rung, "differ")
        return False
    if result is not None:
        found.rungs[name] = result
    return True


def _render(original: Original, found: Checked) -> str | Finding:
    """Our picture: every number finite, but distances, which are infinite for a miss."""
    picture = original.picture
    found.lit = bool(np.any(picture.colour > 0.0)) if "colour" in picture.layers else True
    for name, layer in picture.layers.items():
        far = name in ("distance", "depth")
        bad = np.isnan(layer) if far else ~np.isfinite(layer)
        if bad.any():
            where = np.argwhere(bad)[0].tolist()
            return Finding(
                rung="render",
                cause=f"the layer {name} is not finite",
                detail=f"{int(bad.sum())} numbers, the first in row {where[0]}, column {where[1]}",
            )
    return "agree" if found.lit else "black"


# ---- Mitsuba ------------------------------------------------------------------------------------


def budget_of(scene: Scene, effort: Effort, resolution: bool = False) -> Budget:
    """The comparison's work."""
    return Budget(
        resolution=resolution,
        pixels=max(16, effort.pixels),
        light_pixels=max(16, effort.light_pixels),
        spp=None if scene.integrator.deterministic else effort.spp,
        replicates=effort.replicates,
        limit=0.02,
    )


def compare(
    scene: Scene, effort: Effort, only: Sequence[str], other: Scene | None = None
) -> list[RungResult]:
    """The results of the rungs;  other: what Mitsuba renders, if not the same.

    What Mitsuba resolves is measured only where a rung of light differs: a third of the time.
    """
    subject = Subject(scene, other)
    for resolution in (False, True):
        budget = budget_of(scene, effort, resolution)
        found = limited(gather(subject, budget, lambda step: None, 1, tuple(only)).rungs)
        if not any(r.status == "differ" and r.name in OF_LIGHT for r in found):
            break
    return found


def _compare(
    data: Data, scene: Scene, found: Checked, effort: Effort, only: Sequence[str], folder: Path
) -> Finding | None:
    """The rungs without noise; of a scene with something that Mitsuba lacks, without that."""
    results = compare(scene, effort, only)
    if [result.status for result in results] == ["not-comparable"]:
        plain = without_textures(data)
        results = compare(parse(plain, found.number, folder), effort, only)
        found.rungs["plain"] = "compared"
    found.rungs |= {result.name: result.status for result in results}
    return next((of_rung(result) for result in results if result.status in FAILED), None)


def of_rung(result: RungResult) -> Finding:
    """The finding of a rung that failed."""
    return Finding(rung=result.name, cause=_cause(result), detail=result.reason)


def _cause(result: RungResult) -> str:
    """What is wrong, without this scene's numbers."""
    numbers = result.numbers
    if result.name == "geometry" and "mismatches" in numbers and "rays" in result.reason:
        if "shadow rays" in result.reason:
            return "any-hit queries"
        kinds = [kind for kind, n in numbers["mismatches_by_kind"].items() if n]
        who = "ours wrong" if numbers["decided_ours"] else ""
        who = who or ("Mitsuba's wrong" if numbers["decided_mitsuba"] else "undecided")
        return f"{who}: {', '.join(kinds[:2])}"
    if result.name in ("direct", "whitted"):
        return "values differ" if result.status == "differ" else without_numbers(result.reason)
    return without_numbers(result.reason.partition(";")[0], 80)


SLOW = (Blend, Bump, GltfPbr, Mask, Phong, Plastic, RoughPlastic)
"""Materials whose counterparts in Mitsuba are our plugins, in Python: some 20 microseconds for each
evaluation, so that noisy pictures take minutes."""


def is_slow(scene: Scene) -> bool:
    """Whether Mitsuba's pictures of a scene need plugins in Python."""
    beckmann = any(
        isinstance(m, RoughConductor | RoughDielectric) and m.distribution == "beckmann"
        for m in scene.materials.values()
    )
    context = TranslationContext.of(scene)
    leaves = (
        leaf for copy in copies_of(scene) for member in copy.members for leaf in member.leaves
    )
    # Their meshes have uv and tangents by a plugin, too.
    textured = any(
        isinstance(leaf.shape, Cone | Quadric | Torus) and is_textured(leaf.material, context)
        for leaf in leaves
    )
    return textured or beckmann or any(isinstance(m, SLOW) for m in scene.materials.values())


def _statistics(scene: Scene, found: Checked, effort: Effort) -> Finding | None:
    """Pictures; a difference that noise may have made is looked at again, with other random numbers
    and four times as many, and with what Mitsuba's precision may change.  Pictures without noise
    are what the rungs below saw already, and of so few pixels that one at an edge changes all
    metrics."""
    if is_slow(scene) or scene.integrator.deterministic:
        found.rungs["statistics"] = "not-run"
        return None
    case = pictures(scene, effort)
    failed = _failed(case)
    if failed is not None:
        sampler = scene.resolved_sampler.model_copy(update={"seed": 7_654_321})
        again = effort.model_copy(update={"spp": 4 * effort.spp, "replicates": 16})
        case = pictures(scene.changed(sampler=sampler), again, ("geometry",))
        failed = _failed(case)
        if failed is None:
            now = next((r.status for r in case.rungs if r.name == "statistics"), "not-run")
            found.rungs["statistics"] = now if now == "reference-limited" else "false alarm"
            return None
    found.rungs |= {r.name: r.status for r in case.rungs if r.name in ("statistics", "images")}
    return None if failed is None else of_rung(failed)


def pictures(scene: Scene, effort: Effort, below: tuple[str, ...] = ()) -> Case:
    """The case of a scene's pictures;  below: rungs that may say that Mitsuba's precision limits
    them."""
    budget, rungs = budget_of(scene, effort, bool(below)), (*below, "statistics", "images")
    evidence = gather(Subject(scene), budget, lambda step: None, 1, rungs)
    if evidence.rendered is not None:
        evidence = dataclasses.replace(evidence, lights=None, lengths=None)
    return judge(evidence, budget.limit)


def _failed(case: Case) -> RungResult | None:
    black = "black"  # a picture without light is the generator's, and in both
    return next((r for r in case.rungs if r.status in FAILED and black not in r.reason), None)
