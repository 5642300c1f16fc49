"""Render times of the Cornell box: against two variants of Mitsuba at equal samples, and two
threads against one."""

from comparisons.experiments.bench.row import Row, Setting, against, alternate, seconds
from reference_rt.cameras.film import BoxFilter, Film
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.util.errors import ReferenceUnavailableError

SCENE, SIZE, SPP = "cornell_box", 256, 64

VARIANTS = {"cornell_llvm": ("llvm_ad_rgb", 0.8), "cornell_scalar": ("scalar_rgb", 0.25)}
"""Variant of Mitsuba and goal, by row."""


def measure_samples(setting: Setting) -> list[Row]:
    """Both rows.  Raises ReferenceUnavailableError."""
    return [_samples_row(name, setting) for name in VARIANTS]


def cornell_box(setting: Setting) -> Scene:
    """The scene at the measured size; a quarter of the pixels for a quick run."""
    size = SIZE // 2 if setting.quick else SIZE
    film = Film(width=size, height=size, filter=BoxFilter())
    return setting.load(SCENE).changed(film=film, sampler=Sobol(spp=SPP))


def _samples_row(name: str, setting: Setting) -> Row:
    from comparisons.mitsuba import scene as mitsuba_scene
    from comparisons.mitsuba.backend import variant
    from comparisons.mitsuba.translate import load

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

        render(scene, tables=scene.tables, specialised=True), theirs()  # compile
        times = alternate(
            {"ours": lambda: seconds(ours), mitsuba_variant: lambda: seconds(theirs)},
            say=setting.say,
        )
    return against(
        name,
        f"{SCENE} {size}x{size}, {SPP} samples per pixel: time / Mitsuba {mitsuba_variant}",
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

    render(scene, tables=scene.tables, specialised=True)  # compile
    rates = alternate({"2 threads": lambda: rate(2), "1 thread": lambda: rate(1)}, say=setting.say)
    return [
        against(
            "threads",
            f"{SCENE}: samples per second of two threads / of one",
            rates["2 threads"],
            ("one thread", rates["1 thread"]),
            1.9,
            unit="Msamples/s",
            better="higher",
            details={"rates": rates},
        )
    ]
