"""Which types, and which pairs of types, scenes had."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

from comparisons.experiments.fuzz.types import all_types, possible_pairs

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


def table(found: Coverage) -> str:
    """Markdown: a row for each type."""
    lines = [
        f"{found.scenes:,} scenes have {sum(n > 0 for n in found.types.values())} of "
        f"{len(found.types)} types and {found.pairs:,} of {found.possible:,} pairs of types "
        f"({found.share:.1%})",
        "",
        "| type | scenes | of its pairs |",
        "|---|---|---|",
    ]
    lines += [f"| {name} | {count:,} | {share:.0%} |" for name, count, share in found.rows()]
    return "\n".join(lines) + "\n"
