"""Which types, and pairs of types, the scenes of a run have."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

from comparisons.experiments.fuzz.schema import all_types, possible_pairs
from comparisons.report.table import Column
from comparisons.report.values import label

Pair = tuple[str, str]


def _word(one: tuple[str, str]) -> str:
    return f"{one[0]}:{one[1]}"


@dataclass(frozen=True)
class Coverage:
    """scenes: how many;  types: in how many each type was, 0 included;  pairs, possible: how
    many pairs of types some scene had, and how many one scene can have;  missing: the others."""

    scenes: int
    types: dict[str, int]
    pairs: int
    possible: int
    missing: tuple[Pair, ...]

    @property
    def share(self) -> float:
        """Of the possible pairs."""
        return self.pairs / self.possible if self.possible else 0.0

    def rows(self) -> list[tuple[str, int, float]]:
        """(type, scenes, share of its possible pairs that occurred), the rarest first."""
        partners = Counter(_word(one) for pair in possible_pairs() for one in pair)
        lacking = Counter(name for pair in self.missing for name in pair)
        return [
            (name, count, 1.0 - lacking[name] / partners[name])
            for name, count in sorted(self.types.items(), key=lambda item: item[1])
        ]


def coverage(scenes: Iterable[Iterable[str]]) -> Coverage:
    """The coverage of scenes, given by the types "kind:name" of each."""
    types = Counter({_word(one): 0 for one in all_types()})
    seen: set[Pair] = set()
    count = 0
    for scene in scenes:
        names = sorted(scene)
        count += 1
        types.update(names)
        seen.update(combinations(names, 2))
    possible = {(min(p), max(p)) for p in ((_word(a), _word(b)) for a, b in possible_pairs())}
    missing = tuple(sorted(possible - seen))
    return Coverage(count, dict(types), len(possible) - len(missing), len(possible), missing)


TYPES = (
    Column[tuple[str, int, float]]("type", lambda row: label(row[0].replace(":", ": "))),
    Column[tuple[str, int, float]]("scenes", lambda row: row[1]),
    Column[tuple[str, int, float]](
        "share of its pairs with other types", lambda row: f"{100 * row[2]:.0f} %"
    ),
)
"""Of `Coverage.rows`."""
