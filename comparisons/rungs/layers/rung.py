"""The rung: which layers a scene has, the pictures that are rendered for them, and the result."""

from typing import Any

import numpy as np

from comparisons.mitsuba.counterpart import Counterpart
from comparisons.referee.sizes import ShapeSizes
from comparisons.results.case import RungResult
from comparisons.rungs.layers.centres import Centres, centres
from comparisons.rungs.layers.means import LIMIT, compare_means, expected
from comparisons.rungs.layers.variance import compare_spread
from comparisons.rungs.rays import arbiter
from reference_rt.cameras.film import Film, Filter
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Path as PathTracing
from reference_rt.integrators import RayCast
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid, Independent, Sobol

__all__ = ["applies", "layers"]


MEANS = ("albedo", "normal", "position")
"""Layers that are means over camera rays."""

MOST_PIXELS = 7000
"""Most pixels of the pictures that are rendered for means and variances, if width and height can
be divided by a whole number."""

PICTURES = 4
"""Pictures for the means: two for each of two independent halves."""

SPREAD_PICTURES = 16
"""Pictures for the variance: eight pairs."""

SAMPLES = 32
"""Samples per pixel of each picture for the means.  Only the first hits count: the paths of these
pictures end there, if the integrator can."""

SIDE = 8
"""Mitsuba's film points along each side of a pixel: in a half as many as ours."""

SPREAD_SAMPLES = 8
"""Samples per pixel of each picture for the variance: few, as its estimate is then most in doubt;
from two it would be as noisy as it can be."""


def layers(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    films: tuple[Film, Film],
    seed: int = 0,
) -> RungResult:
    """Compare what is written beside the colour with Mitsuba's hits.

    scene: with a box filter and without layers;  films: ours and Mitsuba's, with filters and
    layers; of ray casting all layers are compared.  Raises SceneError.
    """
    film_layers, film_filters = films[0].layers, (films[0].filter, films[1].filter)
    sizes = ShapeSizes(scene, counterpart.frame)
    if isinstance(scene.integrator, RayCast):
        picture = render(scene, tables=tables)
        cast = centres(scene, tables, counterpart, sizes, picture.layers)
        return _result(_numbers(cast), cast, [])
    small = _smaller(scene)
    numbers: dict[str, Any] = {"layers": list(film_layers)}
    problems: list[str] = []
    compared: Centres | None = None
    own_film = small.film.model_copy(update={"filter": film_filters[0], "layers": film_layers})
    if "variance" in film_layers:
        problems += _of_variance(small.changed(film=own_film), tables, numbers)
    seen = {*MEANS, "depth", "id"}.intersection(film_layers)
    if seen:
        pictures = _pictures(_first_hits(small.changed(film=own_film)), tables, PICTURES, SAMPLES)
        first = {name: x[0] for name, x in pictures.items() if name in ("depth", "id")}
        if first:
            compared = centres(small, tables, counterpart, sizes, first)
            numbers |= _numbers(compared)
        many = {name: x for name, x in pictures.items() if name in MEANS}
        if "position" in many and counterpart.has_planes():
            del many["position"]
            numbers["position"] = "not compared: Mitsuba's infinite planes end"
        if many:
            problems += _of_means(small, counterpart, sizes, film_filters[1], many, seed, numbers)
    return _result(numbers, compared, problems)


def applies(scene: Scene, film: Film) -> bool:
    """Whether the rung has anything to compare."""
    return isinstance(scene.integrator, RayCast) or bool(film.layers)


def _of_means(
    scene: Scene,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    film_filter: Filter,
    pictures: dict[str, FloatArray],
    seed: int,
    numbers: dict[str, Any],
) -> list[str]:
    """The problems of means (pictures, height, width, 3), by name; adds to `numbers`."""
    names = tuple(pictures)
    half = PICTURES // 2
    stand_ins = [s for f in counterpart.stand_ins().values() for s in f]
    slack = {
        "normal": max((s.turn for s in stand_ins), default=0.0),
        "position": max((s.sag for s in stand_ins), default=0.0),
    }
    theirs = [
        expected(scene, counterpart, sizes, film_filter, names, SIDE, 2 * seed + k) for k in (0, 1)
    ]
    problems = []
    for name, all_of in pictures.items():
        ours = all_of[:half].mean(axis=0), all_of[half:PICTURES].mean(axis=0)
        means = compare_means(ours, (theirs[0][name], theirs[1][name]), slack.get(name, 0.0))
        numbers |= {
            f"{name}_score": means.score,
            f"{name}_bias": means.bias,
            f"{name}_seen": means.seen,
        }
        if not any(half.any() for half in (*ours, theirs[0][name], theirs[1][name])):
            numbers.setdefault("empty", []).append(name)
        if not means.score <= LIMIT:
            problems.append(
                f"{name}: the means of pixels are off by {100.0 * means.bias:.2g} % of the largest "
                f"value, root mean square; two independent halves differ alike ({means.score:.1f} "
                f"standard errors); the worst pixel is {means.worst}"
            )
    return problems


def _of_variance(scene: Scene, tables: SceneTables, numbers: dict[str, Any]) -> list[str]:
    """The problem of the variance, if any; adds to `numbers`."""
    pictures = _pictures(scene, tables, SPREAD_PICTURES, SPREAD_SAMPLES)
    spread = compare_spread(pictures["colour"], pictures["variance"])
    numbers |= {"variance_ratio": spread.ratio, "variance_score": spread.score}
    # Where samples are stratified, the layer is an upper estimate.
    if not spread.differs(upper=not isinstance(_sampler(scene, SPREAD_SAMPLES), Independent)):
        return []
    return [
        f"variance: the layer is {spread.ratio:.3g} times the variance of {SPREAD_PICTURES} "
        f"independent pictures ({spread.score:+.1f} standard errors)"
    ]


def _pictures(scene: Scene, tables: SceneTables, count: int, samples: int) -> dict[str, FloatArray]:
    """The layers (count, height, width[, k]) of pictures with independent seeds."""
    sampler = _sampler(scene, samples)
    pictures = [
        render(
            scene.changed(sampler=sampler.model_copy(update={"seed": sampler.seed + k})),
            tables=tables,
        ).layers
        for k in range(count)
    ]
    return {name: np.stack([p[name] for p in pictures]) for name in pictures[0]}


def _sampler(scene: Scene, samples: int) -> Independent | Sobol:
    """The scene's sampler with so many samples.  Samples on a grid have no seed and are no sample
    of the filter: independent ones are taken."""
    sampler = scene.resolved_sampler
    if isinstance(sampler, Grid):
        return Independent(spp=samples)
    return sampler.model_copy(update={"spp": samples})


def _first_hits(scene: Scene) -> Scene:
    """The scene with paths that end at their first hit, if its integrator can."""
    if isinstance(scene.integrator, PathTracing):
        return scene.changed(integrator=scene.integrator.model_copy(update={"max_depth": 1}))
    return scene


def _smaller(scene: Scene) -> Scene:
    """The scene with width and height divided by the least whole number that leaves MOST_PIXELS; as
    it is if there is none."""
    width, height = scene.film.width, scene.film.height
    for k in range(1, min(width, height) + 1):
        if width % k == height % k == 0 and width * height <= MOST_PIXELS * k * k:
            size = {"width": width // k, "height": height // k}
            return scene.changed(film=scene.film.model_copy(update=size))
    return scene


def _numbers(compared: Centres) -> dict[str, Any]:
    return {
        "pixels": compared.pixels,
        "unresolved": compared.unresolved,
        "wrong_pixels": dict(compared.wrong),
        "max_error_over_bound": compared.ratio,
    }


def _result(numbers: dict[str, Any], compared: Centres | None, problems: list[str]) -> RungResult:
    if compared is not None:
        wrong = {name: count for name, count in compared.wrong.items() if count}
        if wrong:
            counts = ", ".join(f"{name} of {count}" for name, count in wrong.items())
            text = f"of {compared.pixels} pixels differ: {counts}; the first: {compared.first}"
            problems = [text, *problems]
    if problems:
        return RungResult("layers", "differ", "; ".join(problems), numbers)
    said: list[str] = []
    if compared is not None:
        edges = (
            f"{compared.unresolved} of {compared.pixels} pixels lie at edges that float32 does not "
            "resolve"
        )
        if arbiter.too_many(compared.unresolved, compared.pixels):
            return RungResult("layers", "reference-limited", edges, numbers)
        names = ", ".join(compared.wrong)
        said.append(f"{names} agree within {compared.ratio:.2g} of float32's bound; {edges}")
    said += [
        f"{name} agrees (a bias of {100.0 * numbers[f'{name}_seen']:.2g} % of its largest value, "
        "root mean square, would be seen)"
        for name in ("albedo", "normal")
        if f"{name}_seen" in numbers and name not in numbers.get("empty", ())
    ]
    if "empty" in numbers:
        names = " and ".join(numbers["empty"])
        said.append(f"{names}: 0 in every pixel of both, which shows little agreement")
    if "variance_ratio" in numbers:
        said.append(f"variance is {numbers['variance_ratio']:.3f} times the pictures' spread")
    return RungResult("layers", "agree", "; ".join(said), numbers)
