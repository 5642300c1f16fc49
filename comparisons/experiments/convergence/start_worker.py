"""`python -m comparisons.experiments.convergence.start_worker SIDE SCENE FOLDER SPP BEGUN`: one
process from its start to its second picture; prints the seconds of each stage as JSON.

BEGUN is when the process was asked for, by `time.time`.  Nothing but the standard library is
imported before the side's own modules.
"""

import json
import os
import sys
import time
from itertools import pairwise
from pathlib import Path


def main() -> None:
    side, path, folder, spp, begun = sys.argv[1:]
    stages = _ours if side == "ours" else _mitsubas
    print(json.dumps(stages(side, Path(path), Path(folder), int(spp), float(begun))))


def _ours(side: str, path: Path, folder: Path, spp: int, begun: float) -> dict[str, float]:
    from reference_rt.rendering.render import render
    from reference_rt.rendering.scene import Scene
    from reference_rt.sampling import Sobol
    from reference_rt.scene.build import build_tables

    marks = [begun, time.time()]
    text = path.read_text(encoding="utf-8")
    scene = Scene.parse(text, str(path), folder).changed(sampler=Sobol(spp=spp))
    marks.append(time.time())
    tables = build_tables(scene)
    marks.append(time.time())
    compiled = render(scene, tables=tables).seconds["compile"]
    start = time.time()
    render(scene, tables=tables)
    last = time.time() - start
    return _named(marks, compiled, last)


def _mitsubas(side: str, path: Path, folder: Path, spp: int, begun: float) -> dict[str, float]:
    own = time.time()  # no part of Mitsuba's start
    from comparisons.mitsuba.llvm_libraries import LIBRARY, load_needed

    load_needed(os.environ.get(LIBRARY, ""))
    begun += time.time() - own
    import mitsuba as mi
    import numpy as np

    mi.set_variant(side)
    marks = [begun, time.time()]
    # What translates is no part of Mitsuba's start; its import counts to nothing.
    from comparisons.mitsuba.backend import mitsuba, variant
    from comparisons.mitsuba.translate import to_mitsuba
    from reference_rt.rendering.scene import Scene

    mitsuba()
    with variant(side):
        before = time.time()
        text = path.read_text(encoding="utf-8")
        description = to_mitsuba(Scene.parse(text, str(path), folder), native=True)
        loaded = time.time()
        scene = mi.load_dict(description)
        built = time.time()
        seconds = []
        for seed in (1, 2):
            start = time.time()
            np.array(mi.render(scene, spp=spp, seed=seed))
            seconds.append(time.time() - start)
    # As if what was imported between had taken no time.
    marks += [marks[-1] + loaded - before, marks[-1] + built - before]
    return _named(marks, max(0.0, seconds[0] - seconds[1]), seconds[1])


def _named(marks: list[float], compiled: float, render: float) -> dict[str, float]:
    start, load, build = (b - a for a, b in pairwise(marks))
    return {"start": start, "load": load, "build": build, "compile": compiled, "render": render}


if __name__ == "__main__":
    main()
