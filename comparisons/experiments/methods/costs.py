"""Operation counts and known failures of the methods, parsed from their docstrings."""

import re
from types import ModuleType

from reference_rt.textbook import box, csg, polygon, sphere, triangle

MODULES: dict[str, ModuleType] = {
    "sphere": sphere,
    "triangle": triangle,
    "box": box,
    "polygon": polygon,
    "csg": csg,
}
"""By family; acceleration structures share one kernel and have no such docstring."""


def stated(method: str) -> dict[str, str]:
    """{"cost": "13 +, 16 *, 2 /, 1 sqrt", "fails": ...}, as far as its docstring says so."""
    family, _, name = method.partition(".")
    function = getattr(MODULES.get(family), name, None)
    text = " ".join((getattr(function, "__doc__", None) or "").split())
    found = {}
    for what, pattern in (("cost", r"Cost: (.*?)\.(?: |$)"), ("fails", r"Fails: (.*)$")):
        if match := re.search(pattern, text):
            found[what] = match[1].replace("`", "").replace(" * ", " × ").replace(" *", " ×")
    return found
