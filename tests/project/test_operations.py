"""The numbers of operations: cached kernels contain them, so that every process must have the same.

An operation has its number from the order in which modules are imported.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import reference_rt

_NUMBERS = """
import importlib, json, pkgutil, random, sys
import reference_rt
names = [one.name for one in pkgutil.walk_packages(reference_rt.__path__, "reference_rt.")]
names = [name for name in names if not name.endswith("__main__")]
order = sys.argv[1]
if order == "reversed":
    names.reverse()
elif order.isdigit():
    random.Random(int(order)).shuffle(names)
elif order:
    getattr(reference_rt, order)
for name in names:
    importlib.import_module(name)

from reference_rt.jit import by_code, links
found = {}
for name, module in sorted(sys.modules.items()):
    if name.startswith("reference_rt"):
        for value in vars(module).values():
            if isinstance(value, by_code.ByCode | links.Linkable):
                key = ",".join(sorted(value.operations))
                found[key] = {o.name: o.number for o in value.operations.values()}
print(json.dumps(found))
"""


def numbers(order: str) -> dict[str, dict[str, int]]:
    """By group and operation, in a process that imports all modules in this order: a public name
    first, "reversed", or shuffled with a seed."""
    done = subprocess.run(
        [sys.executable, "-c", _NUMBERS, order],
        cwd=Path(reference_rt.__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, dict[str, int]] = json.loads(done.stdout)
    return found


@pytest.fixture(scope="module")
def usual() -> dict[str, dict[str, int]]:
    return numbers("")


def test_numbers_count_from_one(usual: dict[str, dict[str, int]]) -> None:
    assert len(usual) > 5
    for group in usual.values():
        assert sorted(group.values()) == list(range(1, len(group) + 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    "order", ["reversed", *"0123", "Scene", "render", "query", "build_tables", "Box", "textbook"]
)
def test_numbers_do_not_depend_on_what_is_imported_first(
    order: str, usual: dict[str, dict[str, int]]
) -> None:
    assert numbers(order) == usual
