"""What the checks of a scene's files and descriptions find."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass
class Findings:
    """checked: how many of each kind;  unread: what no second source reads;  differences: what
    differs, the first one first;  triangles: how many have been compared."""

    checked: dict[str, int] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)
    triangles: int = 0

    def count(self, kind: str, number: int = 1) -> None:
        self.checked[kind] = self.checked.get(kind, 0) + number


def text(numbers: Any) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.ravel(numbers))})"
