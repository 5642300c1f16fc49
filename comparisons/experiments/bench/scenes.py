"""Every scene of the smoke suite that Mitsuba can render, and kinds of scenes that suites lack:
seconds at equal samples, and relMSE times seconds, against Mitsuba's default and best sampler; the
Cornell box on one thread, and against Mitsuba's scalar variant.

relMSE is the variance of independent pictures, relative to their mean: no reference is needed,
whose own noise would favour the noisier side.  It does not see a bias, which `compare` tests: the
details of a row have the squared difference of the two means, less its noise.  Where this is more
than the relMSE of Mitsuba's pictures, they are of something else (far from the origin its paths end
early, for want of digits), and the scene is shown, but is in neither median nor worst.

To add a kind of scenes, write a function and list it in `STRANGERS`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from comparisons.experiments.bench.mesh_rays import blob, write_ply
from comparisons.experiments.bench.row import (
    Row,
    Setting,
    against,
    alternate,
    seconds,
    spread,
)
from comparisons.experiments.convergence.best_sampler import Taken, candidates, in_turn
from comparisons.experiments.convergence.methods import METHODS, AbsentError, with_sampler
from comparisons.experiments.convergence.store import weights
from comparisons.suites.suite import Entry, load_suite
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.files import temporary_folder

SUITE, SPP, PICTURES = "smoke", 64, 6

SECONDS = 10.0
"""Time budget of all pictures of a scene, without trials and compilation."""

USUAL, FEW = "multijitter", 3
"""What stands for the best sampler, and the pictures of each method, of scenes with which a trial
of all samplers would take too long."""

PIXELS, FEWEST = 256 * 192, 64 * 48
"""Most and fewest pixels of a picture; a trial with the fewest chooses the number, by halving."""

OURS, DEFAULT, BEST = (
    m for m in METHODS if m.name in ("ours", "mitsuba_llvm", "mitsuba_llvm_best")
)


class Kind(NamedTuple):
    """title: of its rows;  median, worst: goals of the ratio, over all scenes and of each."""

    title: str
    median: float
    worst: float


KINDS = {
    "samples": Kind(f"time at {SPP} samples per pixel / Mitsuba llvm", 0.7, 1.3),
    "default": Kind("relMSE x time / Mitsuba llvm, default sampler", 0.25, 0.8),
    "best": Kind("relMSE x time / Mitsuba llvm, best sampler", 0.6, 1.0),
}
"""The rows of a scene are called SCENE.KIND."""


# ---- scenes that suites lack --------------------------------------------------------------------


_VIEW: dict[str, Any] = {
    "camera": {"type": "perspective", "eye": [0.0, 2.5, 6.0], "target": [0.0, 0.6, 0.0], "fov": 40},
    "film": {"width": 256, "height": 192},
    "integrator": {"type": "path", "max_depth": 5},
    "lights": [{"type": "constant", "radiance": 0.4}],
}

_FLOOR = {
    "type": "rectangle",
    "transform": [{"scale": 8.0}, {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": -90.0}}],
}

_LAMP = {
    "type": "rectangle",
    "material": "lamp",
    "transform": [
        {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": 90.0}},
        {"translate": [1.0, 5.0, 1.0]},
    ],
}

_LAMPS = {"lamp": {"type": "emissive", "radiance": [12.0, 11.0, 10.0]}}


def million_triangles(folder: Path) -> Scene:
    """One mesh of a million triangles on a floor, under a lamp and a sky."""
    write_ply(folder / "mesh.ply", blob(1_000_000))
    mesh = {
        "type": "mesh",
        "file": str(folder / "mesh.ply"),
        "transform": [{"translate": [0.0, 1.2, 0.0]}],
    }
    return _scene([_FLOOR, _LAMP, mesh], _LAMPS)


def spheres_10000(folder: Path) -> Scene:
    """Ten thousand spheres at random places over a floor."""
    rng = np.random.default_rng(1)
    centers = rng.uniform([-3.0, 0.0, -3.0], [3.0, 2.0, 3.0], (10_000, 3))
    radii = rng.uniform(0.01, 0.05, 10_000)
    spheres = [
        {"type": "sphere", "center": center, "radius": radius, "material": f"m{k % 4}"}
        for k, (center, radius) in enumerate(zip(centers.tolist(), radii.tolist(), strict=True))
    ]
    colours = rng.uniform(0.2, 0.8, (4, 3)).tolist()
    materials = {f"m{k}": {"type": "diffuse", "reflectance": c} for k, c in enumerate(colours)}
    return _scene([_FLOOR, _LAMP, *spheres], _LAMPS | materials)


def materials_200(folder: Path) -> Scene:
    """A ball of each of 200 materials of nine types, no two alike."""
    rng = np.random.default_rng(2)
    materials, balls = {}, []
    for k in range(200):
        colour, alpha = rng.uniform(0.2, 0.9, 3).tolist(), float(rng.uniform(0.05, 0.4))
        ior, metal = float(rng.uniform(1.3, 1.8)), {"eta": [0.2, 0.9, 1.2], "k": [3.9, 2.5, 2.1]}
        types: list[dict[str, Any]] = [
            {"type": "diffuse", "reflectance": colour},
            {"type": "conductor", "reflectance": colour, **metal},
            {"type": "dielectric", "interior_ior": ior},
            {"type": "plastic", "reflectance": colour, "interior_ior": ior},
            {"type": "rough_conductor", "reflectance": colour, "alpha": alpha, **metal},
            {"type": "rough_dielectric", "alpha": alpha, "interior_ior": ior},
            {"type": "rough_plastic", "reflectance": colour, "alpha": alpha},
            {"type": "principled", "base_colour": colour, "roughness": alpha, "metallic": 0.5},
            {"type": "thin_dielectric", "interior_ior": ior},
        ]
        materials[f"m{k}"] = types[k % len(types)]
        place = [0.36 * (k % 20 - 9.5), 0.16, 0.36 * (k // 20 - 6.0)]
        balls.append({"type": "sphere", "center": place, "radius": 0.16, "material": f"m{k}"})
    return _scene([_FLOOR, _LAMP, *balls], _LAMPS | materials)


def _scene(shapes: list[dict[str, Any]], materials: Mapping[str, Any]) -> Scene:
    return Scene.model_validate({**_VIEW, "shapes": shapes, "materials": materials})


STRANGERS: dict[str, Callable[[Path], Scene]] = {
    function.__name__: function for function in (million_triangles, spheres_10000, materials_200)
}


# ---- measuring ----------------------------------------------------------------------------------


QUICK = ("cornell_box", "many_lights", "mesh_knot", "textured_room")


def names(setting: Setting) -> list[str]:
    """The scenes that get rows: those that the suite does not skip, and whose pictures have noise;
    then the kinds that suites lack."""
    budgets = load_suite(SUITE).suite.scenes
    kept = [n for n in setting.names() if budgets.get(n, Entry()).skip is None]
    if setting.quick:
        return [name for name in kept if name in QUICK]
    return [n for n in kept if not setting.load(n).integrator.deterministic] + [*STRANGERS]


def measure(name: str, setting: Setting) -> list[Row]:
    """The rows of a scene.  Raises ReferenceUnavailableError."""
    with temporary_folder() as folder:
        scene = STRANGERS[name](folder) if name in STRANGERS else setting.load(name)
        try:
            return _rows(name, scene, setting)
        except AbsentError as error:
            raise ReferenceUnavailableError(str(error)) from None


def _rows(name: str, scene: Scene, setting: Setting) -> list[Row]:
    budget, pictures = (SECONDS / 4.0 if setting.quick else SECONDS), PICTURES
    small = sized(scene, FEWEST)
    first = in_turn(small, {"ours": OURS, "default": DEFAULT}, SPP, 2, setting.say)
    seconds = {who: float(one.warm.min()) for who, one in first.items()}
    names = candidates(scene)
    if len(names) * PICTURES * seconds["default"] < SECONDS:
        by_name = {sampler: with_sampler(DEFAULT, sampler) for sampler in names}
        trial = in_turn(small, by_name, SPP, PICTURES, setting.say)
        sampler = min(names, key=lambda candidate: trial[candidate].work)
    else:
        sampler, pictures = USUAL if USUAL in names else names[0], FEW
    pixels = affordable(seconds["ours"] + 2.0 * seconds["default"], budget / pictures)
    if pictures == FEW:  # most of such seconds do not depend on the number of pixels
        pixels = PIXELS // 4
    methods = {"ours": OURS, "default": DEFAULT, "best": with_sampler(BEST, sampler)}
    large = sized(scene, pixels)
    taken = in_turn(large, methods, SPP, pictures, setting.say)
    return rows(name, (large.film.width, large.film.height), sampler, taken)


def affordable(seconds: float, budget: float) -> int:
    """The pixels of pictures that take `budget` seconds, if those with FEWEST take `seconds`."""
    pixels = PIXELS
    while pixels > FEWEST and seconds * pixels / FEWEST > budget:
        pixels //= 2
    return pixels


def sized(scene: Scene, pixels: int) -> Scene:
    """The scene with a film of its shape and about so many pixels, without layers, which Mitsuba is
    not asked for."""
    film = scene.film
    factor = (pixels / (film.width * film.height)) ** 0.5
    width, height = (max(1, round(factor * edge)) for edge in (film.width, film.height))
    size = {"width": width, "height": height, "layers": ()}
    return scene.changed(film=film.model_copy(update=size))


def rows(name: str, size: tuple[int, int], sampler: str, taken: Mapping[str, Taken]) -> list[Row]:
    """The rows of pictures of this size.  taken: by "ours", "default" and "best", whose sampler is
    `sampler`."""
    ours, peer = taken["ours"], taken["default"]
    facts: dict[str, Any] = {"width": size[0], "height": size[1], "sampler": sampler}
    facts |= {f"relmse_{who}": float(one.relmse.mean()) for who, one in taken.items()}
    peers = ("default", "best")
    facts |= {f"difference_{who}": difference(ours, taken[who]) for who in peers}
    title = f"{name}, {size[0]}x{size[1]}: "
    kind = KINDS["samples"]
    args = ours.warm.tolist(), ("Mitsuba llvm", peer.warm.tolist()), kind.worst
    found = [against(f"{name}.samples", title + kind.title, *args, details=facts)]
    for who, its in zip(peers, (DEFAULT.sampler, sampler), strict=True):
        kind, theirs = KINDS[who], taken[who]
        each = spread((ours.warm * ours.relmse[1:] / (theirs.warm * theirs.relmse[1:])).tolist())
        ratio = {"ratio": [each.low, each.high]}
        args_of = ours.work, theirs.work, f"Mitsuba llvm, {its}", "s", ours.work / theirs.work
        found.append(
            Row(f"{name}.{who}", title + kind.title, *args_of, kind.worst, "lower", ratio, facts)
        )
    return found


def difference(ours: Taken, theirs: Taken) -> float:
    """The squared relative difference of the expectations of two methods: that of their means less
    the variance of these."""
    weight = weights((ours.mean + theirs.mean) / 2.0)
    noise = (ours.relmse.mean() + theirs.relmse.mean()) / len(ours.relmse)
    return float((weight * (ours.mean - theirs.mean) ** 2).mean() - noise)


# ---- all scenes together ------------------------------------------------------------------------


def summary(rows: Sequence[Row]) -> list[Row]:
    """Median and worst of each kind over all scenes with rows that are the same picture by both;
    none without such rows."""
    found = []
    others = [scene_of(row) for row in of_kind(rows, "samples") if is_other(row)]
    apart = f" (not {', '.join(others)}: Mitsuba's pictures are others)" if others else ""
    for kind, (title, median_goal, worst_goal) in KINDS.items():
        those = [row for row in of_kind(rows, kind) if not is_other(row)]
        those.sort(key=lambda row: row.ratio)
        if not those:
            continue
        around = spread([row.ratio for row in those])
        middle, worst = those[len(those) // 2], those[-1]
        what = f"{title}: median over {len(those)} scenes{apart}"
        found += [
            replace(
                middle,
                name=f"{kind}_median",
                title=what,
                ratio=around.median,
                goal=median_goal,
                spread={"ratio": [around.low, around.high]},
            ),
            replace(
                worst,
                name=f"{kind}_worst",
                title=f"the same, the worst scene ({scene_of(worst)})",
                goal=worst_goal,
            ),
        ]
    return found


def of_kind(rows: Sequence[Row], kind: str) -> list[Row]:
    """The rows of scenes of a kind."""
    return [row for row in rows if row.name.endswith(f".{kind}")]


def scene_of(row: Row) -> str:
    """The scene of its row; "" of a row that is no scene's."""
    return row.name.rpartition(".")[0]


def is_other(row: Row) -> bool:
    """Whether Mitsuba's expectation is further from ours than its pictures are from it."""
    return bool(row.details["difference_default"] > row.details["relmse_default"])


# ---- the Cornell box: variants of Mitsuba, and a second thread ---------------------------------

CORNELL, SIZE = "cornell_box", 256

VARIANTS = {"cornell_llvm": ("llvm_ad_rgb", 0.8), "cornell_scalar": ("scalar_rgb", 0.25)}
"""Variant of Mitsuba and goal, by row."""


def measure_samples(setting: Setting) -> list[Row]:
    """Both rows.  Raises ReferenceUnavailableError."""
    return [_samples_row(name, setting) for name in VARIANTS]


def cornell_box(setting: Setting) -> Scene:
    """The scene at the measured size; a quarter of the pixels for a quick run."""
    size = SIZE // 2 if setting.quick else SIZE
    film = Film(width=size, height=size, filter=BoxFilter())
    return setting.load(CORNELL).changed(film=film, sampler=Sobol(spp=SPP))


def _samples_row(name: str, setting: Setting) -> Row:
    from comparisons.mitsuba import scene as mitsuba_scene
    from comparisons.mitsuba.backend import variant
    from comparisons.translator import load

    mitsuba_variant, goal = VARIANTS[name]
    scene = cornell_box(setting)
    size = scene.film.width
    with variant(mitsuba_variant):
        counterpart = load(scene)
        seeds = iter(range(1, 1000))

        def ours() -> object:
            return render(scene, tables=scene.tables, threads=setting.threads)

        def theirs() -> object:
            return mitsuba_scene.picture(counterpart.mi_scene, SPP, next(seeds))

        render(scene), theirs()  # compile
        times = alternate(
            {"ours": lambda: seconds(ours), mitsuba_variant: lambda: seconds(theirs)},
            say=setting.say,
        )
    return against(
        name,
        f"{CORNELL} {size}x{size}, {SPP} samples per pixel: time / Mitsuba {mitsuba_variant}",
        times["ours"],
        (f"Mitsuba {mitsuba_variant}", times[mitsuba_variant]),
        goal,
        details={"seconds": times, "threads": setting.threads, "sampler": "sobol / independent"},
    )


# ---- a second thread ----------------------------------------------------------------------------


def measure_threads(setting: Setting) -> list[Row]:
    """Samples per second of two threads against one.

    Raises ReferenceUnavailableError on a machine with one core.
    """
    if setting.threads < 2:
        raise ReferenceUnavailableError("two threads need two cores")
    scene = cornell_box(setting)
    samples = scene.film.width * scene.film.height * SPP / 1e6

    def rate(threads: int) -> float:
        return samples / seconds(lambda: render(scene, tables=scene.tables, threads=threads))

    render(scene)  # compile
    rates = alternate({"2 threads": lambda: rate(2), "1 thread": lambda: rate(1)}, say=setting.say)
    return [
        against(
            "threads",
            f"{CORNELL}: samples per second of two threads / of one",
            rates["2 threads"],
            ("one thread", rates["1 thread"]),
            1.9,
            unit="Msamples/s",
            better="higher",
            details={"rates": rates},
        )
    ]
