"""A process whose `reference_rt` is a patched copy with one source fault: compares it with Mitsuba.

Reads a request and writes findings as JSON.
"""

import json
import sys
from pathlib import Path

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.experiments.selftest.fault import SourceFault, compared, finding
from reference_rt.rendering.scene import Scene


def main() -> None:
    """{"fault", "scenes", "budgets": {suite: budget}, "threads", "until_caught", "rungs": only
    these} on standard input."""
    task = json.load(sys.stdin)
    fault = SourceFault(**task["fault"])
    scene = Scene.load(Path(task["scenes"]) / f"{fault.scene}.yaml")
    found = []
    for suite, fields in task["budgets"].items():
        budget = Budget.model_validate(fields)
        if rungs := tuple(task.get("rungs", ())):
            case = compare_scene(Subject(scene), budget, lambda step: None, task["threads"], rungs)
        else:
            case = compared(Subject(scene), budget, task["threads"])
        found.append(finding(fault, suite, case))
        if task.get("until_caught") and found[-1].caught:
            break
    json.dump([one.as_json() for one in found], sys.stdout)


if __name__ == "__main__":
    main()
