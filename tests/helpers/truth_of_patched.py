"""A process whose `reference_rt` is a patched copy: judges its pictures by cases of truth.

Standard input, a JSON object.  cases: names;  scenes: the folder of their scenes;  threads.
Standard output: by name, the verdict and the reason.
"""

import json
import sys
from pathlib import Path

from comparisons.truth.case import cases
from comparisons.truth.judge import judge
from comparisons.truth.renderers import load, ours


def main() -> None:
    task, found = json.load(sys.stdin), {}
    for name in task["cases"]:
        scene = load(Path(task["scenes"]) / f"{name}.yaml")
        judged = judge(cases()[name].compute(), ours(scene, threads=task["threads"]))
        found[name] = judged.verdict, judged.reason
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
