"""The account of what tests cost (`tests/conftest.py`), by runs of pytest on a file of its own.

The costs are real; the limits that they are held against are so low or so high that any machine's
lie on the same side of them.
"""

import json
import os
import re
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

CONFTEST = Path(__file__).parents[1] / "conftest.py"
TESTS_FILE = "test_of_costs.py"
TESTS = """
import conftest
import pytest

def test_cheap():
    conftest.LIMIT = 1e9

def test_dear():
    conftest.LIMIT = 0.0

@pytest.mark.slow
def test_slow():
    conftest.LIMIT = 0.0
"""


def run(
    pytester: pytest.Pytester, *options: str, quick: float | None = None, mark: str = ""
) -> pytest.RunResult:
    """The run of TESTS; no other process compiles anything into its cache.  quick: in place of
    QUICK."""
    text = CONFTEST.read_text(encoding="utf-8")
    if quick is not None:
        text = re.sub(r"^QUICK = .*", f"QUICK = {quick}", text, flags=re.MULTILINE)
    pytester.makeconftest(text)
    pytester.makepyfile(**{Path(TESTS_FILE).stem: TESTS})
    pytester.makeini("[pytest]\nmarkers =\n slow\n cases")
    return pytester.runpytest_subprocess("-p", "no:cacheprovider", "-m", mark, *options)


@pytest.fixture(autouse=True)
def own_cache(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(pytester.path / "cache"))


def test_a_dear_test_is_named_and_the_run_passes(pytester: pytest.Pytester) -> None:
    result = run(pytester)
    assert result.ret == 0
    result.assert_outcomes(passed=3)
    named = result.stdout.str().partition("nothing compiled")[2]
    assert [name for name in ("cheap", "dear", "slow") if f"::test_{name}" in named] == ["dear"]


def test_where_costs_are_judged_a_dear_test_fails(pytester: pytest.Pytester) -> None:
    result = run(pytester, "--judge-costs")
    assert result.ret == 1
    result.assert_outcomes(passed=3, errors=1)
    result.stdout.fnmatch_lines(["*CPU s: expected at most 0 of a test that is not `slow`"])
    result.stdout.fnmatch_lines(["ERROR *::test_dear*"])


def test_what_is_dear_is_measured(pytester: pytest.Pytester) -> None:
    """Slow tests are not: no run but their own holds them."""
    dear = pytester.path / "dear.json"
    run(pytester, "--write-dear", quick=0.0, mark="not slow")
    names = [f"{TESTS_FILE}::test_{name}" for name in ("cheap", "dear")]
    assert json.loads(dear.read_text()) == names
    dear.write_text(json.dumps(names[1:]))
    for options, passed in (
        (("--dear", "only"), 1),
        (("-n", "1"), 1),
        (("-n", "1", TESTS_FILE), 2),  # who names a file has all of it
    ):
        run(pytester, *options, mark="not slow").assert_outcomes(passed=passed)
    run(pytester, "--write-dear", "--dear", "with", quick=1e9, mark="not slow")
    assert json.loads(dear.read_text()) == []


def test_dear_tests_exist() -> None:
    """Their functions: those that are renamed would count as quick ones."""
    root = CONFTEST.parents[1]
    for name in json.loads(CONFTEST.with_name("dear.json").read_text()):
        path, _, function = name.partition("[")[0].rpartition("::")
        text = (root / path.partition("::")[0]).read_text(encoding="utf-8")
        assert re.search(rf"def {function}\b", text), f"{name}: run pytest --write-dear"


def test_tests_run_with_one_thread_of_blas() -> None:
    """So do the processes that they start."""
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
