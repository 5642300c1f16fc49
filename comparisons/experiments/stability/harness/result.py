"""The result of one sweep point, stored in a file of its own, so that it is not measured again."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparisons.experiments.stability.harness.core import OURS, Outcome
from reference_rt.util.files import read_text, replacing


@dataclass(frozen=True)
class Found:
    """outcomes: by contestant;  seconds: that it took, compiling included;  broken: why there are
    no outcomes, "" where there are."""

    family: str
    series: str
    x: float
    outcomes: dict[str, Outcome]
    seconds: float
    broken: str = ""

    @property
    def ours(self) -> Outcome | None:
        return self.outcomes.get(OURS)

    def write(self, path: Path, key: str) -> None:
        """Store it, atomically."""
        document = dataclasses.asdict(self) | {"key": key}
        with replacing(path) as temporary:
            # Infinity is no JSON: only this file, which nobody else reads, has it.  NumPy's
            # numbers become Python's.
            text = json.dumps(document, indent=1, default=lambda value: value.item())
            temporary.write_text(text, encoding="utf-8")

    @classmethod
    def read(cls, path: Path, key: str) -> "Found | None":
        """The stored result, None where there is none of this key."""
        try:
            document: dict[str, Any] = json.loads(read_text(path))
            if document.pop("key") != key:
                return None
            outcomes = {
                name: Outcome(**(some | {"examples": tuple(some["examples"])}))
                for name, some in document.pop("outcomes").items()
            }
            return cls(outcomes=outcomes, **document)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
