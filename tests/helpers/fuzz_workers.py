"""A worker of the fuzzer in tests: by the scene's number it finds nothing, finds something, raises,
hangs, or ends the process."""

import os
import signal
import time

from comparisons.experiments.fuzz import results
from comparisons.experiments.fuzz.finding import Checked, Finding, Reduced, Request
from comparisons.runs.processes import serve

FOUND = Finding(rung="geometry", cause="ours wrong: t", detail="1 of 9 rays")


def scene(request: Request) -> None:
    shapes = [] if request.scene is None else request.scene.get("shapes", [])
    torus = any(shape["type"] == "torus" for shape in shapes)
    if request.number == 1 and (request.scene is None or torus):
        os.kill(os.getpid(), signal.SIGSEGV)
    if request.number == 2:
        raise KeyError("no such thing")
    if request.number == 3:
        time.sleep(600.0)
    findings = [FOUND] if request.number in (4, 5) else []
    types = ["shape:sphere", "material:mirror"]
    results.add(
        request.out, Checked(number=request.number, findings=findings, types=types, lit=True)
    )


def reduced(request: Request) -> None:
    assert request.finding is not None
    results.add(
        request.out,
        Reduced(
            number=request.number,
            finding=request.finding,
            scene={"shapes": [{"type": "sphere"}]},
            types=["shape:sphere"],
            tried=7,
            pixels=48,
        ),
    )


def carry_out(request: Request) -> None:
    (scene if request.task == "scene" else reduced)(request)


if __name__ == "__main__":
    serve(Request, carry_out)
