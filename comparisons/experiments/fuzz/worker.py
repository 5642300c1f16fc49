"""`python -m comparisons.experiments.fuzz.worker`: a process that checks and reduces scenes.

It follows `comparisons.runs.processes.protocol`: it reads `Request`s and stores results in their
folders.  Mitsuba runs in its scalar variant: for a few hundred rays of a scene that is seen once, a
variant that compiles takes several times as long (measured: 2 s against 9 s a scene).
"""

import faulthandler
import os
import sys

from comparisons.experiments.fuzz import assets, stored
from comparisons.experiments.fuzz.check import check
from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.fuzz.effort import Effort
from comparisons.experiments.fuzz.finding import Checked, Finding, Reduced
from comparisons.experiments.fuzz.generate import generate
from comparisons.experiments.fuzz.pictures import pictures_of
from comparisons.experiments.fuzz.reduce import reduce
from comparisons.experiments.fuzz.renderer import check_renderer
from comparisons.experiments.fuzz.request import Request
from comparisons.experiments.fuzz.types import types_in
from comparisons.mitsuba.backend import FORCE, SCALAR
from comparisons.runs.processes.protocol import carry_out, private_stdout

MORE = 3
"""Times as many rays as the scene's check are traced while a finding is reduced: it must not
hang on which rays are drawn."""


def main() -> None:
    """Handle requests until standard input ends."""
    faulthandler.enable()
    os.environ.setdefault(FORCE, SCALAR)
    answers = private_stdout()
    for line in sys.stdin:
        request = Request.model_validate_json(line)
        task = do_scene if request.task == "scene" else do_reduce
        carry_out(lambda task=task, request=request: task(request), answers)  # type: ignore[misc]


def checked(request: Request, scene: Data, effort: Effort) -> Checked:
    """What is found in a scene, with Mitsuba or with another renderer."""
    if request.command:
        return check_renderer(scene, request, effort)
    return check(scene, request.number, effort, request.files)


def scene_of(request: Request) -> Data:
    """The scene of a request."""
    if request.scene is not None:
        return request.scene
    return generate(request.seed, request.number, request.grammar, request.files)


def do_scene(request: Request) -> None:
    """Check a scene and store what is found."""
    assets.write(request.files)
    stored.add(request.out, checked(request, scene_of(request), request.effort))


def do_reduce(request: Request) -> None:
    """Reduce a finding and store it, also if nothing could be left out."""
    assets.write(request.files)
    finding = request.finding
    assert finding is not None
    effort = effort_for(request.effort, finding)
    latest = [finding]

    def fails(candidate: Data) -> bool:
        again = next((f for f in checked(request, candidate, effort).findings), None)
        if again is None or not alike(again, finding):
            return False
        latest[0] = again
        return True

    scene = scene_of(request)
    if not fails(scene):
        effort = request.effort
    found = reduce(scene, fails, seconds=request.seconds)
    fails(found.scene)
    stored.add_reduced(
        request.out,
        Reduced(
            number=request.number,
            finding=latest[0],
            scene=found.scene,
            tried=found.tried,
            pixels=effort.pixels,
            types=sorted(f"{kind}:{name}" for kind, name in types_in(found.scene)),
            pictures=pictures_of(found.scene, request.files),
        ),
    )


def effort_for(effort: Effort, finding: Finding) -> Effort:
    """Only the rung that failed, with more rays."""
    rung = "identities" if finding.rung.startswith("identity") else finding.rung
    rung = {"images": "statistics", "scene": "render", "compare": "geometry"}.get(rung, rung)
    # Statistics may show again what a rung below them found.
    return effort.model_copy(
        update={
            "rungs": (rung,),
            "pixels": MORE * effort.pixels,
            "light_pixels": MORE * effort.light_pixels,
            "identity_rays": MORE * effort.identity_rays,
            "every": 1,
        }
    )


def alike(one: Finding, other: Finding) -> bool:
    """Whether two findings have the same rung and cause; which numbers of a hit differ may change
    while a scene becomes smaller, who is right may not."""
    if one.rung != other.rung:
        return False
    return one.cause.partition(":")[0] == other.cause.partition(":")[0]


if __name__ == "__main__":
    main()
