"""All families, in order.

To add one: a file beside this one that states its law, ranges, counts and what passes at its top
and defines a `Family`, and a line here.
"""

import importlib
from typing import cast

from comparisons.stability.family import Family

MODULES = {
    "F1": "f01_far",
    "F2": "f02_leaving",
    "F3": "f03_watertight",
    "F4": "f04_slivers",
    "F5": "f05_hierarchy",
    "F6": "f06_hostile",
    "F7": "f07_solids",
    "F8": "f08_roots",
    "F9": "f09_metamorphic",
    "F10": "f10_furnaces",
    "F11": "f11_reciprocity",
    "F12": "f12_radiometry",
    "F13": "f13_contact",
    "F14": "f14_determinism",
}


def family(name: str) -> Family:
    """The `FAMILY` of its module, which is imported only when it is needed."""
    module = importlib.import_module(f"comparisons.stability.{MODULES[name]}")
    return cast(Family, module.FAMILY)
