"""The order in which test files are handed to processes."""

import sys
from pathlib import Path

import pytest

# pytest puts this folder on the path, where its own folder `reference_rt` would stand for the
# package if that is installed as editable.
sys.path[:] = [path for path in sys.path if Path(path) != Path(__file__).parent]

from reference_rt.jit import parallel_compile  # noqa: E402

LONGEST_FIRST = (
    "test_extremes",  # compiles the kernels of all tests that use `worlds`
    "test_plain_python",
    "test_counterpart_light",
    "test_reading_plugins",
    "test_rungs",
    "test_stability_metamorphic",
    "test_estimators",
    "test_film_layers",
    "test_properties_of_rays",
    "test_gate",
    "test_stability_leaving",
    "test_invariances",
    "test_furnaces",
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


def pytest_configure(config: pytest.Config) -> None:
    """xdist would start with the files of the most tests, which are quick ones."""
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False
    if hasattr(config, "workerinput"):
        # Every core runs a process of tests already: a kernel is compiled in it, not in a child.
        parallel_compile.may_fork = lambda: False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Other files keep their order."""
    places = {name: k for k, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: places.get(Path(item.path).stem, len(places)))
