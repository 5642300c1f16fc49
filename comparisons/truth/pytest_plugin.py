"""pytest plugin: the fixture `truth_gate`, which checks a picture against a formula.

    def test_disk_lamp(truth_gate):
        truth_gate("disk_lamp", [my_renderer("disk_lamp", seed) for seed in range(4)])

It imports nothing but pytest until it is used.
"""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from comparisons.gate import session, uses

VERDICTS = {"right": "agree", "off": "differ", "noisy": "inconclusive", "invalid": "invalid"}
"""Of cases, by those of `comparisons.truth.judge`."""


@pytest.fixture
def truth_gate(request: pytest.FixtureRequest) -> Callable[[str, Any], None]:
    """truth_gate(name, pictures) fails the test unless pictures are right for the case `name`.

    pictures: linear radiance, (height, width, 3) or (replicates, height, width, 3): arrays, or a
    list of files (EXR, PFM, NPY).
    """

    calls = itertools.count(1)

    def check(name: str, pictures: Any) -> None:
        __tracebackhide__ = True
        call = next(calls)
        missing = ""
        try:
            import numpy as np

            from comparisons.gate.pictures_in import read_candidates
            from comparisons.gate.reference import stacked
            from comparisons.truth.case import cases
            from comparisons.truth.judge import judge
        except ModuleNotFoundError as error:
            from reference_rt.util.extras import needs

            missing = needs("truth_gate", "compare", error.name)
        # Failing outside of `except`: pytest would show the handled error, with all its frames.
        if missing:
            pytest.fail(missing)
        case = cases()[name]
        listed = isinstance(pictures, list | tuple)
        if listed and all(hasattr(p, "__fspath__") or isinstance(p, str) for p in pictures):
            pictures = stacked([p for path in pictures for p in read_candidates(Path(path))])
        array = np.asarray(pictures, np.float64)
        verdict = judge(case.compute(), array if array.ndim == 4 else array[None])
        right = verdict.verdict == "right"
        if request.config.pluginmanager.get_plugin(session.NAME) is not None:
            told = {"verdict": VERDICTS[verdict.verdict], "passed": right, "reason": verdict.reason}
            told["headline"] = f"{name}: {verdict.verdict}"
            uses.note(request.node, "truth_gate", call, **told)
        if not right:
            pytest.fail(f"{name}: {verdict.verdict}: {verdict.reason}")

    return check
