"""What all tests share: which of them a fast run holds, what a test may cost, wording of messages.

A run leaves out the tests marked `slow`.  `@pytest.mark.cases(n)` makes a parametrized test slow
but for n cases.  A run of everything (`pytest`) leaves out the dear ones, too: those that took more
than QUICK, as `dear.json` has them; `--dear only` runs these alone, and a run of files or folders
that are named holds them.  The run prints the tests that took most CPU time, and those that took
more than LIMIT; with `--judge-costs` it fails for these.
"""

import gc
import json
import os
import random
import resource
import sys
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

# A process of tests runs on every core: BLAS's threads would only wait for each other, busily, also
# in child processes.  BLAS reads this when NumPy is imported.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

# No test can see whether a file outlives a power failure, and a disk's word takes 10 ms.
os.fsync = lambda file: None

# pytest puts this folder on the path, where its own folder `reference_rt` would stand for the
# package if that is installed as editable.
sys.path[:] = [path for path in sys.path if Path(path) != Path(__file__).parent]

from reference_rt.jit import kernel_cache, parallel_compile  # noqa: E402

LONGEST_FIRST = (
    "test_furnaces",  # compiles the kernels of all tests that use `worlds`
    "test_counterpart_light",
    "test_plain_python",
    "test_reading_plugins",
    "test_truth_renderers",
    "test_first_look",
    "test_rungs",
    "test_stability_metamorphic",
    "test_film_layers",
    "test_crossings",
    "test_truth_cases",
    "test_transport",
    "test_gate",
    "test_stability_leaving",
    "test_invariances",
    "test_stability_explained",
    "test_shapes_exact",
    "test_pictured",
    "test_solids_of_many",
    "test_stability_furnace",
    "test_convergence_run",
    "test_csg_methods",
    "test_plastic",
    "test_counterpart_csg",
    "test_principled",
    "test_rough",
    "test_suites_processes",
    "test_stability_watertight",
    "test_stability",
)
"""Files that take more than some ten seconds without compiled kernels.  They start first, so that
no process is left alone with one at the end.  Files that share kernels are kept apart in the list:
the second one then finds them compiled."""


QUICK = 1.0
"""CPU seconds above which a test is dear: four in a hundred of the tests, which took six tenths of
the time."""

DEAR = Path(__file__).with_name("dear.json")
"""The names of dear tests, as `--write-dear` has measured them: what a test costs is nothing that a
person knows."""

LIMIT = 5.0
"""CPU seconds that a test that is not slow should take at most, its fixtures and child processes
included, on an idle machine (two cores of an Intel Xeon with AVX-512).  A test during which a
kernel was compiled into the cache is not judged: it is cheaper the next time."""

WORDING = Path(__file__).with_name("wording.json")
"""Whole messages, by the test that shows each (fixture `wording`)."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--tenth", type=int, metavar="K", help="only the K-th tenth of the tests, 1-10"
    )
    parser.addoption(
        "--judge-costs",
        action="store_true",
        help=f"fail fast tests that take more than {LIMIT:g} CPU s, for an idle machine",
    )
    parser.addoption(
        "--dear",
        choices=("with", "without", "only"),
        help="dear tests (default: without, but with them where files or folders are named)",
    )
    parser.addoption("--write-dear", action="store_true", help=f"write {DEAR.name} anew")
    parser.addoption("--write-wording", action="store_true", help=f"write {WORDING.name} anew")


def pytest_configure(config: pytest.Config) -> None:
    """xdist would start with the files of the most tests, which are quick ones.  It would also
    replace a process that died by one that waits for ever: the run ends with an error instead."""
    if config.option.dear is None:  # before xdist tells its processes the options
        everything = config.args_source is not pytest.Config.ArgsSource.ARGS
        config.option.dear = "without" if everything else "with"
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False
        config.option.maxworkerrestart = "0"
    if hasattr(config, "workerinput"):
        # Every core runs a process of tests already: a kernel is compiled in it, not in a child.
        parallel_compile.may_fork = lambda: False
        _collect_from_one_end(config)


def _collect_from_one_end(config: pytest.Config) -> None:
    """Of a run of everything every other process collects the last files first: so each of two
    rewrites the assertions of half of them, and reads those that the other has put into the cache
    (12 s of CPU time for all files, 4 s from the cache)."""
    tests = Path(__file__).parent
    everything = [Path(config.invocation_params.dir, name) for name in config.args] == [tests]
    if everything and int(config.workerinput["workerid"].removeprefix("gw")) % 2:  # type: ignore[attr-defined]
        config.args = sorted(map(str, tests.rglob("test_*.py")), reverse=True)


# ---- which tests a run holds --------------------------------------------------------------------


@pytest.hookimpl(tryfirst=True)  # before pytest leaves out what is marked `slow`
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    functions: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        is_slow = item.get_closest_marker("slow") is not None
        if item.get_closest_marker("cases") is not None and not is_slow:
            functions[item.nodeid.partition("[")[0]].append(item)
    for name, cases in functions.items():
        (most,) = cases[0].get_closest_marker("cases").args
        for item in set(cases).difference(_spread(name, cases, most)):
            item.add_marker(pytest.mark.slow)
    if (tenth := config.getoption("tenth")) is not None:
        items[:] = [item for item in items if zlib.crc32(item.nodeid.encode()) % 10 == tenth % 10]
    _leave_out_dear_ones(config, items)
    places = {name: k for k, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: (places.get(item.path.stem, len(places)), item.path))


def _leave_out_dear_ones(config: pytest.Config, items: list[pytest.Item]) -> None:
    if (dear := config.option.dear) == "with" or not DEAR.exists():
        return
    names = set(json.loads(DEAR.read_text(encoding="utf-8")))
    kept: list[pytest.Item] = []
    left: list[pytest.Item] = []
    for item in items:
        chosen = (item.nodeid in names) == (dear == "only")
        if dear == "without":  # who asks for slow ones by -m has each of them
            chosen = chosen or item.get_closest_marker("slow") is not None
        (kept if chosen else left).append(item)
    config.hook.pytest_deselected(items=left)
    items[:] = kept


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """What collection has made stays: the garbage collector need not look at it again."""
    gc.freeze()


def _spread(name: str, cases: list[pytest.Item], most: int) -> list[pytest.Item]:
    """At most so many of a function's cases: greedily, those that hold the largest number of values
    of arguments that no earlier one holds, then any.  The same ones in every run."""
    left = list(cases)
    random.Random(zlib.crc32(name.encode())).shuffle(left)
    values = {id(item): set(item.callspec.indices.items()) for item in cases}  # type: ignore[attr-defined]
    chosen: list[pytest.Item] = []
    seen: set[tuple[str, int]] = set()
    while left and len(chosen) < most:
        best = max(left, key=lambda item: len(values[id(item)] - seen))
        seen |= values[id(best)]
        chosen.append(best)
        left.remove(best)
    return chosen


# ---- what a test costs --------------------------------------------------------------------------


def _cpu() -> float:
    """Seconds that this process and the children that it has waited for have computed."""
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(use.ru_utime + use.ru_stime for use in map(resource.getrusage, who))


def _kernels() -> int:
    """The latest time, in ns, at which any process put a compiled kernel into the cache.  Counting
    its thousands of files took 20 ms, twice for each test."""
    root = kernel_cache.cache_root() / "kernels"
    folders = [root, *root.iterdir()] if root.is_dir() else []
    return max((folder.stat().st_mtime_ns for folder in folders), default=0)


_begun: dict[str, tuple[float, int]] = {}
_files_begun: set[Path] = set()
_costs: dict[str, float] = {}
_dear: list[str] = []
_judged: list[str] = []


def pytest_runtest_logstart(nodeid: str) -> None:
    _begun[nodeid] = _cpu(), _kernels()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Iterator[pytest.TestReport]:
    """Write the cost of a test into its last report.  The first test of a file sets up what others
    share, such as a browser: that is not its own cost."""
    report = yield
    if call.when == "setup" and item.path not in _files_begun and item.nodeid in _begun:
        _files_begun.add(item.path)
        _begun[item.nodeid] = _cpu(), _begun[item.nodeid][1]
    if call.when == "teardown" and item.nodeid in _begun:
        cpu, kernels = _begun.pop(item.nodeid)
        report.cpu = _cpu() - cpu
        is_fast = item.get_closest_marker("slow") is None
        report.is_judged = is_fast and kernels == _kernels()
        report.is_dear = report.is_judged and report.cpu > LIMIT
        if report.is_dear and report.passed and item.config.getoption("judge_costs"):
            report.outcome = "failed"
            report.longrepr = (
                f"{report.cpu:.1f} CPU s: expected at most {LIMIT:g} of a test that is not `slow`"
            )
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """After the last test of a file: what is left by then stays, such as modules, so that later
    collections need not look at it again.  A file that leaves Mitsuba in another variant than the
    one that comparisons use fails: else tests of later files would."""
    yield
    if nextitem is not None and nextitem.path == item.path:
        return
    gc.collect()
    gc.freeze()
    used = sys.modules.get("comparisons.mitsuba.backend")
    if used is not None and used.mitsuba.cache_info().currsize:
        variant, expected = used.mitsuba().variant(), used.backend().variant
        if variant != expected:
            used.mitsuba().set_variant(expected)
            pytest.fail(f"left Mitsuba's variant as {variant}; expected {expected} as before")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "teardown":
        _costs[report.nodeid] = getattr(report, "cpu", 0.0)
        if getattr(report, "is_dear", False):
            _dear.append(report.nodeid)
        if getattr(report, "is_judged", False):
            _judged.append(report.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write `dear.json`: tests that did not run, or compiled, stay as they were, and a dear one is
    no more dear from a fifth below QUICK on, so that noise does not move it to and fro."""
    if hasattr(session.config, "workerinput") or not session.config.getoption("write_dear"):
        return
    names = set(json.loads(DEAR.read_text(encoding="utf-8"))) if DEAR.exists() else set()
    for name in _judged:
        bound = 0.8 * QUICK if name in names else QUICK
        (names.add if _costs[name] > bound else names.discard)(name)
    DEAR.write_text(json.dumps(sorted(names), indent=0) + "\n", encoding="utf-8")


def pytest_terminal_summary(terminalreporter: Any) -> None:
    total = f"{sum(_costs.values()):.0f} s, compilation included"
    longest = sorted(_costs, key=lambda nodeid: -_costs[nodeid])[:10]
    sections = [(f"most CPU time, of {total}", longest)]
    if _dear:
        sections.append((f"fast tests of more than {LIMIT:g} CPU s, nothing compiled", _dear))
    for title, nodeids in sections:
        terminalreporter.section(title)
        for nodeid in sorted(nodeids, key=lambda nodeid: -_costs[nodeid]):
            terminalreporter.write_line(f"{_costs[nodeid]:6.1f} s  {nodeid}")


# ---- messages -----------------------------------------------------------------------------------


@pytest.fixture
def wording(request: pytest.FixtureRequest) -> Iterator[Callable[[str], None]]:
    """wording(message) checks a message against the one that `wording.json` holds for this test.
    Tests elsewhere assert what a message is about, not how it is worded.  After a change of wording
    run the test with `--write-wording` and read the difference of the file."""
    name = f"{Path(request.node.path).stem}::{request.node.name}"
    said: list[str] = []
    yield said.append
    stored = json.loads(WORDING.read_text(encoding="utf-8")) if WORDING.exists() else {}
    if request.config.getoption("write_wording"):
        stored[name] = said
        text = json.dumps(stored, indent=1, sort_keys=True, ensure_ascii=False)
        WORDING.write_text(text + "\n", encoding="utf-8")
    else:
        assert said == stored.get(name)
