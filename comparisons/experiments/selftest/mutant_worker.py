"""A process whose `reference_rt` may be a mutant: pictures of small scenes, and what the rungs say.

Kernels run as plain Python (NUMBA_DISABLE_JIT=1), as each mutant would have to be compiled: so
pictures are tiny, and rays are few.  Reads a request and writes its answer as JSON.
"""

import json
import os
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, gather
from comparisons.rungs.rays import any_hit
from reference_rt.rendering.query import hits, tracing
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid

SIZE = (8, 6)
"""Pixels of a picture."""

BUDGET = Budget(size=SIZE, spp=4, pixels=24, light_pixels=16)

RUNGS = ("film", "whitted", "direct", "geometry", "layers")
"""The quick ones first: the pictures for the layer `variance` take minutes in plain Python."""

FEW = 64
"""Rays that are traced one by one, in place of the package's limit: blocks take fewer rays then."""


def main() -> None:
    """{"scenes": [paths], "calls": whether to list functions, "before": pictures or None}."""
    task = json.load(sys.stdin)
    for module in (hits, tracing, any_hit):
        setattr(module, "FEW", FEW)  # noqa: B010
    out: dict[str, Any] = {}
    for path in task["scenes"]:
        out[path] = _of_scene(Path(path), task["calls"], (task["before"] or {}).get(path))
    json.dump(out, sys.stdout)


def _of_scene(path: Path, calls: bool, before: Sequence[float] | None) -> dict[str, Any]:
    name = path.stem
    scene = Scene.load(path)
    film = scene.film.model_copy(update={"width": SIZE[0], "height": SIZE[1]})
    sampler = scene.resolved_sampler
    few = sampler.model_copy(update={"spp": 1 if isinstance(sampler, Grid) else 2})
    small = scene.changed(film=film, sampler=few)
    called: set[CodeType] = set()

    def profile(frame: Any, event: str, argument: Any) -> None:
        called.add(frame.f_code)

    if calls:
        threading.setprofile(profile)
        sys.setprofile(profile)
    try:
        with np.errstate(all="ignore"):
            layers = render(small, threads=1).layers
    except Exception as error:  # a mutant may do anything
        return {"error": f"{type(error).__name__}: {error}"[:200]}
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    values = np.concatenate([np.ravel(layer) for layer in layers.values()])
    found: dict[str, Any] = {
        "picture": [repr(x) for x in values.tolist()],
        "functions": sorted({(os.path.realpath(c.co_filename), c.co_name) for c in called}),
        "changed": False,
    }
    if before is None:
        return found
    right = np.array([float(x) for x in before])
    with np.errstate(all="ignore"):
        found["changed"] = not np.allclose(values, right, rtol=1e-7, atol=1e-12, equal_nan=True)
    if not found["changed"]:
        return found
    found["rungs"] = []
    for rung in RUNGS:
        try:
            evidence = gather(Subject(scene), BUDGET, lambda step: None, 1, (rung,))
        except Exception as error:  # as above: the harness stops, with the reason
            found["rungs"].append((rung, "error", f"{type(error).__name__}: {error}"[:200]))
            break
        for result in evidence.rungs:
            found["rungs"].append((result.name, result.status, result.reason[:200]))
        if any(result.status in ("differ", "invalid") for result in evidence.rungs):
            break
    found["scene"] = name
    return found


if __name__ == "__main__":
    main()
