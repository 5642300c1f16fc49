"""A diagnosis leaves the machine's other cores to others."""

from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from comparisons.compare import judge
from comparisons.results.case import Images


def threads() -> list[int]:
    """Of each library of BLAS that is loaded."""
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_fits_use_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the number comes from; afterwards there are as many as before."""
    used: list[list[int]] = []
    whole = judge.diagnosis.likeliest

    def noting(*arguments: Any, **named: Any) -> Any:
        used.append(threads())
        return whole(*arguments, **named)

    monkeypatch.setattr(judge.diagnosis, "likeliest", noting)
    picture = np.random.default_rng(0).uniform(0.5, 1.0, size=(16, 16, 3))
    with threadpool_limits(3, user_api="blas"):
        judge.likeliest_cause(Images(1.5 * picture, picture), lights=None)
        after = threads()
    assert used
    assert {n for ns in used for n in ns} == {1}
    assert set(after) == {3}
