"""The speed-up by a second thread."""

from comparisons.experiments.bench.equal_samples import SCENE, SPP, cornell_box
from comparisons.experiments.bench.row import Row, against
from comparisons.experiments.bench.setting import Setting
from comparisons.experiments.bench.timing import alternate, seconds
from reference_rt.rendering.render import render
from reference_rt.util.errors import ReferenceUnavailableError


def measure(setting: Setting) -> list[Row]:
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
