"""How often Mitsuba's scalar and llvm variants are said to differ: `python docs/measure_variants.py
[SCENE...]`, by default all of scenes/.

Of each scene SEEDS independent pairs of sets of pictures are judged, as `reference-rt variants`
judges one.  Prints a line of JSON for each scene: how many pairs got which verdict, or why it has
no pictures; and of each pair that differs the reason.
"""

import json
import sys
from collections import Counter
from pathlib import Path

from comparisons.experiments.variants import Task, measured, of_pictures
from comparisons.mitsuba.backend import LLVM, SCALAR
from reference_rt.util.files import temporary_folder

SEEDS, PICTURES, SPP, SIZE, LIMIT = 20, 8, 16, (24, 24), 0.02


def told(file: Path) -> dict[str, object]:
    task = Task((str(file),), 0, SIZE, SPP, SEEDS * PICTURES)
    key = f"picture {file.stem}"
    found = {}
    with temporary_folder() as place:
        for name in (SCALAR, LLVM):  # some scenes need integrators of ours, which are not scalar
            one = measured(name, task, place / name, lambda line: None).get(key, {})
            if "array" not in one:
                return {"scene": file.stem, "no pictures": f"{name}: {one.get('reason', '')}"}
            found[name] = one
    # Pictures without noise are one.
    pairs = min(len(one["array"]) for one in found.values()) // PICTURES or 1
    cases = []
    for k in range(pairs):
        part = slice(PICTURES * k, PICTURES * (k + 1))
        sides = {v: {key: {"array": one["array"][part]}} for v, one in found.items()}
        cases.append(of_pictures("picture", file.stem, (LLVM, SCALAR), sides, LIMIT))
    verdicts = Counter(case.verdict for case in cases)
    reasons = [case.reason for case in cases if case.verdict == "differ"]
    return {"scene": file.stem, **verdicts, "reasons": reasons}


if __name__ == "__main__":
    root = Path(__file__).parents[1] / "scenes"
    for file in [Path(name) for name in sys.argv[1:]] or sorted(root.glob("*.yaml")):
        print(json.dumps(told(file)), flush=True)
