"""The numbers of operations: cached kernels contain them, so that every process must have the same.

An operation has its number from the order in which modules are imported.
"""

import json
import subprocess
import sys
from pathlib import Path

import reference_rt

_NUMBERS = """
import importlib, json, pkgutil, sys
import reference_rt
from reference_rt.jit import by_code, links

def numbers():
    found = {}
    for name, module in sorted(sys.modules.items()):
        if name.startswith("reference_rt"):
            for value in vars(module).values():
                if isinstance(value, by_code.ByCode | links.Linkable):
                    key = ",".join(value.operations)
                    found[key] = [o.number for o in value.operations.values()]
    return found

before = numbers()
for one in pkgutil.walk_packages(reference_rt.__path__, "reference_rt."):
    if not one.name.endswith("__main__"):
        importlib.import_module(one.name)
print(json.dumps([before, numbers()]))
"""


def test_importing_the_package_defines_all_operations():
    """So the order is that of the imports in the sources, which the name of the cache's folder
    covers."""
    done = subprocess.run(
        [sys.executable, "-c", _NUMBERS],
        cwd=Path(reference_rt.__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    before, after = json.loads(done.stdout)
    assert before == after
    assert len(before) > 5
    for numbers in before.values():
        assert numbers == list(range(1, len(numbers) + 1))
