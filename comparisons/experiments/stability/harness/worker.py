"""`python -m comparisons.experiments.stability.harness.worker`: measures one sweep point after
another, as `comparisons.runs.processes` requests.

It speaks `comparisons.runs.processes`.  A process of its own, because extreme numbers
crash native libraries.
"""

import faulthandler
import sys
import time
import warnings
from pathlib import Path
from typing import ClassVar

from PIL import Image
from pydantic import BaseModel, ConfigDict

from comparisons.experiments.stability.harness.core import OURS, Draw, Effort, Found, generator
from comparisons.experiments.stability.harness.family import family
from comparisons.runs.processes import carry_out, private_stdout
from reference_rt.util.errors import SceneWarning
from reference_rt.util.files import replacing, temporary_folder


class Request(BaseModel):
    """A sweep point to measure, or, where `shoot` names a contestant, to make an image of.

    out: the file of the result, or of the image, a .png that holds its caption;  key: fingerprint
    that is stored with it.
    """

    model_config = ConfigDict(extra="forbid")
    output: ClassVar[str] = "out"

    family: str
    series: str
    x: float
    seed: int
    effort: Effort
    mitsuba: bool
    out: Path
    key: str
    shoot: str = ""


def measure(request: Request) -> None:
    """Measure a sweep point and store the result."""
    series = family(request.family).by_name[request.series]
    start = time.perf_counter()
    with temporary_folder() as folder:
        draw = Draw(
            generator(request.seed, request.family, request.series, request.x),
            series.cases[request.effort],
            request.mitsuba,
            folder,
            request.effort,
        )
        outcomes = series.measure(draw, request.x)
    if OURS not in outcomes:
        raise RuntimeError(f"{request.family} {request.series}: nothing was said about ours")
    seconds = time.perf_counter() - start
    Found(request.family, request.series, request.x, dict(outcomes), seconds).write(
        request.out, request.key
    )


def shoot(request: Request) -> None:
    """Make an image of a failure and store it."""
    series = family(request.family).by_name[request.series]
    assert series.shoot is not None
    shot = series.shoot(request.shoot, request.x)
    from PIL.PngImagePlugin import PngInfo

    facts = PngInfo()
    facts.add_text("caption", shot.caption)
    facts.add_text("key", request.key)
    with replacing(request.out) as temporary:
        Image.fromarray(shot.pixels).save(temporary, pnginfo=facts)


def main() -> None:
    """Serve requests until standard input ends."""
    faulthandler.enable()
    # Cases have triangles without area on purpose: what a mesh leaves out is no news here.
    warnings.simplefilter("ignore", SceneWarning)
    answers = private_stdout()
    for line in sys.stdin:
        request = Request.model_validate_json(line)
        task = shoot if request.shoot else measure
        carry_out(lambda task=task, request=request: task(request), answers)  # type: ignore[misc]


if __name__ == "__main__":
    main()
