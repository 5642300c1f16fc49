"""The two pictures of a scene, ours and Mitsuba's, as each integrator makes them."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from comparisons import mitsuba_scene
from comparisons.answers import Answers
from comparisons.results import Images, Metrics, Tier
from comparisons.tiers.bounds import ShapeSizes
from comparisons.tiers.camera import camera_rays
from comparisons.tiers.rays import Rays
from comparisons.tiers.whitted import plugin_radiance
from comparisons.twin import Twin, trace
from reference_rt.image import display
from reference_rt.integrators import RayCast, Whitted
from reference_rt.kernel import entry_kernel
from reference_rt.render import Picture, render
from reference_rt.scene import Scene
from reference_rt.shapes.shape import FloatArray, IntArray
from reference_rt.tables import SceneTables
from reference_rt.textures import At, colour_at
from reference_rt.vec3 import row as row_of

DETERMINISTIC_SSIM = 0.9999
"""Pictures without noise differ where float32 moves an edge across a sample: a pixel here and there
(measured: 0.99999 and better); a shift of a tenth of a pixel already gives 0.997."""

NOISE_LIMIT = 1.25
"""How much more than their noise noisy pictures may differ, as a ratio of squares: Mitsuba's own
systematic error (float32, its ray epsilon) may reach half the standard deviation of a pixel."""

FLOAT32 = 1e-5
"""Of a pixel: what float32 may do to Mitsuba's where there is no noise, a background say; the bound
that the Whitted rung holds pixels to."""

TILE = 16


@dataclass(frozen=True)
class Rendered:
    """images: the two pictures;  seconds: wall clock by side and step;  replicates: the noisy
    pictures (replicates, height, width, 3) of each side that they are the means of, else None."""

    images: Images
    seconds: dict[str, dict[str, float]]
    replicates: tuple[FloatArray, FloatArray] | None = None
    notes: tuple[str, ...] = field(default=())


def cast(scene: Scene, tables: SceneTables, twin: Twin) -> Rendered:
    """Ray casting: the shown layer as its picture, Mitsuba's from its own hits of the same rays."""
    assert isinstance(scene.integrator, RayCast)
    ours = render(scene, tables=tables)
    film = scene.film
    y, x = np.mgrid[0 : film.height, 0 : film.width]
    o, d = camera_rays(scene, x.ravel() + 0.5, y.ravel() + 0.5)
    start = time.perf_counter()
    hits = trace(twin, o, d)
    seconds = time.perf_counter() - start
    notes = [f"the pictures show the layer '{ours.shown}' as displayed, not radiance"]
    uv = np.where(hits.has_uv[:, None], hits.uv, ours.layers["uv"].reshape(-1, 2))
    if ours.shown == "uv" and not hits.has_uv[hits.shape >= 0].all():
        notes.append(
            "Mitsuba has other uv, or none, for some shapes: there ours stand on both sides"
        )
    layers = {
        "colour": _colours(scene, tables, hits, uv),
        "distance": hits.t,
        "normal": np.where(hits.stands_in[:, None], hits.ns, hits.n),
        "id": hits.shape.astype(np.float64),
        "uv": uv,
    }
    shaped = {k: v.reshape(film.height, film.width, *v.shape[1:]) for k, v in layers.items()}
    theirs = Picture(shaped, ours.shown)
    return Rendered(
        Images(display(ours), display(theirs)), _seconds(ours, seconds), notes=tuple(notes)
    )


def _colours(scene: Scene, tables: SceneTables, hits: Answers, uv: FloatArray) -> FloatArray:
    """The colour (n, 3) of what was hit: of its material, or of a mesh's vertices at the place."""
    sizes = ShapeSizes(scene)
    names = [*scene.materials, None]
    leaf, local = sizes.leaf_of(hits), sizes.local_points(hits)
    found = np.zeros((len(hits.t), 3))
    mixed = np.full((len(hits.t), 3), -1.0)  # negative stands for none
    material = np.full(len(hits.t), -1)
    for number in np.unique(leaf[leaf >= 0]).tolist():
        rows = np.flatnonzero(leaf == number)
        sizes_of = sizes.leaves[number]
        material[rows] = names.index(sizes_of.material)
        if sizes_of.field == "triangles" and sizes_of.table.colours is not None:
            primitive = hits.primitive[rows]
            weights = _barycentrics(sizes_of.table.vertices[primitive], local[rows])
            of_corners = sizes_of.table.colours[primitive].reshape(-1, 3, 3)
            has_any = of_corners[:, :1, 0] >= 0.0
            mixed[rows] = np.where(has_any, np.einsum("nk,nki->ni", weights, of_corners), -1.0)
    _shown(tables, material, uv, mixed, found)
    return np.where(mixed[:, :1] >= 0.0, mixed, found)


@entry_kernel
def _shown(
    tables: SceneTables, material: IntArray, uv: FloatArray, colours: FloatArray, out: FloatArray
) -> None:
    """The colours of materials (n,), -1 for none, at surface coordinates (n, 2)."""
    for i in range(len(material)):
        if material[i] >= 0:
            at = At(tables.textures, uv[i, 0], uv[i, 1], row_of(colours, i))
            out[i, 0], out[i, 1], out[i, 2] = colour_at(tables.materials.shown, material[i], at)


def _barycentrics(vertices: FloatArray, p: FloatArray) -> FloatArray:
    """(n, 3) weights of the corners of triangles (n, 9), by the areas opposite, for points (n, 3)
    of their planes."""
    v = vertices.reshape(-1, 3, 3)
    normal = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    areas = [np.sum(normal * np.cross(v[:, k - 2] - p, v[:, k - 1] - p), axis=1) for k in range(3)]
    return np.asarray(np.stack(areas, axis=1) / np.sum(normal * normal, axis=1)[:, None])


def _seconds(ours: Picture, mitsuba: float) -> dict[str, dict[str, float]]:
    times = {step: ours.seconds[step] for step in ("compile", "render")}
    return {"ours": times, "mitsuba": {"render": mitsuba}}


def whitted(scene: Scene, tables: SceneTables, twin: Twin) -> Rendered:
    """Recursive ray tracing: Mitsuba's plugin along the rays of our grid of samples."""
    assert isinstance(scene.integrator, Whitted)
    ours = render(scene, tables=tables)
    n = round(scene.resolved_sampler.spp**0.5)
    film = scene.film
    total = np.zeros((film.height * film.width, 3))
    theirs_at = plugin_radiance(scene, tables, twin, scene.integrator)
    y, x = np.mgrid[0 : film.height, 0 : film.width]
    start = time.perf_counter()
    for row in range(n):
        for column in range(n):
            film_x = x.ravel() + (column + 0.5) / n
            film_y = y.ravel() + (row + 0.5) / n
            total += theirs_at(Rays(*camera_rays(scene, film_x, film_y)))
    seconds = time.perf_counter() - start
    theirs = (total / n**2).reshape(film.height, film.width, 3)
    return Rendered(Images(ours.colour, theirs), _seconds(ours, seconds))


def replicates(
    scene: Scene,
    tables: SceneTables,
    twin: Twin,
    count: int,
    threads: int | None,
    say: Callable[[str], None],
) -> Rendered:
    """Path tracing: `count` pictures on each side with independent seeds; the images are their
    means.  "render" is the median time of one picture."""
    sampler = scene.resolved_sampler
    first = getattr(sampler, "seed", 0)
    ours, times = [], []
    for k in range(count):
        say(f"ours, replicate {k + 1} of {count}")
        seeded = scene.changed(sampler=sampler.model_copy(update={"seed": first + k}))
        picture = render(seeded, tables=tables, threads=threads)
        ours.append(picture.colour)
        times.append(picture.seconds)
    say(f"Mitsuba's {count} replicates")
    theirs = mitsuba_scene.render(twin.mi_scene, count, sampler.spp, first)
    pair = (np.stack(ours), theirs.pictures)
    return Rendered(
        Images(pair[0].mean(axis=0), pair[1].mean(axis=0)),
        {
            "ours": {
                "compile": times[0]["compile"],
                "render": float(np.median([t["render"] for t in times])),
            },
            "mitsuba": {"render": float(np.median(theirs.seconds))},
        },
        replicates=pair,
    )


def images_tier(rendered: Rendered, metrics: Metrics) -> Tier:
    """The pictures as wholes: what the rungs below cannot see, an error that averages out."""
    if metrics.nonfinite:
        return Tier("images", "invalid", f"{metrics.nonfinite} pixels are not finite")
    if rendered.replicates is None:
        return _noiseless(metrics)
    ratio, standard_error = noise_ratio(*rendered.replicates)
    numbers = {"difference_over_noise": ratio, "standard_error": standard_error}
    if not ratio > 0.0:
        return Tier("images", "agree", "the pictures are equal", numbers)
    told = f"the squared difference is {ratio:.3g} ± {standard_error:.2g} times that of the noise"
    # Five standard errors: the sum over tiles is near normal, and one false alarm in a million
    # scenes leaves the family's level to the statistics rung.
    if ratio - 5.0 * standard_error > NOISE_LIMIT:
        return Tier("images", "differ", f"{told}: pixels differ by more than noise", numbers)
    return Tier("images", "agree", f"{told}; SSIM {metrics.ssim:.4f}", numbers)


def _noiseless(metrics: Metrics) -> Tier:
    numbers = {"ssim": metrics.ssim}
    if metrics.rmse == 0.0:
        return Tier("images", "agree", "the pictures are equal", numbers)
    told = f"SSIM {metrics.ssim:.6f}, RMSE {metrics.rmse:.2g}"
    if not metrics.ssim >= DETERMINISTIC_SSIM:
        return Tier("images", "differ", f"{told}: expected {DETERMINISTIC_SSIM}", numbers)
    return Tier("images", "agree", told, numbers)


def noise_ratio(ours: FloatArray, mitsuba: FloatArray) -> tuple[float, float]:
    """The squared difference of the mean pictures over its expectation from the replicates' own
    variances, as the mean over tiles (1 where only noise differs), and its standard error.

    (replicates, height, width, 3) on both sides.  Tiles count alike: the edge of a lamp has most
    of a picture's variance, and would drown the rest.  0, 0 where nothing differs or is noisy.
    """
    difference2 = (ours.mean(axis=0) - mitsuba.mean(axis=0)) ** 2
    variance = ours.var(axis=0, ddof=1) / len(ours) + mitsuba.var(axis=0, ddof=1) / len(mitsuba)
    observed, noise = _tile_sums(difference2), _tile_sums(variance)
    rounding = _tile_sums((FLOAT32 * mitsuba.mean(axis=0)) ** 2)
    # A background has no noise to measure by: there the bound is float32's, twice over.
    noisy = noise > rounding
    if np.any(observed[~noisy] > 4.0 * (noise + rounding)[~noisy]):
        return np.inf, 0.0
    if not noisy.any():
        return 0.0, 0.0
    ratios = observed[noisy] / noise[noisy]
    return float(ratios.mean()), float(ratios.std() / np.sqrt(max(len(ratios) - 1, 1)))


def _tile_sums(picture: FloatArray) -> FloatArray:
    """Sums over TILE x TILE tiles; those at the right and the bottom may be smaller."""
    rows = np.add.reduceat(picture.sum(axis=-1), np.arange(0, picture.shape[0], TILE), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, picture.shape[1], TILE), axis=1).ravel())
